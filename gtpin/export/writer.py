"""What a file format is: how a model is written in it, and what it returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from gtpin.compensation.machine import CompensatedMachine, machine_at
from gtpin.errors import ModelError
from gtpin.export.box import Box
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
    undetermined
        Whether a printer's settings change that the data do not determine.
    """

    controller: Model | None = None
    temperatures: tuple[float, ...] = ()
    box: Box | None = None
    firmware: Path | None = None
    undetermined: bool = False

    def believed(self, model: Model) -> Model:
        """The model whose kinematics the controller has, without effects; raises `ModelError` if it is of another robot."""
        if self.controller is None:
            return Model(type(model.geometry).nominal(model.robot))
        if self.controller.robot.n_actuators != model.robot.n_actuators:
            what = f"the controller's model, {self.controller.robot.name}, is of another robot than {model.robot.name}"
            raise ModelError(what, hint="give a model of the same robot")
        return Model(self.controller.geometry)

    def machine(self, model: Model, session: str | None) -> tuple[CompensatedMachine, tuple[str, ...]]:
        """The machine, and names of the effects that no table can represent; raises `ModelError` if temperatures are given
        and no effect is thermal."""
        machine, unknown = machine_at(model, session)
        if self.temperatures and not machine.temperature_columns:
            raise ModelError("no effect of the model depends on a temperature", hint="leave out --temperature")
        return machine, unknown


@dataclass(frozen=True)
class Export:
    """What is written: texts by file name, and names of the parts of the model that the files don't contain.

    ``notes``: messages, such as on the errors that remain. ``in_transmissions``: those of these parts that a URDF has only as
    ``<transmission>``. ``inexact``: names of the effects that the files represent with an error, each with this error.
    """

    files: dict[str, str]
    left_out: tuple[str, ...]
    notes: tuple[str, ...] = ()
    in_transmissions: tuple[str, ...] = ()
    inexact: tuple[str, ...] = ()


@dataclass(frozen=True)
class Writer:
    """A file format.

    ``write``: the files for a model and the name of the file, as texts; of the session, if any, whose zero shifts they hold.
    ``suffix``: the suffix of a file that determines the format; empty if only its name does. ``tables``: whether its files are
    tables that correct the sum of all errors, for a controller and conditions.
    """

    write: Callable[[Model, Path, str | None, TablesFor], Export]
    suffix: str = ""
    tables: bool = False
