"""Where a check keeps what: datasets, sealed truths apart from them, diagnoses, and what the check was asked to do."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

import gtpin
from gtpin.blind.seal import DIGEST
from gtpin.blind.truth import TruePoses, Truth
from gtpin.blind.worker import Said
from gtpin.data.files import placed_file, write_table
from gtpin.data.names import ORIENTATION, POSITION
from gtpin.data.table import Column
from gtpin.errors import GtpinError
from gtpin.output import writing

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

    def claim(self, settings: Settings) -> None:
        """Make the folder, or go on in it where it is that of the same check.

        Raises
        ------
        GtpinError
            If it holds anything else, or can't be written.
        """
        file = self.root / "check.json"
        told = {"schema": "gtpin-blind/1", **asdict(settings)}
        if file.is_file():
            self._compare(file, told)
        elif self.root.exists() and (not self.root.is_dir() or any(self.root.iterdir())):
            raise GtpinError("this is not the folder of a check", file=self.root, hint="name a new folder")
        with writing(self.root):
            for part in (self.cases, self.root / "sealed", self.root / "diagnoses"):
                part.mkdir(parents=True, exist_ok=True)
            file.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")

    @staticmethod
    def _compare(file: Path, told: dict[str, object]) -> None:
        try:
            there = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            there = {}
        words = {"diagnosis": "sources of the diagnosis", "plant": "sources of the plant", "source": "cases"}
        for name, value in told.items():
            if not isinstance(there, dict) or there.get(name) != value:
                what = f"the folder belongs to another check: other {words.get(name, name)}"
                raise GtpinError(what, file=file.parent, hint="name a new folder, or ask for the same again")

    def files_of(self, name: str) -> dict[str, bytes]:
        """All that a diagnosis of a case is given: the files of its dataset's folder."""
        return {file.name: file.read_bytes() for file in sorted(self.case(name).iterdir()) if file.is_file()}

    def said(self, name: str, without: bool = False) -> Said | None:
        """What was said of a case (once its effect was taken out of the catalogue); None where nothing was yet."""
        file = self._said(name, without)
        return Said.model_validate_json(file.read_bytes()) if file.is_file() else None

    def keep(self, name: str, said: Said, seconds: float, without: bool = False) -> None:
        """Keep what was said, and apart from it how long that took."""
        file = self._said(name, without)
        with placed_file(file) as beside:
            beside.write_text(said.model_dump_json() + "\n", encoding="utf-8")
        with (self.root / "seconds.txt").open("a", encoding="utf-8") as log:
            log.write(f"{file.stem} {seconds:.2f}\n")

    def seconds(self) -> list[float]:
        """How long each diagnosis took, s."""
        file = self.root / "seconds.txt"
        lines = file.read_text(encoding="utf-8").split() if file.is_file() else []
        return [s for s in map(float, lines[1::2]) if s == s]

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
