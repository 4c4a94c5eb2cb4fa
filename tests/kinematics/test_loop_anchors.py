"""Anchors of loops that are no rods are parameters: the lengths of the links at which a loop is cut."""

import pickle
import warnings
from pathlib import Path

import numpy as np
import pytest
from single_postures import written

import gtpin
from gtpin.data import InstrumentSection
from gtpin.kinematics.kinematics import Kinematics

FIVE_BAR = Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf"
STEP = 1e-6


@pytest.fixture(scope="module")
def geometry() -> gtpin.Geometry:
    """A geometry that is not nominal."""
    nominal = gtpin.Geometry.nominal(gtpin.load_robot(FIVE_BAR).measuring(["elbow_right"]))
    return nominal.with_values(nominal.values + 2e-3 * np.random.default_rng(4).standard_normal(len(nominal.values)))


@pytest.fixture(scope="module")
def q() -> np.ndarray:
    return np.random.default_rng(5).uniform(-0.4, 0.4, (6, 2))


def columns(geometry: gtpin.Geometry) -> list[int]:
    return [i for i, name in enumerate(geometry.names) if name.startswith("anchor[")]


def test_a_loop_has_the_positions_of_both_anchors_as_parameters(geometry: gtpin.Geometry) -> None:
    names = [geometry.names[i] for i in columns(geometry)]
    assert names == [f"anchor[pin.{link}].{axis}" for link in ("left_far", "right_far") for axis in "xyz"]


def test_the_derivative_of_a_posture_by_anchors_is_that_of_the_poses(geometry: gtpin.Geometry, q: np.ndarray) -> None:
    own = gtpin.Geometry.nominal(written(geometry))
    assert own.names == geometry.names

    def posture(step: np.ndarray) -> gtpin.ClosedPosture:
        return gtpin.home(written(own.with_values(own.values + step))).moved_to(q[0])

    found = gtpin.geometry_jacobian(gtpin.home(own.robot).moved_to(q[0]), own)
    for column in columns(own):
        step = STEP * np.eye(len(own.values))[column]
        slope = (posture(step).T - posture(-step).T) / (2.0 * STEP)
        np.testing.assert_allclose(found[:3, column], slope, rtol=0, atol=1e-8)


def test_moved_anchors_are_in_the_urdf_in_a_pickled_robot_and_in_pickled_kinematics(
    geometry: gtpin.Geometry, q: np.ndarray, tmp_path: Path
) -> None:
    (tmp_path / "moved.urdf").write_text(Kinematics(geometry).urdf(), encoding="utf-8")
    poses = Kinematics(geometry).forward(q)
    robot = gtpin.load_robot(tmp_path / "moved.urdf")
    np.testing.assert_allclose(robot.forward(q).T, poses.T, rtol=0, atol=1e-12)
    again = pickle.loads(pickle.dumps(robot))
    np.testing.assert_allclose([gtpin.home(again).moved_to(row).T for row in q], poses.T, rtol=0, atol=1e-12)
    here = pickle.loads(pickle.dumps(Kinematics(geometry)))
    np.testing.assert_array_equal(here.forward(q).T, poses.T)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1])
def test_a_far_link_of_another_length_is_calibrated_and_the_model_is_read_again(seed: int, tmp_path: Path) -> None:
    """1 um of noise, 0.3 mm of a length: without the anchors' parameters what is left is far above the noise."""
    rng = np.random.default_rng(seed)
    model = gtpin.read_model(FIVE_BAR)
    values = model.geometry.values.copy()
    values[list(model.geometry.names).index("anchor[pin.right_far].x")] += 3e-4
    true = Kinematics(model.geometry.with_values(values))
    q = rng.uniform(-0.5, 0.5, (50, 2))
    T = true.forward(q).T + 1e-6 * rng.standard_normal((50, 3))
    pose = np.arange(50).astype(str).astype(object)
    instrument = InstrumentSection(position_sigma=1e-6)
    dataset = gtpin.Dataset(robot=str(FIVE_BAR), pose=pose, q=q, position=T, instrument=instrument)
    found = gtpin.calibrate(dataset)
    assert 0.7 < found.chi2_per_dof < 1.3
    found.save(tmp_path / "found")
    again = gtpin.read_model(tmp_path / "found" / "model")
    fresh = rng.uniform(-0.5, 0.5, (40, 2))
    off = again.predict(fresh).T - true.forward(fresh).T
    assert np.sqrt((off**2).sum(axis=1).mean()) < 1e-6
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)  # of other parameters, which stray in the anchors' place
        assert gtpin.calibrate(dataset, without=["anchor"]).chi2_per_dof > 2.0
