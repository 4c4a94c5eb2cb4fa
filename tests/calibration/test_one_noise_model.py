"""One noise model: a tracker's data give the same calibration as poses of schema 1 and as readings of an instrument."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from virtual_gantry import case, undeclared

import gtpin

pytestmark = pytest.mark.slow


def as_readings(dataset):
    """The dataset as readings of an instrument that has a name."""
    (table,) = dataset.readings.tables
    named = replace(dataset.readings, tables=(table.model_copy(update={"name": "tracker"}),))
    return replace(dataset, instrument=gtpin.data.InstrumentSection(), orientation=None, readings=named)


def visited(dataset, rng, times, scatter):
    """Each pose visited several times, with a scatter between the visits, m and rad."""
    again = dataset.take(np.repeat(np.arange(len(dataset)), times))
    moved = again.position + scatter * rng.standard_normal(again.position.shape)
    if again.orientation is None:
        return replace(again, position=moved)
    turns = Rotation.from_rotvec(scatter * rng.standard_normal((len(again), 3)))
    orientation = (turns * Rotation.from_quat(again.orientation, scalar_first=True)).as_quat(scalar_first=True)
    return replace(again, position=moved, orientation=orientation)


@pytest.mark.filterwarnings("ignore:position_sigma:gtpin.errors.GtpinWarning")  # which visits contradict
@pytest.mark.parametrize("declared", [True, False], ids=["declared", "undeclared"])
@pytest.mark.parametrize("times", [1, 3], ids=["once", "three times"])
@pytest.mark.parametrize("orientation", [True, False], ids=["poses", "positions"])
def test_poses_and_readings_of_one_tracker_calibrate_alike(declared, times, orientation):
    rng = np.random.default_rng([declared, times, orientation])
    _, data = case(rng, 60, orientation=orientation)
    data = visited(data, rng, times, 3e-5) if times > 1 else data
    data = data if declared else undeclared(data)
    poses = gtpin.calibrate(data)
    readings = gtpin.calibrate(as_readings(data))
    (named,), (lone, *_) = readings.by_instrument, poses.by_instrument
    assert (named.name, lone.name) == ("tracker", "")
    for what in ("before", "after", "floor", "left_out"):
        assert getattr(named, what) == pytest.approx(getattr(lone, what), rel=1e-3)
    np.testing.assert_allclose(readings.values, poses.values, atol=1e-4 * poses.sigma.min())
    np.testing.assert_allclose(readings.sigma, poses.sigma, rtol=1e-4)
    assert readings.chi2_per_dof == pytest.approx(poses.chi2_per_dof, rel=1e-4)
    assert readings.noise.sigma[0] == pytest.approx(poses.noise.position_sigma, rel=1e-4)
    assert readings.noise.repeatability == pytest.approx(poses.noise.repeatability, rel=1e-3, abs=1e-9)
    assert readings.noise.source == poses.noise.source
