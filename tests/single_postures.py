"""One posture of one copy of a robot by Pinocchio's own functions: what the batches of the kinematics must equal."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import gtpin
from gtpin.kinematics.kinematics import Kinematics
from gtpin.robot.description import RobotDescription
from gtpin.robot.parameters import DIRECTIONS, Parameter, rotation_axes

Floats = np.ndarray

STRIDE = 0.02
"""Largest step of a command on the way from home, m or rad."""


def written(geometry: gtpin.Geometry) -> gtpin.Robot:
    """The robot of the URDF that carries a geometry."""
    return gtpin.Robot(RobotDescription.parse(Kinematics(geometry).urdf()))


def by_own(geometry: gtpin.Geometry, own: gtpin.Geometry) -> Floats:
    """(p, p) derivative of the parameters of the written robot, at their nominal values, by those of the geometry.

    They differ where a parameter turns: twists are about turned axes, scales relative to the travel.
    """
    assert own.names == geometry.names
    found = np.eye(len(own.names))
    places = {(p.kind, p.part, p.component): i for i, p in enumerate(own.parameters)}
    for kind, part in {(p.kind, p.part) for p in own.parameters}:
        if kind in ("placement", "platform"):
            block = [places[kind, part, c] for c in range(6)]
            found[np.ix_(block, block)] = pin.Jexp6(geometry.deviation[block])
        elif kind in DIRECTIONS:
            block = [places[kind, part, c] for c in range(2)]
            owner = geometry.robot.sites.index(part)
            axes, moved = (rotation_axes(g.robot.actuators[owner].axis)[:2] for g in (geometry, own))
            turn = geometry.deviation[block] @ axes
            # Rates of a rotation vector to the left: the right Jacobian of the opposite vector.
            found[np.ix_(block, block)] = moved @ pin.Jexp3(-turn) @ axes.T
        elif kind == "scale":
            own_place = places[kind, part, 0]
            found[own_place, own_place] = 1.0 / geometry.scale[geometry.robot.sites.index(part)]
    return found


class Single:
    """Pinocchio's data at a configuration X (nq,) whose loops are closed; ``q``: (n,) the commands."""

    def __init__(self, robot: gtpin.Robot, q: Floats, X: Floats) -> None:
        self.robot, self.q, self.X = robot, np.array(q, dtype=float), X
        self.data = robot.model.createData()
        pin.computeJointJacobians(robot.model, self.data, X)
        self._constraints = pin.StdVec_ConstraintData()
        for model in robot.constraint_models:
            self._constraints.append(model.createData())
            model.calc(robot.model, self.data, self._constraints[-1])

    @staticmethod
    def at(robot: gtpin.Robot, q: Floats, start: Single | None = None) -> Single:
        """By Newton's method along the straight line from home, or from another posture, in strides that are always short."""
        here = start or Single(robot, robot.home_q, robot.assembly.configuration).closed(robot.home_q)
        way = np.asarray(q) - here.q
        strides = int(np.ceil(np.abs(way).max() / STRIDE))
        begin = here.q
        for k in range(1, strides + 1):
            here = here.closed(begin + k / strides * way)
        return here

    def closed(self, q: Floats) -> Single:
        """Newton's method at other commands, without safeguards."""
        here = Single(self.robot, q, self.robot.with_commands(self.X, q))
        for _ in range(10):
            gaps = here.gaps
            if np.abs(gaps).max(initial=0.0) <= 1e-15 * self.robot.size:
                break
            V = self.robot.fold[:, self.robot.passive] @ (-here._inverse @ gaps)
            here = Single(self.robot, q, pin.integrate(self.robot.model, here.X, V))
        assert np.abs(here.gaps).max(initial=0.0) <= 1e-14 * self.robot.size
        return here

    def anchor(self, index: int) -> Floats:
        """(3,) position of a loop's anchor, base frame, m."""
        joint, placement = self.robot.anchors[index]
        return np.asarray((self.data.oMi[joint] * placement).translation)

    @property
    def gaps(self) -> Floats:
        """(m,) the loop equations: the gap between the anchors of each loop, in the first anchor's frame, m."""
        loops = range(len(self.robot.constraints))
        whole = [self.to_gap(i, self.anchor(2 * i + 1) - self.anchor(2 * i)) for i in loops]
        return self.robot.closing(np.concatenate([np.zeros(0), *whole]))

    def to_gap(self, loop: int, motion: Floats) -> Floats:
        """(3, ...) a loop's gap in the first anchor's frame from that (3, ...) in the base frame."""
        joint, placement = self.robot.anchors[2 * loop]
        return np.asarray((self.data.oMi[joint] * placement).rotation.T @ motion)

    @property
    def constraint_jacobian(self) -> Floats:
        """(m, nv) derivative of the gaps by the velocities, by ``pinocchio.getConstraintsJacobian``."""
        robot, nv = self.robot, self.robot.model.nv
        if not robot.constraints:
            return np.zeros((0, nv))
        J = pin.getConstraintsJacobian(robot.model, self.data, robot.constraint_models, self._constraints)
        return robot.closing(robot.folded(np.reshape(J, (-1, nv))))

    @property
    def _inverse(self) -> Floats:
        """(p, m) pseudoinverse of the passive columns."""
        left, sizes, rows = np.linalg.svd(self.constraint_jacobian[:, self.robot.passive], full_matrices=False)
        rank = self.robot.rank
        return (rows[:rank].T / sizes[:rank]) @ left[:, :rank].T

    @property
    def tcp(self) -> pin.SE3:
        """The TCP in the base frame."""
        return self.data.oMi[self.robot.tcp_joint] * self.robot.tcp_placement

    @property
    def tcp_jacobian(self) -> Floats:
        """(6, nv) derivative of the TCP by the velocities, base frame."""
        robot = self.robot
        frame = robot.tcp_joint, robot.tcp_placement, pin.LOCAL_WORLD_ALIGNED
        J = pin.getFrameJacobian(robot.model, self.data, *frame)
        return robot.folded(np.reshape(np.array(J), (6, robot.model.nv)))

    def by_gaps(self, gaps: Floats) -> Floats:
        """(6 + k, ...) motion that closes gaps (3 L, ...) in the loops: of the TCP, and of the measured joints."""
        x = -self._inverse @ self.robot.closing(gaps)
        own = np.searchsorted(self.robot.passive, [joint.index_v for joint in self.robot.measured_joints])
        return np.concatenate([self.tcp_jacobian[:, self.robot.passive] @ x, x[own]])

    @property
    def jacobian(self) -> Floats:
        """(6, n) derivative of the TCP by the commands."""
        driven, passive = self.robot.driven, self.robot.passive
        x = -self._inverse @ self.constraint_jacobian[:, driven]
        return self.tcp_jacobian[:, driven] + self.tcp_jacobian[:, passive] @ x

    @property
    def by_placements(self) -> Floats:
        """(6 + k, 6 J) motion by twists of the joints' placements, in their own axes: Pinocchio's kinematic regressor."""
        robot = self.robot
        tcp = self._regressor(robot.tcp_joint, robot.tcp_placement)
        gaps = np.zeros((3 * len(robot.constraints), tcp.shape[1]))
        for i in range(len(robot.constraints)):
            first, second = (self._regressor(*robot.anchors[2 * i + end]) for end in (0, 1))
            # The gap across a planar loop, where the joints have play, is not zero: it rotates with the first anchor.
            gap = self.anchor(2 * i + 1) - self.anchor(2 * i)
            turning = np.cross(first[3:], gap, axisa=0, axisc=0)
            gaps[3 * i : 3 * i + 3] = self.to_gap(i, second[:3] - first[:3] - turning)
        found = self.by_gaps(gaps)
        found[:6] += tcp
        return found

    def _regressor(self, joint: int, placement: pin.SE3) -> Floats:
        model = self.robot.model
        if joint == 0:
            return np.zeros((6, 6 * (model.njoints - 1)))
        found = pin.computeJointKinematicRegressor(model, self.data, joint, pin.LOCAL_WORLD_ALIGNED, placement)
        return np.array(found)

    def by_anchor(self, index: int, motion: Floats) -> Floats:
        """(6 + k,) motion by a displacement (3,) of a loop's anchor, base frame, m."""
        gaps = np.zeros(3 * len(self.robot.constraints))
        sign = 1.0 if index % 2 else -1.0  # the gap goes from the first anchor to the second
        gaps[3 * (index // 2) : 3 * (index // 2) + 3] = self.to_gap(index // 2, sign * motion)
        return self.by_gaps(gaps)

    def by_parameters(self, geometry: gtpin.Geometry) -> Floats:
        """(6 + k, p) derivative by the parameters of a geometry of this robot, all at their nominal values."""
        assert not geometry.deviation.any()
        placed = self.by_placements
        columns = [self._by_parameter(p, placed) for p in geometry.parameters]
        return np.array(columns).reshape(-1, self.robot.motion_size).T

    def _by_parameter(self, p: Parameter, placed: Floats) -> Floats:
        robot, found = self.robot, np.zeros(self.robot.motion_size)
        if p.kind == "placement":
            return placed[:, 6 * (robot.model.getJointId(p.part) - 1) + p.component]
        if p.kind == "platform":
            found[p.component // 3 * 3 :][:3] = np.asarray(self.tcp.rotation)[:, p.component % 3]
            return found
        if p.kind == "anchor":
            loops = robot.description.loops
            names = [f"{loop.name}.{end.link}" for loop in loops for end in (loop.anchor1, loop.anchor2)]
            anchor = names.index(p.part)
            turn = self.data.oMi[robot.anchors[anchor][0]].rotation @ robot.anchor_axes[anchor]
            return self.by_anchor(anchor, turn[:, p.component])
        if p.kind == "scale":
            found[:6] = (self.jacobian * self.q)[:, robot.sites.index(p.part)]
            return found
        if p.kind in DIRECTIONS:
            return self._turned(p, placed)
        rod = next(rod for rod in robot.rods if rod.name == p.part)
        if p.kind == "length":
            along = self.anchor(rod.tip) - self.data.oMi[rod.joint_id].translation
            return self.by_anchor(rod.tip, along / np.linalg.norm(along))
        if p.kind == "platform_joint":
            return self._twisted(placed, rod.joint_id, robot.tcp_placement.rotation[:, p.component], np.zeros(3))
        return self.by_anchor(rod.seat, self._now(rod.carrier, np.eye(3)[p.component]))

    def _turned(self, p: Parameter, placed: Floats) -> Floats:
        """The joint's placement rotates, and the anchors on its carrier rotate back to their places at the command 0."""
        robot, a = self.robot, self.robot.sites.index(p.part)
        actuator = robot.actuators[a]
        turn = rotation_axes(actuator.axis)[p.component]
        found = self._twisted(placed, actuator.joint_id, np.zeros(3), turn)
        for rod in robot.rods:
            if rod.carrier == a:
                found = found - self.by_anchor(rod.seat, self._now(a, np.cross(turn, rod.C - actuator.origin)))
        return found

    def _now(self, carrier: int | None, motion: Floats) -> Floats:
        """A motion (3,), base frame, of a rod's seat at the command 0, as its carrier has turned it since."""
        if carrier is None or not self.robot.actuators[carrier].revolute:
            return motion
        return pin.exp3(self.robot.actuators[carrier].axis * self.q[carrier]) @ motion

    def _twisted(self, placed: Floats, joint: int, shift: Floats, turn: Floats) -> Floats:
        """By a motion of a joint's placement in the axes of its parent."""
        back = self.robot.model.jointPlacements[joint].rotation.T
        return placed[:, 6 * (joint - 1) : 6 * joint] @ np.concatenate([back @ shift, back @ turn])
