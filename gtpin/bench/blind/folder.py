"""The folder of a check: its files with the digests that they had first, and how one run at a time reserves it."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from pydantic import ValidationError

import gtpin
from gtpin.bench.blind.truth import DIGEST, UNFINISHED, Truth, digest_of, digest_of_files, files_of, placed_file
from gtpin.bench.blind.worker import Outcome
from gtpin.data.files import write_table
from gtpin.data.names import ORIENTATION, POSITION
from gtpin.data.table import Column
from gtpin.errors import GtpinError
from gtpin.output.ownership import MARKER, aside, refuse_foreign
from gtpin.output.results import writing
from gtpin.output.work_folder import work_folder

KEY = "digests"
"""The key of ``check.json`` that holds the digests, by kind of file and name."""


JUDGES = ("bench", "extras", "report", "commands")
"""Parts of gtpin that a diagnosis does not depend on."""


@dataclass(frozen=True)
class Settings:
    """The settings of a check and the digests of its sources. Results are valid for these settings only."""

    cases: int  # Number of cases
    # None for cases that somebody else made: the seed from which they are drawn, and their robot
    seed: int | None
    source: str | None  # Digest of the cases that somebody else made, or None
    robot: str | None
    plant: str | None  # Digest of the source files that make the cases, or None
    diagnosis: str  # Digest of those that diagnose them
    instruments: str | None = None  # Kinds of the instruments, separated by commas; None for a tracker or given cases


def diagnosis_digest() -> str:
    """SHA-256 of all source files that a diagnosis may depend on, with their names."""
    root = Path(gtpin.__file__).parent
    files = {file.relative_to(root): file for file in root.rglob("*.py")}
    return digest_of_files({n.as_posix(): f.read_bytes() for n, f in files.items() if n.parts[0] not in JUDGES})


@dataclass(frozen=True)
class CheckFolder:
    """The folder of one check."""

    root: Path

    @property
    def cases(self) -> Path:
        """Datasets by name, the manifest and, at the end, the opened truths."""
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

    def compared(self, kind: str, digests: Mapping[str, str]) -> list[str]:
        """Compare digests, by the case's name, with those that the claim had first, and remember those of new names.

        Returns ``KIND of NAME`` for each file whose digest is another one, or that was remembered and is not there.
        """
        claim = self.root / CLAIM
        content = json.loads(claim.read_text(encoding="utf-8"))
        known: dict[str, str] = content.setdefault(KEY, {}).setdefault(kind, {})
        new = {name: digest for name, digest in digests.items() if name not in known}
        changed = [f"{kind} of {name}" for name, digest in digests.items() if known.get(name, digest) != digest]
        changed += [f"{kind} of {name}" for name in known if name not in digests]
        if new:
            known.update(new)
            _write(claim, json.dumps(content, indent=1))
        return changed

    def digests(self, names: Iterable[str]) -> dict[str, str]:
        """The digests that were published in the cases' folders."""
        return {name: (self.case(name) / DIGEST).read_text(encoding="utf-8").strip() for name in names}

    @property
    def parts(self) -> tuple[Path, ...]:
        """The folders of the cases, of the sealed truths, and of the diagnoses."""
        return self.cases, self.root / "sealed", self.root / "diagnoses"

    @property
    def published(self) -> bool:
        """Whether the digests of all truths are published. An empty manifest is left by a crash and does not count."""
        return self.manifest.is_file() and self.manifest.stat().st_size > 0

    def is_sealed(self, name: str) -> bool:
        """Whether a case was made: its truth is sealed, and its digest is in the case's folder."""
        try:
            return digest_of(self.sealed(name).read_bytes()) == self.digests([name])[name]
        except OSError:
            return False

    def dataset_digest(self, name: str) -> str:
        """SHA-256 of a dataset's files; empty where they are missing."""
        try:
            files = files_of(self.case(name))
        except (OSError, GtpinError):
            return ""
        return digest_of_files({file: content for file, content in files.items() if file != DIGEST})

    def outcome_digest(self, name: str, without: bool = False) -> str:
        """SHA-256 of the outcome for a case; empty where it is missing."""
        file = self._outcome_file(name, without)
        return digest_of(file.read_bytes()) if file.is_file() else ""

    def outcome(self, name: str, without: bool = False) -> Outcome | None:
        """The outcome for a case (``without``: with its effect removed from the catalogue); None if there is none yet.

        A file that a crash has left empty or incomplete is ignored: the case is diagnosed again.
        """
        try:
            return Outcome.model_validate_json(self._outcome_file(name, without).read_bytes())
        except (FileNotFoundError, ValidationError):
            return None

    def keep(self, name: str, outcome: Outcome, seconds: float, without: bool = False) -> None:
        """Write the outcome, and to another file the time that it took."""
        file = self._outcome_file(name, without)
        _write(file, outcome.model_dump_json())
        with writing(self.root), (self.root / "seconds.txt").open("a", encoding="utf-8") as log:
            log.write(f"{file.stem} {seconds:.2f}\n")

    def seconds(self) -> list[float]:
        """Time of each diagnosis, s."""
        file = self.root / "seconds.txt"
        text = file.read_text(encoding="utf-8", errors="replace") if file.is_file() else ""
        return [float(number) for number in re.findall(r"^\S+ (\d+\.\d\d)$", text, re.MULTILINE)]

    def _outcome_file(self, name: str, without: bool) -> Path:
        return self.root / "diagnoses" / (f"{name}.without.json" if without else f"{name}.json")

    def publish(self, name: str, truth: Truth) -> None:
        """Write an opened truth next to the datasets, so that others can read it and score the cases again."""
        _write(self.cases / f"{name}.truth.json", truth.model_dump_json(exclude={"poses"}, exclude_none=True))
        if (poses := truth.poses) is not None:
            columns: dict[str, Column] = {"pose": np.array(poses.pose, dtype=object)}
            columns |= dict(zip(POSITION, poses.T.T, strict=True))
            if poses.orientation is not None:
                columns |= dict(zip(ORIENTATION, np.array(poses.orientation).T, strict=True))
            with placed_file(self.cases / f"{name}.truth.csv") as unfinished:
                write_table(unfinished, columns)


