"""What a robot is asked first: forward, inverse and Jacobian, of every kind of chain, for one command and for many."""

from __future__ import annotations

import pickle
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import gtpin
from gtpin.errors import ClosureError, ModelError, UnreachableError
from gtpin.export import export
from gtpin.kinematics.rotations import log
from gtpin.robot.library import urdf_path

FIVE_BAR = str(Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf")
OPEN = ("ur5", "panda", "z1", "talos_left_arm", "allegro_left_hand")
"""Arms with six and more joints, and a hand, which is a tree; joints of the gripper are among them."""
CLOSED = ("gantry_tau", "stewart", FIVE_BAR)
"""Rods with three and with six actuators, and a planar loop."""
COUNT = 12


@pytest.fixture(scope="module", params=[*CLOSED, *OPEN], ids=lambda kind: Path(kind).stem)
def robot(request: pytest.FixtureRequest) -> gtpin.Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)  # of fingers that do not move the TCP
        return gtpin.load_robot(request.param)


@pytest.fixture
def q(robot: gtpin.Robot) -> np.ndarray:
    """Commands (N, n) over most of the ranges of an open chain, and over half of those of loops, about home."""
    middle, half = (robot.upper + robot.lower) / 2.0, (robot.upper - robot.lower) / 2.0
    share = 0.5 if robot.constraints else 0.9
    return middle + share * half * np.random.default_rng(0).uniform(-1.0, 1.0, (COUNT, robot.n_actuators))


def test_many_commands_give_what_each_of_them_gives(robot: gtpin.Robot, q: np.ndarray) -> None:
    poses, J = robot.forward(q), robot.jacobian(q)
    for i in range(COUNT):
        one = robot.forward(list(q[i]))
        np.testing.assert_allclose(poses.T[i], one.T, rtol=0, atol=1e-11)
        np.testing.assert_allclose(poses.R[i], one.R, rtol=0, atol=1e-11)
        np.testing.assert_allclose(J[i], robot.jacobian(tuple(q[i])), rtol=0, atol=1e-10)
        np.testing.assert_array_equal(one.tcp.translation, one.T)


def test_the_jacobian_is_the_derivative_of_the_pose(robot: gtpin.Robot, q: np.ndarray) -> None:
    J, h = robot.jacobian(q), 1e-5
    for k in range(robot.n_actuators):
        step = h * np.eye(robot.n_actuators)[k]
        ahead, behind = robot.forward(q + step), robot.forward(q - step)
        turn = log(ahead.R @ np.swapaxes(behind.R, 1, 2))
        np.testing.assert_allclose(J[:, :, k], np.hstack([ahead.T - behind.T, turn]) / (2.0 * h), rtol=0, atol=1e-6)


@pytest.mark.slow
def test_inverse_finds_commands_within_their_ranges_for_every_pose_that_there_is(
    robot: gtpin.Robot, q: np.ndarray
) -> None:
    poses = robot.forward(q)
    whole = np.tile(np.eye(4), (COUNT, 1, 1))
    whole[:, :3, :3], whole[:, :3, 3] = poses.R, poses.T
    for wanted, turned in (((poses,), True), ((poses.T, poses.R), True), ((whole,), True), ((poses.T,), False)):
        found = robot.inverse(*wanted)
        assert found.shape == q.shape
        assert (found >= robot.lower - 1e-9).all()
        assert (found <= robot.upper + 1e-9).all()
        there = robot.forward(found)
        np.testing.assert_allclose(there.T, poses.T, rtol=0, atol=1e-9)
        assert not turned or np.abs(log(there.R @ np.swapaxes(poses.R, 1, 2))).max() < 1e-9
    one = robot.forward(q[0])
    for same in ((one,), (one.tcp,), (one.tcp.homogeneous,), (one.T, one.R)):
        np.testing.assert_array_equal(robot.inverse(*same), robot.inverse(one.T, one.R))


