"""Parameters of a test of which some run in the quick suite, and all with ``-m slow`` beside it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def quick_first(cases: Iterable[Any], quick: int = 1) -> list[Any]:
    """The cases, of which those after the first ``quick`` ones are slow. A tuple is a case of several parameters."""
    told = list(cases)
    later = (pytest.param(*(one if isinstance(one, tuple) else (one,)), marks=pytest.mark.slow) for one in told[quick:])
    return [*told[:quick], *later]
