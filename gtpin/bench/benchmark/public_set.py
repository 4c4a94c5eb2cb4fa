"""The public set: which cases it has, the digests of their files, and how they are made."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, Field

from gtpin.bench.blind.draw import Draft, drafts, made, truth_of
from gtpin.bench.blind.truth import TruePoses, TrueReadings, Truth, digest_of, digest_of_files, files_of
from gtpin.bench.simulator.truth import InstrumentCase
from gtpin.data.files import read_bytes, read_table, write_table
from gtpin.errors import GtpinError
from gtpin.output.ownership import MARKER
from gtpin.threads import in_one_thread

FILE = Path(__file__).parent / "set1.json"
"""The set that gtpin ships."""
SCHEMA = "gtpin-benchmark/1"


class Block(BaseModel, frozen=True):
    """Cases of one machine, measured by one instrument."""

    name: str  # Beginning of the cases' names
    robot: str  # Name of a robot, or of a URDF file in the set's folder
    # Kind of the instrument that measures in place of a tracker with its own pose; empty for the tracker
    instrument: str = ""
    # `cases`, `seed`: Number of cases, and the seed from which they are drawn
    cases: Annotated[int, Field(ge=1)]
    seed: int

    def reference(self, folder: Path) -> str:
        """The robot's name, or the path of its URDF file in the set's folder."""
        return str(folder / self.robot) if self.robot.endswith(".urdf") else self.robot

    def drafts(self, folder: Path, without: Collection[str]) -> Iterator[Draft]:
        """The block's cases; ``folder`` holds the set's URDF files, ``without`` names effects that are newer than the set."""
        robot = self.reference(folder)
        kinds = (self.instrument,) if self.instrument else ()
        for number, draft in enumerate(drafts(self.cases, self.seed, robot, kinds, without=without)):
            yield replace(draft, name=f"{self.name}-{number:02d}")


class Published(BaseModel, frozen=True):
    """What is published of a case."""

    # `dataset`, `truth`: SHA-256 of the files that a solver sees, and of the truth
    dataset: str
    truth: str
    # D of a single effect: the energy that the best wrong effect leaves; None for other cases
    leaves: float | None = None


class PublicSet(BaseModel, frozen=True):
    """A set of cases that anybody can make again."""

    schema_: Annotated[str, Field(alias="schema", pattern=f"^{SCHEMA}$")]
    plant: str  # Digest of the plant's sources that made the set first
    without: tuple[str, ...] = ()  # Effects that the catalogue had not when the set was published
    blocks: tuple[Block, ...]  # The cases, by machine and instrument
    cases: dict[str, Published]  # What is published of each case, by its name

    @staticmethod
    def read(file: Path = FILE) -> PublicSet:
        """The set in a file; by default the one that gtpin ships."""
        return PublicSet.model_validate_json(file.read_bytes())

    def chosen(self, names: Sequence[str] | None) -> list[str]:
        """The names of some cases; None: all. Raises GtpinError if the set has no such case."""
        for name in names or ():
            if name not in self.cases:
                known = ", ".join(f"{block.name}-00 to -{block.cases - 1:02d}" for block in self.blocks)
                raise GtpinError(f"no case is called {name!r}", hint=f"cases are {known}")
        return list(names or self.cases)

    def robot(self, case: str, folder: Path = FILE.parent) -> str | None:
        """The robot of a case: its name, or the path of its URDF; None where the case is in no block."""
        found = [block for block in self.blocks if case.rpartition("-")[0] == block.name]
        return found[0].reference(folder) if found else None

    def drafts(self, folder: Path = FILE.parent) -> dict[str, Draft]:
        """All cases to be made, by name."""
        return {draft.name: draft for block in self.blocks for draft in block.drafts(folder, self.without)}


CASES, TRUTHS = "cases", "truths"
ROBOT = "robot.urdf"
DECIMALS = 7
DIGITS = 4
"""Significant digits of the noise and of energies, in truths."""
NOTHING = 1e-3
"""A smaller energy is written as 0: it can consist of rounding errors."""
NUMBER = re.compile(r"-?\d+(\.\d*)?(e[-+]?\d+)?")


@dataclass(frozen=True)
class MadeCase:
    """A case that was made: the digests of its files, and its truth before rounding, with displacements."""

    name: str
    digests: Published
    truth: Truth


@in_one_thread
def make(draft: Draft, folder: Path) -> MadeCase:
    """Write a case: ``cases/NAME/`` for solvers, ``truths/NAME.json`` for the scorer."""
    place = folder / CASES / draft.name
    place.mkdir(parents=True, exist_ok=True)
    case = made(draft)
    case.write_dataset(place)
    truth = truth_of(case, draft.kind)
    # For an instrument that reads anywhere, the held-out commands, with what it reads at each, as in the truth.
    for gauge in case.gauges if isinstance(case, InstrumentCase) else ():
        if not gauge.touches:
            held = read_table(place / "commands.csv").columns
            write_table(place / f"commands-{gauge.name}.csv", {**held, **gauge.in_turn(len(case.commands)).ids})
    if (urdf := Path(draft.robot)).suffix == ".urdf":  # it is copied into the dataset's folder, and named there
        (place / ROBOT).write_bytes(urdf.read_bytes())
        lines = (place / "dataset.toml").read_text(encoding="utf-8").splitlines()
        named = [f'robot = "{ROBOT}"' if line.startswith("robot = ") else line for line in lines]
        (place / "dataset.toml").write_text("\n".join(named) + "\n", encoding="utf-8")
    for file in place.glob("*.csv"):
        round_table(file)
    (place / MARKER).unlink(missing_ok=True)  # it describes the files as they were before rounding
    content = _published(truth).model_dump_json(exclude_none=True).encode() + b"\n"
    (folder / TRUTHS).mkdir(exist_ok=True)
    (folder / TRUTHS / f"{draft.name}.json").write_bytes(content)
    return MadeCase(draft.name, Published(dataset=digest_of_folder(place), truth=digest_of(content)), truth)


def changed(public: PublicSet, folder: Path, names: Collection[str], *, truths_alone: bool = False) -> Iterator[str]:
    """Names of the cases, among ``names``, whose files, or only the truths, do not have the published digests.

    Raises GtpinError if a truth can't be read.
    """
    for name in names:
        truth, published = digest_of(read_bytes(folder / TRUTHS / f"{name}.json")), public.cases[name]
        dataset = published.dataset if truths_alone else digest_of_folder(folder / CASES / name)
        if (truth, dataset) != (published.truth, published.dataset):
            yield name


def digest_of_folder(folder: Path) -> str:
    """SHA-256 of all files of a dataset, with their names."""
    return digest_of_files(files_of(folder))


def _published(truth: Truth) -> Truth:
    """A truth as it is written: without displacements and orientations, with rounded numbers."""
    poses, effects, readings = truth.poses, [], []
    for effect in truth.effects:
        noncentrality = rounded_energy(effect.energy or 0.0)
        effects.append(effect.model_copy(update={"displacement": None, "amplitude": None, "energy": noncentrality}))
    for one in truth.readings:
        sigma = tuple(tuple(map(to_digits, row)) for row in one.sigma)
        readings.append(TrueReadings(name=one.name, values=rounded_rows(one.values), sigma=sigma))
    return Truth(
        kind=truth.kind,
        effects=tuple(effects),
        poses=poses and TruePoses.model_validate({"pose": poses.pose, "position": rounded_rows(poses.position)}),
        readings=tuple(readings),
        sigma=truth.sigma,
    )


def rounded(value: float, decimals: int = DECIMALS) -> float:
    """A value rounded to ``decimals`` decimals; never a negative zero."""
    return round(value, decimals) + 0.0


def to_digits(value: float) -> float:
    """A value to ``DIGITS`` significant digits."""
    return float(f"{value:.{DIGITS}g}")


def rounded_energy(value: float) -> float:
    """An energy to ``DIGITS`` significant digits; 0 below ``NOTHING``."""
    return to_digits(value) if value >= NOTHING else 0.0


def rounded_rows(rows: Iterable[Iterable[float]]) -> tuple[tuple[float, ...], ...]:
    """Rows of values, each :func:`rounded`."""
    return tuple(tuple(rounded(value) for value in row) for row in rows)


def round_table(file: Path) -> None:
    """Round all numbers of a CSV file that have a decimal point or an exponent; whole numbers and words stay."""
    head, *lines = file.read_text(encoding="utf-8").splitlines()
    decimals = [3 if name.startswith("temp_") else DECIMALS for name in head.split(",")]

    def cell(text: str, decimals: int) -> str:
        whole = text.lstrip("-").isdigit()
        return repr(rounded(float(text), decimals)) if NUMBER.fullmatch(text) and not whole else text

    rows = [",".join(map(cell, line.split(","), decimals)) for line in lines]
    file.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
