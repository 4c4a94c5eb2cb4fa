"""Models in files: a folder with ``model.json`` and the URDFs; a robot's name or a URDF gives a nominal model."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from gtpin.data.instrument_tables import TABLES, AnyTable, written
from gtpin.effects.active import ActiveEffect
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.effect import Effect
from gtpin.errors import GtpinError, ModelError, check_kind
from gtpin.model.effect_record import active_effect, record
from gtpin.model.fit_conditions import FitConditions, ModelDiscrepancy
from gtpin.model.model import FittedInstrument, Frame, Model
from gtpin.model.model_file import (
    AGAIN,
    SCHEMA,
    FitRecord,
    FrameRecord,
    InstrumentRecord,
    ModelFile,
    TrackRecord,
    UnexplainedRecord,
    explained,
    read_model_file,
)
from gtpin.output.results import results_folder
from gtpin.paper.geometry import PaperGeometry, nominal_geometry
from gtpin.paper.tracks import MeasuredTrack
from gtpin.robot.chain import Chain
from gtpin.robot.description import RobotDescription
from gtpin.robot.geometry import Geometry, check_names
from gtpin.robot.library import load_robot
from gtpin.robot.parameters import DIRECTIONS
from gtpin.typing import Floats

FILES = ("model.json", "robot.urdf", "nominal.urdf")
"""Files that ``write_model`` writes."""
RESULTS = (".json", ".html", ".txt")
"""Suffixes of files that stand beside a model in a result's folder."""
FOLDER = "give a folder that calibrate, diagnose or certify wrote"
UNKNOWN = 0.05
"""Tolerance of ``platform.x``, m, from which it is the place of a free target. Older versions did not write ``target``."""
NOT_TURNED = 1e-9
"""Largest accepted error of a rotation matrix's orthogonality, and of a correlation above 1."""
LARGEST_DEVIATION = 10.0
"""Largest deviation of a length, in sizes of the robot, and of a scale, from nominal: no machine is so far from its drawing."""
MOST_UNCERTAIN = 1e3
"""Standard deviation, m or rad, above which a file is refused: tolerances of geometric parameters are millimetres. Assumed."""


def calibrated_urdf(model: Model) -> str:
    """URDF of a model's robot with the model's geometry, as far as a URDF can represent it, and with a link for each target."""
    return model.kinematics.urdf(model.targets)


def in_doubt(model: Model) -> tuple[str, ...]:
    """What to say first of a file that is made from a model whose geometry is in doubt; else none."""
    return (f"has a geometry in doubt: {model.doubt}",) if model.doubt else ()


def said_first(xml: str, notes: Iterable[str]) -> str:
    """An XML document with a comment at its head for each note, which says what this file has."""
    declaration, end, body = xml.rpartition("?>\n")
    comments = (f"<!-- this file {note.replace('--', '- -')} -->\n" for note in notes)
    return "".join((declaration, end, *comments, body))


def write_model(model: Model, folder: str | Path, *, force: bool = False) -> None:
    """Write ``model.json``, ``robot.urdf`` (the model's geometry) and ``nominal.urdf`` into a folder.

    ``read_model`` reads the same model, with bit-identical predictions. ``model.json`` also has what a URDF can't represent.
    A model that gtpin wrote is replaced. With ``force``, files of these names that gtpin did not write, or that were changed
    since, are renamed (``NAME.old-1``).

    Raises
    ------
    ModelError
        If the written file could not be read again (two effects have the same id, a number is not finite); if the folder can't
        be written; or, without ``force``, if it has files of these names that gtpin did not write or that were changed since.

    Examples
    --------
    >>> import gtpin
    >>> gtpin.write_model(gtpin.read_model("gantry_tau"), "nominal")
    >>> gtpin.read_model("nominal").robot.name
    'gantry_tau'
    """
    check_kind(model, Model)
    folder = Path(folder)
    file = folder / "model.json"
    try:
        content = _content(model)
    except ValidationError as error:
        raise explained(error, file) from None
    _effects(content, model.geometry, file, {active.effect.id: active.effect for active in model.effects})
    urdf = said_first(calibrated_urdf(model), in_doubt(model))
    with results_folder(folder, FILES, force=force, kind=ModelError) as new:
        (new / "model.json").write_text(_text(content), encoding="utf-8")
        (new / "robot.urdf").write_text(urdf, encoding="utf-8")
        (new / "nominal.urdf").write_text(model.robot.description.xml, encoding="utf-8")


