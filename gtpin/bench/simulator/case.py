"""Cases for a blind check: a machine with random effects, or with the effects that are asked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.bench.simulator.arms.robot import Arm
from gtpin.bench.simulator.build import build, capacity, known_robot
from gtpin.bench.simulator.causes.kinds import kind, listed, unlisted
from gtpin.bench.simulator.conditions import Conditions
from gtpin.bench.simulator.recipe import Recipe, Wanted
from gtpin.bench.simulator.tracker import Noise
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
