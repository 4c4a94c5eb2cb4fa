"""The public set: which cases it has, and the digests of their files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from gtpin.bench.blind.draw import Draft, drafts
from gtpin.errors import GtpinError

FILE = Path(__file__).parent / "set1.json"
"""The set that gtpin ships."""
SCHEMA = "gtpin-benchmark/1"


class Block(BaseModel):
    """Cases of one machine, measured by one instrument."""

    model_config = ConfigDict(frozen=True)

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

    def drafts(self, folder: Path) -> Iterator[Draft]:
        """The block's cases; ``folder`` holds the set's URDF files."""
        robot = self.reference(folder)
        kinds = (self.instrument,) if self.instrument else ()
        for number, draft in enumerate(drafts(self.cases, self.seed, robot, kinds)):
            yield replace(draft, name=f"{self.name}-{number:02d}")


class Published(BaseModel):
    """What is published of a case."""

    model_config = ConfigDict(frozen=True)

    # `dataset`, `truth`: SHA-256 of the files that a solver sees, and of the truth
    dataset: str
    truth: str
    # D of a single effect: the energy that the best wrong effect leaves; None for other cases
    leaves: float | None = None


class PublicSet(BaseModel):
    """A set of cases that anybody can make again."""

    model_config = ConfigDict(frozen=True)

    schema_: Annotated[str, Field(alias="schema", pattern=f"^{SCHEMA}$")]
    plant: str  # Digest of the plant's sources that made the set first
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
        return {draft.name: draft for block in self.blocks for draft in block.drafts(folder)}
