"""The truth of a case, the effects of its machine and its true poses, and its seal: a digest that is published first."""

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

from gtpin.data.files import read_bytes
from gtpin.errors import DatasetError, GtpinError
from gtpin.output.ownership import MARKER
from gtpin.output.results import writing
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
    """The sealed truth of a case."""

    kind: Kind  # Kind of case
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


MANIFEST = "gtpin-blind-manifest/1"


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
    manifest = {"schema": MANIFEST, "plant": plant, "truths": dict(sorted(digests.items()))}
    with placed_file(file) as unfinished:
        unfinished.write_bytes((json.dumps(manifest, indent=1) + "\n").encode())


def read_manifest(file: Path) -> dict[str, str]:
    """Read the digests by case name. Raises SealError if the file can't be read."""
    try:
        truths = json.loads(read_bytes(file))["truths"]
        return {str(name): str(digest) for name, digest in truths.items()}
    except (ValueError, KeyError, TypeError, AttributeError):
        raise SealError("no manifest", file=file, hint="start again in a new folder") from None
