"""Where a check keeps what: datasets, sealed truths apart from them, diagnoses, and what the check was asked to do."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import ValidationError

import gtpin
from gtpin.blind.seal import DIGEST, digest_of
from gtpin.blind.truth import TruePoses, Truth
from gtpin.blind.worker import Said
from gtpin.data.files import placed_file, write_table
from gtpin.data.names import ORIENTATION, POSITION
from gtpin.data.table import Column
from gtpin.output.ownership import MARKER
from gtpin.output.results import writing

JUDGES = ("blind", "plant", "report", "commands", "paper")
"""Parts of gtpin that a diagnosis does not depend on."""


@dataclass(frozen=True)
class Settings:
    """What a check was asked to do, and with which sources: its results belong to no other.

    Parameters
    ----------
    cases, seed
        How many, and drawn from which seed; the seed is None where somebody else made them.
    source
        Digest of the cases that somebody else made, or None.
    robot
        Whose cases were drawn, or None where somebody else made them.
    plant, diagnosis
        Digests of the sources that made the cases, and of those that diagnose them.
    """

    cases: int
    seed: int | None
    source: str | None
    robot: str | None
    plant: str | None
    diagnosis: str


def diagnosis_digest() -> str:
    """SHA-256 of all sources that a diagnosis may depend on, by name."""
    root = Path(gtpin.__file__).parent
    found = hashlib.sha256()
    for file in sorted(root.rglob("*.py")):
        name = file.relative_to(root)
        if name.parts[0] not in JUDGES:
            found.update(name.as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return found.hexdigest()


@dataclass(frozen=True)
class CheckFolder:
    """The folder of one check."""

    root: Path

    @property
    def cases(self) -> Path:
        """Datasets by name, the manifest, and at the end the opened truths."""
        return self.root / "cases"

    @property
    def manifest(self) -> Path:
        """The digests of all truths."""
        return self.cases / "manifest.json"

    def case(self, name: str) -> Path:
        """A dataset's folder."""
        return self.cases / name

    def sealed(self, name: str) -> Path:
        """A case's sealed truth."""
        return self.root / "sealed" / f"{name}.json"

    def digests(self, names: Iterable[str]) -> dict[str, str]:
        """The digests that were published in the cases' folders."""
        return {name: (self.case(name) / DIGEST).read_text(encoding="utf-8").strip() for name in names}

    @property
    def parts(self) -> tuple[Path, ...]:
        """The folders in it."""
        return self.cases, self.root / "sealed", self.root / "diagnoses"

    @property
    def published(self) -> bool:
        """Whether the digests of all truths are published. An empty manifest is what a crash has left."""
        return self.manifest.is_file() and self.manifest.stat().st_size > 0

    def is_sealed(self, name: str) -> bool:
        """Whether a case was made: its truth is sealed, and its digest stands in the case's folder."""
        try:
            return digest_of(self.sealed(name).read_bytes()) == self.digests([name])[name]
        except OSError:
            return False

    def files_of(self, name: str) -> dict[str, bytes]:
        """All that a diagnosis of a case is given: the files of its dataset's folder."""
        files = (file for file in sorted(self.case(name).iterdir()) if file.is_file() and file.name != MARKER)
        return {file.name: file.read_bytes() for file in files}

    def said(self, name: str, without: bool = False) -> Said | None:
        """What was said of a case (once its effect was taken out of the catalogue); None where nothing was yet.

        A file that a crash has left empty, or broken off, says nothing: the case is diagnosed again.
        """
        try:
            return Said.model_validate_json(self._said(name, without).read_bytes())
        except (FileNotFoundError, ValidationError):
            return None

    def keep(self, name: str, said: Said, seconds: float, without: bool = False) -> None:
        """Keep what was said, and apart from it how long that took."""
        file = self._said(name, without)
        with placed_file(file) as beside:
            beside.write_text(said.model_dump_json() + "\n", encoding="utf-8")
        with writing(self.root), (self.root / "seconds.txt").open("a", encoding="utf-8") as log:
            log.write(f"{file.stem} {seconds:.2f}\n")

    def seconds(self) -> list[float]:
        """How long each diagnosis took, s."""
        file = self.root / "seconds.txt"
        text = file.read_text(encoding="utf-8", errors="replace") if file.is_file() else ""
        return [float(number) for number in re.findall(r"^\S+ (\d+\.\d\d)$", text, re.MULTILINE)]

    def _said(self, name: str, without: bool) -> Path:
        return self.root / "diagnoses" / (f"{name}.without.json" if without else f"{name}.json")

    def publish(self, name: str, truth: Truth) -> None:
        """Put an opened truth beside the datasets, so that others can read it and the cases can be scored again."""
        text = truth.model_dump_json(exclude={"poses"}, exclude_none=True) + "\n"
        with placed_file(self.cases / f"{name}.truth.json") as beside:
            beside.write_text(text, encoding="utf-8")
        if truth.poses is not None:
            with placed_file(self.cases / f"{name}.truth.csv") as beside:
                write_table(beside, _columns(truth.poses))


def _columns(poses: TruePoses) -> dict[str, Column]:
    columns: dict[str, Column] = {"pose": np.array(poses.pose, dtype=object)}
    columns |= dict(zip(POSITION, poses.T.T, strict=True))
    if poses.orientation is not None:
        columns |= dict(zip(ORIENTATION, np.array(poses.orientation).T, strict=True))
    return columns
