"""Numbers of the benchmark's files are rounded, so that the last bits of a processor or a library do not change the files.

A number is rounded to 1e-7 (m, rad, or its own unit). That is 0.1 um, where the instruments' noise is 10 um or more. Two
computers whose results differ by 1e-15 write different digits only where a number lies within 1e-15 of the middle between two
rounded values: one in 1e8 numbers. Temperatures come from a larger computation and differ by 1e-10 degC: they are rounded to
1e-3 degC.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

DECIMALS = 7
COARSE = {"temp_frame": 3, "temp_link": 3}
"""Number of decimals of the columns that have fewer than ``DECIMALS``."""
DIGITS = 4
"""Significant digits of the noise and of energies, in truths."""
NOTHING = 1e-3
"""A smaller energy is written as 0: it can consist of rounding errors."""
NUMBER = re.compile(r"-?\d+(\.\d*)?(e[-+]?\d+)?")


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
    decimals = [COARSE.get(name, DECIMALS) for name in head.split(",")]
    rows = [",".join(map(_cell, line.split(","), decimals)) for line in lines]
    file.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")


def _cell(text: str, decimals: int) -> str:
    return repr(rounded(float(text), decimals)) if NUMBER.fullmatch(text) and not text.lstrip("-").isdigit() else text
