"""Machines of the plant, measured on one day for a model and on a later day for a check."""

from dataclasses import replace
from functools import cache

import numpy as np

import gtpin
from gtpin.bench.simulator import Case, make_case, measure_at
from gtpin.bench.simulator.recipe import SimulatedNoise

POSES = 10


@cache
def machine(seed: int, *, free: bool = False, robot: str = "gantry_tau") -> tuple[Case, gtpin.Model]:
    """A machine without an effect, and the model of its calibration; not to be changed."""
    noise = SimulatedNoise(free=free)
    case = make_case(seed, effects=[], poses=140, held_out=40, noise=noise, background=False, robot=robot)
    return case, gtpin.calibrate(case.dataset).model


def commanded(
    case: Case, rng: np.random.Generator, poses: int, shift: dict[int, float] | None, reversal: dict[int, float] | None
) -> tuple[np.ndarray, np.ndarray, gtpin.Commands]:
    """Commands of a check, directions of approach, and where the drives go: off by a shift of the zero and a reversal error."""
    q = case.dataset.q[rng.choice(len(case.dataset), poses, replace=False)]
    ways = np.column_stack([rng.permutation(np.resize([-1.0, 1.0], poses)) for _ in range(q.shape[1])])
    off = np.zeros_like(q)
    for actuator, size in (shift or {}).items():
        off[:, actuator] += size
    for actuator, size in (reversal or {}).items():
        off[:, actuator] -= size / 2.0 * ways[:, actuator]
    ids = np.array([f"check{i}" for i in range(poses)], dtype=object)
    return q, ways, gtpin.Commands(ids, q + off, {f"approach{i + 1}": way for i, way in enumerate(ways.T)})


def later(
    case: Case,
    seed: int,
    *,
    shift: dict[int, float] | None = None,
    reversal: dict[int, float] | None = None,
    poses: int = POSES,
) -> gtpin.Dataset:
    """The machine measured again at some of its poses, approached from both sides.

    The drives are off by what the controller does not know: a shift of the zero, m, or a reversal error, m, by actuator.
    """
    q, _, commands = commanded(case, np.random.default_rng([seed, 11]), poses, shift, reversal)
    return replace(measure_at(case, commands, seed), q=q)


def classes(found: gtpin.HealthCheck) -> list[set[tuple[str, str]]]:
    """The classes of a check's causes."""
    return [{(m.effect, m.site) for m in cause.members} for cause in found.causes]
