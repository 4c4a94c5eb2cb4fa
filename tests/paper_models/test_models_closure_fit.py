"""The paper's cost: squared closure residuals at measured poses, each rod by itself (eq. 6)."""

from dataclasses import replace
from pathlib import Path

import model_machines as mm
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.stats import t as student
from scripts import load

from gtpin import Dataset
from gtpin.calibration.calibrate import calibrate_geometry
from gtpin.kinematics.poses import Poses
from gtpin.paper.geometry import PaperGeometry
from gtpin.paper.kinematics import PaperKinematics
from gtpin.paper.models import model_geometry

if not (Path(__file__).parents[2] / "examples" / "dressler2010").is_dir():
    pytest.skip("the examples are not here", allow_module_level=True)
paper_closures = load("dressler2010/paper_closures")

Q = mm.commands(80, seed=11)
BENT = tuple(mm.bent(mm.AXES[c], mm.wavy(1e-4, 12 + c)) for c in range(3))
MACHINE = replace(mm.Machine.nominal(), paths=tuple(BENT[c] for c in mm.CART)).off(15)


def poses_of(dataset: Dataset) -> Poses:
    return Poses(dataset.position, Rotation.from_quat(dataset.orientation.copy(), scalar_first=True).as_matrix())


def fitted(dataset: Dataset) -> tuple[PaperGeometry, np.ndarray]:
    """Model 3, and the cost of each rod."""
    at = dataset.q, poses_of(dataset)
    geometry = paper_closures.fit_closures(model_geometry(3, mm.ROBOT, dataset), *at)
    return geometry, paper_closures.closure_costs(geometry, *at)


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    return MACHINE.dataset(Q, 1e-5, 5e-5, 0, mm.carts_of(BENT))


def test_the_residual_is_the_papers_equation_5(dataset: Dataset):
    poses = poses_of(dataset)
    wanted = np.empty((len(Q), 6))
    for i, c in enumerate(mm.CART):
        joint = mm.C0[i] + Q[:, [c]] * mm.AXES[c]
        wanted[:, i] = mm.L0[i] ** 2 - ((poses.T + poses.R @ mm.P0[i] - joint) ** 2).sum(axis=1)
    found = paper_closures.closure_residual(PaperKinematics(PaperGeometry.nominal(mm.ROBOT)), Q, poses)
    assert np.allclose(found, wanted, rtol=0, atol=1e-12)


def test_the_residual_of_the_reduced_arm_is_equation_1_whatever_the_measured_orientation(dataset: Dataset):
    geometry, poses = model_geometry(1, mm.ROBOT, dataset), poses_of(dataset)
    R = Rotation.from_matrix(poses.R).mean().as_matrix()
    turned = Poses(poses.T, Rotation.from_rotvec([0.1, 0.0, 0.0]).as_matrix() @ poses.R)
    residual = paper_closures.closure_residual(PaperKinematics(geometry), Q, turned)
    for c in range(3):
        rods = c == mm.CART
        centre = (mm.C0 - mm.P0 @ R.T)[rods].mean(axis=0) + Q[:, [c]] * mm.AXES[c]
        wanted = mm.L0[rods].mean() ** 2 - ((poses.T - centre) ** 2).sum(axis=1)
        assert np.allclose(residual[:, rods], wanted[:, None], rtol=0, atol=1e-10)


def test_each_rod_is_by_itself(dataset: Dataset):
    rng = np.random.default_rng(1)
    q = dataset.q.copy()
    q[:, 0] += 1e-3 * rng.standard_normal(len(q))  # moves the cart of rod 1 alone
    (one, cost), (other, other_cost) = fitted(dataset), fitted(replace(dataset, q=q))
    own = np.array(["[1]" in name for name in one.names])
    change = np.abs(one.values - other.values) / one.tolerance
    assert change[own].max() > 0.1
    assert change[~own].max() < 1e-3
    assert other_cost[0] > 10.0 * cost[0]
    assert np.allclose(other_cost[1:], cost[1:], rtol=1e-6)


def rod_residual(rod: int, x: np.ndarray, dataset: Dataset) -> np.ndarray:
    """(N,) eq. 5 of model 3 for one rod, written down again: x is L, P, C and the direction's three components."""
    poses, q = poses_of(dataset), dataset.q[:, [mm.CART[rod]]]
    d = poses.T + poses.R @ x[1:4] - x[4:7] - q * x[7:10]
    return x[0] ** 2 - (d**2).sum(axis=1)


