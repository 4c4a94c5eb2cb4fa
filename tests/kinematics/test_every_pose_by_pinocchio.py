"""All poses of a calibration and of a diagnosis, in every iteration, are computed by Pinocchio's joint Jacobians."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from closures import nominal

import gtpin
from gtpin.kinematics.copies import Copies
from gtpin.kinematics.kinematics import Kinematics

Floats = np.ndarray


@dataclass
class Counted:
    """Poses that Pinocchio computed, numbers of poses that kinematics were asked for, and largest differences, m and rad, of
    some of them from Pinocchio's forward kinematics of one copy."""

    computed: int = 0
    asked: list[int] = field(default_factory=list)
    unaccounted: int = 0
    differences: list[float] = field(default_factory=list)


def one_copy(kinematics: Kinematics, configuration: Floats) -> pin.SE3:
    """The TCP by forward kinematics of a model that has the geometry's placements."""
    robot, placements = kinematics.robot, kinematics.placed.placements
    model = robot.model.copy()
    for j in range(1, model.njoints):
        numbers = placements[j - 1]
        model.jointPlacements[j] = pin.SE3(numbers[:9].reshape(3, 3).T, numbers[9:])
    data = model.createData()
    pin.forwardKinematics(model, data, configuration)
    return data.oMi[robot.tcp_joint] * kinematics.tcp


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counted:
    count = Counted()
    plain, joints = pin.computeJointJacobians, Copies.joints

    def computing(model: Any, data: Any, configuration: Floats) -> Any:
        count.computed += len(configuration) // 22  # of the Gantry-Tau
        return plain(model, data, configuration)

    def batch(self: Copies, X: Floats, placements: Floats) -> tuple[Floats, Floats]:
        before = count.computed
        found = joints(self, X, placements)
        count.unaccounted += max(0, len(X) - (count.computed - before))
        return found

    def asked(method: Callable[..., gtpin.Poses]) -> Callable[..., gtpin.Poses]:
        def ask(self: Kinematics, q: Floats, *rest: Any) -> gtpin.Poses:
            before = count.computed
            poses = method(self, q, *rest)
            count.asked.append(len(q))
            count.unaccounted += max(0, int(poses.reached.sum()) - (count.computed - before))
            if method.__name__ == "forward" and poses.reached.any():
                i, assured = int(np.flatnonzero(poses.reached)[-1]), poses.configuration
                there = one_copy(self, assured[i])
                off = np.abs(there.translation - poses.T[i]).max(), np.abs(there.rotation - poses.R[i]).max()
                count.differences.append(float(max(off)))
            return poses

        return ask

    monkeypatch.setattr(pin, "computeJointJacobians", computing)
    monkeypatch.setattr(Copies, "joints", batch)
    for name in ("forward", "displaced"):
        monkeypatch.setattr(Kinematics, name, asked(getattr(Kinematics, name)))
    return count


def measured(count: int) -> gtpin.Dataset:
    """Poses of a Gantry-Tau with two lengths off, read with noise."""
    machine, rng = nominal("gantry_tau"), np.random.default_rng(7)
    return machine.off({"length[2a]": 1e-3, "length[3b]": -7e-4}).measured(machine.commands(count, seed=8), rng)


@pytest.mark.slow
@pytest.mark.parametrize("run", [gtpin.calibrate, gtpin.diagnose])
def test_every_pose_of_every_iteration_is_pinocchio_s(counted: Counted, run: Callable[..., Any]) -> None:
    dataset = measured(60)
    found = run(dataset)
    calibration = found if run is gtpin.calibrate else gtpin.calibrate(dataset)
    assert calibration.iterations >= 2
    assert counted.computed >= len(dataset) * calibration.iterations
    assert sum(counted.asked) >= len(dataset) * calibration.iterations
    assert counted.unaccounted == 0
    assert max(counted.differences) <= 1e-13 * gtpin.load_robot("gantry_tau").size


@pytest.mark.slow
def test_without_pinocchio_s_joint_jacobians_there_is_no_calibration(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: Any) -> None:
        raise RuntimeError("no joint Jacobians")

    dataset = measured(60)
    gtpin.load_robot("gantry_tau")
    monkeypatch.setattr(Copies, "joints", refused)
    for run in (gtpin.calibrate, gtpin.diagnose):
        with pytest.raises(RuntimeError, match="no joint Jacobians"):
            run(dataset)
