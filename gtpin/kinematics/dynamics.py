"""Forces of a robot with closed loops: inverse dynamics, the forces in its loops and rods, and the loads on its joints.

The balance of the passive velocities gives the forces lambda in the loops, with tau the generalized forces of the tree by
Pinocchio's ``rnea``, less those of the tool: sum over the loops of J' lambda = tau, passive rows. The balance of the driven
velocities then gives the actuators' forces.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from gtpin.errors import ModelError
from gtpin.kinematics.closing import Here, LoopClosure
from gtpin.kinematics.copies import copies
from gtpin.kinematics.placed import PlacedParts, rotation, times
from gtpin.robot.chain import Chain
from gtpin.typing import Floats


@dataclass(frozen=True, eq=False)
class Forces:
    """The forces of a robot at rest or in motion; of N postures, all arrays have N rows.

    ``actuators``: (n,) force, N, or torque, N m, that each actuator must apply, positive in the direction of its command.
    ``loops``: (L, 3) constraint force in each of the L loops, of the second anchor's body on the first anchor's body, base
    frame, N. ``rods``: (k,) axial force at the middle of each of k uniform rods, N, tension positive.
    """

    actuators: Floats
    loops: Floats
    rods: Floats


@dataclass(frozen=True, eq=False)
class Loads(Forces):
    """The forces at N postures, and those on the joints."""

    _joints: Callable[[], Floats]

    @cached_property
    def joints(self) -> Floats:
        """(N, J + 1, 6) force, N, and moment, N m, that the bodies beyond each joint exert on it.

        About the origin of the joint's placement frame and in its axes; then those on the TCP, in its axes.
        """
        return self._joints()


def loads(
    loops: LoopClosure,
    here: Here,
    placed: PlacedParts,
    force: Floats | None = None,
    payload: Floats | None = None,
    moment: Floats | None = None,
    V: Floats | None = None,
    A: Floats | None = None,
    outer: Floats | None = None,
) -> Loads:
    """The loads at postures, by gravity, by a ``force`` (N, 3), N, and ``moment`` (N, 3), N m, on the tool, base frame, and by
    a ``payload`` (N,), kg, at the TCP of the robot's file; with velocities and accelerations V, A (N, nv), those of motion too.

    ``outer``: (N, k, 3) gravity less the acceleration of the outer half of each rod, m/s^2; None: of rods at rest. A payload's
    inertia is not in it: give it as a force.

    Raises `ModelError` if the loops are redundant, so that statics alone does not give their forces.
    """
    robot, n = loops.robot, len(here)
    if len(loops.loop_of) != len(loops.solved):
        wrong = "are redundant" if len(loops.loop_of) > len(loops.solved) else "leave motions free"
        hint = "statics gives as many forces as there are passive coordinates"
        raise ModelError(f"the loops of {robot.name} {wrong}", hint=hint)
    tool = np.zeros((n, 3)) if force is None else force.copy()
    if payload is not None:
        tool += payload[:, None] * robot.model.gravity.linear
    carrier = here.oMi[:, robot.tcp_joint]
    at = rotation(carrier) @ np.asarray(robot.tcp_placement.translation) + carrier[:, 9:]
    on_tool = np.concatenate([tool, np.cross(at, tool) + (0.0 if moment is None else moment)], axis=1)
    tau, carried = copies(robot).inverse_dynamics(here.X, V, A, placed.placements)
    tau = (tau - np.einsum("nvi,ni->nv", here.J, on_tool) * loops.tcp) @ loops.fold
    pulled = constraint_forces(loops, here, tau)
    wrenches, by_loops = _wrenches(loops, here, pulled)
    actuators = (tau - by_loops @ loops.fold)[:, loops.driven]
    joints = partial(_on_joints, loops, here, placed, carried, wrenches, on_tool)
    return Loads(actuators, -pulled, _axial(robot, here, pulled, outer), joints)


def _wrenches(loops: LoopClosure, here: Here, forces: Floats) -> tuple[Floats, Floats]:
    """(N, L, 6) wrenches about the base frame's origin of forces (N, L, 3) in the loops, and generalized forces (N, nv)."""
    found = np.concatenate([forces, np.cross(here.p.transpose(2, 0, 1), forces)], axis=2)
    return found, np.einsum("lv,nvi,nli->nv", loops.S, here.J, found, optimize=True)


