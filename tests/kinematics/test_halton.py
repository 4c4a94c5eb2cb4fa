"""Halton's sequence, computed here because the import of `scipy.stats` takes long."""

import numpy as np
import pytest
from scipy.stats import qmc

from gtpin.kinematics.first_guess import halton


@pytest.mark.parametrize("coordinates", [1, 3, 6])
@pytest.mark.parametrize("count", [1, 2, 1001])
def test_the_sequence_is_scipys_to_the_last_bit(coordinates: int, count: int) -> None:
    assert np.array_equal(halton(coordinates, count), qmc.Halton(coordinates, scramble=False).random(count))
