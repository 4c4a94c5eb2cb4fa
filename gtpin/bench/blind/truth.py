"""The truth of a case, the effects of its machine and its true poses; its seal; and truths that somebody else wrote."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import uuid
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import BaseModel, Field, SerializerFunctionWrapHandler, ValidationError, model_serializer

from gtpin.data.description import SECOND, Description, describe, read_toml, write_description
from gtpin.data.files import find_table, read_bytes, read_table
from gtpin.data.instrument_tables import InstrumentTable, describe_second, written
from gtpin.data.names import POSITION
from gtpin.effects.catalogue import effects_by_id
from gtpin.errors import DatasetError, GtpinError
from gtpin.output.ownership import MARKER
from gtpin.output.results import writing
from gtpin.references import is_path
from gtpin.robot.chain import Chain
from gtpin.robot.closures import SUFFIX
from gtpin.robot.description import RobotDescription
from gtpin.robot.library import load_robot
from gtpin.typing import Floats

Kind = Literal["one", "none", "unlisted", "two", "three", "known_and_unlisted", "rough", "power", "many"]
"""Kind of case: see ``docs/blind.md``."""
Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Triple = tuple[Finite, Finite, Finite]
Six = tuple[Finite, Finite, Finite, Finite, Finite, Finite]


class TrueEffect(BaseModel, frozen=True):
    """A true effect of a machine."""

    # `effect`, `site`: Its id and its site; the id of an unlisted effect is in no catalogue
    effect: Annotated[str, Field(min_length=1)]
    site: str = ""
    energy: Positive | None = None  # E: its whitened energy that geometry can't explain
    # D: the part of E that the best wrong effect leaves; None if the file does not give it
    leaves: Positive | None = None
    amplitude: Finite | None = None  # Its size relative to the typical size
    # (N, 6) TCP displacement by this effect alone at the dataset's rows: position, m, and rotation vector, rad, base
    # frame
    displacement: tuple[Six, ...] | None = None

    @property
    def name(self) -> str:
        """``effect@site``."""
        return f"{self.effect}@{self.site}"


class TruePoses(BaseModel, frozen=True):
    """True poses at a case's ``commands.csv``: ids, positions (H, 3), m, and quaternions (H, 4), scalar first, if known."""

    pose: tuple[str, ...]
    position: tuple[Triple, ...]
    orientation: tuple[tuple[Finite, Finite, Finite, Finite], ...] | None = None

    @property
    def T(self) -> Floats:
        """(H, 3) positions, m."""
        return np.array(self.position).reshape(-1, 3)


class TrueReadings(BaseModel, frozen=True):
    """What an instrument reads without noise at a case's ``commands-NAME.csv`` or, without this file, ``commands.csv``.

    Stations, planes or targets are assigned to the rows of ``commands.csv`` in turn, in alphabetical order of their ids; the
    predictions of the worker have the same assignment. The reading of a touch is the distance of the target from what it
    touches.
    """

    name: str  # Name of the instrument
    # `values`, `sigma`: (H, c) readings and their noise, m or rad; for a tracker, positions
    values: tuple[tuple[Finite, ...], ...]
    sigma: tuple[tuple[Finite, ...], ...]


class TrueNoise(BaseModel, frozen=True):
    """The noise of an instrument's readings with which E is computed."""

    name: str  # Name of the instrument
    # (M, c) sigma of every number in the rows of its table, with the scatter by the machine's repeatability, m or rad
    sigma: tuple[tuple[Finite, ...], ...]


