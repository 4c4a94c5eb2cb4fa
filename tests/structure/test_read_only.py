"""What `read_only` freezes: arrays of a result, wherever they are in it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pytest

from gtpin.errors import ModelError
from gtpin.read_only import read_only
from gtpin.real import probability


@dataclass
class Part:
    array: np.ndarray


@dataclass
class Whole:
    parts: tuple[Part, ...]
    named: Mapping[str, np.ndarray]
    kinds: Mapping[str, type] = field(default_factory=dict)


def test_arrays_are_read_only_in_dataclasses_tuples_and_mappings_beside_classes() -> None:
    whole = Whole((Part(np.zeros(2)),), {"x": np.zeros(3)}, {"part": Part})
    assert read_only(whole) is whole
    for array in (whole.parts[0].array, whole.named["x"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


@pytest.mark.parametrize("value", [0.0, 1.0, float("nan"), "0.1", None])
def test_what_is_no_probability_is_refused(value: object) -> None:
    with pytest.raises(ModelError, match=r"false_alarm=.*; give a probability above 0 and below 1"):
        probability(value, "false_alarm")
