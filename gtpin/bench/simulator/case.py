"""Cases for a blind check: a machine with random effects, or with the effects that are asked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.bench.simulator.arm import Arm
from gtpin.bench.simulator.build import build, capacity, known_robot
from gtpin.bench.simulator.causes.kinds import kind, listed, unlisted
from gtpin.bench.simulator.recipe import Conditions, Noise, Recipe, Wanted
from gtpin.bench.simulator.truth import Case, Truth
from gtpin.errors import GtpinError
from gtpin.robot.robot import Robot

__all__ = ["Case", "Truth", "make_case"]

ENERGY = (30.0, 4000.0)
"""Range from which an effect's energy is drawn, uniformly in its logarithm."""
ENERGY_OF_ARMS = (30.0, 20000.0)
"""The same range for arms, whose errors are about ten times a tracker's noise: 0.1 to 0.2 mm remain on a calibrated UR5."""
POSES = (140, 280)
"""Range from which the number of poses is drawn."""


def energies(robot: Robot | Arm) -> tuple[float, float]:
    """Range from which the energy of an effect on a robot is drawn."""
    return ENERGY_OF_ARMS if isinstance(robot, Arm) else ENERGY


def make_case(
    seed: int,
    *,
    effects: Sequence[tuple[str, str | None]] | None = None,
    n_effects: int = 1,
    unknown: bool = False,
    energy: float | tuple[float, float] | None = None,
    poses: int | None = None,
    held_out: int = 120,
    noise: Noise | None = None,
    conditions: Conditions | None = None,
    without: tuple[str, ...] = (),
    background: bool = True,
    robot: str = "gantry_tau",
) -> Case:
    """Make a case: a virtual machine with effects, its measurements and its truth. What is not given is drawn at random.

    Parameters
    ----------
    seed
        Seed of the random numbers. The same seed and arguments give the same bytes.
    effects
        Id and site of each effect; a site of None is drawn. None: ``n_effects`` effects of the catalogue are drawn.
    n_effects
        Number of effects to draw where ``effects`` is None.
    unknown
        Whether effects are drawn that are not in the catalogue.
    energy
        Whitened energy of each effect (docs/glossary.md), or two numbers between which it is drawn, uniformly in its logarithm.
        None: between 30 and 4,000, for arms 20,000.
    poses
        Number of different commands; a tenth of them is visited twice. None: drawn between 140 and 280.
    held_out
        Number of further commands, which are not measured and whose truth is given.
    noise, conditions
        Noise of the instrument, and measurement conditions. None: the usual noise, and conditions under which the effects show.
    without
        Columns, or beginnings of their names, that the dataset lacks in addition to those that ``conditions`` names.
    background
        Whether the machine also has other, weak effects.
    robot
        Name of a shipped robot, or the path of a URDF: an open chain, loops that are no rods, or six rods, each of which an
        actuator moves.

    Raises
    ------
    GtpinError
        If an effect or site is not known, or there is nothing to measure.
    """
    return build(
        drawn_recipe(
            seed,
            effects=effects,
            n_effects=n_effects,
            unknown=unknown,
            energy=energy,
            poses=poses,
            held_out=held_out,
            noise=noise,
            conditions=conditions,
            without=without,
            background=background,
            robot=robot,
        )
    )


def drawn_recipe(
    seed: int,
    *,
    effects: Sequence[tuple[str, str | None]] | None = None,
    n_effects: int = 1,
    unknown: bool = False,
    energy: float | tuple[float, float] | None = None,
    poses: int | None = None,
    held_out: int = 120,
    noise: Noise | None = None,
    conditions: Conditions | None = None,
    without: tuple[str, ...] = (),
    background: bool = True,
    robot: str = "gantry_tau",
) -> Recipe:
    """Draw the recipe of a case; see :func:`make_case`."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 0]))
    found = known_robot(robot)
    kinds = unlisted(found) if unknown else listed(found)
    if effects is None:
        chosen = [kinds[i] for i in rng.choice(len(kinds), size=n_effects, replace=False)] if n_effects else []
        effects = [(k.name, None) for k in chosen]
    span = (energy, energy) if isinstance(energy, int | float) else energy or energies(found)
    wanted = []
    for name, site in effects:
        sites = kind(name, found).sites(found)
        if not sites:
            raise GtpinError(f"{name} can't be on {found.name}", hint="choose what the robot's parts can have")
        place = site or str(rng.choice(sites))
        wanted.append(Wanted(name, place, energy=float(np.exp(rng.uniform(*np.log(span))))))
    needs = {need for name, _ in effects for need in kind(name, found).needs}
    drawn = Conditions.draw(rng, needs, capacity(found))
    measured = conditions or drawn
    count = int(rng.integers(POSES[0], POSES[1] + 1))
    return Recipe(
        tuple(wanted),
        seed,
        robot=robot,
        poses=poses if poses is not None else count,
        held_out=held_out,
        noise=noise or Noise(),
        conditions=measured.model_copy(update={"without": measured.without + without}),
        background=background,
    )


SHARES = {"one": 0.70, "two": 0.12, "none": 0.08, "unknown": 0.10}
"""Probability that a machine has one effect of the catalogue, two, none, or one that is in no catalogue."""
LACKING: tuple[tuple[str, ...], ...] = ((), ("temp",), ("payload",), ("session",), ("speed",), ("time",), ("approach",))
"""Beginnings of the names of columns that a rough case lacks: one of these sets, drawn at random."""


def draw_case(seed: int, *, rough: bool = False, poses: int | None = None, robot: str = "gantry_tau") -> Case:
    """Draw a case: the machine's effects, their energies, and how it is measured.

    ``seed``: seed of the random numbers. The same seed gives the same bytes. ``rough``: whether heavy tails, gross errors,
    noise that grows with the distance or is not declared, missing columns, and 70 to 200 poses are drawn as well.
    ``poses``: number of poses; None: it is drawn. ``robot``: as for :func:`~gtpin.bench.simulator.case.make_case`.
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
