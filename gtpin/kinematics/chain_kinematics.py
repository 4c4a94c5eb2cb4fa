"""Forward kinematics and derivatives of any robot that Pinocchio loads."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import pinocchio as pin

from gtpin.errors import ClosureError, ConvergenceError
from gtpin.kinematics.bodies import bodies, configurations, driven_twists, index_of, responses
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.posture import ClosedPosture, home
from gtpin.kinematics.protocol import Bodies, SmallError
from gtpin.kinematics.rotations import twist_jacobian
from gtpin.kinematics.statics import joint_loads
from gtpin.robot.chain import Chain
from gtpin.robot.constrained_model import joint_axis
from gtpin.robot.export import placements_to_urdf
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats

COMPONENTS = ("x", "y", "z", "rx", "ry", "rz")
"""Components of a placement (of a joint on its parent, of the TCP on its body): translation, m, and rotation, rad, own axes."""


@dataclass(frozen=True)
class ChainKinematics:
    """The kinematics of a robot without rods, computed by Pinocchio.

    ``geometry``: geometry whose parameters are displacements of joints, of the TCP on its body, and of the loops' anchors.
    """

    geometry: Geometry

    @cached_property
    def robot(self) -> Chain:
        robot = self.geometry.robot
        placements = self.geometry.deviations("placement", "joint", (robot.model.njoints, 6))
        anchors = self.geometry.anchors
        return robot.with_placements(placements, self.geometry.platform, anchors if anchors.any() else None)

    @cached_property
    def home(self) -> Poses:
        return self.forward(self.robot.home_q[None])

    def forward(self, q: Floats, start: Poses | None = None) -> Poses:
        """Poses at commands q (N, n), base frame; NaN where the loops can't be closed. ``start`` is not needed."""
        return self._displaced(q, {})

    def displaced(
        self, q: Floats, plain: Poses, commands: Floats, twists: Mapping[int, Floats], lengths: Floats
    ) -> Poses:
        return self._displaced(commands, twists)  # of joints and TCP: no effect displaces an anchor

    def _displaced(self, q: Floats, twists: Mapping[int, Floats]) -> Poses:
        self.robot.check_commands(q)
        poses = Poses.unknown(len(q), (joint.name for joint in self.robot.measured_joints))
        if self.robot.constraints:
            self._with_loops(q, twists, poses)
        else:
            self._open(q, twists, poses)
        return poses

    def command_jacobian(self, q: Floats, poses: Poses, at: Bodies | None = None) -> Floats:
        return _contracted(self._responses(q) if at is None else at.response, driven_twists(self.robot))

    def bodies(self, q: Floats, poses: Poses) -> Bodies:
        return bodies(self.robot, q)

    def carried(self, actuator: int) -> tuple[int, ...]:
        """The index of the placement frame of an actuator's joint."""
        return (index_of(self.robot.actuators[actuator].joint_id),)

    def axis(self, actuator: int) -> Floats:
        """(3,) unit vector of a joint's axis, in its placement frame."""
        joint = self.robot.actuators[actuator]
        twist = joint_axis(self.robot.model, joint.joint_id)
        return twist[3:] if joint.revolute else twist[:3]

    def loads(self, q: Floats, poses: Poses, force: Floats | None = None, payload: Floats | None = None) -> Floats:
        """(N, J + 1, 6) loads on each joint and the TCP: :func:`~gtpin.kinematics.statics.joint_loads`."""
        return joint_loads(self.robot, q, force, payload)

    def rod_vectors(self, q: Floats, poses: Poses) -> tuple[Floats, Floats]:
        return np.zeros((len(q), 0, 3)), np.zeros((len(q), 0, 3))

    def rod_forces(self, q: Floats, poses: Poses, force: Floats | None, payload: Floats | None) -> Floats:
        return np.zeros((len(q), 0))

    def length_response(self, q: Floats, poses: Poses) -> Floats:
        return np.zeros((len(q), self.robot.motion_size, 0))

    def singularity(self, q: Floats, poses: Poses) -> tuple[Floats, str]:
        """(N,) smallest singular value of the derivative of the TCP's pose by the commands, relative to the best of the poses.

        Rotations are multiplied by the reach, the root mean square distance of the TCP from its mean position.
        """
        J = self.command_jacobian(q, poses)[:, :6]
        reach = float(np.sqrt(((poses.T - poses.T.mean(axis=0)) ** 2).sum(axis=1).mean()))
        least = np.linalg.svd(np.concatenate([J[:, :3], reach * J[:, 3:]], axis=1), compute_uv=False)[:, -1]
        return np.asarray(least / max(float(least.max()), 1e-300), dtype=np.float64), "best"

    def small_errors(self, q: Floats, poses: Poses) -> Iterator[SmallError]:
        """Errors of the placement of each joint on its parent, of the TCP and of the loops' anchors, in their own axes."""
        J = self.geometry_jacobian(q, poses)[:, :6]
        for column, p in enumerate(self.geometry.parameters):
            place = p.name.rpartition(".")[0]
            link = place.removeprefix("placement[").removeprefix("anchor[").removesuffix("]")
            yield SmallError(COMPONENTS[p.component], link, J[:, :, column], partial(self._stepped, q, column))

    def urdf(self) -> str:
        """See :func:`~gtpin.robot.export.placements_to_urdf`."""
        return placements_to_urdf(self.geometry)

    def _stepped(self, q: Floats, column: int, step: float) -> Poses:
        """Poses at commands after a step of one parameter of the geometry; raises `ConvergenceError` where the loops open."""
        values = self.geometry.values.copy()
        values[column] += step
        poses = ChainKinematics(self.geometry.with_values(values)).forward(q)
        if not poses.reached.all():
            what = f"a step of {step:g} opens the loops at row {np.flatnonzero(~poses.reached)[0]}"
            raise ConvergenceError(what, hint="leave out commands near a singularity")
        return poses

    def geometry_jacobian(self, q: Floats, poses: Poses) -> Floats:
        return _contracted(self._responses(q), self._parameter_twists)

    def _responses(self, q: Floats) -> Floats:
        """The last response is kept: derivatives by commands and by parameters are computed at the same commands."""
        if not self.robot.constraints:
            return responses(self.robot, q)
        if self._last.get("q") != (key := q.tobytes()):
            self._last.update(q=key, response=responses(self.robot, q, self._home))
        return np.asarray(self._last["response"])

    @cached_property
    def _last(self) -> dict[str, object]:
        return {}

    @cached_property
    def _parameter_twists(self) -> Floats:
        """(J + 1 + 2 L, 6, p) twist of each placement frame, of the TCP and of each loop's anchor by each parameter."""
        robot = self.geometry.robot
        count, anchors = robot.model.njoints - 1, len(robot.anchors)
        placements = self.geometry.deviations("placement", "joint", (count + 1, 6))
        platform = self.geometry.platform
        twists = np.zeros((count + 1 + anchors, 6, len(self.geometry.parameters)))
        for column, p in enumerate(self.geometry.parameters):
            if p.kind == "anchor":
                twists[count + 1 + p.owner, p.component, column] = 1.0
                continue
            index, deviation = (count, platform) if p.kind == "platform" else (p.owner - 1, placements[p.owner])
            twists[index, :, column] = twist_jacobian(deviation)[:, p.component]
        return twists

    def _open(self, q: Floats, twists: Mapping[int, Floats], poses: Poses) -> None:
        robot = self.robot
        model, data, tcp = robot.model, robot.data, robot.tcp_placement
        moved = {index + 1: twist for index, twist in twists.items() if index + 1 < model.njoints}
        plain = {j: model.jointPlacements[j].copy() for j in moved}
        tool = twists.get(model.njoints - 1)
        try:
            for i, configuration in enumerate(configurations(robot, q)):
                for j, twist in moved.items():
                    model.jointPlacements[j] = plain[j] * pin.exp6(twist[i])
                pin.forwardKinematics(model, data, configuration)
                pose = data.oMi[robot.tcp_joint] * (tcp if tool is None else tcp * pin.exp6(tool[i]))
                poses.T[i], poses.R[i] = pose.translation, pose.rotation
        finally:
            for j, placement in plain.items():
                model.jointPlacements[j] = placement

    def _with_loops(self, q: Floats, twists: Mapping[int, Floats], poses: Poses) -> None:
        try:
            start = self._home
        except ClosureError:
            if not np.any(self.geometry.deviation):
                raise  # the URDF is wrong, not the commands
            return
        count = self.robot.model.njoints - 1
        for i, row in enumerate(q):
            try:
                if twists:
                    by_joint = np.zeros((count + 1, 6))
                    for index, twist in twists.items():
                        if index < count:
                            by_joint[index + 1] = twist[i]
                    start = home(self.robot.with_placements(by_joint, twists.get(count, np.zeros((len(q), 6)))[i]))
                posture = start.moved_to(row)
            except ClosureError:
                continue
            poses.T[i], poses.R[i] = posture.T, posture.R
            for joint in self.robot.measured_joints:
                poses.joints[joint.name][i] = joint.coordinate(posture.configuration)

    @cached_property
    def _home(self) -> ClosedPosture:
        return home(self.robot)


def _contracted(response: Floats, twists: Floats) -> Floats:
    """(N, 6 + k, m) motion of the TCP and the k measured joints by twists (J + 1 + 2 L, 6, m), the same at all postures."""
    n, width, count, _ = response.shape
    flat = response.reshape(n * width, count * 6) @ twists.reshape(count * 6, -1)
    return np.asarray(flat).reshape(n, width, -1)
