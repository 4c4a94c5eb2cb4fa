"""Active effects as they are stored in ``model.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Generic, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer

from gtpin.data.description import Driver, Motion
from gtpin.effects.active import ActiveEffect
from gtpin.effects.catalogue import GROUP, effects_by_id
from gtpin.effects.driver import PREFIX, DriverColumn, DriverEffect, InstrumentAxes, refusal
from gtpin.effects.effect import Effect
from gtpin.effects.operating_points import PARTS, OperatingPoints, References
from gtpin.effects.operating_points import Column as Covariate
from gtpin.effects.sites import joints, links
from gtpin.errors import ModelError
from gtpin.kinematics.kinematics import Kinematics
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Triple = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Load = Annotated[list[Finite], Field(min_length=6, max_length=6)]
LoadSize = Annotated[list[Positive], Field(min_length=6, max_length=6)]
Value = TypeVar("Value")
Size = TypeVar("Size")

UNIT = 1e-6
"""Largest accepted difference of a unit vector's length from 1."""


class Record(BaseModel):
    """A part of a JSON file. Unknown keys, and text in place of numbers, are errors.

    Keys in ``optional`` are written only where they have a value.
    """

    model_config = ConfigDict(extra="forbid", strict=True, populate_by_name=True, defer_build=True)
    optional: ClassVar[tuple[str, ...]] = ()

    @model_serializer(mode="wrap")
    def _without_unset(self, write: SerializerFunctionWrapHandler) -> dict[str, object]:
        return {key: value for key, value in write(self).items() if key not in self.optional or value}


class TimeRecord(Record):
    """Start and duration of a fit's measurements, s."""

    start: Finite
    span: Positive


class SpreadRecord(Record, Generic[Value, Size]):
    """Mean of what each rod, or each joint and the TCP, had in a fit, and its spread."""

    mean: list[Value]
    spread: list[Size]


class CommandsRecord(Record):
    """Smallest and largest commands in a fit, m or rad; ``measured``: for each joint, the parts of a turn that had commands."""

    optional = ("measured",)
    lower: list[Finite]
    upper: list[Finite]
    measured: list[list[Annotated[int, Field(ge=0, lt=PARTS)]]] | None = None


class ReferencesRecord(Record):
    """Reference values of the covariates; see :class:`~gtpin.effects.operating_points.References`.

    ``force``: axial forces of the rods, N. ``direction``: unit vectors of the rods, base frame; the spread in rad. ``joints``:
    the load on each joint and on the TCP, N and N m.
    """

    optional = ("commands", "joints")  # robots with rods have none
    temperature: Finite
    time: TimeRecord
    sessions: list[str]
    force: SpreadRecord[Finite, Positive]
    direction: SpreadRecord[Triple, Positive]
    covariates: list[str]
    commands: CommandsRecord | None = None
    joints: SpreadRecord[Load, LoadSize] | None = None


class DriverRecord(Record):
    """What a recorded column may move; see :class:`~gtpin.data.description.Driver`. ``column``: if it is not the first one."""

    optional = ("column",)
    column: str | None = None
    site: str
    motion: Motion
    size: Positive


class FurtherRecord(Record):
    """A recorded column with its mean and range in the fitted data."""

    name: str
    mean: Finite
    range: Positive


class ColumnRecord(FurtherRecord):
    """A recorded column that moves sites, and ``further`` ones of its ``sensor``: :class:`~gtpin.effects.driver.DriverEffect`.

    ``origin`` (m) and ``axes`` (by rows) are the instrument's in the base frame.
    """

    optional = ("sensor", "further")
    sensor: str | None = None
    further: list[FurtherRecord] = []
    drivers: Annotated[list[DriverRecord], Field(min_length=1)]
    origin: Triple
    axes: Annotated[list[Triple], Field(min_length=3, max_length=3)]


class EffectRecord(Record):
    """An effect at a site with its coefficients; see :class:`~gtpin.effects.active.ActiveEffect`.

    ``setting`` is the value of its nonlinear parameter, and ``further_settings`` are further values where it acts with several.
    """

    optional = ("column", "further_settings", "only_measured")
    effect: str
    site: str
    setting: Finite | None
    further_settings: list[Finite] = []
    coefficients: list[Finite]
    covariance: list[list[Finite]]
    references: ReferencesRecord
    column: ColumnRecord | None = None
    only_measured: bool = False


