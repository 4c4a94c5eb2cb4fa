"""Equal values of a column as equal integers, without pandas, whose import takes longer than reading a small dataset."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def codes(values: NDArray[Any]) -> tuple[NDArray[np.intp], NDArray[Any]]:
    """(N,) index of each of N values among the distinct ones, and the distinct values, sorted."""
    if values.dtype != object:
        distinct, code = np.unique(values, return_inverse=True)
        return code.ravel(), distinct
    place = {value: index for index, value in enumerate(sorted(set(values)))}
    return np.fromiter(map(place.__getitem__, values), np.intp, len(values)), np.array(list(place), dtype=object)
