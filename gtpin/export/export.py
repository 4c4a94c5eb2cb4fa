"""Writes a model for other software."""

from __future__ import annotations

import os
from collections.abc import Collection
from math import isfinite
from pathlib import Path
from typing import Literal, get_args

from gtpin.compensation.corrections import MOST, TRIPLETS, correctable, correction_table, corrections, linuxcnc_file
from gtpin.compensation.machine import check_session
from gtpin.errors import GtpinError, check_kind, warn
from gtpin.export.loss import with_losses, with_remainders
from gtpin.export.urdf import side_file, with_anchors, with_transmissions
from gtpin.extras.controllers.machine_error import left_of_drives
from gtpin.extras.controllers.tables import Export, TablesFor, grid_file, printer_files
from gtpin.extras.simulators.carts import with_cart_springs, with_guideways
from gtpin.extras.simulators.drives import drive_scales, with_drives
from gtpin.extras.simulators.mechanism import mechanism
from gtpin.extras.simulators.mjcf import to_mjcf
from gtpin.extras.simulators.sdf import to_sdf
from gtpin.extras.simulators.springs import with_joint_springs, with_link_springs
from gtpin.model.dh import controller_table
from gtpin.model.model import Model
from gtpin.model.model_folder import calibrated_urdf
from gtpin.output.results import results_folder
from gtpin.paper.geometry import PaperGeometry
from gtpin.robot.chain import Chain
from gtpin.robot.description import RobotDescription

Format = Literal["urdf", "parallel-robots", "sdf", "mjcf", "csv", "linuxcnc", "grid", "dh", "klipper", "reprapfirmware"]
TABLES: tuple[Format, ...] = ("grid", "klipper", "reprapfirmware")
"""Formats of tables that correct the sum of all errors, as far as they can; see ``TablesFor``."""
SUFFIXES: dict[str, Format] = {
    ".urdf": "urdf",
    ".yaml": "parallel-robots",
    ".sdf": "sdf",
    ".xml": "mjcf",
    ".csv": "csv",
    ".comp": "linuxcnc",
    ".cfg": "klipper",
    ".g": "reprapfirmware",
}


def export(
    model: Model,
    file: str | Path,
    form: Format | None = None,
    *,
    session: str | None = None,
    tables: TablesFor | None = None,
    force: bool = False,
) -> tuple[Path, ...]:
    """Write a model for other software. A warning names the parts that the format can't represent, each with its loss, um.

    Parameters
    ----------
    file
        The file to write; its suffix determines the format: ``.urdf``; ``.yaml`` (and a URDF of the same name in the same
        folder, for example-parallel-robots); ``.sdf``; ``.xml`` (MJCF); ``.csv`` (a table of corrections); ``.comp``
        (LinuxCNC's compensation files, ``FILE_SITE.comp`` for each actuator); ``.cfg`` (Klipper); ``.g`` (RepRapFirmware's
        macro, and a height map in the same folder).
    form
        The format, if the suffix does not determine it; ``grid`` (a table over commands and temperatures) and ``dh`` (the
        parameters of Denavit and Hartenberg of a serial arm, with their corrections) have no suffix.
    session
        Session whose zero shifts are in tables of corrections and MJCF; None: no zero shifts.
    tables
        Controller and conditions for the formats ``TABLES``.
    force
        Rename files of these names that gtpin has not written, or that were changed since, to ``NAME.old-1``.

    Returns
    -------
    files
        Paths of the written files.

    Raises
    ------
    GtpinError
        If the suffix, the format or the session is not known, the format can't represent the robot, or the file can't be
        written; or, without ``force``, there is a file that gtpin has not written.
    """
    check_kind(model, Model)
    file = Path(file)
    if os.path.isdir(file):
        raise GtpinError("this is a folder", file=file, hint="name a file")
    form = form or SUFFIXES.get(file.suffix.lower())
    if form is None:
        raise GtpinError(
            f"no format has the suffix {file.suffix!r}",
            file=file,
            hint=f"use {', '.join(SUFFIXES)}, or say which of {', '.join(get_args(Format))} it shall be",
        )
    if form not in get_args(Format):
        raise GtpinError(
            f"no format is called {form!r}", file=file, hint=f"choose one of {', '.join(get_args(Format))}"
        )
    check_session(model.effects, session)
    made = texts(model, file, form, session=session, tables=tables)
    with results_folder(file.parent, tuple(made.files), force=force, key=file.name, shown=file, alone=True) as folder:
        for name, text in made.files.items():
            (folder / name).write_text(text, encoding="utf-8")
    if made.left_out:
        lost = ", ".join(with_losses(model, made.left_out))
        more = f"; {', '.join(made.in_transmissions)}: as <transmission> only" if made.in_transmissions else ""
        warn(f"{file.name} does not hold {lost}{more}")
    if made.inexact:
        warn(f"{file.name} holds {', '.join(made.inexact)}")
    for note in made.notes:
        warn(f"{file.name} {note}")
    return tuple(file.parent / name for name in made.files)


