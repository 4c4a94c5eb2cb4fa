"""Analytic derivatives of the models' kinematics against differences of the kinematics themselves."""

import model_machines as mm
import numpy as np
import pytest

from gtpin import Dataset
from gtpin.paper.geometry import PaperGeometry
from gtpin.paper.kinematics import PaperKinematics
from gtpin.paper.models import model_geometry

PATHS = tuple(mm.bent(mm.AXES[c], mm.wavy(1e-4, 30 + c)) for c in range(3))
TURNS = tuple(mm.bent(np.array([2e-4, -1e-4, 3e-4]), mm.wavy(3e-4, 40 + c)) for c in range(3))
MODELS = [(1, False), (2, False), (2, True), (3, False), (4, False), (4, True), (5, False), (5, True)]
Q = mm.commands(12, seed=3)


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    return mm.Machine.nominal().dataset(Q, 1e-5, 5e-5, 0, mm.carts_of(PATHS, turns=TURNS))


@pytest.fixture(scope="module", params=MODELS, ids=lambda p: f"model{p[0]}{'-turning' if p[1] else ''}")
def geometry(request: pytest.FixtureRequest, dataset: Dataset) -> PaperGeometry:
    """A model's geometry with every parameter a tolerance or so off."""
    number, orientations = request.param
    nominal = model_geometry(number, mm.ROBOT, dataset, orientations=orientations)
    return nominal.with_values(
        nominal.values + nominal.tolerance * np.random.default_rng(5).standard_normal(len(nominal.values))
    )


def moved(geometry: PaperGeometry, column: int, step: float) -> PaperKinematics:
    values = geometry.values.copy()
    values[column] += step
    return PaperKinematics(geometry.with_values(values))


@pytest.mark.slow
def test_pose_derivatives_by_every_parameter_are_those_of_differences(geometry: PaperGeometry):
    rods = PaperKinematics(geometry)
    poses = rods.forward(Q)
    J = rods.geometry_jacobian(Q, poses)
    for column, name in enumerate(geometry.names):
        h = 1e-2 * geometry.tolerance[column]
        plus, minus = (moved(geometry, column, s * h).forward(Q, poses) for s in (1.0, -1.0))
        difference = plus.minus(minus) / (2.0 * h)
        size = max(np.abs(difference).max(), 1e-3)
        assert np.allclose(J[:, :, column], difference, rtol=0, atol=1e-6 * size), name


def test_command_derivatives_are_those_of_differences_between_measured_points(geometry: PaperGeometry):
    rods = PaperKinematics(geometry)
    h = 1e-5
    between = Q[(np.abs(Q[:, :, None] - mm.POINTS).min(axis=(1, 2)) > 2.0 * h)]
    poses = rods.forward(between)
    J = rods.command_jacobian(between, poses)
    # Rates of the carts' rotation vectors count as rates of rotation: what that leaves is the vectors' product with their
    # rates, 1e-3 rad by 1e-2 rad/m, on levers of 0.25 m, and several times as much at the TCP.
    turning = any(track is not None and track.turns is not None for track in geometry.tracks)
    for actuator in range(3):
        step = h * np.eye(3)[actuator]
        plus, minus = rods.forward(between + step, poses), rods.forward(between - step, poses)
        difference = plus.minus(minus) / (2.0 * h)
        assert np.allclose(J[:, :, actuator], difference, rtol=0, atol=1e-5 if turning else 1e-8)


def test_measured_tracks_have_a_third_rotation_and_no_scale_and_straight_ones_the_reverse(dataset: Dataset):
    names = model_geometry(5, mm.ROBOT, dataset).names
    assert {"track_direction[cart2].c", "scale[1]", "scale[3a]", "track_direction[3c].b"} <= set(names)
    assert not {"scale[2a]", "scale[2b]", "track_direction[2a].a", "track_direction[cart1].c"} & set(names)


def test_the_reduced_arm_has_one_length_and_one_joint_for_each_cart(dataset: Dataset):
    names = model_geometry(2, mm.ROBOT, dataset).names
    joints = {f"cart_joint[cart{c}].{axis}" for c in (1, 2, 3) for axis in "xyz"}
    turns = {f"track_direction[cart{c}].{axis}" for c in (1, 2, 3) for axis in "abc"}
    assert set(names) == {f"length[cart{c}]" for c in (1, 2, 3)} | joints | turns