def record(active: ActiveEffect) -> EffectRecord:
    """An active effect as it is stored in a file.

    Raises `ModelError` if another effect of the catalogue has the same id, since reading the file would give that effect.
    """
    own, known = active.effect, active.references
    if not isinstance(own, type(effects_by_id().get(own.id, own))):
        raise ModelError(f"the catalogue has another effect {own.id}", hint="give one of them another id")
    measured = [np.flatnonzero(parts).tolist() for parts in known.angles] if len(known.angles) else None
    lower, upper = (part.tolist() for part in known.commands)
    column = None
    if isinstance(own, DriverEffect):
        first, *others = own.columns.values()
        column = ColumnRecord(
            **vars(first),
            sensor=own.drivers[0].sensor,
            further=[FurtherRecord(**vars(other)) for other in others],
            drivers=[
                DriverRecord(
                    site=d.site, motion=d.motion, size=d.size, column=d.column if d.column != first.name else None
                )
                for d in own.drivers
            ],
            origin=own.instrument.origin.tolist(),
            axes=own.instrument.axes.tolist(),
        )

    def spread(pair: tuple[Floats, Floats]) -> Any:
        return {"mean": pair[0].tolist(), "spread": pair[1].tolist()}

    return EffectRecord(
        effect=own.id,
        site=active.site,
        setting=None if active.shape_parameter is None else float(active.shape_parameter),
        further_settings=list(map(float, active.further)),
        coefficients=active.coefficients.tolist(),
        covariance=active.covariance.tolist(),
        references=ReferencesRecord(
            temperature=float(known.temperature),
            time=TimeRecord(start=known.time[0], span=known.time[1]),
            sessions=list(known.sessions),
            force=spread(known.force),
            direction=spread(known.direction),
            covariates=list(known.covariates),
            commands=CommandsRecord(lower=lower, upper=upper, measured=measured) if lower else None,
            joints=spread(known.joints) if known.joints[0].size else None,
        ),
        column=column,
        only_measured=active.only_measured,
    )


def _driver_effect(stored: ColumnRecord, robot: Chain) -> DriverEffect:
    for driver in stored.drivers:
        if why := refusal(robot, driver.site, driver.motion):
            raise ModelError(why, column="column")
    columns = [DriverColumn(one.name, one.mean, one.range) for one in (stored, *stored.further)]
    drivers = [Driver(d.column or stored.name, d.site, d.motion, d.size, stored.sensor) for d in stored.drivers]
    if lacking := {driver.column for driver in drivers} - {column.name for column in columns}:
        raise ModelError(f"a driver of the column {min(lacking)}, which is not there", column="column")
    return DriverEffect(columns, drivers, InstrumentAxes(np.array(stored.origin), np.array(stored.axes)))


def active_effect(stored: EffectRecord, kinematics: Kinematics, known: Mapping[str, Effect]) -> ActiveEffect:
    """An active effect from a file.

    ``known``: accepted effects, by id. ``kinematics``: kinematics of the geometry to which the effect belongs.

    Raises `ModelError` if the effect does not fit the robot; ``column`` is the wrong key.
    """
    robot = kinematics.geometry.robot
    effect = known.get(stored.effect)
    if (
        effect is None
        and stored.column is not None
        and stored.effect == PREFIX + (stored.column.sensor or stored.column.name)
    ):
        effect = _driver_effect(stored.column, robot)
    if effect is None:
        hint = f"install the package that registers it under {GROUP}, or give it: read_model(..., effects=[MyEffect()])"
        raise ModelError(f"no effect is called {stored.effect!r}", column="effect", hint=hint)
    effect = effect.as_stored(len(stored.coefficients))
    sites = effect.sites(robot)
    if stored.site not in sites:
        raise ModelError(
            f"{effect.id} of {robot.name} can't be at {stored.site!r}", column="site", hint=f"use {', '.join(sites)}"
        )
    if effect.has_nonlinear != (stored.setting is not None):
        raise ModelError(f"{effect.id} {'needs' if effect.has_nonlinear else 'has no'} setting", column="setting")
    if stored.further_settings and len(stored.further_settings) >= effect.most_values:
        raise ModelError(f"{effect.id} has {effect.most_values} settings at most", column="further_settings")
    since_a_model = effect.since_a_model and not stored.references.sessions  # it can be applied without covariates
    active = ActiveEffect(
        effect,
        stored.site,
        stored.setting,
        np.array(stored.coefficients, dtype=float),
        np.zeros((0, 0)),
        _references(stored.references, robot, () if since_a_model else effect.covariates(robot, stored.site)),
        tuple(stored.further_settings),
        stored.only_measured,
    )
    angles = active.references.angles
    if active.only_measured and not (
        effect.of_own_command and len(angles) and angles[robot.sites.index(active.site)].any()
    ):
        what = f"only a curve of a turning joint with references.commands.measured can be, not {active.name}"
        raise ModelError(what, column="only_measured")
    _try(active, kinematics)
    count = len(stored.coefficients)
    if len(stored.covariance) != count or any(len(row) != count for row in stored.covariance):
        raise ModelError(f"not {count} x {count}", column="covariance")
    covariance = np.array(stored.covariance, dtype=float).reshape(count, count)
    if (covariance.diagonal() < 0.0).any():
        raise ModelError("a negative variance", column="covariance")
    return replace(active, covariance=covariance)


