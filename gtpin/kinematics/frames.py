"""First- and second-order motion of any frame of a closed chain by the commands, the forces that it takes, and its inertia.

With velocities v of the n commands, Pinocchio's joints have the velocities V = G v and, with accelerations a, the accelerations
A = G a + c. G closes the loops to first order. c closes what the anchors' accelerations open at constant v:
Pinocchio's ``constraint_acceleration_error``, the second derivative of the closure equations. Followers (``<mimic>``) are in G
and c, and passive motions that the loops do not determine are as small as can be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
import pinocchio as pin

from gtpin.errors import ModelError, listed
from gtpin.kinematics.copies import copies
from gtpin.kinematics.dynamics import Forces, loads
from gtpin.kinematics.kinematics import nominal
from gtpin.kinematics.placed import rotation
from gtpin.kinematics.rotations import skew
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

Frame = tuple[int, pin.SE3]
"""A frame: the Pinocchio joint that carries it, and its placement on this joint, m."""


def frame_of(robot: Chain, name: str | None) -> Frame:
    """The frame of a link, or of another frame of Pinocchio's model with this name; None: the TCP.

    Raises `ModelError` if there is none.
    """
    if name is None:
        return robot.tcp_joint, robot.tcp_placement
    model = robot.model
    for kind in (pin.FrameType.BODY, pin.FrameType.OP_FRAME, pin.FrameType.FIXED_JOINT, pin.FrameType.JOINT):
        if isinstance(name, str) and model.existFrame(name, kind):
            frame = model.frames[model.getFrameId(name, kind)]
            return int(frame.parentJoint), frame.placement
    raise ModelError(f"{robot.name} has no link {name!r}", hint=f"links are {listed(robot.links)}")


class Moving:
    """A robot at N closed postures, with motions of its commands.

    ``v``, ``a``: (N, n) velocities and accelerations of the commands, m or rad, per s and s^2. ``V``, ``A``: (N, nv) those of
    Pinocchio's joints. Motions of frames are linear (m) at the frame's origin, then angular (rad), in the base frame's axes.

    Parameters
    ----------
    robot
        The robot, as its file describes it.
    X
        (N, nq) Pinocchio configurations at which its loops are closed.
    """

    def __init__(self, robot: Chain, X: Floats) -> None:
        own = nominal(robot)
        self.robot, self.X, self._loops, self._placed = robot, X, own.loops, own.placed
        self._here = own.loops.at(X, own.placed)

    @cached_property
    def response(self) -> Floats:
        """(N, nv, n) G: velocities of Pinocchio's joints by unit velocities of each command."""
        still, each = np.zeros_like(self._here.g), (len(self._here), 1)
        return np.stack([self._closed(still, np.tile(unit, each)) for unit in np.eye(self.robot.n_actuators)], axis=2)

    def velocities(self, v: Floats) -> Floats:
        """V (N, nv) of Pinocchio's joints."""
        return np.asarray(np.einsum("nvi,ni->nv", self.response, v))

    def accelerations(self, v: Floats, a: Floats) -> Floats:
        """A (N, nv) of Pinocchio's joints."""
        gaps, model, data = np.zeros_like(self._here.g), self.robot.model, self.robot.model.createData()
        loops = [(constraint, constraint.createData()) for constraint in self.robot.constraints]
        for i, V in enumerate(self.velocities(v) if loops else ()):
            pin.forwardKinematics(model, data, self.X[i], V, np.zeros(model.nv))
            for loop, (constraint, its) in enumerate(loops):
                constraint.calc(model, data, its)
                gaps[loop, :, i] = its.oMc1.rotation @ its.constraint_acceleration_error
        return self._closed(gaps, a)

    def _closed(self, gaps: Floats, commands: Floats) -> Floats:
        """(N, nv) of Pinocchio's joints, with those of the commands (N, n), that close gaps (L, 3, N) to first order."""
        return self._loops.step(replace(self._here, g=gaps), commands)

    def poses(self, frame: Frame) -> tuple[Floats, Floats]:
        """Positions (N, 3), m, and rotations (N, 3, 3) of a frame in the base frame."""
        carrier, placement = self._here.oMi[:, frame[0]], frame[1]
        turn = rotation(carrier)
        return turn @ np.array(placement.translation) + carrier[:, 9:], turn @ np.array(placement.rotation)

    def jacobian(self, frame: Frame) -> Floats:
        """(N, 6, n) derivative of a frame's pose by the commands."""
        moves = np.isin(self._loops.joint_of, list(self.robot.model.supports[frame[0]]))
        found = np.swapaxes(self._here.J * moves[:, None], 1, 2) @ self.response
        found[:, :3] -= skew(self.poses(frame)[0]) @ found[:, 3:]
        return np.asarray(found)

    def velocity(self, frame: Frame, v: Floats) -> Floats:
        """(N, 6) velocity of a frame."""
        return np.asarray(np.einsum("nij,nj->ni", self.jacobian(frame), v))

    def acceleration(self, frames: Sequence[Frame], V: Floats, A: Floats) -> Floats:
        """(N, F, 6) accelerations of F frames: of their origins, and of their rotation. Pinocchio's classical accelerations."""
        model, data = self.robot.model, self.robot.model.createData()
        found = np.empty((len(V), len(frames), 6))
        for i, x in enumerate(self.X):
            pin.forwardKinematics(model, data, x, V[i], A[i])
            for k, (joint, placement) in enumerate(frames):
                found[i, k] = pin.getFrameClassicalAcceleration(
                    model, data, joint, placement, pin.LOCAL_WORLD_ALIGNED
                ).vector
        return found

    # ------------------------------------------------------------------------------------------- forces

    def actuator_forces(self, v: Floats, a: Floats, force: Floats, moment: Floats, payload: Floats) -> Floats:
        """(N, n) forces of the actuators; see :meth:`forces`. Of redundant loops too: G' takes the loops' forces away."""
        V, A = self.velocities(v), self.accelerations(v, a)
        tau, _ = copies(self.robot).inverse_dynamics(self.X, V, A, self._placed.placements)
        tool = np.concatenate([force + self._carried(V, A, payload), moment], axis=1)
        held = np.einsum("nij,ni->nj", self.jacobian(frame_of(self.robot, None)), tool)
        return np.asarray(np.einsum("nvi,nv->ni", self.response, tau) - held)

    def forces(self, v: Floats, a: Floats, force: Floats, moment: Floats, payload: Floats) -> Forces:
        """Forces with a ``force`` (N, 3), N, and ``moment`` (N, 3), N m, on the tool, base frame, and a ``payload`` (N,), kg.

        Raises `ModelError` if the loops are redundant, so that their forces are not determined.
        """
        robot, V, A = self.robot, self.velocities(v), self.accelerations(v, a)
        ends = [f for rod in robot.rods for f in ((rod.joint_id, pin.SE3.Identity()), robot.anchors[rod.tip])]
        moved = self.acceleration(ends, V, A)[..., :3].reshape(len(V), -1, 2, 3)
        outer = np.asarray(robot.model.gravity.linear) - 0.25 * moved[:, :, 0] - 0.75 * moved[:, :, 1]
        tool = force + self._carried(V, A, payload)
        return loads(self._loops, self._here, self._placed, tool, None, moment, V, A, outer)

    def _carried(self, V: Floats, A: Floats, payload: Floats) -> Floats:
        """(N, 3) force of a payload (N,) on the tool: its weight, less what accelerates it."""
        fall = (
            np.asarray(self.robot.model.gravity.linear)
            - self.acceleration([frame_of(self.robot, None)], V, A)[:, 0, :3]
        )
        return np.asarray(payload[:, None] * fall)

    def inertia(self) -> Floats:
        """(N, n, n) inertia at the actuators, G' M G, with M of Pinocchio's ``crba``."""
        model, data = self.robot.model, self.robot.model.createData()
        M = np.array([np.triu(pin.crba(model, data, x)) for x in self.X])
        M += np.swapaxes(np.triu(M, 1), 1, 2)
        return np.asarray(np.swapaxes(self.response, 1, 2) @ M @ self.response)