def _write(file: Path, text: str) -> None:
    with placed_file(file) as unfinished:
        unfinished.write_text(text + "\n", encoding="utf-8")


SCHEMA = "gtpin-blind/1"
CLAIM = "check.json"
"""The check's settings."""
NO_CHECK = "this is not the folder of a check"
SCORE_FILES = ("judged.json", "score.json", "score.html")
"""Files that are written after all cases are judged."""


@contextlib.contextmanager
def claimed(folder: CheckFolder, settings: Settings, force: bool = False) -> Iterator[None]:
    """Make a folder, or resume the same check in it; the folder is locked for other runs.

    A new check that ends before a case is complete leaves no files. With ``force``, files of another check, or files that
    gtpin did not write, are renamed (``NAME.old-1``).

    Raises GtpinError if the folder contains other files, another run uses it, or it can't be written.
    """
    root = folder.root
    if os.path.lexists(root) and not os.path.isdir(root):
        raise GtpinError(NO_CHECK, file=root, hint="name a new folder")
    missing = [place for place in (root, *root.parents) if not os.path.lexists(place)]
    try:
        with contextlib.ExitStack() as held:
            with writing(root):
                root.mkdir(parents=True, exist_ok=True)
                held.enter_context(work_folder(root, "check"))
                _claim(folder, settings, force)
            try:
                yield
            finally:
                if _unbegun(folder):
                    _give_up(folder)
    finally:
        for place in missing:
            with contextlib.suppress(OSError):  # not empty: it holds the check
                place.rmdir()


def _claim(folder: CheckFolder, settings: Settings, force: bool) -> None:
    content = {"schema": SCHEMA, **asdict(settings)}
    there = _there(folder)
    other = next((name for name, value in content.items() if there.get(name) != value), None)
    foreign = [entry for entry in folder.root.iterdir() if not entry.name.startswith((UNFINISHED, MARKER))]
    if other and there and _unbegun(folder):
        _give_up(folder)
    elif other and (there or foreign):
        if not force:
            words = {"diagnosis": "sources of the diagnosis", "plant": "sources of the plant", "source": "cases"}
            what = f"the folder belongs to another check: other {words.get(other, other)}"
            hint = "name a new folder, ask for the same again, or move it aside with --force"
            if not there:
                what, hint = NO_CHECK, "name a new folder, or move what is in the way aside with --force"
            raise GtpinError(what, file=folder.root, hint=hint)
        for place in (*(folder.root / name for name in (CLAIM, "seconds.txt", *SCORE_FILES)), *folder.parts):
            if os.path.lexists(place):
                os.replace(place, aside(place))
    refuse_foreign(folder.root, SCORE_FILES, force)
    if not _there(folder):
        _write(folder.root / CLAIM, json.dumps(content, indent=1))
    for part in folder.parts:
        part.mkdir(exist_ok=True)
        for unfinished in part.glob(f"{UNFINISHED}*"):  # of a run that was killed
            unfinished.unlink()


def _there(folder: CheckFolder) -> dict[str, object]:
    """The settings of the folder's check; empty if there is none."""
    try:
        there = json.loads((folder.root / CLAIM).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return there if isinstance(there, dict) and there.get("schema") == SCHEMA else {}


def _unbegun(folder: CheckFolder) -> bool:
    """Whether the check can be deleted without loss: no case was made, or the given cases were not yet all copied."""
    begun = any((folder.root / "sealed").glob("*.json"))
    return not folder.published and (not begun or _there(folder).get("source") is not None)


def _give_up(folder: CheckFolder) -> None:
    for part in folder.parts:
        shutil.rmtree(part, ignore_errors=True)
    with contextlib.suppress(OSError):
        (folder.root / CLAIM).unlink()