def model_json(model: Model) -> str:
    """The content of the ``model.json`` of a model that can be written."""
    return _text(_content(model))


def _text(content: ModelFile) -> str:
    return content.model_dump_json(by_alias=True, indent=1) + "\n"


def _listed(values: Floats | None) -> Any:
    return None if values is None else values.tolist()


def _content(model: Model) -> ModelFile:
    geometry, frame = model.geometry, model.frame
    sites = geometry.robot.sites
    scaled = {p.part for p, _ in geometry.all_deviations if p.kind == "scale"}
    single = {p.kind for p, _ in geometry.all_deviations if p.part not in sites}
    tracks = geometry.tracks if isinstance(geometry, PaperGeometry) else ()
    return ModelFile(
        schema=SCHEMA,
        robot=geometry.robot.name,
        nominal_urdf="nominal.urdf",
        tcp=geometry.robot.tcp_frame,
        directions="rod" if single & set(DIRECTIONS) else "actuator",
        scale=("actuator" if scaled <= set(sites) else "rod") if scaled else None,
        arm="reduced" if geometry.positions_only else "full",
        tracks=[
            None if track is None else TrackRecord(**{key: _listed(values) for key, values in vars(track).items()})
            for track in tracks
        ],
        parameters={name: float(value) for name, value in zip(geometry.names, geometry.values, strict=True)},
        tolerance={p.name: p.tolerance for p in geometry.parameters},
        widened={p.name: p.widened for p in geometry.parameters if p.widened != 1.0},
        target=None if geometry.target is None else [p.nominal for p in geometry.parameters if p.kind == "platform"],
        held={p.name: value for p, value in geometry.held},
        covariance=_listed(model.covariance),
        joint_covariance=_listed(model.joint_covariance),
        between_members=_listed(model.between_members),
        fit=None if model.fit is None else FitRecord(**asdict(model.fit)),
        unexplained=None if model.unexplained is None else UnexplainedRecord(**asdict(model.unexplained)),
        doubt=model.doubt,
        base_in_instrument=None if frame.is_base else FrameRecord(position=frame.T.tolist(), rotation=frame.R.tolist()),
        effects=[record(active) for active in model.effects],
        instruments=[
            InstrumentRecord(
                declared=written(one.table),
                columns=list(one.columns),
                known={name: list(ids) for name, ids in one.known.items()},
                unknowns=dict(one.unknowns),
            )
            for one in model.instruments
        ],
    )


def _instrument(number: int, record: InstrumentRecord, file: Path) -> FittedInstrument:
    kind = TABLES.get(str(record.declared.get("kind")), AnyTable)
    try:
        table = kind.model_validate(record.declared, strict=False)
    except ValidationError as error:
        raise explained(error, file, f"instruments.{number}.declared.") from None
    known = {name: tuple(ids) for name, ids in record.known.items()}
    return FittedInstrument(table, tuple(record.columns), known, dict(record.unknowns))