def _references(stored: ReferencesRecord, robot: Chain, needed: tuple[str, ...]) -> References:
    rods, force, direction = len(links(robot)), stored.force, stored.direction
    for name, one in (("force", force), ("direction", direction)):
        for part in ("mean", "spread"):
            count = len(getattr(one, part))
            if count != rods:
                raise ModelError(f"{count} values for {rods} rods", column=f"references.{name}.{part}")
    towards = np.array(direction.mean).reshape(rods, 3)
    if (np.abs(np.linalg.norm(towards, axis=1) - 1.0) > UNIT).any():
        raise ModelError("not unit vectors", column="references.direction.mean")
    missing = [name for name in needed if name not in stored.covariates]
    if missing:
        raise ModelError(f"{missing[0]} is missing, which the effect needs", column="references.covariates")
    if len(set(stored.sessions)) != len(stored.sessions) or bool(stored.sessions) != ("session" in stored.covariates):
        what = "list each session of the fit once, and none without the covariate session"
        raise ModelError(what, column="references.sessions")
    found = References(
        temperature=stored.temperature,
        time=(stored.time.start, stored.time.span),
        sessions=tuple(stored.sessions),
        force=(np.array(force.mean), np.array(force.spread)),
        direction=(towards, np.array(direction.spread)),
        covariates=tuple(stored.covariates),
    )
    if not joints(robot):
        return found
    commands, loads, n = stored.commands, stored.joints, robot.n_actuators
    if commands is None or {len(commands.lower), len(commands.upper)} != {n}:
        raise ModelError(f"not {n} values", column="references.commands")
    if loads is None or {len(loads.mean), len(loads.spread)} != {robot.model.njoints}:
        raise ModelError(f"not {robot.model.njoints} values", column="references.joints")
    measured = commands.measured or []
    if commands.measured is not None and len(measured) != n:
        raise ModelError(f"not {n} values", column="references.commands.measured")
    angles = np.zeros((len(measured), PARTS), dtype=bool)
    for parts, known in zip(angles, measured, strict=True):
        parts[known] = True
    return replace(
        found,
        commands=(np.array(commands.lower), np.array(commands.upper)),
        joints=(np.array(loads.mean), np.array(loads.spread)),
        angles=angles,
    )


def _try(active: ActiveEffect, kinematics: Kinematics) -> None:
    """Apply an effect once at home, to raise the error of an effect whose parts do not fit together."""
    home, known = kinematics.home, active.references
    if not home.reached.all():
        return
    some: dict[str, Covariate] = {name: np.zeros(1) for name in known.covariates}
    if known.sessions:
        some["session"] = np.array(known.sessions[:1], dtype=object)
    at = OperatingPoints(kinematics, kinematics.geometry.robot.home_q[None], home, some, fixed=known)
    try:
        with np.errstate(all="ignore"):
            displacement = active.basis(at).displacement(at) @ active.coefficients
    except ModelError as error:
        raise ModelError(error.what, column="coefficients", hint=error.hint) from None
    except Exception as error:  # a user's effect may raise any error
        raise ModelError(f"{active.name} can't be applied ({type(error).__name__}: {error})") from error
    if not np.isfinite(displacement).all():
        raise ModelError(f"{active.name} gives a displacement that is not finite", column="coefficients")
