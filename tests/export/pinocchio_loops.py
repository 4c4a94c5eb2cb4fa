"""A Pinocchio model with point constraints, closed by the tests' own Newton."""

from __future__ import annotations

from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

import gtpin

Anchor = tuple[int, "pin.SE3"]


def anchor(model: pin.Model, element: Element | None) -> Anchor:
    """The point that <link1> or <link2> tells, on a joint."""
    assert element is not None
    frame = model.frames[model.getFrameId(element.get("link"), pin.FrameType.BODY)]
    point = np.array([float(x) for x in element.get("xyz", "").split()])
    return frame.parentJoint, frame.placement * pin.SE3(np.eye(3), point)


class Loops:
    """Anchors that must coincide, and the driven joints in the order of q."""

    def __init__(self, model: pin.Model, ends: list[tuple[Anchor, ...]], drives: list[str]) -> None:
        self.model, self.data, self.ends = model, model.createData(), ends
        joints = [model.getJointId(name) for name in drives]
        self.driven = [model.idx_vs[j] for j in joints]
        self.driven_q = [model.idx_qs[j] for j in joints]
        self.free = np.setdiff1d(np.arange(model.nv), self.driven)

    def worst(self, robot: gtpin.Robot, q: np.ndarray, poses: gtpin.Poses) -> tuple[float, float]:
        """Largest difference, m and rad, to poses at commands q (N, n), each reached from home in small strides."""
        home, position, turn = robot.home_q, 0.0, 0.0
        start = self.closed(self.with_drives(pin.neutral(self.model), home))
        frame = self.model.getFrameId(robot.tcp_frame, pin.FrameType.BODY)
        for row, T, R in zip(q, poses.T, poses.R, strict=True):
            x = start
            for share in np.linspace(0.0, 1.0, 9)[1:]:
                x = self.closed(self.with_drives(x, home + share * (row - home)))
            pin.framesForwardKinematics(self.model, self.data, x)
            there = self.data.oMf[frame]
            position = max(position, float(np.abs(there.translation - T).max()))
            turn = max(turn, float(np.linalg.norm(pin.log3(there.rotation @ R.T))))
        return position, turn

    def with_drives(self, x: np.ndarray, q: np.ndarray) -> np.ndarray:
        x = x.copy()
        x[self.driven_q] = q
        return x

    def closed(self, x: np.ndarray) -> np.ndarray:
        for _ in range(30):
            pin.computeJointJacobians(self.model, self.data, x)
            gap, J = zip(*(self._gap(*pair) for pair in self.ends), strict=True)
            if np.abs(np.concatenate(gap)).max() < 1e-12:
                return x
            step = np.zeros(self.model.nv)
            step[self.free] = np.linalg.solve(np.vstack(J)[:, self.free], -np.concatenate(gap))
            x = pin.integrate(self.model, x, step)
        raise AssertionError("the loops don't close")

    def _gap(self, one: Anchor, other: Anchor) -> tuple[np.ndarray, np.ndarray]:
        (p, J), (r, K) = self._point(*one), self._point(*other)
        return p - r, J - K

    def _point(self, joint: int, placement: pin.SE3) -> tuple[np.ndarray, np.ndarray]:
        where = self.data.oMi[joint]
        arm = where.rotation @ placement.translation
        if joint == 0:
            return arm, np.zeros((3, self.model.nv))
        J = pin.getJointJacobian(self.model, self.data, joint, pin.LOCAL_WORLD_ALIGNED)
        return where.translation + arm, J[:3] - pin.skew(arm) @ J[3:]
