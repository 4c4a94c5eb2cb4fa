"""Effects of an earlier model stay as they are while the geometry is identified."""

import warnings
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

import gtpin
from gtpin.cli import app
from gtpin.effects.active import ActiveEffect
from gtpin.effects.situation import References
from gtpin.model.model_folder import write_model
from gtpin.model.predict import predict

PERIOD, AMPLITUDE, PHASE = 0.4, 8e-4, 0.7
SITE = "elbow_joint"
SIGMA = 1e-5
LOW, HIGH = -2.0, 2.0


@pytest.fixture(scope="module")
def robot():
    return gtpin.load_robot("ur5")


def acting(robot, effect="rack_periodic", site=SITE, nonlinear=PERIOD):
    """The effect of the equation in ``machine``, as an earlier fit would have it."""
    known = next(e for e in gtpin.catalogue() if e.id == effect)
    c = AMPLITUDE * np.array([np.cos(PHASE), np.sin(PHASE), 0.0, 0.0])
    fitted = References(
        temperature=20.0,
        time=(0.0, 1.0),
        sessions=(),
        force=(np.zeros(0), np.zeros(0)),
        direction=(np.zeros((0, 3)), np.zeros(0)),
        covariates=(),
        commands=(np.full(6, LOW), np.full(6, HIGH)),
        joints=(np.zeros((7, 6)), np.ones((7, 6))),
    )
    return ActiveEffect(known, site, nonlinear, c, np.zeros((4, 4)), fitted)


def machine(robot, rng):
    """Poses by Pinocchio's forward kinematics of an arm that is off, whose elbow errs by A cos(2 pi q / p - phi)."""
    model = robot.model.copy()
    for joint in range(1, model.njoints):
        model.jointPlacements[joint] = model.jointPlacements[joint] * pin.exp6(3e-4 * rng.standard_normal(6))
    data, frame = model.createData(), model.getFrameId(robot.tcp_frame)
    j = robot.sites.index(SITE)

    def poses(q):
        T, R = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
        for i, row in enumerate(q):
            moved = row.copy()
            moved[j] += AMPLITUDE * np.cos(2.0 * np.pi * row[j] / PERIOD - PHASE)
            pin.framesForwardKinematics(model, data, moved)
            T[i], R[i] = data.oMf[frame].translation, data.oMf[frame].rotation
        return T, R

    return poses


def measured(poses, rng, count=60):
    """Poses of a machine as a tracker somewhere reads them, with noise."""
    q = rng.uniform(LOW, HIGH, (count, 6))
    T, R = poses(q)
    turn, shift = Rotation.from_rotvec([0.3, -0.2, 1.0]), np.array([2.0, -1.0, 0.4])
    noise = Rotation.from_rotvec(SIGMA * rng.standard_normal((count, 3)))
    read = noise * turn * Rotation.from_matrix(R)
    return gtpin.Dataset(
        robot="ur5",
        pose=[str(i) for i in range(count)],
        q=q,
        position=turn.apply(T) + shift + SIGMA * rng.standard_normal((count, 3)),
        orientation=read.as_quat(scalar_first=True),
        instrument=gtpin.data.Instrument(position_sigma=SIGMA, orientation_sigma=SIGMA, frame="free"),
    )


@pytest.fixture(scope="module")
def case(robot):
    rng = np.random.default_rng(11)
    poses = machine(robot, rng)
    return poses, measured(poses, rng)


def off(model, data):
    """RMS distance of predicted and measured positions, m."""
    found = model.predict(data.q, data.covariates)
    return float(np.sqrt(((found.T - data.position) ** 2).sum(axis=1).mean()))


@pytest.mark.slow
def test_geometry_and_kept_effects_together_predict_other_poses(robot, case):
    poses, data = case
    fitted = gtpin.calibrate(data, keep_effects=[acting(robot)])
    other = measured(poses, np.random.default_rng(12), 200)
    assert off(fitted.model, other) < 3.0 * SIGMA
    assert 0.7 < fitted.chi2_per_dof < 1.4
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        assert off(gtpin.calibrate(data).model, other) > 10.0 * SIGMA


@pytest.mark.slow
def test_without_effects_the_calibration_is_the_usual_one(case):
    _, data = case
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        usual, same = gtpin.calibrate(data), gtpin.calibrate(data, keep_effects=[])
    np.testing.assert_array_equal(same.values, usual.values)


@pytest.mark.slow
def test_what_only_one_day_had_is_left_out_with_a_warning(robot, case):
    _, data = case
    shift = acting(robot, "frame_shift", "frame", None)
    with pytest.warns(gtpin.GtpinWarning, match="frame_shift@frame"):
        fitted = gtpin.calibrate(data, keep_effects=[acting(robot), shift])
    assert [active.name for active in fitted.model.effects] == [f"rack_periodic@{SITE}"]


def test_an_effect_of_another_robot_is_refused(robot, case):
    _, data = case
    with pytest.raises(gtpin.GtpinError, match="cart1"):
        gtpin.calibrate(data, keep_effects=[acting(robot, site="cart1")])


def test_readings_of_other_instruments_are_refused(robot, case, tmp_path):
    made = CliRunner().invoke(
        app, ["simulate", "--robot", "ur5", "--instrument", "range", "--poses", "40", "-o", str(tmp_path / "wire")]
    )
    assert made.exit_code == 0, made.output
    with pytest.raises(gtpin.GtpinError, match="one tracker"):
        gtpin.calibrate(gtpin.Dataset.read(tmp_path / "wire"), keep_effects=[acting(robot)])


@pytest.mark.slow
def test_commands_outside_the_range_of_the_fit_are_said(robot, case):
    _, data = case
    model = gtpin.calibrate(data, keep_effects=[acting(robot)]).model
    q = np.zeros((4, 6))
    q[1:3, robot.sites.index(SITE)] = HIGH + 0.5, LOW - 0.5
    commands = gtpin.Commands(pose=list("abcd"), q=q)
    with pytest.warns(gtpin.GtpinWarning, match=r"2 of 4 commands of elbow_joint .* extrapolated"):
        predict(model, commands)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        predict(model, replace(commands, q=np.zeros((4, 6))))


@pytest.mark.slow
def test_the_command_keeps_the_effects_of_a_folder(robot, case, tmp_path):
    _, data = case
    earlier = gtpin.calibrate(data, keep_effects=[acting(robot)]).model
    write_model(earlier, tmp_path / "earlier")
    data.save(tmp_path / "data")
    done = CliRunner().invoke(
        app,
        ["calibrate", str(tmp_path / "data"), "--keep-effects", str(tmp_path / "earlier"), "-o", str(tmp_path / "out")],
    )
    assert done.exit_code == 0, done.output
    again = gtpin.read_model(tmp_path / "out")
    assert [active.name for active in again.effects] == [f"rack_periodic@{SITE}"]
    assert off(again, data) < 3.0 * SIGMA