def read_model(
    reference: str | Path,
    *,
    tcp: str | None = None,
    actuators: Sequence[str] = (),
    home: Sequence[float] | str = (),
    effects: Iterable[Effect] = (),
) -> Model:
    """Read a model.

    Parameters
    ----------
    reference
        A folder with ``model.json`` or ``model/model.json``; or, for nominal geometry, a robot's name, or the path of its URDF
        or MJCF file: see :func:`~gtpin.robot.library.load_robot`.
    tcp
        For a robot by its name or path: the link that is the TCP, where it is not the robot's own.
    actuators, home
        For a robot by its name or path: as for :func:`gtpin.load_robot`.
    effects
        Your own effects that the model may have, in addition to those of :func:`gtpin.catalogue`: their coefficients are in
        ``model.json``, but not their equations.

    Raises
    ------
    GtpinError
        If there is no such model, or it can't be read.

    Examples
    --------
    >>> import gtpin
    >>> model = gtpin.read_model("gantry_tau")  # of the nominal geometry
    >>> model.effects
    ()
    """
    path, own = Path(reference), {effect.id: effect for effect in effects}
    if (tcp is not None or actuators or home) and (os.path.isdir(path) or path.suffix == ".json"):
        what = "a model has a TCP, actuators and a home of its own"
        raise ModelError(what, file=path, hint="leave --tcp, --actuators and --home out, or name the robot")
    if os.path.isdir(path):
        if folder := _model_in(path):
            return _read_folder(folder, own)
        raise ModelError("no model.json here", file=path, hint=FOLDER)
    if os.path.isfile(path) and path.suffix in RESULTS and path.name != "model.json":
        hint = f"give the folder: {path.parent}" if _model_in(path.parent) else FOLDER
        raise ModelError("this file of a result is no model", file=path, hint=hint)
    if os.path.isfile(path) and path.suffix == ".json":
        return _read_folder(path.parent, own)
    if len(path.parts) > 1 and not path.suffix and not os.path.exists(path):  # a name without folders is a robot's
        raise ModelError("no such folder", file=path, hint=FOLDER)
    return Model(Geometry.nominal(load_robot(reference, tcp, actuators, home)))


def _model_in(path: Path) -> Path | None:
    """The folder with ``model.json``: this one, or ``model`` in it; None where there is none."""
    return next((folder for folder in (path, path / "model") if (folder / "model.json").exists()), None)


def _read_folder(folder: Path, own: Mapping[str, Effect]) -> Model:
    file = folder / "model.json"
    content = read_model_file(file)
    if Path(content.nominal_urdf).name != content.nominal_urdf:
        raise ModelError("the nominal URDF is not in the model's folder", file=file, column="nominal_urdf", hint=AGAIN)
    for name, value in (content.parameters | content.held).items():
        if name.startswith("length[") and value <= 0.0:
            raise ModelError(f"{name} is {value:g} m", file=file, column=f"parameters.{name}", hint=AGAIN)
    robot = Chain(RobotDescription.read(folder / content.nominal_urdf), content.tcp)
    instruments = tuple(_instrument(i, one, file) for i, one in enumerate(content.instruments))
    try:
        tables = [one.table for one in instruments]
        robot = robot.measuring(
            (j for t in tables for j in t.measured_joints), (k for t in tables for k in t.measured_links)
        )
        geometry = _geometry(robot, content)
        frame, names = _frame(content), list(content.parameters)
        order = [names.index(name) for name in geometry.names]
        size = len(order) + sum(len(effect.coefficients) for effect in content.effects)
        covariance = _covariance(content.covariance, order, "covariance", len(order))
        whole = [*order, *range(len(order), size)]
        joint = _covariance(content.joint_covariance, whole, "joint_covariance", len(order))
        between = _covariance(content.between_members, order, "between_members", len(order))
    except GtpinError as error:
        raise ModelError(error.what, file=file, column=error.column, hint=AGAIN) from None
    effects = _effects(content, geometry, file, own)
    fit = None if content.fit is None else FitConditions(**content.fit.model_dump())
    unexplained = None if content.unexplained is None else ModelDiscrepancy(**content.unexplained.model_dump())
    return Model(geometry, frame, effects, covariance, instruments, joint, fit, unexplained, content.doubt, between)


def _effects(content: ModelFile, geometry: Geometry, file: Path, own: Mapping[str, Effect]) -> tuple[ActiveEffect, ...]:
    if not content.effects:
        return ()
    solver, known, found = Model(geometry).kinematics, {**effects_by_id(), **own}, []
    for number, one in enumerate(content.effects):
        try:
            found.append(active_effect(one, solver, known))
        except GtpinError as error:
            key = f"effects.{number}.{error.column}" if error.column else f"effects.{number}"
            raise ModelError(error.what, file=file, column=key, hint=error.hint or AGAIN) from None
    return tuple(found)