def constraint_forces(loops: LoopClosure, here: Here, tau: Floats) -> Floats:
    """(N, L, 3) force of each loop on the body of its second anchor, base frame, N, from generalized forces tau (N, nv)."""
    found = np.zeros((len(here), loops.count, 3))
    if loops.reduced:
        found = np.einsum("nlk,lk,lkin->nli", tau[:, loops.private], loops.lead, here.equations.alone)
        tau = tau - _wrenches(loops, here, found)[1]
    f = np.einsum("nve,nv->ne", here.inverse, tau[:, loops.solved])
    for e, loop in enumerate(loops.loop_of):
        found[:, loop] += here.equations.d[e].T * f[:, e, None]
    return found


def _on_joints(
    loops: LoopClosure, here: Here, placed: PlacedParts, carried: Floats, pulled: Floats, on_tool: Floats
) -> Floats:
    """See :class:`Loads`; ``carried`` (N, J, 6): Pinocchio's forces without loops and tool, own axes; the others are wrenches
    about the base frame's origin."""
    robot = loops.robot
    model, n = robot.model, len(here)
    found = np.empty((n, model.njoints, 6))
    for j in range(1, model.njoints):
        own = here.oMi[:, j]
        R = rotation(own)
        F, M = -(R @ carried[:, j - 1, :3, None])[..., 0], -(R @ carried[:, j - 1, 3:, None])[..., 0]
        M += np.cross(own[:, 9:], F)
        beyond = np.einsum("l,nli->ni", loops.signs[:, j], pulled)
        if loops.moves_tcp[j]:
            beyond = beyond + on_tool
        F, M = F + beyond[:, :3], M + beyond[:, 3:]
        frame, T = times(here.oMi[:, int(model.parents[j])], placed.placements[..., j - 1, :])
        found[:, j - 1, :3] = np.einsum("nji,nj->ni", frame, F)
        found[:, j - 1, 3:] = np.einsum("nji,nj->ni", frame, M - np.cross(T, F))
    frame, T = times(here.oMi[:, robot.tcp_joint], placed.tcp)
    found[:, -1, :3] = np.einsum("nji,nj->ni", frame, on_tool[:, :3])
    found[:, -1, 3:] = np.einsum("nji,nj->ni", frame, on_tool[:, 3:] - np.cross(T, on_tool[:, :3]))
    return found


def rod_ends(robot: Chain, here: Here) -> tuple[Floats, Floats]:
    """(N, k, 3) joints of the rods on the platform, and (N, k, 3) those on their carriers, base frame, m."""
    loops = [rod.loop for rod in robot.rods]
    on_platform = here.oMi[:, [rod.joint_id for rod in robot.rods], 9:]
    shape = (len(here), len(loops), 3)
    return on_platform.reshape(shape), here.p.transpose(2, 0, 1)[:, loops].reshape(shape)


def _axial(robot: Chain, here: Here, pulled: Floats, outer: Floats | None) -> Floats:
    """(N, k) axial force at the middle of each rod, N, tension positive; ``outer``: see :func:`loads`."""
    roots, tips = rod_ends(robot, here)
    pull = np.broadcast_to(robot.model.gravity.linear, roots.shape) if outer is None else outer
    along = tips - roots
    length = np.linalg.norm(along, axis=2)
    u = along / np.where(length > 0.0, length, 1.0)[..., None]
    found = np.zeros(length.shape)
    for i, rod in enumerate(robot.rods):
        stretch = 0.0 if rod.extension is None else here.X[:, robot.actuators[rod.extension].index_q]
        # Between the carrier joint and the middle, the axial force changes by the weight of the mass that the carrier supports.
        held = (rod.moment + rod.sliding * stretch) / length[:, i]
        on_rod = (1.0 if rod.rod_end else -1.0) * pulled[:, rod.loop]
        found[:, i] = np.einsum("ni,ni->n", on_rod, u[:, i]) + held * np.einsum("ni,ni->n", u[:, i], pull[:, i])
    return found
