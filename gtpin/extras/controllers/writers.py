"""Formats of ``gtpin export`` that correct a controller: its actuators, the sum of all errors, an arm's table."""

from __future__ import annotations

from functools import partial
from math import isfinite
from pathlib import Path

from gtpin.compensation.machine import correctable
from gtpin.errors import GtpinError
from gtpin.export.loss import left_out, not_explained, not_oriented
from gtpin.export.writer import Export, TablesFor, Writer
from gtpin.extras.controllers.corrections import MOST, TRIPLETS, correction_table, corrections, linuxcnc_file
from gtpin.extras.controllers.machine_error import left_of_drives
from gtpin.extras.controllers.tables import grid_file, printer_files
from gtpin.model.dh import controller_table
from gtpin.model.model import Model


def _csv(model: Model, file: Path, session: str | None, tables: TablesFor) -> Export:
    table = correction_table(corrections(model, session=session, most=MOST))
    return _of_drives(model, {file.name: table.to_csv(index=False, lineterminator="\n")}, session)


def _linuxcnc(model: Model, file: Path, session: str | None, tables: TablesFor) -> Export:
    found = corrections(model, session=session, most=TRIPLETS)
    files = {f"{file.stem}_{table.site}{file.suffix}": linuxcnc_file(table) for table in found}
    return _of_drives(model, files, session)


def _of_drives(model: Model, files: dict[str, str], session: str | None) -> Export:
    carried = {"drive scales", *(active.name for active in correctable(model, session))}
    # Of what these tables leave out, name only effects ("effect@site"). The geometry belongs in the controller's kinematics.
    missing = tuple(name for name in left_out(model, carried) if "@" in name)
    return Export(files, missing, left_of_drives(model, carried, session))


def _dh(model: Model, file: Path, session: str | None, tables: TablesFor) -> Export:
    """Rows ``joint parameter unit nominal correction sigma determined``; sigma is blank for a nominal robot."""
    table = controller_table(model, exact=True)
    if not table:
        what = (
            f"{model.robot.name} is not a serial arm with all placements, so it has no table of Denavit and Hartenberg"
        )
        raise GtpinError(what, hint="write its URDF")
    lines = ["joint,parameter,unit,nominal,correction,sigma,determined"]
    for p in table:
        sigma = f"{p.sigma:.9f}" if isfinite(p.sigma) else ""
        known = "yes" if p.determined else "no"
        lines.append(f"{p.site},{p.name},{p.unit},{p.nominal:z.9f},{p.correction:z.9f},{sigma},{known}")
    missing = tuple(name for name in left_out(model) if "@" in name)
    doubt = tuple(f"{words}: corrections may be off by more than their sigmas" for words in not_explained(model))
    return Export({file.name: "\n".join(lines) + "\n"}, missing, (*doubt, *not_oriented(model)))


CSV = Writer(_csv, ".csv")
LINUXCNC = Writer(_linuxcnc, ".comp")
KLIPPER = Writer(partial(printer_files, form="klipper"), ".cfg", tables=True)
REPRAPFIRMWARE = Writer(partial(printer_files, form="reprapfirmware"), ".g", tables=True)
GRID = Writer(grid_file, tables=True)
DH = Writer(_dh)
