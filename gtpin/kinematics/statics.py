"""Static forces in rods, actuators and joints under gravity and a load on the tool."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from gtpin.errors import ClosureError, ModelError, SingularityError
from gtpin.kinematics.bodies import configurations, to_gap
from gtpin.kinematics.closures import pose_jacobian, rod_vectors
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.posture import ClosedPosture, home
from gtpin.kinematics.rod_geometry import RodGeometry
from gtpin.robot.chain import Chain
from gtpin.typing import Floats


@dataclass(frozen=True)
class StaticForces:
    """The forces that hold a robot at rest at a posture.

    ``loops``: (number of loops, 3) force of the second anchor's body on the first anchor's body in each loop, base frame,
    N. ``rods``: (k,) axial force at each rod's middle, N, tension positive; k = 0 for a robot without rods. ``actuators``:
    (n,) force (N) or torque (N m) that each actuator must apply, positive in the direction of its command.
    """

    loops: Floats
    rods: Floats
    actuators: Floats


def static_forces(
    posture: ClosedPosture,
    force: npt.ArrayLike = (0.0, 0.0, 0.0),
    moment: npt.ArrayLike = (0.0, 0.0, 0.0),
    payload: float = 0.0,
) -> StaticForces:
    """Static forces by Pinocchio: gravity of all bodies, a force and moment on the tool, and a payload.

    The balance of the passive coordinates, J' lambda = g - J_tcp' w, gives the forces lambda in the loops, with J the
    constraint Jacobian, g the generalized gravity, J_tcp the Jacobian of the TCP and w force and moment on it. The balance of
    the driven coordinates then gives the actuators' forces. A planar loop transmits no force across its plane.

    Parameters
    ----------
    posture
        The posture at which the robot is at rest.
    force, moment
        (3,) force, N, and moment, N m, on the tool at the TCP, base frame; zero by default.
    payload
        Mass held at the TCP, kg; zero by default.

    Raises
    ------
    ModelError
        If the robot's loops are redundant, so that statics alone does not give their forces.

    Examples
    --------
    >>> import gtpin
    >>> forces = gtpin.static_forces(gtpin.home(gtpin.load_robot("gantry_tau")), payload=10.0)
    >>> forces.rods.shape, forces.actuators.shape
    ((6,), (3,))
    """
    robot = posture.robot
    model, data = robot.model, robot.data
    J = posture.constraint_jacobian
    if len(J) != robot.n_passive:
        raise ModelError(
            f"the loops of {robot.name} are redundant",
            hint="statics gives as many forces as there are passive coordinates",
        )
    gravity = robot.folded(np.array(pin.computeGeneralizedGravity(model, data, posture.configuration)))
    wrench = np.concatenate([np.asarray(force, float) + payload * model.gravity.linear, np.asarray(moment, float)])
    load = gravity - posture.tcp_jacobian.T @ wrench
    multipliers = posture.passive_inverse.T @ load[robot.passive]
    driven, on_gaps = robot.driven, robot.spread(multipliers)
    posture.refresh()
    # From the frame of the first anchor to the base frame.
    world = [to_gap(robot, i, np.eye(3)).T @ on_gaps[3 * i : 3 * i + 3] for i in range(len(robot.constraints))]
    loops = -np.array(world).reshape(-1, 3)
    return StaticForces(loops, _axial(posture, loops), load[driven] - J[:, driven].T @ multipliers)


def _axial(posture: ClosedPosture, loops: Floats) -> Floats:
    """(k,) axial force at the middle of each rod, tension positive."""
    robot = posture.robot
    forces = np.zeros(len(robot.rods))
    for i, rod in enumerate(robot.rods):
        along = robot.anchor_point(rod.tip) - robot.data.oMi[rod.joint_id].translation
        u = along / np.linalg.norm(along)
        on_rod = loops[rod.loop] if rod.rod_end == 0 else -loops[rod.loop]
        stretch = 0.0 if rod.extension is None else float(posture.q[rod.extension])
        # Between the carrier joint and the middle, the axial force changes by the weight that the carrier supports.
        on_carrier = _rod_mass(robot, i).on_carrier(np.array(stretch), np.asarray(np.linalg.norm(along)))
        forces[i] = on_rod @ u + float(on_carrier) * (robot.model.gravity.linear @ u)
    return forces


@dataclass(frozen=True)
class _RodMass:
    """A rod's mass, kg, its first moment about the joint on the platform, kg m, and the mass that slides in a variable leg,
    kg."""

    mass: float
    moment: float
    sliding: float

    def on_carrier(self, stretch: Floats, length: Floats) -> Floats:
        """The part of its mass, kg, that the carrier supports when the leg is extended by ``stretch`` to a length, m."""
        return np.asarray((self.moment + self.sliding * stretch) / length)


def _rod_mass(robot: Chain, rod_index: int) -> _RodMass:
    rod = robot.rods[rod_index]
    model = robot.model
    tip, end = robot.anchors[rod.tip]
    chain = list(model.supports[tip])
    chain = chain[chain.index(rod.joint_id) :]
    placements = [pin.SE3.Identity()]
    for joint in chain[1:]:
        placements.append(placements[-1] * model.jointPlacements[joint])
    along = (placements[-1] * end).translation / rod.L
    extension = None if rod.extension is None else robot.actuators[rod.extension].joint_id
    mass = moment = sliding = 0.0
    for joint, placement in zip(chain, placements, strict=True):
        inertia = model.inertias[joint]
        mass += inertia.mass
        moment += inertia.mass * float(placement.act(inertia.lever) @ along)
        sliding += inertia.mass if extension is not None and joint >= extension else 0.0
    return _RodMass(mass, moment, sliding)


def rod_forces(
    kinematics: RodGeometry,
    q: Floats,
    poses: Poses,
    force: Floats | None = None,
    payload: Floats | None = None,
) -> Floats:
    """Axial forces f at the middle of the k rods for many poses, from the platform's balance J' f = w.

    J is the derivative of the distances between the rods' ends by the platform's pose. w is the wrench on the platform about
    the TCP: its weight, its share of the rods' weight, the payload's weight, and the force on the tool.

    Parameters
    ----------
    kinematics
        ``model.kinematics`` of a robot with rods.
    q, poses
        (N, n) commands, m or rad, and the (N) poses at them, base frame.
    force
        (N, 3) force on the tool at the TCP, base frame, N; None: zero.
    payload
        (N,) mass held at the TCP, kg; None: zero.

    Returns
    -------
    forces
        (N, k) axial forces, N, tension positive.

    Raises
    ------
    SingularityError
        If the rods can't hold the platform at some pose: J is singular.

    Examples
    --------
    >>> import gtpin
    >>> model = gtpin.read_model("gantry_tau")
    >>> q = model.robot.home_q[None]
    >>> gtpin.rod_forces(model.kinematics, q, model.kinematics.forward(q)).shape
    (1, 6)
    """
    robot = kinematics.geometry.robot
    ends = kinematics.ends(q)
    d, RP = rod_vectors(poses, ends)
    gravity = robot.model.gravity.linear
    inertia = robot.tcp_placement.inverse() * robot.model.inertias[robot.tcp_joint]
    wrench = np.zeros((len(q), 6))
    wrench[:, :3] = inertia.mass * gravity
    wrench[:, 3:] = np.cross(poses.R @ inertia.lever, inertia.mass * gravity)
    length = np.linalg.norm(d, axis=2)
    for i in range(len(robot.rods)):
        rod = _rod_mass(robot, i)
        stretch = np.broadcast_to(ends.L, length.shape)[:, i] - kinematics.L0[i]
        weight = (rod.mass - rod.on_carrier(stretch, length[:, i]))[:, None] * gravity
        wrench[:, :3] += weight
        wrench[:, 3:] += np.cross(RP[:, i], weight)
    if force is not None:
        wrench[:, :3] += force
    if payload is not None:
        wrench[:, :3] += payload[:, None] * gravity
    # d points from the carrier to the platform: a rod in tension pulls the platform back along it.
    directions = pose_jacobian(d, RP) / length[..., None]
    try:
        return np.asarray(np.linalg.solve(np.swapaxes(directions, 1, 2), wrench[..., None])[..., 0])
    except np.linalg.LinAlgError:
        raise SingularityError("the rods can't hold the platform at one of the poses", hint="leave it out") from None


def joint_loads(robot: Chain, q: Floats, force: Floats | None = None, payload: Floats | None = None) -> Floats:
    """Static wrenches that the bodies beyond each joint exert on it: Pinocchio's ``rnea`` with external forces.

    ``q``: (N, n) commands, m or rad. ``force``: (N, 3) force on the tool at the URDF's TCP, base frame, N. ``payload``:
    (N,) mass held at the URDF's TCP, kg.

    Returns (N, J + 1, 6) force, N, and moment, N m, about the origin of each placement frame, in its own axes; then those
    on the TCP, in its axes. See :class:`~gtpin.kinematics.bodies.Bodies`. NaN where the loops can't be closed.
    """
    model, data = robot.model, robot.data
    loads = np.full((len(q), model.njoints, 6), np.nan)
    tool = np.zeros((len(q), 3)) if force is None else force.copy()
    if payload is not None:
        tool += payload[:, None] * model.gravity.linear
    still = np.zeros(model.nv)
    external = pin.StdVec_Force()
    external.extend([pin.Force.Zero() for _ in range(model.njoints)])
    anchors = {joint for joint, _ in robot.anchors}
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
        for index, (joint, placement) in enumerate(robot.anchors):
            pulled = loops[index // 2] if index % 2 else -loops[index // 2]
            local = placement.act(pin.Force(_in(data.oMi[joint] * placement, pulled), np.zeros(3)))
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


def _postures(robot: Chain, q: Floats, tool: Floats) -> list[tuple[Floats | None, Floats]]:
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
