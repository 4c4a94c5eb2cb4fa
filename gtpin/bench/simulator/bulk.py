"""Many cases, with everything drawn at random."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.build import build
from gtpin.bench.simulator.case import Case, drawn_recipe
from gtpin.bench.simulator.recipe import Recipe
from gtpin.bench.simulator.tracker import Noise

SHARES = {"one": 0.70, "two": 0.12, "none": 0.08, "unknown": 0.10}
"""Probability that a machine has one effect of the catalogue, two, none, or one that is in no catalogue."""
LACKING: tuple[tuple[str, ...], ...] = ((), ("temp",), ("payload",), ("session",), ("speed",), ("time",), ("approach",))
"""Beginnings of the names of columns that a rough case lacks: one of these sets, drawn at random."""


def draw_case(seed: int, *, rough: bool = False, poses: int | None = None, robot: str = "gantry_tau") -> Case:
    """Draw a case: the machine's effects, their energies, and how it is measured.

    Parameters
    ----------
    seed
        Seed of the random numbers. The same seed gives the same bytes.
    rough
        Whether heavy tails, gross errors, noise that grows with the distance or is not declared, missing columns, and 70 to 200
        poses are drawn as well.
    poses
        Number of poses; None: it is drawn.
    robot
        As for :func:`~gtpin.bench.simulator.case.make_case`.
    """
    return build(bulk_recipe(seed, rough=rough, poses=poses, robot=robot))


def bulk_recipe(seed: int, *, rough: bool = False, poses: int | None = None, robot: str = "gantry_tau") -> Recipe:
    """The recipe of a case; see :func:`draw_case`."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 3]))
    what = str(rng.choice(list(SHARES), p=list(SHARES.values())))
    number = {"one": 1, "two": 2, "none": 0, "unknown": 1}[what]
    noise: Noise | None = None
    without: tuple[str, ...] = ()
    if rough:
        noise, without = _rough_noise(rng), LACKING[int(rng.integers(len(LACKING)))]
        poses = poses or int(rng.integers(70, 201))
    unknown = what == "unknown"
    return drawn_recipe(seed, n_effects=number, unknown=unknown, poses=poses, noise=noise, without=without, robot=robot)


def _rough_noise(rng: np.random.Generator) -> Noise:
    return Noise(
        declared=bool(rng.random() < 0.5),
        by_range=float(rng.choice([0.0, 0.5])),
        tails=float(rng.uniform(3.0, 6.0)) if rng.random() < 0.5 else None,
        gross=float(rng.choice([0.0, 0.01, 0.03])),
        orientations=bool(rng.random() < 0.85),
    )
