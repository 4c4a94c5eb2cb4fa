"""Positions that were computed and not measured: gtpin says so, and names no cause of their rounding errors."""

from dataclasses import replace

import numpy as np
import pytest

import gtpin
from gtpin.data import Instrument

pytestmark = pytest.mark.slow


def computed(seed: int, digits: int) -> gtpin.Dataset:
    """Poses of an arm whose geometry is not nominal, as a controller writes its targets: without noise, and rounded."""
    rng = np.random.default_rng(seed)
    model = gtpin.read_model("ur5")
    geometry = model.geometry
    other = geometry.with_values(geometry.values + geometry.tolerance * rng.normal(size=len(geometry.values)))
    q = rng.uniform(-1.0, 1.0, (300, 6)) + np.array([0.0, -1.0, 1.5, 0.0, 1.0, 0.0])
    T = replace(model, geometry=other).predict(q).T
    pose = np.arange(len(q)).astype(str).astype(object)
    return gtpin.Dataset(robot="ur5", pose=pose, q=q, position=np.round(T, digits), instrument=Instrument(frame="free"))


@pytest.mark.parametrize(("seed", "digits"), [(1, 9), (2, 8), (3, 12)])
def test_computed_positions_are_doubted_and_have_no_cause(seed, digits):
    with pytest.warns(gtpin.GtpinWarning, match="were they computed"):
        found = gtpin.diagnose(computed(seed, digits))
    assert found.verdict == "none"
    assert not found.causes
