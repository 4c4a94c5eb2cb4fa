"""Tables beside the measured poses: commands, the input of a prediction, and poses of carts along their guideways."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gtpin.data.checks import CheckedRows, frozen, unnumbered
from gtpin.data.files import read_table, write_table
from gtpin.data.ids import Ids, normal_ids
from gtpin.data.names import ORIENTATION, POSITION, TAKEN_IN_CARTS, TAKEN_IN_POSES, command_names
from gtpin.data.table import Column
from gtpin.errors import DatasetError
from gtpin.output.results import result_file
from gtpin.typing import Floats


@dataclass(frozen=True, eq=False, repr=False)
class Commands:
    """N commanded poses of a robot with n actuators.

    Parameters
    ----------
    pose
        (N,) ids, `str`. Rows with the same id have the same commands.
    q
        (N, n) commands, m or rad.
    covariates
        By name, (N,) each: `session` as ids, everything else as float64 in SI units.
    row
        (N,) line number of each row in its file, for messages; by default 2, 3, ... (line 1 is the header).
    file
        The file that the rows were read from; None where they were not read from a file.

    Raises
    ------
    DatasetError
        Where shapes do not fit, or a value is not valid for its column.

    Examples
    --------
    >>> import gtpin
    >>> robot = gtpin.load_robot("gantry_tau")
    >>> commands = gtpin.Commands(["first", "second"], [robot.home_q, robot.home_q + 0.05])
    >>> len(commands), commands.q.shape
    (2, (2, 3))
    """

    pose: Ids
    q: Floats
    covariates: Mapping[str, Column] = field(default_factory=dict)
    row: NDArray[np.int64] = field(default_factory=unnumbered)
    file: Path | None = None

    def __post_init__(self) -> None:
        rows = CheckedRows.of(self.file, self.row, len(self.pose))
        pose, q = rows.ids(self.pose, "pose"), rows.commands(self.q)
        rows.same_commands(pose, q)
        covariates = rows.covariates(self.covariates, q.shape[1], TAKEN_IN_POSES)
        for name, value in {"pose": pose, "q": q, "covariates": covariates, "row": rows.line}.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        covariates = ", ".join(self.covariates) or "none"
        return f"Commands: {len(self)} of {self.q.shape[1]} actuators; covariates: {covariates}"

    def __len__(self) -> int:
        return len(self.pose)

    def place(self, index: int) -> tuple[Path | None, int]:
        """File, and line in it, of the row with this index (counted from 0)."""
        return self.file, int(self.row[index])

    @property
    def n_actuators(self) -> int:
        """Number of actuators."""
        return int(self.q.shape[1])

    @classmethod
    def read(
        cls, file: Path | str, n_actuators: int | None = None, ids: Collection[str] = (), *, numbered: bool = False
    ) -> Commands:
        """Read a CSV or Parquet file of commands; FILE.parquet is read if FILE.csv does not exist.

        Measured columns (`x y z qw qx qy qz`) are ignored, so that a dataset's poses.csv can be used. `ids` names
        further columns to ignore, such as `station`. All other columns are covariates. `numbered`: a table without `pose`
        that has `time` is read too; its rows are numbered from 1.
        Raises `DatasetError` for a file that can't be read, or whose number of command columns is not `n_actuators`
        (None: any number).
        """
        file = Path(file)
        twin = file.with_suffix(".parquet") if file.name else file
        if not os.path.exists(file) and file.suffix.lower() == ".csv" and os.path.exists(twin):
            file = twin
        table = read_table(file, ignore=(*POSITION, *ORIENTATION))
        q = table.commands()
        lacks_pose = numbered and "pose" not in table.names and "time" in table.names
        pose = normal_ids(range(1, len(q) + 1)) if lacks_pose else table.column("pose")
        if n_actuators is not None and q.shape[1] != n_actuators:
            what = f"the file has {q.shape[1]} columns of commands, the robot {n_actuators} actuators"
            raise DatasetError(what, file=file, row=1, column=f"q{q.shape[1]}", hint="one for each, q1 .. qn")
        taken = {"pose", *command_names(q.shape[1]), *POSITION, *ORIENTATION, *ids}
        commands = cls(pose, q, table.covariates(taken), table.row, file)
        table.warn_of_covariates(taken)
        return commands

    def write(self, file: Path | str, *, force: bool = False) -> None:
        """Write a CSV file, or a Parquet file if the suffix is `.parquet`. `read` returns exactly the same values.

        After an error no incomplete file is left. An existing file that gtpin wrote is replaced. If another program wrote or
        changed the existing file, `DatasetError` is raised; with `force` that file is renamed (NAME.old-1) instead.
        """
        names = command_names(self.n_actuators)
        table = {"pose": self.pose, **dict(zip(names, self.q.T, strict=True)), **self.covariates}
        with result_file(Path(file), force=force, kind=DatasetError) as unfinished:
            write_table(unfinished, table)


@dataclass(frozen=True, eq=False)
class CartMeasurements:
    """M measured cart poses of a robot with n actuators, all in one frame, which may be any.

    Parameters
    ----------
    cart
        (M,) number of the cart, 1 .. n: cart i is moved by actuator i.
    q
        (M,) command of this cart, m.
    position
        (M, 3) measured position, m.
    orientation
        (M, 4) unit quaternions, wxyz; None where only positions were measured.
    covariates
        By name, (M,) each: `session` as ids, everything else as float64 in SI units.
    n_actuators
        Number of actuators, n.
    row
        (M,) line of each row in its file; by default 2, 3, ...
    file
        The file that the rows were read from; None where they were not read from a file.

    Raises
    ------
    DatasetError
        Where shapes do not fit, or a value is not valid for its column.
    """

    cart: NDArray[np.int64]
    q: Floats
    position: Floats
    orientation: Floats | None = None
    covariates: Mapping[str, Column] = field(default_factory=dict)
    n_actuators: int = 3
    row: NDArray[np.int64] = field(default_factory=unnumbered)
    file: Path | None = None

    def __post_init__(self) -> None:
        rows = CheckedRows.of(self.file, self.row, len(self.cart))
        cart = rows.floats(self.cart, ["cart"])
        known = np.isin(cart, np.arange(1, self.n_actuators + 1))
        if not known.all():
            index = int(np.argmin(known))
            raise rows.error(index, "cart", f"there is no cart {cart[index]:g}", f"carts are 1 to {self.n_actuators}")
        values = {
            "cart": frozen(cart.astype(np.int64)),
            "q": rows.floats(self.q, ["q"]),
            "position": rows.floats(self.position, list(POSITION)),
            "orientation": None if self.orientation is None else rows.quaternions(self.orientation),
            "covariates": rows.covariates(self.covariates, self.n_actuators, TAKEN_IN_CARTS),
            "row": rows.line,
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.cart)

    @classmethod
    def read(cls, file: Path | str, n_actuators: int) -> CartMeasurements:
        """Read carts.csv, or the same as Parquet; raises `DatasetError` for what can't be read."""
        table = read_table(Path(file))
        cart, q, position = table.column("cart"), table.column("q"), table.matrix(POSITION)
        orientation = table.orientation()
        taken = {"pose", "cart", "q", *POSITION, *ORIENTATION}
        covariates = table.covariates(taken)
        carts = cls(cart, q, position, orientation, covariates, n_actuators, table.row, Path(file))
        table.warn_of_covariates(taken)
        return carts

    @property
    def columns(self) -> dict[str, Column]:
        """The columns of carts.csv, which `read` reads back bit-identically."""
        table: dict[str, Column] = {"cart": self.cart, "q": self.q, **dict(zip(POSITION, self.position.T, strict=True))}
        if self.orientation is not None:
            table |= dict(zip(ORIENTATION, self.orientation.T, strict=True))
        return table | dict(self.covariates)
