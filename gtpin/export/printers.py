"""Correction files for Klipper and RepRapFirmware: dimensions of a delta, offset, skew, and heights on a grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gtpin.compensation.box import Box
from gtpin.compensation.controller import Controller, ModelController, there
from gtpin.compensation.machine import Machine, parts
from gtpin.compensation.plane_tables import PlaneTables, plane_tables
from gtpin.compensation.printer_files import klipper_config, named, rrf_heightmap, rrf_macro
from gtpin.compensation.towers import Drives, TowerController, Towers, drives_of, fitted_towers
from gtpin.errors import GtpinError, ModelError
from gtpin.export.tables_for import POINTS, Left, TablesFor, Written, both_approaches, by_parts, check_any
from gtpin.importers.klipper import TOWERS, tower_dimensions
from gtpin.importers.klipper_config import needed, read_config
from gtpin.importers.rrf import read_rrf_delta
from gtpin.model.model import Model
from gtpin.typing import Floats

PRINTER_AXES = 3


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

    def corrected(part: Machine) -> tuple[Towers | None, Controller]:
        """The dimensions and the controller with them. They are fitted at the lowest temperature, and used at all."""
        if present is None:
            return None, plain
        towers = fitted_towers(replace(part, temperatures=known[0]), present.drives, box)
        return towers, TowerController(present.drives, towers)

    def left(part: Machine, controller: Controller, table: PlaneTables) -> Left:
        points = box.fill(POINTS)
        approach = both_approaches(POINTS)
        before = there(part, plain, box, points, approach) - points
        return Left(before, there(part, controller, box, table.applied(points), approach) - points)

    def left_alone(part: Machine) -> Left:
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
