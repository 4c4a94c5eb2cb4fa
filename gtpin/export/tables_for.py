"""What a table that corrects the sum of all errors is made for: controller, its coordinates, and temperatures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gtpin.compensation.box import Box
from gtpin.compensation.machine import Machine, machine_at
from gtpin.errors import ModelError
from gtpin.model.model import Model


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
