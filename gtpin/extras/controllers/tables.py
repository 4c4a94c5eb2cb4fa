"""Tables that correct the sum of all errors: for Klipper and RepRapFirmware, over commands; and the errors that they leave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from gtpin.compensation.machine import CompensatedMachine, parts
from gtpin.errors import GtpinError, ModelError
from gtpin.export.box import Box, spread
from gtpin.export.loss import both_approaches, ranges, ranges_known, um
from gtpin.export.writer import Export, TablesFor
from gtpin.extras.controllers.controller import Controller, controller_of, there
from gtpin.extras.controllers.grid_table import GridTable, grid_table
from gtpin.extras.controllers.machine_error import (
    Left,
    by_parts,
    changed_dimensions,
    check_any,
    determined,
    motions_of_no_error,
    open_directions,
    touches_one_plane,
)
from gtpin.extras.controllers.plane_tables import PARTS, PlaneTables, changes_of_parts, plane_tables
from gtpin.extras.controllers.printer_files import klipper_config, named, rrf_heightmap, rrf_macro
from gtpin.extras.controllers.towers import DIMENSIONS, Drives, TowerFit, drives_of
from gtpin.extras.importers.klipper import TOWERS, tower_dimensions
from gtpin.extras.importers.klipper_config import needed, read_config
from gtpin.extras.importers.rrf import read_rrf_delta
from gtpin.extras.importers.towers import Towers
from gtpin.model.model import Model
from gtpin.model.place import without_place
from gtpin.typing import Floats, Mask

POINTS = 512
"""Number of points at which errors are computed."""
PRINTER_AXES = 3
D = len(DIMENSIONS)
GRID = (9, 9, 5)
"""Numbers of points along x, y and z of the box, at which it is decided what the data determine of offset, skew and heights."""


@dataclass(frozen=True, eq=False)
class PrinterCorrection:
    """The corrections of a printer's firmware for a machine under one or several temperatures.

    ``towers``, ``controller``: the new dimensions of a delta, None where they do not change, and the firmware with them.
    ``changes``: a message on their changes.
    ``tables``, ``left``: for each temperature the tables, and the errors that they leave. ``alone``: settings that stay as they
    are, because the data do not determine them. ``notes``, ``absent``: messages on single effects, and names of those that move
    nothing.
    """

    towers: Towers | None
    controller: Controller
    tables: tuple[PlaneTables, ...]
    left: tuple[Left, ...]
    alone: tuple[str, ...]
    notes: tuple[str, ...]
    absent: tuple[str, ...]
    changes: tuple[str, ...] = ()


def printer_files(model: Model, file: Path, session: str | None, wanted: TablesFor, *, form: str) -> Export:
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
    # The drives of a delta as its firmware is configured now, and for each tower the rotation distance, mm, or steps per mm.
    # A configuration may include the file that is about to be written: what is there now does not count.
    drives, per_tower = None, None
    if wanted.firmware is not None:
        if form == "klipper":
            sections = read_config(wanted.firmware, without=file)
            towers = tower_dimensions(sections, wanted.firmware)
            options = [needed(sections, tower, "rotation_distance", wanted.firmware) for tower in TOWERS]
            per_tower = np.array([option.number() for option in options])
        else:
            towers, per_tower = read_rrf_delta(wanted.firmware)
        drives = drives_of(towers, believed, box)
    machine, unknown = wanted.machine(model, session)
    steps: Sequence[float | None] = sorted(set(wanted.temperatures)) or [None]
    known = [{} if t is None else dict.fromkeys(machine.temperature_columns, t) for t in steps]
    machines = [replace(machine, temperatures=temperatures) for temperatures in known]
    found = printer_correction(model, machines, believed, box, drives, undetermined=wanted.undetermined)
    notes = [some.words("the box", at.temperatures) for at, some in zip(machines, found.left, strict=True)]
    notes += [found.left[0].size(box.fill(POINTS)), *found.changes]
    if found.alone:
        notes.append(f"leaves alone what the data do not determine: {', '.join(found.alone)}")
    kinematics = "its nominal kinematics" if wanted.controller is None else "the kinematics of the model given"
    title = f"{robot.name}, for a controller with {kinematics if drives is None else 'the dimensions below'}"
    if form == "klipper":
        tables = list(zip(steps, found.tables, strict=True))
        files = {file.name: klipper_config(title, tables, found.towers, per_tower)}
    else:
        files = {}
        for step, table in zip(steps, found.tables, strict=True):
            stem = f"{file.stem}{named(step)}"
            heights = f"{stem}_heightmap.csv"
            files[f"{stem}{file.suffix}"] = rrf_macro(title, table, heights, found.towers, per_tower)
            files[heights] = rrf_heightmap(table)
    return Export(files, (*unknown, *found.absent), (*notes, *found.notes))


def printer_correction(
    model: Model,
    machines: Sequence[CompensatedMachine],
    believed: Model,
    box: Box,
    drives: Drives | None,
    *,
    undetermined: bool = False,
) -> PrinterCorrection:
    """The correction of a model's machine at each of several temperatures, the lowest first.

    ``believed``: the firmware's kinematics. ``drives``: those of a delta whose dimensions may change; None: they stay.
    ``undetermined``: whether settings change that the data do not determine.
    """
    plain, first, free = controller_of(believed, box.origin), machines[0], motions_of_no_error(model)
    shown, standing = _shown(first, plain, drives, box), touches_one_plane(model)
    if standing:
        shown[[D + PARTS.index("offset x"), D + PARTS.index("offset y")]] = False
    chosen = shown | undetermined

    def corrected(part: CompensatedMachine) -> tuple[Towers | None, Controller]:
        """The dimensions and the controller with them. They are fitted at the lowest temperature, and used at all."""
        if drives is None:
            return None, plain
        towers = TowerFit.of(replace(part, temperatures=first.temperatures), drives, box).towers(chosen[:D])
        return towers, partial(drives.commands, towers)

    def tables_of(part: CompensatedMachine, controller: Controller) -> PlaneTables:
        return plane_tables(part, controller, box).only(chosen[D:])

    def left(part: CompensatedMachine, controller: Controller, table: PlaneTables, whole: Model | None = None) -> Left:
        points, approach = box.fill(POINTS), both_approaches(POINTS)
        before = there(part, plain, box, points, approach) - points
        after = there(part, controller, box, table.applied(points), approach) - points
        before, after = (without_place(errors, points + box.origin, free) for errors in (before, after))
        doubt = None if whole is None else open_directions(part, whole, plain(points))
        return Left(before, after, doubt, standing)

    towers, controller = corrected(first)
    tables = tuple(tables_of(at, controller) for at in machines)
    remains = tuple(left(at, controller, table, model) for at, table in zip(machines, tables, strict=True))
    check_any(remains)
    single = {name: (part, corrected(part)[1]) for name, part in parts(machines[-1], believed).items()}
    words, absent = by_parts({name: left(part, own, tables_of(part, own)) for name, (part, own) in single.items()})
    names = (*(DIMENSIONS if drives is not None else [""] * D), *PARTS)
    alone = tuple(name for name, used in zip(names, chosen, strict=True) if name and not used)
    changes = () if drives is None or towers is None else changed_dimensions(first, drives, towers, chosen[:D], box)
    return PrinterCorrection(towers, controller, tables, remains, alone, words, absent, changes)


def _shown(machine: CompensatedMachine, plain: Controller, drives: Drives | None, box: Box) -> Mask:
    """Which dimensions of a delta, and which ``PARTS`` of the tables, the data determine."""
    free = np.ones(D + len(PARTS), dtype=bool)
    if machine.model.covariance is None:
        return free
    if drives is None:
        xyz = box.grid(*GRID)
        free[D:] = determined(machine, plain(xyz), lambda errors: changes_of_parts(xyz, errors))
        return free
    fit = TowerFit.of(machine, drives, box)
    gain = fit.response(free[:D])[1]
    free[:D] = determined(machine, fit.needed, lambda errors: [*(gain @ errors.reshape(gain.shape[1], -1))])
    by, gain = fit.response(free[:D])

    def parts_of(errors: Floats) -> list[Floats]:
        flat = errors.reshape(len(by), -1)
        return changes_of_parts(fit.xyz, (flat + by @ (gain @ flat)).reshape(errors.shape))

    free[D:] = determined(machine, fit.needed, parts_of)
    return free


def grid_file(model: Model, file: Path, session: str | None, wanted: TablesFor) -> Export:
    """The table; see :func:`~gtpin.extras.controllers.grid_table.grid_table`.

    Raises `GtpinError` if the robot has too many actuators for such a table, or one without a range; if temperatures are
    given and no effect depends on one; or if there is nothing to correct.
    """
    if wanted.box is not None or wanted.firmware is not None:
        raise ModelError("a table over commands takes no --box and no --firmware", hint="leave them out")
    machine, unknown = wanted.machine(model, session)
    believed = wanted.believed(model)
    table = grid_table(machine, believed, wanted.temperatures)
    last = replace(machine, temperatures=table.temperatures[-1])
    alone = {
        name: _left_of_grid(part, believed, grid_table(part, believed, wanted.temperatures), model)
        for name, part in parts(last, believed).items()
    }
    coarse = tuple(name for name, one in alone.items() if name != "geometry" and one.is_worse)
    if coarse:
        finer = replace(machine, model=machine.model.without(coarse))
        table = grid_table(finer, believed, wanted.temperatures)
    remains = _left_of_grid(last, believed, table, model)
    check_any([remains])
    words, absent = by_parts(alone)
    if ranges_known(model):
        used = _left_of_grid(last, believed, table, model, ranges(model))
        over = f"leaves {um(remains.expected)} um in the whole ranges of the actuators"
        notes = [used.words("the ranges of the fit", last.temperatures), over, *words]
    else:
        notes = [remains.words("the whole ranges of the actuators", last.temperatures), *words]
    if coarse:
        notes.append(f"is without {', '.join(coarse)}: it has too few nodes for it, and would make the error larger")
    missing = np.isnan(table.change[0]).any(axis=-1)
    if missing.any():
        notes.append(f"has no numbers at {missing.sum()} of {missing.size} nodes, where the robot can't be")
    text = table.frame().to_csv(index=False, lineterminator="\n", float_format="%.10g")
    return Export({file.name: text}, (*unknown, *absent), tuple(notes))


def _left_of_grid(
    machine: CompensatedMachine,
    controller: Model,
    table: GridTable,
    whole: Model,
    within: tuple[Floats | float, Floats | float] = (-np.inf, np.inf),
) -> Left:
    """Errors at commands of Halton's sequence, in cells of the table without NaN, at its last temperature step; ``within``:
    (n,) smallest and largest commands."""
    low, high = (np.clip([nodes[k] for nodes in table.nodes], *within) for k in (0, -1))
    q = spread(low, high, POINTS)
    asked = table.applied(q, len(table.temperatures) - 1)
    wanted = controller.kinematics.forward(q)
    inside = wanted.reached & np.isfinite(asked).all(axis=1)
    at = replace(machine, temperatures=table.temperatures[-1])
    approach = both_approaches(int(inside.sum()))
    before, after = (at.goes_to(some[inside], approach) - wanted.T[inside] for some in (q, asked))
    kept = np.isfinite(before).all(axis=1) & np.isfinite(after).all(axis=1)
    if not kept.any():
        raise ModelError("the robot can't be anywhere between the nodes of the table", hint="check its limits")
    free, T = motions_of_no_error(whole), wanted.T[inside][kept]
    before, after = (without_place(errors[kept], T, free) for errors in (before, after))
    return Left(before, after, open_directions(at, whole, q[inside][kept]))
