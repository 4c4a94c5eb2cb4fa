"""Tables that correct the sum of all errors: for Klipper and RepRapFirmware, over commands; and the errors that they leave."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gtpin.compensation.box import Box
from gtpin.compensation.controller import Controller, ModelController, there
from gtpin.compensation.grid_table import GridTable, grid_table
from gtpin.compensation.machine import CompensatedMachine, machine_at, parts
from gtpin.compensation.plane_tables import PlaneTables, plane_tables
from gtpin.compensation.printer_files import klipper_config, named, rrf_heightmap, rrf_macro
from gtpin.compensation.towers import Drives, TowerController, Towers, drives_of, fitted_towers
from gtpin.errors import GtpinError, ModelError
from gtpin.importers.klipper import TOWERS, tower_dimensions
from gtpin.importers.klipper_config import needed, read_config
from gtpin.importers.rrf import read_rrf_delta
from gtpin.model.model import Model
from gtpin.typing import Floats

POINTS = 512
"""Number of points at which errors are computed."""
LEAST = 1e-8
"""Motion of the TCP, m, below which an effect counts as absent under the conditions of the tables."""
PRINTER_AXES = 3


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

    def machine(self, model: Model, session: str | None) -> tuple[CompensatedMachine, tuple[str, ...]]:
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
    machines: Mapping[str, CompensatedMachine], left: Callable[[CompensatedMachine], Left]
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


@dataclass(frozen=True, eq=False)
class _Present:
    """A delta as its firmware is configured now: its drives, and for each tower the rotation distance, mm, or steps per mm."""

    drives: Drives
    per_tower: Floats


def printer_files(model: Model, file: Path, form: str, wanted: TablesFor, session: str | None = None) -> Written:
    """Klipper's configuration, or RepRapFirmware's macro with a height map for each temperature.

    Raises `GtpinError` if the robot does not have three actuators, a box is missing or can't be reached, the firmware's
    file does not fit the robot, or there is nothing to correct.
    """
    robot, box = model.robot, wanted.box
    if robot.n_actuators != PRINTER_AXES:
        what = f"{robot.name} has {robot.n_actuators} actuators, and tables of a printer's firmware move three axes"
        raise ModelError(what, hint="write corrected commands with --commands")
    if box is None:
        hint = "give x0 x1 y0 y1 z0 z1 in the controller's coordinates, m, and its --origin"
        raise GtpinError("tables of a printer's firmware need --box", file=file, hint=hint)
    believed = wanted.believed(model)
    plain = ModelController(believed, box.origin)
    present = None if wanted.firmware is None else _present(wanted.firmware, form, believed, box, file)
    machine, unknown = wanted.machine(model, session)
    steps: Sequence[float | None] = sorted(set(wanted.temperatures)) or [None]
    known = [{} if t is None else dict.fromkeys(machine.temperature_columns, t) for t in steps]
    machines = [replace(machine, temperatures=temperatures) for temperatures in known]

    def corrected(part: CompensatedMachine) -> tuple[Towers | None, Controller]:
        """The dimensions and the controller with them. They are fitted at the lowest temperature, and used at all."""
        if present is None:
            return None, plain
        towers = fitted_towers(replace(part, temperatures=known[0]), present.drives, box)
        return towers, TowerController(present.drives, towers)

    def left(part: CompensatedMachine, controller: Controller, table: PlaneTables) -> Left:
        points = box.fill(POINTS)
        approach = both_approaches(POINTS)
        before = there(part, plain, box, points, approach) - points
        return Left(before, there(part, controller, box, table.applied(points), approach) - points)

    def left_alone(part: CompensatedMachine) -> Left:
        controller = corrected(part)[1]
        return left(part, controller, plane_tables(part, controller, box))

    towers, controller = corrected(machine)
    tables = [plane_tables(at, controller, box) for at in machines]
    remains = [left(at, controller, table) for at, table in zip(machines, tables, strict=True)]
    check_any(remains)
    notes = [some.words("the box", at.temperatures) for at, some in zip(machines, remains, strict=True)]
    words, absent = by_parts(parts(machines[-1], believed), left_alone)
    title = f"{robot.name}, for a controller with {_kinematics(wanted, present)}"
    per_tower = None if present is None else present.per_tower
    if form == "klipper":
        files = {file.name: klipper_config(title, list(zip(steps, tables, strict=True)), towers, per_tower)}
    else:
        files = {}
        for step, table in zip(steps, tables, strict=True):
            stem = f"{file.stem}{named(step)}"
            heights = f"{stem}_heightmap.csv"
            files[f"{stem}{file.suffix}"] = rrf_macro(title, table, heights, towers, per_tower)
            files[heights] = rrf_heightmap(table)
    return Written(files, (*unknown, *absent), (*notes, *words))


def _kinematics(wanted: TablesFor, present: _Present | None) -> str:
    if present is not None:
        return "the dimensions below"
    return "its nominal kinematics" if wanted.controller is None else "the kinematics of the model given"


def _present(file: Path, form: str, nominal: Model, box: Box, output: Path) -> _Present:
    """Read the dimensions of a delta; raises `GtpinError` if they are not those of the nominal robot.

    A configuration may include the file ``output`` that is about to be written: what is there now does not count.
    """
    if form == "klipper":
        sections = read_config(file, without=output)
        radius, arms, ends, angles = tower_dimensions(sections, file)
        per_tower = np.array([needed(sections, tower, "rotation_distance", file).number() for tower in TOWERS])
    else:
        found = read_rrf_delta(file)
        radius, arms, ends, angles, per_tower = found.radius, found.arms, found.ends, found.angles, found.steps
    towers = Towers(1e-3 * radius, 1e-3 * arms, np.radians(angles), 1e-3 * ends, np.ones(3))
    return _Present(drives_of(towers, nominal, box), per_tower)


def grid_file(model: Model, file: Path, wanted: TablesFor, session: str | None = None) -> Written:
    """The table; see :func:`~gtpin.compensation.grid_table.grid_table`.

    Raises `GtpinError` if the robot has too many actuators for such a table, or one without a range; if temperatures are
    given and no effect depends on one; or if there is nothing to correct.
    """
    if wanted.box is not None or wanted.firmware is not None:
        raise ModelError("a table over commands takes no --box and no --firmware", hint="leave them out")
    machine, unknown = wanted.machine(model, session)
    believed = wanted.believed(model)
    table = grid_table(machine, believed, wanted.temperatures)
    last = replace(machine, temperatures=table.temperatures[-1])

    def left(part: CompensatedMachine) -> Left:
        return _left_of_grid(part, believed, grid_table(part, believed, wanted.temperatures))

    remains = _left_of_grid(last, believed, table)
    check_any([remains])
    words, absent = by_parts(parts(last, believed), left)
    notes = [remains.words("the range of the actuators", last.temperatures), *words]
    missing = np.isnan(table.change[0]).any(axis=-1)
    if missing.any():
        notes.append(f"has no numbers at {missing.sum()} of {missing.size} nodes, where the robot can't be")
    text = table.frame().to_csv(index=False, lineterminator="\n", float_format="%.10g")
    return Written({file.name: text}, (*unknown, *absent), tuple(notes))


def _left_of_grid(machine: CompensatedMachine, controller: Model, table: GridTable) -> Left:
    """Errors at commands of Halton's sequence, in cells of the table without NaN, at its last temperature step."""
    from scipy.stats import qmc

    low, high = (np.array([nodes[k] for nodes in table.nodes]) for k in (0, -1))
    q = low + (high - low) * qmc.Halton(len(low), scramble=False).random(POINTS + 1)[1:]
    asked = table.applied(q, len(table.temperatures) - 1)
    wanted = controller.kinematics.forward(q)
    inside = wanted.reached & np.isfinite(asked).all(axis=1)
    at = replace(machine, temperatures=table.temperatures[-1])
    approach = both_approaches(int(inside.sum()))
    before, after = (at.goes_to(some[inside], approach) - wanted.T[inside] for some in (q, asked))
    kept = np.isfinite(before).all(axis=1) & np.isfinite(after).all(axis=1)
    if not kept.any():
        raise ModelError("the robot can't be anywhere between the nodes of the table", hint="check its limits")
    return Left(before[kept], after[kept])