def test_the_minimum_is_that_of_the_equations_written_down_again(dataset: Dataset):
    found, cost = fitted(dataset)
    sigma = np.sqrt(cost / len(Q))  # what the tolerances are weighed against, by each rod's own residuals
    # Two small rotations and a scale move the direction by their tolerances along three axes, which need not be named.
    tolerance = np.array([1e-3, *[1e-3] * 3, *[2e-3] * 3])
    for rod in range(6):
        start = np.concatenate([[mm.L0[rod]], mm.P0[rod], mm.C0[rod], mm.AXES[mm.CART[rod]]])
        along = start[7:10]

        def misfit(y: np.ndarray, rod=rod, start=start, along=along) -> np.ndarray:
            x = start.copy()
            x[:7] += tolerance * y[:7]
            off = y[7:] - (y[7:] @ along) * along
            x[7:] = (1.0 + 5e-4 * (y[7:] @ along)) * (along + 1e-3 * off)
            return np.concatenate([rod_residual(rod, x, dataset) / sigma[rod], y])

        other = least_squares(misfit, np.zeros(10), xtol=1e-12, ftol=1e-12, gtol=1e-12)
        residual = other.fun[: len(Q)] * sigma[rod]
        # The rounds that weigh the residuals against the tolerances end within a per cent of where they would settle.
        assert np.isclose((residual**2).sum(), cost[rod], rtol=1e-3)
        name = mm.ROBOT.rods[rod].name
        ours = [found[f"length[{name}]"], *(found[f"platform_joint[{name}].{axis}"] for axis in "xyz")]
        theirs = start[:4] + tolerance[:4] * other.x[:4]
        assert np.allclose(ours, theirs, rtol=0, atol=0.02 * 1e-3)


@pytest.mark.slow
def test_held_out_a_machine_on_bent_tracks_is_best_predicted_by_model_4(dataset: Dataset):
    mean = paper_closures.held_out(dataset)[0].mean(axis=1)
    assert np.argmin(mean) == 3
    assert np.argmax(mean) in (0, 2)


@pytest.mark.slow
@pytest.mark.parametrize("bends", [(False, True, False), (True, False, True)])
def test_by_validation_the_rods_whose_measured_tracks_are_true_take_them(bends: tuple[bool, ...]):
    """Bends were measured of all carts; the others are straight."""
    paths = tuple(BENT[c] if bends[c] else mm.straight(mm.AXES[c]) for c in mm.CART)
    truth = replace(mm.Machine.nominal(), paths=paths).off(84)
    found = paper_closures.better_measured(truth.dataset(mm.commands(150, seed=6), 1e-5, 5e-5, 2, mm.carts_of(BENT)))
    assert found.tolist() == [bends[c] for c in mm.CART]


@pytest.mark.slow
def test_noisy_orientations_bias_the_closure_cost_but_not_the_pose_cost():
    """The machine is nominal, so that the priors pull nothing away from the truth, and what is left in the mean is bias.

    A joint's place P stands in the closure times the measured rotation: errors in it count as if the plate had turned,
    and P is drawn to where turning moves it least, by as much as its tolerance lets it.
    """
    q, draws = mm.commands(120, seed=16), 24
    closure, pose = [], []
    for seed in range(draws):
        noisy = mm.Machine.nominal().dataset(q, 1e-5, 1e-3, seed)
        geometry = model_geometry(3, mm.ROBOT, noisy)
        closure.append(paper_closures.fit_closures(geometry, q, poses_of(noisy)).deviation)
        pose.append(calibrate_geometry(noisy, geometry).model.geometry.deviation)

    def mean_and_t(deviations: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        mean, sigma = np.mean(deviations, axis=0), np.std(deviations, axis=0, ddof=1)
        return mean, np.abs(mean) / (sigma / np.sqrt(draws))

    names = geometry.names
    bound = student.isf(
        0.5e-3 / len(names), draws - 1
    )  # exceeded by any of so many unbiased means once in a thousand times
    mean, t = mean_and_t(closure)
    joints = np.array([name.startswith("platform_joint") for name in names])
    assert t[joints].max() > 5.0 * bound
    assert np.abs(mean[joints]).max() == pytest.approx(0.8e-3, abs=0.1e-3)  # docs/paper.md
    assert mean_and_t(pose)[1].max() < bound
