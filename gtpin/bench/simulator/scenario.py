"""Scenario files: TOML files with the effects of a virtual machine and its measurement conditions."""

from __future__ import annotations

import os
import re
import tomllib
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gtpin.bench.simulator.build import build, capacity, known_robot
from gtpin.bench.simulator.case import Case, energies
from gtpin.bench.simulator.causes.kinds import kind
from gtpin.bench.simulator.recipe import Conditions, Noise, Recipe, Wanted
from gtpin.data.files import read_text, refuse_control
from gtpin.errors import GtpinError
from gtpin.references import is_path

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class Effect(BaseModel):
    """One ``[[effect]]``: its id; and, unless they are drawn, its site, its energy or its amplitude in typical sizes, and its
    numbers of periods a turn."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    id: str
    site: str | None = None
    energy: Annotated[float, Field(gt=0.0, le=1e6)] | None = None
    amplitude: Annotated[float, Field(gt=0.0, le=100.0)] | None = None
    periods: Annotated[tuple[Annotated[float, Field(gt=0.0, le=1000.0)], ...], Field(max_length=9)] = ()


class Scenario(BaseModel):
    """The content of a scenario file. Keys of ``covariates`` that are left out are drawn so that the effects can be
    detected."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    robot: str = "gantry_tau"
    seed: Annotated[int, Field(ge=0)] = 0
    poses: Annotated[int, Field(ge=2, le=100_000)] = 200
    held_out: Annotated[int, Field(ge=1, le=100_000)] = 120
    background: bool = True
    effect: tuple[Effect, ...] = ()
    noise: Noise = Noise()
    covariates: Conditions = Conditions()


def read_scenario(file: Path | str) -> Scenario:
    """Read a scenario file. A path of a URDF in it is relative to its folder.

    Raises GtpinError if the file is no TOML, or has an unknown key or a value that is not allowed.
    """
    file = Path(file)
    try:
        content = tomllib.loads(read_text(file))
        refuse_control(content, file)
        scenario = Scenario.model_validate(content)
    except ValidationError as error:
        raise _explained(file, error) from None
    except (ValueError, RecursionError) as error:
        line = re.search(r"at line (\d+)", str(error))
        hint = "correct the line" if line else "correct the file"
        what = f"not TOML: {re.sub(r' *[(]at .*[)]$', '', str(error))[:80]}"
        raise GtpinError(what, file=file, row=int(line[1]) if line else None, hint=hint) from None
    for number, effect in enumerate(scenario.effect):
        if effect.energy is not None and effect.amplitude is not None:
            where = f"effect.{number}"
            raise GtpinError("both energy and amplitude", file=file, column=where, hint="give one of them")
    if is_path(scenario.robot):
        return scenario.model_copy(update={"robot": os.path.abspath(file.parent / scenario.robot)})
    return scenario


def simulate_scenario(
    file: Path | str, *, seed: int | None = None, poses: int | None = None, robot: str | None = None
) -> Case:
    """Make the case of a scenario file. ``seed``, ``poses`` and ``robot`` take precedence over those in the file.

    Raises `GtpinError` if the file can't be read, or an effect or site in it is not known.
    """
    return build(scenario_recipe(file, seed=seed, poses=poses, robot=robot))


def scenario_recipe(
    file: Path | str, *, seed: int | None = None, poses: int | None = None, robot: str | None = None
) -> Recipe:
    """The recipe of a scenario file; see :func:`simulate_scenario`."""
    scenario = read_scenario(file)
    seed = scenario.seed if seed is None else seed
    rng = np.random.default_rng(np.random.SeedSequence([seed, 4]))
    reference = robot or scenario.robot
    known, wanted = known_robot(reference), []
    for number, effect in enumerate(scenario.effect):
        try:
            sites = kind(effect.id, known).sites(known)
            if not sites:
                raise GtpinError(f"{effect.id} can't be on {reference}", hint="choose what the robot's parts can have")
            if effect.periods and not kind(effect.id, known).periodic:
                raise GtpinError(f"{effect.id} on {reference} has no periods that can be given", hint="leave them out")
            if effect.site is not None and effect.site not in sites:
                raise GtpinError(f"{effect.id} can't be at {effect.site!r}", hint=f"use {', '.join(sites)}")
        except GtpinError as error:
            raise GtpinError(error.what, file=file, column=f"effect.{number}", hint=error.hint) from None
        site = effect.site or str(rng.choice(sites))
        drawn = float(np.exp(rng.uniform(*np.log(energies(known)))))
        energy = effect.energy or (drawn if effect.amplitude is None else None)
        wanted.append(Wanted(effect.id, site, energy, effect.amplitude, effect.periods))
    needs = {need for effect in scenario.effect for need in kind(effect.id, known).needs}
    given = scenario.covariates.model_dump(include=scenario.covariates.model_fields_set)
    return Recipe(
        tuple(wanted),
        seed,
        robot=reference,
        poses=scenario.poses if poses is None else poses,
        held_out=scenario.held_out,
        noise=scenario.noise,
        conditions=Conditions.draw(rng, needs, capacity(known)).model_copy(update=given),
        background=scenario.background,
    )


def _explained(file: Path, error: ValidationError) -> GtpinError:
    """The first validation error of pydantic as a :class:`~gtpin.errors.GtpinError`."""
    first: Any = error.errors(include_url=False)[0]
    where = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        sections: dict[str, type[BaseModel]] = {"effect": Effect, "noise": Noise, "covariates": Conditions}
        known = sections.get(str(first["loc"][0]), Scenario).model_fields
        return GtpinError("unknown key", file=file, column=where, hint=f"known here: {', '.join(known)}")
    if first["type"] == "missing":
        return GtpinError("the key is missing", file=file, column=where, hint="an [[effect]] needs an id")
    value = str(first["input"])[:60]
    return GtpinError(f"{value!r} can't be: {first['msg']}", file=file, column=where, hint="correct the value")
