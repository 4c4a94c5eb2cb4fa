"""The least-squares problem: its derivatives, and its optimum as scipy finds it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from virtual_gantry import (
    GANTRY,
    ORIENTATION_SIGMA,
    POSITION_SIGMA,
    case,
    commands,
    draw,
    measured,
    names,
    tolerance,
    undeclared,
)

import gtpin
from gtpin.calibration.problem import Problem, measured_poses, rough_frame
from gtpin.instruments.readings import Readings
from gtpin.model.model import Frame, Model, in_frame
from gtpin.noise.noise import Noise
from gtpin.paper.geometry import nominal_geometry

SCALES = {"plain": {}, "sixty": {"directions": "rod", "scale": "rod"}}


@pytest.mark.slow
@pytest.mark.parametrize("away", [False, True], ids=["start", "away"])
@pytest.mark.parametrize("orientation", [True, False], ids=["poses", "positions"])
@pytest.mark.parametrize("free", [False, True], ids=["robot", "free"])
@pytest.mark.parametrize("options", SCALES.values(), ids=SCALES)
def test_the_derivative_of_the_whole_problem_equals_finite_differences(options, free, orientation, away):
    rng = np.random.default_rng(2)
    _, dataset = case(rng, 7, free=free, orientation=orientation)
    q = dataset.q
    nominal = Model(nominal_geometry(gtpin.load_robot("gantry_tau"), **options))
    poses, seen = nominal.predict(q), measured_poses(dataset)
    start = replace(nominal, frame=rough_frame(poses, seen)) if free else nominal
    J = in_frame(nominal.kinematics.command_jacobian(q, poses), start.frame)
    # Everything that the whitening can hold: range and angle, and the carts' repeatability.
    noise = Noise(POSITION_SIGMA, ORIENTATION_SIGMA, 2e-5).rows(len(q), seen.components)
    noise = replace(noise.towards(dataset.position, np.array([1.5, -7.0, 0.3])), range_ratio=0.4)
    readings = Readings.of(dataset, nominal.robot)
    problem = Problem(start, readings, noise.whitening(J, seen.components), free)
    assert problem.size == len(start.geometry.names) + 6 * free
    # Away from the start by several tolerances, and by 3 cm and 0.3 rad of the instrument's pose.
    x = rng.standard_normal(problem.size) * ([2.0] * problem.n_geometry + [30.0] * 3 * free + [300.0] * 3 * free) * away
    found = problem.jacobian(problem.point(x), slice(0, 7))
    h = 1e-3
    for k in range(problem.size):
        ends = []
        for sign in (1.0, -1.0):
            moved = x.copy()
            moved[k] += sign * h
            ends.append(problem.point(moved).model.in_instrument_frame(problem.point(moved).poses))
        step = ends[0].minus(ends[1]) if orientation else ends[0].T - ends[1].T
        # h of a tolerance is about a micrometre: differences are good to 1e-6 of it, and to rounding in the closures.
        np.testing.assert_allclose(
            found[:, :, k],
            (problem.whitening @ step[:, :, None])[:, :, 0] / (2.0 * h),
            rtol=1e-5,
            atol=1e-5 * np.abs(found).max(initial=1.0),
        )


@pytest.mark.slow
@pytest.mark.parametrize("free", [False, True], ids=["robot", "free"])
def test_scipy_finds_the_same_optimum(free):
    _, dataset = case(np.random.default_rng(11), 25, free=free)
    found, q = gtpin.calibrate(dataset), dataset.q
    parameters = names()
    sizes = np.array([tolerance(name) for name in parameters])
    turn = Rotation.from_quat(dataset.orientation, scalar_first=True)
    view = found.model.frame  # scipy starts from here, and moves it by 1e-5 m and rad a unit

    def residual(x):
        T, R = GANTRY.off(dict(zip(parameters, sizes * x[:48], strict=True))).poses(q)
        seen = Rotation.from_matrix(R)
        if free:
            look = Rotation.from_rotvec(1e-5 * x[51:]) * Rotation.from_matrix(view.R)
            T, seen = look.apply(T) + view.T + 1e-5 * x[48:51], look * seen
        residual = np.hstack(
            [(dataset.position - T) / POSITION_SIGMA, (turn * seen.inv()).as_rotvec() / ORIENTATION_SIGMA]
        )
        return np.concatenate([residual.ravel(), x[:48]])

    def jacobian(x):
        # scipy's own steps are too short for a tolerance of a millimetre: rounding would show.
        steps = 1e-3 * np.eye(len(x))
        return np.transpose([(residual(x + step) - residual(x - step)) / 2e-3 for step in steps])

    best = least_squares(residual, np.zeros(54 if free else 48), jacobian, xtol=1e-12, ftol=1e-14, gtol=1e-8)
    values = [dict(zip(parameters, best.x[:48], strict=True))[name] for name in found.names]
    off = (found.model.geometry.deviation / found.model.geometry.tolerance - values) / (
        found.sigma / found.model.geometry.tolerance
    )
    assert np.abs(off).max() < 1e-3
    x = found.model.geometry.deviation / found.model.geometry.tolerance
    assert found.chi2 + x @ x == pytest.approx(2.0 * best.cost, rel=1e-6)
    # The covariance too: J'J at scipy's optimum, by its finite differences.
    covariance = np.linalg.inv(best.jac.T @ best.jac)[:48, :48] * np.outer(sizes, sizes)
    order = [parameters.index(name) for name in found.names]
    np.testing.assert_allclose(found.sigma, np.sqrt(np.diag(covariance))[order], rtol=1e-3)


@pytest.mark.slow
def test_the_free_frame_is_found_from_any_stand():
    rng = np.random.default_rng(0)
    for _ in range(5):
        machine, dataset = case(rng, 60, free=True)
        found = gtpin.calibrate(dataset)
        assert not found.model.frame.is_base
        q = commands(rng, 20)
        T, turn = machine.seen(q)
        poses = found.model.predict(q)
        assert np.abs(poses.T - T).max() < 6 * POSITION_SIGMA
        assert (Rotation.from_matrix(poses.R) * turn.inv()).magnitude().max() < 6 * ORIENTATION_SIGMA


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.parametrize("declared", [True, False])
def test_positions_on_a_straight_line_are_fitted_though_a_free_frame_can_turn_about_it(declared):
    for seed in range(4):
        rng = np.random.default_rng(seed)
        q = np.repeat(
            np.linspace(-0.25, 0.25, 48)[:, None], 3, axis=1
        )  # the carts together: the platform slides along x
        dataset = measured(draw(rng, free=True), q, rng, orientation=False)
        found = gtpin.calibrate(dataset if declared else undeclared(dataset))
        size = np.sqrt((found.residual[:, :3] ** 2).mean())
        assert 0.8 * POSITION_SIGMA < size < 1.2 * POSITION_SIGMA
        assert len(found.unobservable) > 30


def test_a_robot_frame_stays_the_base_frame():
    found = gtpin.calibrate(case(np.random.default_rng(0), 40)[1])
    assert found.model.frame.is_base
    assert np.array_equal(found.model.frame.T, Frame().T)
