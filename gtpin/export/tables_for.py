"""What a table that corrects the sum of all errors is made for, and the errors that remain with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gtpin.compensation.box import Box
from gtpin.compensation.machine import Machine, machine_at
from gtpin.errors import ModelError
from gtpin.model.model import Model
from gtpin.typing import Floats

POINTS = 512
"""Number of points at which errors are computed."""
LEAST = 1e-8
"""Motion of the TCP, m, below which an effect counts as absent under the conditions of the tables."""


@dataclass(frozen=True)
class TablesFor:
    """The controller and the conditions of tables.

    Parameters
    ----------
    controller
        The model whose kinematics the controller has; by default the nominal robot.
    temperatures
        Temperatures, degC, for each of which there is a table; by default only the reference temperature of the fit.
    box
        The part of the workspace that the tables cover; needed for printers.
    firmware
        The present printer.cfg or config.g of a delta, to correct its dimensions too.
    """

    controller: Model | None = None
    temperatures: tuple[float, ...] = ()
    box: Box | None = None
    firmware: Path | None = None

    def believed(self, model: Model) -> Model:
        """The model whose kinematics the controller has, without effects; raises `ModelError` if it is of another robot."""
        if self.controller is None:
            return Model(type(model.geometry).nominal(model.robot))
        if self.controller.robot.n_actuators != model.robot.n_actuators:
            what = f"the controller's model, {self.controller.robot.name}, is of another robot than {model.robot.name}"
            raise ModelError(what, hint="give a model of the same robot")
        return Model(self.controller.geometry)

    def machine(self, model: Model, session: str | None) -> tuple[Machine, tuple[str, ...]]:
        """The machine, and names of the effects that no table can represent; raises `ModelError` if temperatures are given
        and no effect is thermal."""
        machine, unknown = machine_at(model, session)
        if self.temperatures and not machine.temperature_columns:
            raise ModelError("no effect of the model depends on a temperature", hint="leave out --temperature")
        return machine, unknown


@dataclass(frozen=True)
class Written:
    """Text by file name, names of effects that the files do not contain, and messages on the errors that remain."""

    files: dict[str, str]
    left_out: tuple[str, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Left:
    """(N, 3) errors of the TCP without and with tables, base frame, m."""

    before: Floats
    after: Floats

    @property
    def is_nothing(self) -> bool:
        """Whether there is no error to correct."""
        return _rms(self.before) < LEAST

    def words(self, where: str, temperatures: Mapping[str, float]) -> str:
        """Text with the root mean squares of both errors, um."""
        warm = "".join(f", {name} {value:g} degC" for name, value in temperatures.items())
        return (
            f"leaves {_um(self.after)} of {_um(self.before)} um of the TCP's error in {where}{warm}"
            f" (z: {_um(self.after[:, 2:])} of {_um(self.before[:, 2:])} um)"
        )


def check_any(left: Sequence[Left]) -> None:
    """Raise `ModelError` if there is no error to correct at any temperature."""
    if all(some.is_nothing for some in left):
        hint = "give a calibrated or diagnosed model, and --temperature for effects of temperatures"
        raise ModelError("there is nothing to correct: the model is what the controller has", hint=hint)


def both_approaches(count: int) -> Floats:
    """(count,) alternating directions of approach, +1 and -1."""
    return np.where(np.arange(count) % 2, 1.0, -1.0)


def by_parts(
    machines: Mapping[str, Machine], left: Callable[[Machine], Left]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The remaining error of each part of the model if tables are made for it alone, as texts, and the names of effects that
    move nothing under the conditions of the tables."""
    words, absent = [], []
    for name, machine in machines.items():
        found = left(machine)
        if not found.is_nothing:
            words.append(f"{name} {_um(found.after)} of {_um(found.before)} um")
        elif name != "geometry":
            absent.append(name)
    return ((f"leaves of each part alone: {', '.join(words)}",) if words else ()), tuple(absent)


def _rms(errors: Floats) -> float:
    return float(np.sqrt((errors**2).sum(axis=1).mean()))


def _um(errors: Floats) -> str:
    size = 1e6 * _rms(errors)
    if size < 0.01:
        return "under 0.01"
    return f"{size:.3g}" if size < 1000.0 else f"{size:.0f}"
