"""The scatter of a case's poses by the machine's repeatability, which the plant draws but does not return."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gtpin.bench.simulator.arms.machine import ArmMachine
from gtpin.bench.simulator.instruments.case import InstrumentCase
from gtpin.bench.simulator.recipe import Recipe
from gtpin.typing import Floats


def jitter(case: InstrumentCase, recipe: Recipe) -> Floats:
    """(N, 6 + k, n) motions of the poses at stops, and of k joints, by 1 sigma of each actuator's repeatability, m and rad.

    NaN at stops at which no instrument measures. Repeatability is drawn as
    :func:`~gtpin.bench.simulator.instruments.build.build_measured` draws it from the same seed.
    """
    part = np.random.SeedSequence([recipe.seed, 5]).spawn(5)[3]
    repeatability = recipe.noise.repeatability_of(case.machine, np.random.default_rng(part))
    used = stops(case)
    q, poses = case.dataset.q[used], case.true[used]
    arm = isinstance(case.machine, ArmMachine)
    by_command = case.machine.command_jacobian(q, tuple(poses.joints) if arm else poses)
    found = np.full((len(case.dataset.q), *by_command.shape[1:]), np.nan)
    found[used] = by_command * repeatability
    return found


def stops(case: InstrumentCase) -> npt.NDArray[np.int_]:
    """Indices of the stops at which an instrument measures."""
    return np.unique(np.concatenate([gauge.stop for gauge in case.gauges]))