class Truth(BaseModel, frozen=True):
    """The sealed truth of a case, and the content of ``NAME.truth.json``: without ``kind`` unless gtpin wrote it."""

    kind: Kind | None = None  # Kind of case
    effects: tuple[TrueEffect, ...]  # True effects of the machine; can be empty
    poses: TruePoses | None = None  # True poses at the held-out commands, if known
    # True readings where other instruments than a tracker alone measured; ``poses`` is then None
    readings: tuple[TrueReadings, ...] = ()
    # (6,) the instrument's noise, m and rad, with which displacements are whitened; None if not known
    sigma: Six | None = None
    noise: tuple[TrueNoise, ...] = ()  # The same for instruments of schema 2, for each number; empty if not known

    @model_serializer(mode="wrap")
    def _without_empty_noise(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave the noise out where there is none: truths of a tracker's cases keep the digests that were published."""
        found: dict[str, Any] = handler(self)
        return found if self.noise else {name: value for name, value in found.items() if name != "noise"}


Content = TypeVar("Content", bound=BaseModel)


def read_json(file: Path, kind: type[Content], hint: str) -> Content:
    """The content of a JSON file. Raises GtpinError if it can't be read, is no JSON, or (with the ``hint``) is no ``kind``."""
    try:
        return kind.model_validate(json.loads(read_bytes(file).decode("utf-8-sig")))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        raise GtpinError(str(first["msg"]), file=file, column=key, hint=hint) from None
    except json.JSONDecodeError as error:
        raise GtpinError(f"no JSON ({error.msg})", file=file, row=error.lineno, hint="correct the file") from None
    except (UnicodeDecodeError, RecursionError, ValueError) as error:
        raise GtpinError(f"no JSON that can be read ({str(error)[:80]})", file=file, hint="correct the file") from None


class SealError(GtpinError):
    """The truth is missing, or its digest is not the published one."""


UNFINISHED = ".gtpin-"
"""Prefix of the names of files that are being written."""
DIGEST = "truth.sha256"
"""File in a case's folder with the digest of its truth."""


@contextlib.contextmanager
def placed_file(target: Path) -> Iterator[Path]:
    """Give a temporary file in the folder of `target`, and rename it to `target` if the block ends without an error.

    For files inside a folder that is gtpin's own as a whole: what is there already is replaced.
    """
    unfinished = target.with_name(f"{UNFINISHED}{uuid.uuid4().hex}{target.suffix}")
    try:
        with writing(target, DatasetError):
            yield unfinished
            os.replace(unfinished, target)
    finally:
        with contextlib.suppress(OSError):
            unfinished.unlink()


def seal(truth: Truth, case: Path, file: Path) -> None:
    """Write the SHA-256 of a truth to the case's folder, then the truth to a file in another folder."""
    content = truth.model_dump_json().encode() + b"\n"
    (case / DIGEST).write_text(digest_of(content) + "\n", encoding="utf-8")
    with placed_file(file) as unfinished:
        unfinished.write_bytes(content)


def digest_of(content: bytes) -> str:
    """SHA-256 of bytes, in hexadecimal."""
    return hashlib.sha256(content).hexdigest()


def digest_of_files(files: Mapping[str, bytes]) -> str:
    """SHA-256 of several files with their names, in hexadecimal."""
    parts = (name.encode() + b"\0" + hashlib.sha256(files[name]).digest() for name in sorted(files))
    return digest_of(b"".join(parts))


def files_of(folder: Path) -> dict[str, bytes]:
    """The files of a dataset's folder, by name. Raises GtpinError if one can't be read, OSError if the folder can't."""
    files = (file for file in sorted(folder.iterdir()) if file.is_file() and file.name != MARKER)
    return {file.name: read_bytes(file) for file in files}


def opened(file: Path, digest: str) -> Truth:
    """Read a sealed truth. Raises SealError if the file is missing, or its digest is not the published one."""
    try:
        content = read_bytes(file)
    except GtpinError as error:
        raise SealError(error.what, file=file, hint="the case can't be scored without its truth") from None
    if digest_of(content) != digest:
        raise SealError("the seal is broken: not the digest that was published", file=file, hint="make the case anew")
    try:
        return Truth.model_validate_json(content)
    except ValidationError as error:
        raise SealError(f"no truth ({error.errors()[0]['msg']})", file=file, hint="make the case anew") from None


def write_manifest(file: Path, digests: Mapping[str, str], plant: str | None) -> None:
    """Write the digests of all truths by case name.

    ``plant``: digest of the sources of the simulated machine; None where somebody else made the cases.
    """
    manifest = {"schema": "gtpin-blind-manifest/1", "plant": plant, "truths": dict(sorted(digests.items()))}
    with placed_file(file) as unfinished:
        unfinished.write_bytes((json.dumps(manifest, indent=1) + "\n").encode())


def read_manifest(file: Path) -> dict[str, str]:
    """Read the digests by case name. Raises SealError if the file can't be read."""
    try:
        truths = json.loads(read_bytes(file))["truths"]
        return {str(name): str(digest) for name, digest in truths.items()}
    except (ValueError, KeyError, TypeError, AttributeError):
        raise SealError("no manifest", file=file, hint="start again in a new folder") from None


TRUTH, POSES = ".truth.json", ".truth.csv"
ROBOT = "robot.urdf"
"""Name of a dataset's own URDF once it is in the dataset's folder."""


def given(folder: Path) -> dict[Path, Truth]:
    """The truths of all cases in a folder, ``NAME.truth.json``, by the folders ``NAME/`` of their datasets, ordered by name.

    Raises GtpinError if there are no cases, a dataset has no truth, a truth has no dataset, or a truth can't be read.
    """
    try:
        entries = sorted(folder.iterdir())
    except OSError as error:
        reason = error.strerror or str(error)
        raise GtpinError(f"can't be read ({reason})", file=folder, hint="name a folder of cases") from None
    truths = {entry.name.removesuffix(TRUTH) for entry in entries if entry.name.endswith(TRUTH)}
    datasets = {entry.name for entry in entries if entry.is_dir() and not entry.name.startswith(".")}
    if not truths and not datasets:
        hint = "it needs NAME/ and NAME.truth.json for each case"
        raise GtpinError("there are no cases here", file=folder, hint=hint)
    for name in sorted(datasets ^ truths):
        file = folder / (f"{name}{TRUTH}" if name in datasets else name)
        hint = "each case is a folder NAME/ and a file NAME.truth.json next to it"
        raise GtpinError("is missing", file=file, hint=hint)
    found = {}
    for name in sorted(truths):
        file = folder / f"{name}{TRUTH}"
        content = read_json(file, Truth, 'write {"effects": [{"effect": ID, "site": SITE}, ...]}')
        _check(file, content, folder / name)
        kind = content.kind or kind_of([effect.effect for effect in content.effects])
        found[folder / name] = content.model_copy(update={"kind": kind, "poses": _poses(folder, name)})
    return found


def _check(file: Path, content: Truth, dataset: Path) -> None:
    """Raise an error for known effects at sites that the robot does not have, and for an effect that is listed twice."""
    robot: Chain | None = None
    with contextlib.suppress(GtpinError):  # the diagnosis reports a dataset that can't be read
        said, _ = _described(dataset / "dataset.toml")
        robot = load_robot(_path_of(dataset, said.robot) or said.robot, said.tcp, said.actuators)
    for number, effect in enumerate(content.effects):
        where = f"effects.{number}.site"
        sites = effects_by_id()[effect.effect].sites(robot) if robot and effect.effect in effects_by_id() else None
        if sites is not None and effect.site not in sites:
            what, hint = f"{effect.effect} can't be at {effect.site!r}", f"use {', '.join(sites)}"
            raise GtpinError(what, file=file, column=where, hint=hint)
        if effect.name in {other.name for other in content.effects[:number]}:
            raise GtpinError(f"{effect.name} is there twice", file=file, column=where, hint="keep one of them")


def kind_of(effects: list[str]) -> Kind:
    """The kind of case, from its effects."""
    known = sum(effect in effects_by_id() for effect in effects)
    kinds: Mapping[tuple[int, int], Kind] = {
        (0, 0): "none",
        (1, 0): "one",
        (2, 0): "two",
        (3, 0): "three",
        (0, 1): "unlisted",
        (1, 1): "known_and_unlisted",
    }
    return kinds.get((known, len(effects) - known), "many")


def _described(file: Path) -> tuple[Description, tuple[InstrumentTable, ...]]:
    """The content of a dataset.toml, and its instruments; none where it is of schema 1."""
    values = read_toml(file)
    return describe_second(values, file, {}) if values.get("schema") == SECOND else (describe(values, file), ())


def _path_of(folder: Path, robot: str) -> Path | None:
    return Path(os.path.abspath(folder / robot)) if is_path(robot) else None


def _poses(folder: Path, name: str) -> TruePoses | None:
    """The true poses, which must be those of the commands."""
    file = folder / f"{name}{POSES}"
    if not file.exists():
        return None
    table = read_table(file)
    pose, T, turns = table.column("pose").tolist(), table.matrix(POSITION), table.orientation()
    if len(set(pose)) < len(pose):
        raise DatasetError("a pose is there twice", file=file, column="pose", hint="give each command one true pose")
    commands = find_table(folder / name, "commands")
    if commands is None:
        hint = "the true poses are those at its commands"
        raise DatasetError("the file is missing", file=folder / name / "commands.csv", hint=hint)
    other = set(pose) ^ set(read_table(commands).column("pose").tolist())
    if other:
        what = f"pose {sorted(other)[0]} is not in both this file and {commands.name}"
        raise DatasetError(what, file=file, column="pose", hint="give each command its true pose")
    return TruePoses(
        pose=tuple(pose),
        position=tuple(map(tuple, T.tolist())),
        orientation=None if turns is None else tuple(map(tuple, turns.tolist())),
    )


def source_digest(cases: Mapping[Path, Truth]) -> str:
    """SHA-256 of all datasets and truths, by name."""
    files = {f"{place.name}/{name}": content for place in cases for name, content in files_of(place).items()}
    return digest_of_files(
        files | {f"{at.name}/truth": truth.model_dump_json().encode() for at, truth in cases.items()}
    )


def take_in(dataset: Path, place: Path) -> None:
    """Copy a dataset, with the URDF that it names."""
    with writing(place):
        place.mkdir(parents=True, exist_ok=True)
        for name, content in files_of(dataset).items():
            (place / name).write_bytes(content)
        try:
            said, instruments = _described(dataset / "dataset.toml")
            urdf = _path_of(dataset, said.robot)
            if urdf is not None:
                of_two = urdf.suffix.lower() == SUFFIX  # a URDF and its loops in another file
                (place / ROBOT).write_bytes(RobotDescription.read(urdf).xml.encode() if of_two else read_bytes(urdf))
                moved = said.model_copy(update={"robot": ROBOT})
                write_description(place / "dataset.toml", moved, [written(one) for one in instruments])
        except GtpinError:
            return  # its diagnosis reports the error
