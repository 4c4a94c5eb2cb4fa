"""Cases with random effects, with those that are asked for, or with those of a scenario file."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from inspect import signature
from pathlib import Path
from typing import Annotated, Any, ParamSpec

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from gtpin.bench.simulator.arm import Arm
from gtpin.bench.simulator.build import build, known_robot
from gtpin.bench.simulator.causes.kinds import kind, listed, unlisted
from gtpin.bench.simulator.recipe import Recipe, SimulatedConditions, SimulatedNoise, Wanted
from gtpin.bench.simulator.truth import Case, EffectTruth
from gtpin.data.description import read_toml
from gtpin.data.names import site_called
from gtpin.errors import GtpinError, renamed_argument
from gtpin.references import is_path
from gtpin.robot.chain import Chain

__all__ = ["Case", "EffectTruth", "make_case"]

ENERGY = (30.0, 4000.0)
"""Range from which an effect's energy is drawn, uniformly in its logarithm."""
ENERGY_OF_ARMS = (30.0, 20000.0)
"""The same range for arms, whose errors are about ten times a tracker's noise: 0.1 to 0.2 mm remain on a calibrated UR5."""
POSES = (140, 280)
"""Range from which the number of poses is drawn."""


def _drawn(
    rng: np.random.Generator,
    robot: Chain | Arm,
    effects: Sequence[tuple[str, str | None]],
    span: tuple[float, float] | None = None,
) -> tuple[list[Wanted], SimulatedConditions]:
    """Effects with the sites and energies that are not given, and conditions under which they show."""
    span, wanted = span or (ENERGY_OF_ARMS if isinstance(robot, Arm) else ENERGY), []
    for name, site in effects:
        place = site or str(rng.choice(kind(name, robot).sites(robot)))
        wanted.append(Wanted(name, place, noncentrality=float(np.exp(rng.uniform(*np.log(span))))))
    needs = {need for name, _ in effects for need in kind(name, robot).needs}
    return wanted, SimulatedConditions.draw(rng, needs, robot.capacity if isinstance(robot, Arm) else 20.0)


@renamed_argument("energy", "noncentrality")
def drawn_recipe(
    seed: int,
    *,
    effects: Sequence[tuple[str, str | None]] | None = None,
    n_effects: int = 1,
    unknown: bool = False,
    noncentrality: float | tuple[float, float] | None = None,
    poses: int | None = None,
    held_out: int = 120,
    noise: SimulatedNoise | None = None,
    conditions: SimulatedConditions | None = None,
    without: tuple[str, ...] = (),
    background: bool = True,
    robot: str = "gantry_tau",
) -> Recipe:
    """The recipe of a virtual machine with effects, its measurements and its truth. What is not given is drawn at random.

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
    noncentrality
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
    rng = np.random.default_rng(np.random.SeedSequence([seed, 0]))
    found = known_robot(robot)
    kinds = [one for one in (unlisted(found) if unknown else listed(found)) if not one.newer]
    if effects is None:
        chosen = rng.choice(len(kinds), size=n_effects, replace=False).tolist() if n_effects else []
        effects = [(kinds[i].name, None) for i in chosen]
    span = (noncentrality, noncentrality) if isinstance(noncentrality, int | float) else noncentrality
    wanted, drawn = _drawn(rng, found, effects, span)
    measured = conditions or drawn
    count = int(rng.integers(POSES[0], POSES[1] + 1))
    return Recipe(
        tuple(wanted),
        seed,
        robot=robot,
        poses=poses if poses is not None else count,
        held_out=held_out,
        noise=noise or SimulatedNoise(),
        conditions=measured.model_copy(update={"without": measured.without + without}),
        background=background,
    )


SHARES = {"one": 0.70, "two": 0.12, "none": 0.08, "unknown": 0.10}
"""Probability that a machine has one effect of the catalogue, two, none, or one that is in no catalogue."""
LACKING: tuple[tuple[str, ...], ...] = ((), ("temp",), ("payload",), ("session",), ("speed",), ("time",), ("approach",))
"""Beginnings of the names of columns that a rough case lacks: one of these sets, drawn at random."""


def bulk_recipe(seed: int, *, rough: bool = False, poses: int | None = None, robot: str = "gantry_tau") -> Recipe:
    """Draw a case: the machine's effects, their energies, and how it is measured.

    ``seed``: seed of the random numbers. The same seed gives the same bytes. ``rough``: whether heavy tails, gross errors,
    noise that grows with the distance or is not declared, missing columns, and 70 to 200 poses are drawn as well.
    ``poses``: number of poses; None: it is drawn. ``robot``: as for :func:`~gtpin.bench.simulator.case.make_case`.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 3]))
    what = str(rng.choice(list(SHARES), p=list(SHARES.values())))
    number = {"one": 1, "two": 2, "none": 0, "unknown": 1}[what]
    noise: SimulatedNoise | None = None
    without: tuple[str, ...] = ()
    if rough:
        noise = SimulatedNoise(
            declared=bool(rng.random() < 0.5),
            by_range=float(rng.choice([0.0, 0.5])),
            tails=float(rng.uniform(3.0, 6.0)) if rng.random() < 0.5 else None,
            gross=float(rng.choice([0.0, 0.01, 0.03])),
            orientations=bool(rng.random() < 0.85),
        )
        without = LACKING[int(rng.integers(len(LACKING)))]
        poses = poses or int(rng.integers(70, 201))
    unknown = what == "unknown"
    return drawn_recipe(seed, n_effects=number, unknown=unknown, poses=poses, noise=noise, without=without, robot=robot)


