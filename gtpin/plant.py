"""Deprecated name of :mod:`gtpin.bench.simulator`; goes with version 0.4."""

from gtpin.bench.simulator import *  # noqa: F403
from gtpin.bench.simulator import __getattr__ as __getattr__
