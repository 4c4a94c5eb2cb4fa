"""The machine that a controller's tables correct: a model under constant conditions; what tables of single actuators can
correct, and scales of the drives."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gtpin.compensation.compensate import machine_of
from gtpin.data.names import is_approach
from gtpin.effects.active import ActiveEffect
from gtpin.effects.operating_points import Column, OperatingPoints
from gtpin.effects.sites import number
from gtpin.errors import ModelError
from gtpin.model.model import Model
from gtpin.model.place import without_free
from gtpin.typing import Floats

CONDITIONS = ("session", "time", "payload", "fx", "fy", "fz")
"""Covariates, besides temperatures, speeds and approaches, for which `Machine` defines the value that a table is made for."""


@dataclass(frozen=True)
class CompensatedMachine:
    """A model at constant temperatures, in one session, at rest, without a load on the tool, at the end of its dataset's time.

    ``model``: the model in the base frame, without effects of the instrument. ``session``: session whose zero shifts apply;
    None if no effect depends on a session. ``temperatures``: temperatures by covariate, degC; where one is missing, the
    reference temperature of the fit.
    """

    model: Model
    session: str | None = None
    temperatures: Mapping[str, float] = field(default_factory=dict)

    def goes_to(self, q: Floats, approach: Floats | float | None = None) -> Floats:
        """(N, 3) positions of the TCP at commands q (N, n), m or rad, base frame, m; NaN where the loops can't be closed.

        ``approach``: +1 or -1, or (N,), for all actuators: the direction from which they come. By default, the mean of the
        positions for both: a table without directions can correct only that.
        """
        if approach is None and any(
            is_approach(name) for active in self.model.effects for name in needed_by(self.model, active)
        ):
            return np.asarray(0.5 * (self.goes_to(q, 1.0) + self.goes_to(q, -1.0)))
        return self.model.predict(q, self.columns(len(q), 1.0 if approach is None else approach)).T

    @property
    def temperature_columns(self) -> tuple[str, ...]:
        """Names of the temperature covariates that the model's effects depend on."""
        names = {
            name for active in self.model.effects for name in active.effect.covariates(self.model.robot, active.site)
        }
        return tuple(sorted(name for name in names if name.startswith("temp_")))

    def columns(self, count: int, approach: Floats | float = 1.0) -> dict[str, Column]:
        """(count,) values of each covariate that the model's effects need; ``approach``: see :meth:`goes_to`."""
        known: dict[str, Column] = {}
        for active in self.model.effects:
            references = active.references
            for name in needed_by(self.model, active):
                if name == "session":  # a shift since an earlier model is of no session
                    known[name] = np.full(count, self.session or [*references.sessions, ""][0], dtype=object)
                elif name == "time":
                    known[name] = np.full(count, sum(references.time))
                elif name.startswith("temp_"):
                    known[name] = np.full(count, self.temperatures.get(name, references.temperature), dtype=float)
                else:
                    known[name] = np.full(count, approach if is_approach(name) else 0.0)
        return known


def machine_at(model: Model, session: str | None = None) -> tuple[CompensatedMachine, tuple[str, ...]]:
    """The machine of a model in a session, without effects whose conditions are not known, and the names of these.

    Raises `ModelError` if the session is not one of the model's.
    """
    check_session(model.effects, session)
    machine = machine_of(model)
    unknown = tuple(active.name for active in machine.effects if not _is_known(machine, active, session))
    return CompensatedMachine(machine.without(unknown), session), unknown


def check_session(effects: Sequence[ActiveEffect], session: str | None) -> None:
    """Raise `ModelError` if a session is none of those of the effects."""
    known = sorted({name for active in effects for name in active.references.sessions})
    if session is not None and session not in known:
        raise ModelError(f"the model knows no session {session!r}", hint=f"sessions are {', '.join(known) or 'none'}")


def parts(machine: CompensatedMachine, controller: Model) -> dict[str, CompensatedMachine]:
    """By name, machines that each have one part of the errors: the model's geometry, or the controller's with one effect."""
    model = machine.model
    mine, other = model.geometry, controller.geometry
    same = mine.names == other.names and bool((mine.values == other.values).all())
    found = {} if same else {"geometry": replace(machine, model=Model(mine))}
    for active in model.effects:
        found[active.name] = replace(machine, model=Model(other, effects=(active,)))
    return found


def needed_by(model: Model, active: ActiveEffect) -> set[str]:
    """Covariates that an effect may need."""
    return {*active.references.covariates, *active.effect.covariates(model.robot, active.site)}


def _is_known(model: Model, active: ActiveEffect, session: str | None) -> bool:
    names = active.effect.covariates(model.robot, active.site)
    if "session" in names and session is None:
        return False
    return all(name in CONDITIONS or name.startswith(("temp_", "speed")) or is_approach(name) for name in names)


def correctable(model: Model, session: str | None = None) -> tuple[ActiveEffect, ...]:
    """Effects along an actuator that depend only on its position, its direction of approach, and, if given, the session."""
    known = () if session is None else ("session",)
    robot = model.robot
    found = []
    for active in model.effects:
        if active.site in robot.sites:
            i = number(robot, active.site)
            own = {f"q{i}", f"approach{i}", *known}
            if set(active.effect.coordinates(robot, active.site)) <= own and _moves_along(model, active):
                found.append(active)
    return tuple(found)


def geometric_scales(model: Model) -> dict[str, float]:
    """Travel per command of each drive by site, from the geometry alone."""
    scales = dict.fromkeys(model.robot.sites, 1.0)
    for parameter, deviation in model.geometry.all_deviations:
        if parameter.kind == "scale" and parameter.part in scales:
            scales[parameter.part] += deviation
    return scales


def lacks(model: Model, names: Collection[str], q: Floats, covariates: Mapping[str, Column]) -> float:
    """Root mean square error of the TCP, m, at commands (N, n), of a file that has a model without some effects.

    ``names``: these effects. ``covariates``: (N,) each, by name. It is without motions of the machine and of the
    tool that the instrument does not show.
    """
    tool = model.of_tool()
    whole, held = (one.predict(q, covariates) for one in (tool, tool.without(names)))
    there = whole.reached & held.reached
    off = without_free(model, whole[there].minus(held[there]), held[there])
    return float(np.sqrt((off**2).sum(axis=1).mean())) if there.any() else 0.0


def _moves_along(model: Model, active: ActiveEffect) -> bool:
    """Whether an effect moves its actuator in the actuator's own direction, as straightness does not."""
    q, known = model.robot.home_q[None], CompensatedMachine(replace(model, effects=(active,))).columns(1)
    at = OperatingPoints(model.kinematics, q, model.kinematics.forward(q), known, active.references)
    return active.basis(at).command is not None


def drive_scales(model: Model) -> tuple[dict[str, float], set[str]]:
    """Travel per command of each drive by site, from a model's scales and ``encoder_scale``, and the names of the parts of the
    model that these scales represent."""
    scales = geometric_scales(model)
    carried = set()
    for active in model.effects:
        if active.effect.exported_as == "drive_scale":
            scales[active.site] *= (
                1.0 + active.effect.parameters(active.coefficients, active.shape_parameter)["scale"][0]
            )
            carried.add(active.name)
    return scales, carried | {"drive scales"}
