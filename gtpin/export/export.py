"""Writes a model for other software. Formats besides URDF are registered by entry points of the group ``gtpin.writers``."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from gtpin.compensation.machine import check_session, drive_scales
from gtpin.errors import GtpinError, RobotError, check_kind, warn
from gtpin.export.loss import assumed_tool, left_out, notes_of_robots, with_losses
from gtpin.export.urdf import changed_origins, side_file, with_anchors, with_transmissions
from gtpin.export.writer import Export, TablesFor, Writer
from gtpin.extensions import extension_names, extensions
from gtpin.model.model import Model
from gtpin.model.model_folder import calibrated_urdf, in_doubt, said_first
from gtpin.output.results import results_folder
from gtpin.robot.chain import Chain
from gtpin.robot.description import RobotDescription

GROUP = "gtpin.writers"
"""Entry-point group of the formats; each is a :class:`~gtpin.export.writer.Writer`."""


def export(
    model: Model,
    file: str | Path,
    form: str | None = None,
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
        folder, for example-parallel-robots); ``.diff`` (what changes in the robot's URDF: origins and anchors); of the extras
        ``.sdf``; ``.xml`` (MJCF); ``.csv`` (a table of corrections);
        ``.comp`` (LinuxCNC's compensation files, ``FILE_SITE.comp`` for each actuator); ``.cfg`` (Klipper); ``.g``
        (RepRapFirmware's macro, and a height map in the same folder).
    form
        The format, if the suffix does not determine it; ``grid`` (a table over commands and temperatures) and ``dh`` (the
        parameters of Denavit and Hartenberg of a serial arm, with their corrections) have no suffix.
    session
        Session whose zero shifts are in tables of corrections and MJCF; None: no zero shifts.
    tables
        Controller and conditions for the formats ``grid``, ``klipper`` and ``reprapfirmware``.
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
    name, writer = writer_of(file, form)
    check_session(model.effects, session)
    if tables is not None and not writer.tables:
        what = f"{name} takes no box, temperatures, firmware or controller"
        raise GtpinError(what, file=file, hint="these belong to --format grid, .cfg and .g")
    made = writer.write(model, file, session, tables or TablesFor())
    notes = (*in_doubt(model), *_held(model, made), *made.notes, *(() if writer.tables else assumed_tool(model)))
    with results_folder(file.parent, tuple(made.files), force=force, key=file.name, shown=file, alone=True) as folder:
        for name, text in made.files.items():
            (folder / name).write_text(said_first(text, notes) if text.startswith("<") else text, encoding="utf-8")
    for note in notes:
        warn(f"{file.name} {note}")
    return tuple(file.parent / name for name in made.files)


def _held(model: Model, made: Export) -> tuple[str, ...]:
    """What files do not hold of a model, and what they hold with an error, as texts; else none."""
    single = made.in_transmissions
    lost = ", ".join(with_losses(model, tuple(name for name in made.left_out if name not in single)))
    driven, exact = ", ".join(with_losses(model, single)), ", ".join(made.inexact)
    words = (
        lost and f"does not hold {lost}",
        driven and f"holds {driven} as <transmission> only, which not every program reads",
        exact and f"holds {exact}",
    )
    return tuple(filter(None, words))


def writer_of(file: Path, form: str | None = None) -> tuple[str, Writer]:
    """Name and writer of the format ``form``, or by default of the format that a file's suffix determines.

    Raises `GtpinError` if there is no such format.
    """
    known = OWN | extensions(GROUP)
    if form is None:
        found = {writer.suffix: name for name, writer in known.items() if writer.suffix}
        form = found.get(file.suffix.lower())
        if form is None:
            hint = f"use {', '.join(found)}, or say which of {', '.join(known)} it shall be"
            raise GtpinError(f"no format has the suffix {file.suffix!r}", file=file, hint=hint)
    if form not in known:
        raise GtpinError(f"no format is called {form!r}", file=file, hint=f"choose one of {', '.join(known)}")
    return form, known[form]


def format_names() -> tuple[str, ...]:
    """The names of all formats."""
    return (*OWN, *extension_names(GROUP))


def calibrated_chain(model: Model) -> Chain:
    """The robot with a model's geometry, without its effects."""
    return Chain(RobotDescription.parse(calibrated_urdf(model), f"the URDF of {model.robot.name}"))  # it names the TCP


def _urdf(model: Model, file: Path, session: str | None, tables: TablesFor) -> Export:
    scales, carried = drive_scales(model)
    urdf = with_transmissions(calibrated_urdf(model), model.robot, scales)
    missing = left_out(model)
    transmitted = tuple(name for name in missing if name in carried)
    return Export({file.name: urdf}, missing, notes_of_robots(model), in_transmissions=transmitted)


def _parallel_robots(model: Model, file: Path, session: str | None, tables: TablesFor) -> Export:
    robot = calibrated_chain(model)
    files = {file.name: side_file(robot), f"{file.stem}.urdf": with_anchors(robot)}
    return Export(files, left_out(model), notes_of_robots(model))


def _diff(model: Model, file: Path, session: str | None, tables: TablesFor) -> Export:
    robot = model.robot.description
    after = replace(model, geometry=model.geometry.at_tool(), instruments=())  # without links that the file has not
    if robot.kind != "urdf":
        raise RobotError(f"{robot.name} was read from an MJCF, which has no origins", hint="write its URDF or MJCF")
    text = changed_origins(robot.xml, calibrated_urdf(after), f"{robot.name}.urdf")
    return Export({file.name: text}, left_out(model), notes_of_robots(model))


OWN = {
    "urdf": Writer(_urdf, ".urdf"),
    "parallel-robots": Writer(_parallel_robots, ".yaml"),
    "diff": Writer(_diff, ".diff"),
}
"""The formats that are no extras."""
