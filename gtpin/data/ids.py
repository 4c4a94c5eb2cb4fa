"""Ids of poses and sessions: text, in which a number has one spelling however it was written."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtpin.errors import DatasetError

Ids = NDArray[np.object_]

LONGEST = 10_000
"""Largest length of an id, because messages and reports contain it."""

# A leading zero makes a name ("007"), and so does an exponent without a sign ("1e3" may be a hash).
_NUMBER = re.compile(r"([+-]?(?:0|[1-9][0-9]{0,300}))(?:\.(0*)([0-9]{0,300}))?([eE][+-][0-9]{1,4})?")


def normal_id(value: object) -> str:
    """Spell one id in its normal form: `2`, `2.0`, `"2"` and `"2.000000000"` all become `"2"`.

    Raises `ValueError`, with a reason to show, for what is blank, not a number or not printable.
    """
    text = str(value).strip()
    if not text:
        raise ValueError("the cell is blank")
    if text.lower() in ("nan", "<na>", "nat") or value is None:
        raise ValueError("the id is missing")
    if len(text) > LONGEST:
        raise ValueError(f"the id has {len(text)} letters, more than {LONGEST}")
    if not text.isprintable():
        raise ValueError("the id has unprintable characters")
    match = _NUMBER.fullmatch(text)
    if match is None:
        return text
    whole, _, fraction, exponent = match.groups()
    if not fraction and not exponent:
        return str(int(whole))
    number = float(text)
    if not np.isfinite(number):
        return text
    return str(int(number)) if number.is_integer() else repr(number)


def normal_ids(
    values: Iterable[Any],
    name: str = "id",
    file: Path | None = None,
    lines: Sequence[int] | NDArray[np.int64] | None = None,
) -> Ids:
    """Spell ids in their normal form, as an (N,) array of `str`.

    Raises `DatasetError` for the first that `normal_id` refuses, with the file, its line, and the column ``name``.
    """
    known: dict[Any, str] = {}
    result = []
    for index, value in enumerate(values):
        if value not in known:
            try:
                known[value] = normal_id(value)
            except ValueError as error:
                row, hint = None if lines is None else int(lines[index]), f"give every row its {name}"
                raise DatasetError(str(error), file=file, row=row, column=name, hint=hint) from None
        result.append(known[value])
    array = np.empty(len(result), dtype=object)
    array[:] = result
    return array


def codes(values: NDArray[Any]) -> tuple[NDArray[np.intp], NDArray[Any]]:
    """(N,) index of each of N values among the distinct ones, and the distinct values, sorted."""
    if values.dtype != object:
        distinct, code = np.unique(values, return_inverse=True)
        return code.ravel(), distinct
    place = {value: index for index, value in enumerate(sorted(set(values)))}
    return np.fromiter(map(place.__getitem__, values), np.intp, len(values)), np.array(list(place), dtype=object)


def joint_codes(columns: Iterable[NDArray[Any]]) -> NDArray[np.intp]:
    """(N,) index of each row among the distinct combinations of some columns (N,), in the order of the columns."""
    each = (np.unique(column, return_inverse=True)[1].ravel() for column in columns)
    return reduce(lambda a, b: np.unique(a * (b.max(initial=0) + 1) + b, return_inverse=True)[1].ravel(), each)
