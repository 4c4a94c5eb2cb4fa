"""Loads on every joint of a chain: gravity of links and payload, and the force on the tool."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from gtpin.errors import ClosureError
from gtpin.kinematics.bodies import configurations
from gtpin.kinematics.posture import home
from gtpin.kinematics.statics import static_forces
from gtpin.robot.robot import Robot
from gtpin.typing import Floats


def joint_loads(robot: Robot, q: Floats, force: Floats | None = None, payload: Floats | None = None) -> Floats:
    """Static wrenches that the bodies beyond each joint exert on it: Pinocchio's ``rnea`` with external forces.

    Parameters
    ----------
    q
        (N, n) commands, m or rad.
    force
        (N, 3) force on the tool at the URDF's TCP, base frame, N.
    payload
        (N,) mass held at the URDF's TCP, kg.

    Returns
    -------
    loads
        (N, J + 1, 6) force, N, and moment, N m, about the origin of each placement frame, in its own axes; then those on the
        TCP, in its axes. See :class:`~gtpin.kinematics.bodies.Bodies`. NaN where the loops can't be closed.
    """
    model, data = robot.model, robot.data
    loads = np.full((len(q), model.njoints, 6), np.nan)
    tool = np.zeros((len(q), 3)) if force is None else force.copy()
    if payload is not None:
        tool += payload[:, None] * model.gravity.linear
    still = np.zeros(model.nv)
    external = pin.StdVec_Force()
    external.extend([pin.Force.Zero() for _ in range(model.njoints)])
    anchors = {joint for c in robot.constraints for joint in (c.joint1_id, c.joint2_id)}
    placements = [pin.SE3(placement) for placement in model.jointPlacements]
    on_tcp = robot.tcp_placement.inverse() * robot.load_placement
    for i, (configuration, loops) in enumerate(_postures(robot, q, tool)):
        if configuration is None:
            continue
        pin.forwardKinematics(model, data, configuration)
        for joint in anchors:
            external[joint] = pin.Force.Zero()
        hung = pin.Force(_in(data.oMi[robot.tcp_joint] * robot.load_placement, tool[i]), np.zeros(3))
        external[robot.tcp_joint] = robot.load_placement.act(hung)
        for constraint, pulled in zip(robot.constraints, loops, strict=True):
            for joint, placement, sign in (
                (constraint.joint1_id, constraint.joint1_placement, -1.0),
                (constraint.joint2_id, constraint.joint2_placement, 1.0),
            ):
                frame = data.oMi[joint] * placement
                local = placement.act(pin.Force(_in(frame, sign * pulled), np.zeros(3)))
                external[joint] = external[joint] + local
        pin.rnea(model, data, configuration, still, still, external)
        carried, moved = data.f, data.liMi
        for j in range(1, model.njoints):
            loads[i, j - 1] = -placements[j].actInv(moved[j]).act(carried[j]).vector
        loads[i, -1] = on_tcp.act(hung).vector
    return loads


def _in(frame: pin.SE3, vector: Floats) -> Floats:
    """A vector (3,) of the base frame in another frame's axes."""
    return np.asarray(frame.rotation.T @ vector)


def _postures(robot: Robot, q: Floats, tool: Floats) -> list[tuple[Floats | None, Floats]]:
    """For each row: the configuration (nq,), None where the loops can't be closed; and the forces of the loops.

    The force (L, 3) is that of each of the L loops on the body of its second anchor, base frame, N.
    """
    if not robot.constraints:
        return [(configuration, np.zeros((0, 3))) for configuration in configurations(robot, q)]
    start = home(robot)
    found: list[tuple[Floats | None, Floats]] = []
    for row, force in zip(q, tool, strict=True):
        try:
            posture = start.moved_to(row)
            # ``static_forces`` gives what the second body exerts on the first.
            found.append((posture.configuration, -static_forces(posture, force).loops))
        except ClosureError:
            found.append((None, np.zeros((len(robot.constraints), 3))))
    return found
