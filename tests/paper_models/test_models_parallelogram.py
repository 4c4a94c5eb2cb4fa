"""The reduced arm: a plate that never turns, on three rods that meet in a point (eqs. 1 to 3)."""

import model_machines as mm
import numpy as np
import pytest
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from gtpin.paper.geometry import PaperGeometry
from gtpin.paper.kinematics import PaperKinematics
from gtpin.paper.models import model_geometry, parallelogram

Q = mm.commands(60, seed=4, reach=0.65)
TILTED = Rotation.from_rotvec([0.01, -0.02, 0.005]).as_matrix() @ mm.HOME_R


@pytest.mark.parametrize("R", [mm.HOME_R, TILTED])
def test_its_plate_never_turns(R: np.ndarray):
    rods = PaperKinematics(PaperGeometry.nominal(parallelogram(mm.ROBOT, R), arm="reduced", scale="actuator"))
    poses = rods.forward(Q)
    assert poses.reached.all()
    assert np.abs(poses.R - R).max() < 1e-10


def test_its_plate_never_turns_whatever_its_parameters_are():
    nominal = model_geometry(1, mm.ROBOT, mm.Machine.nominal().dataset(Q, 1e-5, 5e-5, 0))
    off = nominal.with_values(
        nominal.values + nominal.tolerance * np.random.default_rng(2).standard_normal(len(nominal.values))
    )
    poses = PaperKinematics(off).forward(Q)
    assert poses.reached.all()
    assert np.abs(poses.R - poses.R[0]).max() < 1e-10


def test_it_is_where_three_spheres_meet():
    rods = PaperKinematics(PaperGeometry.nominal(parallelogram(mm.ROBOT, mm.HOME_R), arm="reduced"))
    centres = np.array([(mm.C0 - mm.P0 @ mm.HOME_R.T)[c == mm.CART].mean(axis=0) for c in range(3)])
    lengths = np.array([mm.L0[c == mm.CART].mean() for c in range(3)])
    for q, T in zip(Q[:10], rods.forward(Q[:10]).T, strict=True):
        joints = centres + q[:, None] * mm.AXES
        met = fsolve(lambda x, joints=joints: np.linalg.norm(x - joints, axis=1) - lengths, T + 0.01, xtol=1e-13)
        assert np.allclose(T, met, rtol=0, atol=1e-10)


def test_its_constant_orientation_is_the_mean_of_those_measured():
    dataset = mm.Machine.nominal().dataset(Q, 1e-5, 5e-5, 0)
    measured = Rotation.from_quat(dataset.orientation.copy(), scalar_first=True)
    R = PaperKinematics(model_geometry(1, mm.ROBOT, dataset)).home.R[0]
    # The mean rotation is that from which rotation vectors sum to zero, to second order in the millirads they are.
    left = (measured * Rotation.from_matrix(R).inv()).as_rotvec()
    assert np.abs(left.mean(axis=0)).max() < 1e-3 * np.abs(left).max()
