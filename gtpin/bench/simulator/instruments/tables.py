"""A dataset of several instruments (schema 2), written by the plant itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from gtpin.data.files import write_table
from gtpin.data.ids import Ids
from gtpin.data.table import Column
from gtpin.typing import Floats, Ints

SCHEMA = "gtpin-dataset/2"


@dataclass(frozen=True, eq=False)
class Read:
    """An instrument's ``[[instrument]]`` in dataset.toml, and its table: the stop of each row (M,), and its own columns."""

    described: dict[str, Any]
    stop: Ints
    columns: dict[str, Column]


@dataclass(frozen=True, eq=False)
class Tables:
    """A dataset of schema 2.

    Parameters
    ----------
    robot, tcp
        Names of the robot and of its TCP frame in dataset.toml.
    reference_temperature
        Temperature at which the geometry holds, degC.
    pose, q, covariates
        (N,) id, (N, n) commands and (N,) covariates of each of the machine's stops.
    read
        Description and table of each instrument.
    """

    robot: str
    tcp: str | None
    reference_temperature: float
    pose: Ids
    q: Floats
    covariates: dict[str, Column]
    read: tuple[Read, ...]

    def __len__(self) -> int:
        return sum(len(one.stop) for one in self.read)

    def write(self, folder: Path) -> None:
        """Write dataset.toml and a CSV file for each instrument into a folder, which is created if it is missing."""
        folder.mkdir(parents=True, exist_ok=True)
        head = {"schema": SCHEMA, "robot": self.robot, **({"tcp": self.tcp} if self.tcp else {})}
        about = {"conditions": {"reference_temperature": self.reference_temperature}}
        text = tomli_w.dumps({**head, **about, "instrument": [one.described for one in self.read]})
        (folder / "dataset.toml").write_text(text, encoding="utf-8", newline="\n")
        for one in self.read:
            columns: dict[str, Column] = {"pose": self.pose[one.stop]}
            columns |= {f"q{i + 1}": values for i, values in enumerate(self.q[one.stop].T)}
            columns |= one.columns | {name: values[one.stop] for name, values in self.covariates.items()}
            write_table(folder / f"{one.described['name']}.csv", columns)
