"""Models on disk: a folder with ``model.json`` and the URDFs, or anything else that names a model."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gtpin.errors import GtpinError, ModelError
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.kinematics.rotations import from_quaternions, to_quaternions
from gtpin.model import Frame, Model
from gtpin.robot.description import Description
from gtpin.robot.export import placements_to_urdf, to_urdf
from gtpin.robot.geometry import Arm, Geometry
from gtpin.robot.library import load_robot
from gtpin.robot.parameters import Per
from gtpin.robot.robot import Robot
from gtpin.robot.tracks import MeasuredTrack

SCHEMA = "gtpin-model/1"
Finite = Annotated[float, Field(allow_inf_nan=False)]


Triple = Annotated[list[Finite], Field(min_length=3, max_length=3)]


class _FrameFile(BaseModel):
    model_config = ConfigDict(extra="forbid")

    position: Triple
    orientation: Annotated[list[Finite], Field(min_length=4, max_length=4)]


class _TrackFile(BaseModel):
    """A measured track; see :class:`~gtpin.robot.tracks.MeasuredTrack`."""

    model_config = ConfigDict(extra="forbid")

    q: list[Finite]
    path: list[Triple]
    turns: list[Triple] | None
    origin: Triple


class _ModelFile(BaseModel):
    """What ``model.json`` holds."""

    model_config = ConfigDict(extra="forbid", populate_by_name=True)

    schema_: Literal["gtpin-model/1"] = Field(alias="schema")
    robot: str
    nominal_urdf: str
    tcp: str
    directions: Per
    scale: Per | None
    arm: Arm = "full"
    tracks: list[_TrackFile | None] = []
    parameters: dict[str, Finite]
    tolerance: dict[str, Annotated[float, Field(gt=0.0, allow_inf_nan=False)]]
    covariance: list[list[Finite]] | None = None
    base_in_instrument: _FrameFile | None


def calibrated_urdf(model: Model) -> str:
    """URDF of a model's robot with the model's geometry, as far as a URDF can carry it."""
    geometry = model.geometry
    if not geometry.robot.rods:
        return placements_to_urdf(geometry)
    rods = RodKinematics(geometry)
    if not rods.home.reached.all():
        raise ModelError(f"the loops of {geometry.robot.name} don't close at home", hint="check the geometry's values")
    return to_urdf(geometry, rods.P, rods.C0, rods.L0, rods.v, (rods.home.T[0], rods.home.R[0]))


def write_model(model: Model, folder: str | Path) -> None:
    """Write ``model.json``, ``robot.urdf`` (the model's geometry) and ``nominal.urdf`` into a folder.

    ``read_model`` gives the same model again. In ``model.json`` stands what a URDF can't carry too.
    """
    if model.effects:
        raise ModelError(
            "effects can't be written yet", hint="write the model without them: replace(model, effects=())"
        )
    geometry = model.geometry
    frame = model.frame
    kinds = {p.kind: p.per for p in geometry.parameters}
    told = _ModelFile(
        schema="gtpin-model/1",
        robot=geometry.robot.name,
        nominal_urdf="nominal.urdf",
        tcp=geometry.robot.tcp_frame,
        directions="rod" if ("direction", "rod") in {(p.kind, p.per) for p in geometry.parameters} else "actuator",
        scale=kinds.get("scale"),  # type: ignore[arg-type]
        arm="reduced" if geometry.reduced else "full",
        tracks=[None if track is None else _TrackFile(**_track_lists(track)) for track in geometry.tracks],
        parameters={name: float(value) for name, value in zip(geometry.names, geometry.values, strict=True)},
        tolerance={p.name: p.tolerance for p in geometry.parameters},
        covariance=None if model.covariance is None else model.covariance.tolist(),
        base_in_instrument=None
        if frame.is_base
        else _FrameFile(position=frame.T.tolist(), orientation=to_quaternions(frame.R[None])[0].tolist()),
    )
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.json").write_text(told.model_dump_json(by_alias=True, indent=1) + "\n", encoding="utf-8")
    (folder / "robot.urdf").write_text(calibrated_urdf(model), encoding="utf-8")
    (folder / "nominal.urdf").write_text(geometry.robot.description.xml, encoding="utf-8")


def _track_lists(track: MeasuredTrack) -> dict[str, Any]:
    turns = None if track.turns is None else track.turns.tolist()
    return {"q": track.q.tolist(), "path": track.path.tolist(), "turns": turns, "origin": track.origin.tolist()}


def read_model(reference: str | Path) -> Model:
    """Read a model.

    Parameters
    ----------
    reference
        A folder that holds ``model.json``, or whose ``model/`` does; the name of a robot that gtpin ships, or the path of a
        URDF, both of which give nominal geometry.

    Raises
    ------
    GtpinError
        If there is no such model, or it can't be read.
    """
    path = Path(reference)
    if path.is_dir():
        for folder in (path, path / "model"):
            if (folder / "model.json").is_file():
                return _read_folder(folder)
        raise ModelError("no model.json here", file=path, hint="give a folder that calibrate or diagnose wrote")
    if path.is_file() and path.suffix == ".json":
        return _read_folder(path.parent)
    return Model(Geometry.nominal(load_robot(reference)))


def _read_folder(folder: Path) -> Model:
    file = folder / "model.json"
    try:
        told = _ModelFile.model_validate(json.loads(file.read_text(encoding="utf-8-sig")))
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"can't be read ({error})", file=file, hint="write the model again") from None
    except json.JSONDecodeError as error:
        raise ModelError(f"no JSON ({error.msg})", file=file, row=error.lineno, hint="write the model again") from None
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise ModelError(first["msg"], file=file, column=key, hint="write the model again") from None
    except (RecursionError, ValueError) as error:  # brackets nested a thousand deep, endless integers
        raise ModelError(
            f"no JSON that can be read ({str(error)[:80]})", file=file, hint="write the model again"
        ) from None
    robot = Robot(Description.read(folder / told.nominal_urdf), told.tcp)
    try:
        geometry = _geometry(robot, told)
        return Model(geometry, _frame(told), covariance=_covariance(geometry, told))
    except GtpinError as error:
        raise ModelError(error.what, file=file, hint="write the model again") from None


def _geometry(robot: Robot, told: _ModelFile) -> Geometry:
    # Tolerances are told by parameter, so those of the kinds, which the URDF may not know, do not matter here.
    tracks = tuple(None if t is None else _track(t) for t in told.tracks)
    if tracks and len(tracks) != len(robot.rods):
        raise ModelError(f"{len(tracks)} tracks for {len(robot.rods)} rods")
    full = Geometry.nominal(robot, directions=told.directions, scale=told.scale, arm=told.arm, tracks=tracks)
    unknown = sorted(set(told.parameters) - set(full.names))
    if unknown:
        raise ModelError(f"no parameter is called {unknown[0]!r}")
    kept = tuple(p for p in full.parameters if p.name in told.parameters)
    values = np.array([told.parameters[p.name] for p in kept])
    tolerances = (told.tolerance.get(p.name, p.tolerance) for p in kept)
    parameters = tuple(p.with_tolerance(tolerance) for p, tolerance in zip(kept, tolerances, strict=True))
    return Geometry(robot, parameters, values, tracks)


def _track(told: _TrackFile) -> MeasuredTrack:
    if len(told.path) != len(told.q) or (told.turns is not None and len(told.turns) != len(told.q)):
        raise ModelError("a track's points differ in number")
    turns = None if told.turns is None else np.array(told.turns)
    return MeasuredTrack(np.array(told.q), np.array(told.path), turns, np.array(told.origin))


def _covariance(geometry: Geometry, told: _ModelFile) -> npt.NDArray[np.float64] | None:
    if told.covariance is None:
        return None
    count = len(geometry.parameters)
    if len(told.covariance) != count or any(len(row) != count for row in told.covariance):
        raise ModelError(f"the covariance is not {count} x {count}")
    # In the order of the file's parameters, as it was written.
    order = [list(told.parameters).index(name) for name in geometry.names]
    return np.array(told.covariance)[np.ix_(order, order)]


def _frame(told: _ModelFile) -> Frame:
    if told.base_in_instrument is None:
        return Frame()
    wxyz = np.array(told.base_in_instrument.orientation)
    if abs(np.linalg.norm(wxyz) - 1.0) > 1e-3:
        raise ModelError("base_in_instrument.orientation is no unit quaternion")
    return Frame(np.array(told.base_in_instrument.position), from_quaternions(wxyz[None])[0])
