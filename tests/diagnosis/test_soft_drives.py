"""Two drives of a UR5 that give way under its own weight, and a wheel that is off its axis: by Pinocchio and SciPy alone."""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from diagnosed import quietly
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.diagnosis.result import Diagnosis

pytestmark = pytest.mark.slow

POSES, SHIFT, TURN = 180, 2e-5, 8e-5
MIDDLE, HALF = np.array([0.0, -1.2, 1.2, 0.0, 0.8, 0.0]), np.array([1.2, 0.6, 0.7, 1.6, 1.2, 2.0])
"""Of the commands, rad: the first wrist joint moves through half a turn."""
GIVES = np.array([0.0, 4e-5, 7e-5, 0.0, 0.0, 0.0])
"""Compliances of the drives, rad/(N m)."""
WHEEL = 7e-4
"""Error of the first wrist joint once a turn, rad."""
TARGET, AWAY, FRAME = np.array([0.03, 0.02, 0.1]), np.array([2.0, 1.0, 0.5]), Rotation.from_rotvec([0.2, 0.1, 1.0])


@cache
def diagnosed(seed: int) -> Diagnosis:
    """Poses of a tracker whose frame and target nobody knows."""
    rng, robot = np.random.default_rng(seed), gtpin.load_robot("ur5")
    model, q = robot.model.copy(), MIDDLE + HALF * rng.uniform(-1.0, 1.0, (POSES, 6))
    data = model.createData()
    weight = np.array([-pin.computeGeneralizedGravity(model, data, one) for one in q])
    for joint in range(1, model.njoints):
        model.jointPlacements[joint] = model.jointPlacements[joint] * pin.exp6(rng.normal(0.0, 2e-4, 6))
    there = q + GIVES * weight + rng.normal(0.0, 8e-6, q.shape)
    there[:, 3] += WHEEL * np.cos(q[:, 3] - 0.7)
    data, T, R = model.createData(), np.empty((POSES, 3)), np.empty((POSES, 3, 3))
    for n, one in enumerate(there):
        pin.framesForwardKinematics(model, data, one)
        tool = data.oMf[model.getFrameId(robot.tcp_frame)]
        T[n], R[n] = tool.translation + tool.rotation @ TARGET, tool.rotation
    turn = Rotation.from_rotvec(rng.normal(0.0, TURN, (POSES, 3))) * FRAME * Rotation.from_matrix(R)
    return quietly(
        gtpin.diagnose,
        gtpin.Dataset(
            "ur5",
            np.array([f"p{n}" for n in range(POSES)]),
            q,
            FRAME.apply(T) + AWAY + rng.normal(0.0, SHIFT, T.shape),
            turn.as_quat(scalar_first=True),
            {},
            {"position_sigma": SHIFT, "orientation_sigma": TURN, "frame": "free", "target": "free"},
        ),
    )


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_two_drives_that_give_way_are_not_all_links_that_bend(seed: int) -> None:
    """Each alone explains less than all links do."""
    found = diagnosed(seed)
    leaders = {(cause.effect, cause.site): cause.probability for cause in found.causes}
    assert leaders["joint_compliance", "elbow_joint"] >= 0.9
    assert ("link_compliance", "arm") not in leaders
    held = {(member.effect, member.site) for cause in found.causes for member in cause.members}
    assert ("joint_compliance", "shoulder_lift_joint") in held


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_line_once_a_turn_that_is_seen_through_half_a_turn_has_no_second_period(seed: int) -> None:
    found = diagnosed(seed)
    wrist = [cause for cause in found.causes if cause.site == "wrist_1_joint"]
    assert ("rack_periodic", "wrist_1_joint") in {(m.effect, m.site) for cause in wrist for m in cause.members}
    assert not any("period_2" in cause.parameters for cause in found.causes)