def test_a_start_at_a_solution_is_kept(robot: gtpin.Robot, q: np.ndarray) -> None:
    poses = robot.forward(q)
    np.testing.assert_allclose(robot.inverse(poses, start=q), q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(robot.inverse(poses.T[0], poses.R[0], start=q[0]), q[0], rtol=0, atol=1e-9)


@pytest.fixture(scope="module")
def ur5() -> gtpin.Robot:
    return gtpin.load_robot("ur5")


@pytest.fixture(scope="module")
def gantry() -> gtpin.Robot:
    return gtpin.load_robot("gantry_tau")


FAR = [9.0, 0.0, 0.0]
MISTAKES: dict[str, tuple[Callable[[gtpin.Robot, gtpin.Robot], object], type[Exception], str]] = {
    "an arm's position": (lambda arm, _: arm.inverse(FAR), UnreachableError, r"ur5.*\(9, 0, 0\); stay inside"),
    "a machine's": (lambda _, m: m.inverse(FAR), UnreachableError, "gantry_tau.*; stay inside the workspace"),
    "one of many": (lambda arm, _: arm.inverse([[0.4, 0.2, 0.3], FAR]), UnreachableError, "^row 1: ur5"),
    "a rotation": (lambda _, m: m.inverse(m.forward(m.home_q).T, pin.exp3(np.ones(3))), UnreachableError, "leave"),
    "no number": (lambda arm, _: arm.inverse([np.nan, 0.0, 0.0]), UnreachableError, "give finite numbers"),
    "commands apart": (lambda _, m: m.forward([-2.0, 0.0, 2.0]), ClosureError, "gantry_tau.*; stay"),
    "one of them": (lambda _, m: m.jacobian([[0, 0, 0], [-2.0, 0, 2.0]]), ClosureError, "^row 1: .*; stay"),
    "few commands": (lambda arm, _: arm.forward([0.0, 0.0]), ModelError, r"\(2,\) for ur5; give 6 finite numbers"),
    "cubes of them": (lambda arm, _: arm.jacobian(np.zeros((2, 2, 6))), ModelError, "N rows of 6"),
    "words": (lambda arm, _: arm.forward("home"), ModelError, "ur5 are str without numbers; give 6"),
    "complex numbers": (lambda arm, _: arm.forward(np.zeros(6, complex)), ModelError, "are complex numbers; give 6"),
    "truth values": (lambda _, m: m.jacobian([True, False, True]), ModelError, "are truth values; give 3"),
    "dates": (lambda arm, _: arm.forward(np.zeros(6, "datetime64[s]")), ModelError, "are dates; give 6"),
    "masked": (lambda arm, _: arm.forward(np.ma.array(np.zeros(6), mask=[1, 0, 0, 0, 0, 0])), ModelError, "masked"),
    "astronomical": (lambda arm, _: arm.forward(np.full((2, 6), 1e20)), ModelError, "1e[+]20 for ur5; give m and rad"),
    "a huge integer": (
        lambda arm, _: arm.forward([10**400] * 6),
        ModelError,
        "are integers too large for a float; give 6",
    ),
    "a complex position": (lambda arm, _: arm.inverse(np.zeros(3, complex)), ModelError, "are complex numbers; give"),
    "a seed below 0": (lambda *_: gtpin.analyse(gtpin.read_model("ur5"), seed=-1), ModelError, "seed=-1; give"),
    "endless": (lambda _, m: m.forward([np.inf, 0.0, 0.0]), ModelError, "give 3 finite numbers"),
    "half a position": (lambda arm, _: arm.inverse([0.0, 0.0]), ModelError, r"\(2,\); give"),
    "a dictionary": (lambda arm, _: arm.inverse({"x": 1.0}), ModelError, "are dict without numbers; give"),
    "rotations for one": (lambda arm, _: arm.inverse(np.zeros(3), np.zeros((2, 3, 3))), ModelError, "each position"),
    "two starts": (lambda arm, _: arm.inverse(np.zeros((3, 3)), start=np.zeros((2, 6))), ModelError, "one for each"),
    "no robot": (lambda *_: gtpin.load_robot("gantry_tao"), gtpin.GtpinError, "did you mean gantry_tau"),
    "no file": (lambda *_: gtpin.load_robot("nowhere.urdf"), gtpin.GtpinError, "nowhere.urdf"),
    "no dataset": (lambda *_: gtpin.Dataset.read("nowhere"), gtpin.GtpinError, "nowhere"),
    "no model": (lambda *_: gtpin.read_model("nowhere/"), gtpin.GtpinError, "nowhere"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_ends_in_one_line_that_says_what_to_do(ur5: gtpin.Robot, gantry: gtpin.Robot, mistake: str) -> None:
    call, kind, said = MISTAKES[mistake]
    with pytest.raises(kind, match=said) as caught:
        call(ur5, gantry)
    shown = "".join(traceback.format_exception(caught.value))
    assert shown.count("Traceback") == 1  # no error before it, of a library
    assert shown.rstrip().splitlines()[-1] == f"gtpin.errors.{type(caught.value).__name__}: {caught.value}"


KINDS = {
    "analyse": (gtpin.analyse, ("ur5",), "read_model"),
    "calibrate": (gtpin.calibrate, ("measured",), "Dataset.read"),
    "certify": (gtpin.certify, ("measured",), "Dataset.read"),
    "diagnose": (gtpin.diagnose, ("measured",), "Dataset.read"),
    "export": (export, ("ur5", "ur5.xml"), "read_model"),
    "home": (gtpin.home, ("ur5",), "load_robot"),
    "plan": (gtpin.plan, ("ur5", "calibration", 10), "read_model"),
    "write_model": (gtpin.write_model, ("ur5", "folder"), "read_model"),
}


@pytest.mark.parametrize("name", KINDS)
def test_a_name_in_the_place_of_what_it_names_is_an_error_that_says_how_to_read_it(name: str) -> None:
    function, arguments, hint = KINDS[name]
    with pytest.raises(gtpin.GtpinError, match=f"a str where .*{hint}"):
        function(*arguments)


def test_a_robot_moves_on_after_it_was_sent_to_another_process(gantry: gtpin.Robot) -> None:
    sent = pickle.loads(pickle.dumps(gantry))
    assert type(sent) is gtpin.Robot is type(gtpin.Robot.from_urdf(urdf_path("gantry_tau")))
    np.testing.assert_array_equal(sent.forward([0.1, 0.2, 0.1]).T, gantry.forward([0.1, 0.2, 0.1]).T)
