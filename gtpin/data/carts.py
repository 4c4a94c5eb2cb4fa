"""Poses of the carts along their guideways, measured separately."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gtpin.data.checks import CheckedRows, frozen, unnumbered
from gtpin.data.files import read_table, write_table
from gtpin.data.names import ORIENTATION, POSITION, TAKEN_IN_CARTS
from gtpin.data.table import Column
from gtpin.typing import Floats


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

    def write(self, file: Path) -> None:
        """Write a CSV, or Parquet by the suffix, which `read` reads back bit-identically."""
        table: dict[str, Column] = {"cart": self.cart, "q": self.q}
        table |= dict(zip(POSITION, self.position.T, strict=True))
        if self.orientation is not None:
            table |= dict(zip(ORIENTATION, self.orientation.T, strict=True))
        write_table(file, table | dict(self.covariates))