def _geometry(robot: Chain, content: ModelFile) -> Geometry:
    # The file gives a tolerance for each parameter; those of the kinds, which a URDF may lack, are not used here.
    tracks = tuple(None if t is None else _track(t) for t in content.tracks)
    if tracks and len(tracks) != len(robot.rod_sites):
        raise ModelError(f"{len(tracks)} tracks for {len(robot.rod_sites)} rods")
    zeros = any(name.startswith("zero[") for name in (*content.parameters, *content.held))
    options = {"directions": content.directions, "scale": content.scale, "arm": content.arm, "tracks": tracks}
    full = nominal_geometry(robot, **options, zeros=zeros)  # type: ignore[arg-type]
    check_names(content.parameters, full.names)
    full = full.holding(content.held)
    kept = tuple(p for p in full.parameters if p.name in content.parameters)
    values = np.array([content.parameters[p.name] for p in kept])
    parameters = tuple(
        replace(p, tolerance=content.tolerance.get(p.name, p.tolerance), widened=content.widened.get(p.name, 1.0))
        for p in kept
    )
    guess = content.target
    if guess is None and content.tolerance.get("platform.x", 0.0) >= UNKNOWN:
        guess = list(Geometry(robot, parameters, values).platform)
    if guess is not None:
        parameters = tuple(replace(p, nominal=guess[p.component]) if p.kind == "platform" else p for p in parameters)
    geometry = replace(full, parameters=parameters, values=values)
    _check_values(geometry)
    return geometry


def _check_values(geometry: Geometry) -> None:
    """Raise `ModelError`, with the parameter, for a value that no machine has, or where the loops don't close at home."""
    largest = {"m": LARGEST_DEVIATION * geometry.robot.size, "rad": np.pi, "m/m": LARGEST_DEVIATION}
    moved = geometry.deviation
    for parameter, deviation in geometry.all_deviations:
        if abs(deviation) > largest[parameter.unit]:
            what = f"{parameter.nominal + deviation:g} {parameter.unit}, where {parameter.nominal:g} is nominal"
            raise ModelError(what, column=f"parameters.{parameter.name}")
    if geometry.robot.constraints and moved.any() and not Model(geometry).kinematics.home.reached.all():
        i = int(np.argmax(np.abs(moved) / geometry.tolerance))
        most = geometry.parameters[i]
        what = f"the loops don't close at home; farthest from nominal, {most.nominal:g}, is this value, {geometry.values[i]:g}"
        raise ModelError(what, column=f"parameters.{most.name}")


def _track(record: TrackRecord) -> MeasuredTrack:
    if len(record.path) != len(record.q) or (record.turns is not None and len(record.turns) != len(record.q)):
        raise ModelError("a track's points differ in number")
    turns = None if record.turns is None else np.array(record.turns)
    return MeasuredTrack(np.array(record.q), np.array(record.path), turns, np.array(record.origin))


def _covariance(rows: list[list[float]] | None, order: list[int], column: str, n_parameters: int) -> Floats | None:
    """A covariance from a file, with its rows and columns rearranged by the indices ``order``; raises `ModelError` if invalid.

    The first ``n_parameters`` are parameters of the geometry.
    """
    if rows is None:
        return None
    count = len(order)
    if len(rows) != count or any(len(row) != count for row in rows):
        raise ModelError(f"the covariance is not {count} x {count}", column=column)
    covariance = np.array(rows)[np.ix_(order, order)]
    sigma = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
    # Coefficients of effects, at the end of a joint covariance, have other units.
    if (covariance.diagonal() < 0.0).any() or (sigma[:n_parameters] > MOST_UNCERTAIN).any():
        raise ModelError(f"a variance that is not between 0 and {MOST_UNCERTAIN:g} squared", column=column)
    if (np.abs(covariance) > (1.0 + NOT_TURNED) * np.outer(sigma, sigma)).any():
        raise ModelError("a covariance larger than the variances allow", column=column)
    return covariance


def _frame(content: ModelFile) -> Frame:
    if content.base_in_instrument is None:
        return Frame()
    R = np.array(content.base_in_instrument.rotation)
    if np.abs(R @ R.T - np.eye(3)).max() > NOT_TURNED or np.linalg.det(R) < 0.0:
        raise ModelError("no rotation matrix", column="base_in_instrument.rotation")
    return Frame(np.array(content.base_in_instrument.position), R)