def texts(
    model: Model, file: Path, form: Format, *, session: str | None = None, tables: TablesFor | None = None
) -> Export:
    """The files that :func:`export` writes, as texts."""
    wanted = tables or TablesFor()
    if form in TABLES:
        if form == "grid":
            return grid_file(model, file, wanted, session)
        return printer_files(model, file, form, wanted, session)
    if tables is not None:
        what = f"{form} takes no box, temperatures, firmware or controller"
        raise GtpinError(what, file=file, hint="these belong to --format grid, .cfg and .g")
    if form == "dh":
        missing = tuple(name for name in left_out(model) if "@" in name)
        return Export({file.name: _dh(model)}, missing, _doubt(model))
    if form in ("csv", "linuxcnc"):
        return _corrections(model, file, form, session)
    urdf = calibrated_urdf(model)
    if form == "urdf":
        scales, carried = drive_scales(model)
        urdf = with_transmissions(urdf, model.robot, scales)
        in_transmissions = tuple(name for name in left_out(model) if name in carried)
        return Export({file.name: urdf}, left_out(model), in_transmissions=in_transmissions)
    robot = Chain(RobotDescription.parse(urdf, f"the URDF of {model.robot.name}"))  # it names the TCP
    if form == "parallel-robots":
        files = {file.name: side_file(robot), f"{file.stem}.urdf": with_anchors(robot)}
        return Export(files, left_out(model))
    plain = mechanism(robot)
    if form == "sdf":
        machine, shown = with_link_springs(plain, model, robot)
        return Export({file.name: to_sdf(machine)}, left_out(model, shown), inexact=with_remainders(model, shown))
    machine, shown = with_guideways(plain, model, robot)
    for parts in (with_cart_springs, with_link_springs):
        machine, more = parts(machine, model, robot)
        shown |= more
    machine, by_joints = with_joint_springs(machine, model)
    machine, by_drives = with_drives(machine, model, session)
    shown |= by_joints | by_drives
    missing = left_out(model, {*shown, "drive scales"})
    return Export({file.name: to_mjcf(machine, plain)}, missing, inexact=with_remainders(model, shown, session))


def _corrections(model: Model, file: Path, form: Format, session: str | None) -> Export:
    carried = {"drive scales", *(active.name for active in correctable(model, session))}
    # Of what these tables leave out, name only effects ("effect@site"). The geometry belongs in the controller's kinematics.
    missing = tuple(name for name in left_out(model, carried) if "@" in name)
    tables = corrections(model, session=session, most=MOST if form == "csv" else TRIPLETS)
    if form == "csv":
        files = {file.name: correction_table(tables).to_csv(index=False, lineterminator="\n")}
    else:
        files = {f"{file.stem}_{table.site}{file.suffix}": linuxcnc_file(table) for table in tables}
    return Export(files, missing, left_of_drives(model, carried, session))


def _doubt(model: Model) -> tuple[str, ...]:
    """A message where the sigmas of a table are too small if what the model leaves of the data is no noise."""
    unexplained = model.unexplained
    if unexplained is None or unexplained.none:
        return ()
    left, unit = (unexplained.position, "um") if unexplained.position else (unexplained.orientation, "urad")
    kind = "beyond noise, so" if unexplained.noise_known else "an axis: if these are no noise,"
    return (
        f"is of a model that leaves {1e6 * left:.3g} {unit} {kind} corrections may be off by more than their sigmas",
    )


def _dh(model: Model) -> str:
    """Rows ``joint parameter unit nominal correction sigma determined``; sigma is blank for a nominal robot."""
    table = controller_table(model)
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
    return "\n".join(lines) + "\n"


def left_out(model: Model, carried: Collection[str] = ()) -> tuple[str, ...]:
    """Names of parts of a model, beyond straight tracks, rods and joints, that a file can't represent.

    ``carried``: parts that the file represents, of these names: ``effect@site``, ``drive scales``, ``directions of single
    rods``, ``measured tracks``, ``instrument's frame``.
    """
    geometry = model.geometry
    moved = {(p.kind, p.per) for p, d in zip(geometry.parameters, geometry.deviation, strict=True) if d != 0.0}
    has = {
        "drive scales": bool({("scale", "actuator"), ("scale", "rod")} & moved),
        "directions of single rods": ("direction", "rod") in moved,
        "measured tracks": isinstance(geometry, PaperGeometry) and any(track is not None for track in geometry.tracks),
        "instrument's frame": not model.frame.is_base,
    }
    names = [name for name, there in has.items() if there] + [active.name for active in model.effects]
    return tuple(name for name in names if name not in carried)