class ScenarioEffect(BaseModel, frozen=True, extra="forbid"):
    """One ``[[effect]]``: its id; its site, energy or amplitude in typical sizes, and periods a turn, unless they are drawn."""

    id: str
    site: str | None = None
    energy: Annotated[float, Field(gt=0.0, le=1e6)] | None = None
    amplitude: Annotated[float, Field(gt=0.0, le=100.0)] | None = None
    periods: Annotated[tuple[Annotated[float, Field(gt=0.0, le=1000.0)], ...], Field(max_length=9)] = ()


class Scenario(BaseModel, frozen=True, extra="forbid"):
    """The content of a scenario file. Missing keys of ``covariates`` are drawn so that the effects can be detected."""

    robot: str = "gantry_tau"
    seed: Annotated[int, Field(ge=0)] = 0
    poses: Annotated[int, Field(ge=2, le=100_000)] = 200
    held_out: Annotated[int, Field(ge=1, le=100_000)] = 120
    background: bool = True
    effect: tuple[ScenarioEffect, ...] = ()
    noise: SimulatedNoise = SimulatedNoise()
    covariates: SimulatedConditions = SimulatedConditions()


def read_scenario(file: Path | str) -> Scenario:
    """Read a scenario file. A path of a URDF in it is relative to its folder.

    Raises GtpinError if the file is no TOML, or has an unknown key or a value that is not allowed.
    """
    file = Path(file)
    try:
        scenario = Scenario.model_validate(read_toml(file))
    except ValidationError as error:
        raise _explained(file, error) from None
    for number, effect in enumerate(scenario.effect):
        if effect.energy is not None and effect.amplitude is not None:
            where = f"effect.{number}"
            raise GtpinError("both energy and amplitude", file=file, column=where, hint="give one of them")
    if is_path(scenario.robot):
        return scenario.model_copy(update={"robot": os.path.abspath(file.parent / scenario.robot)})
    return scenario


def scenario_recipe(
    file: Path | str, *, seed: int | None = None, poses: int | None = None, robot: str | None = None
) -> Recipe:
    """The recipe of a scenario file. ``seed``, ``poses`` and ``robot`` take precedence over those in the file.

    Raises `GtpinError` if the file can't be read, or an effect or site in it is not known.
    """
    scenario = read_scenario(file)
    seed = scenario.seed if seed is None else seed
    rng = np.random.default_rng(np.random.SeedSequence([seed, 4]))
    reference = robot or scenario.robot
    known, effects = known_robot(reference), []
    for number, effect in enumerate(scenario.effect):
        try:
            sites = kind(effect.id, known).sites(known)
            if effect.periods and not kind(effect.id, known).periodic:
                raise GtpinError(f"{effect.id} on {reference} has no periods that can be given", hint="leave them out")
            site = effect.site and site_called(effect.site, sites)
            if site is not None and site not in sites:
                raise GtpinError(f"{effect.id} can't be at {effect.site!r}", hint=f"use {', '.join(sites)}")
        except GtpinError as error:
            raise GtpinError(error.what, file=file, column=f"effect.{number}", hint=error.hint) from None
        effects.append((effect.id, site))
    wanted, conditions = _drawn(rng, known, effects)
    for number, effect in enumerate(scenario.effect):
        drawn = wanted[number]
        energy = effect.energy or (drawn.noncentrality if effect.amplitude is None else None)
        wanted[number] = Wanted(drawn.effect, drawn.site, energy, effect.amplitude, effect.periods)
    given = scenario.covariates.model_dump(include=scenario.covariates.model_fields_set)
    return Recipe(
        tuple(wanted),
        seed,
        robot=reference,
        poses=scenario.poses if poses is None else poses,
        held_out=scenario.held_out,
        noise=scenario.noise,
        conditions=conditions.model_copy(update=given),
        background=scenario.background,
    )


def _explained(file: Path, error: ValidationError) -> GtpinError:
    """The first validation error of pydantic as a :class:`~gtpin.errors.GtpinError`."""
    first: Any = error.errors(include_url=False)[0]
    where = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        sections: dict[str, type[BaseModel]] = {"effect": ScenarioEffect, "noise": SimulatedNoise}
        sections["covariates"] = SimulatedConditions
        known = sections.get(str(first["loc"][0]), Scenario).model_fields
        return GtpinError("unknown key", file=file, column=where, hint=f"known here: {', '.join(known)}")
    if first["type"] == "missing":
        return GtpinError("the key is missing", file=file, column=where, hint="an [[effect]] needs an id")
    value = str(first["input"])[:60]
    return GtpinError(f"{value!r} can't be: {first['msg']}", file=file, column=where, hint="correct the value")


Given = ParamSpec("Given")


def built(recipe: Callable[Given, Recipe], name: str) -> Callable[Given, Case]:
    """The function that makes the case of a recipe, with the same arguments and errors."""

    def make(*args: Given.args, **kwargs: Given.kwargs) -> Case:
        return build(recipe(*args, **kwargs))

    make.__name__ = make.__qualname__ = name
    make.__doc__ = (recipe.__doc__ or "").replace("The recipe of", "Make the case of", 1)
    make.__signature__ = signature(recipe).replace(return_annotation=Case)  # type: ignore[attr-defined]
    return make


make_case = built(drawn_recipe, "make_case")
draw_case = built(bulk_recipe, "draw_case")
simulate_scenario = built(scenario_recipe, "simulate_scenario")
