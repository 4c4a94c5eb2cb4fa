"""Small errors of one rod: its length, its joints, and the direction of its track (Dressler et al. 2010, Table III)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.errors import ConvergenceError
from gtpin.kinematics.closures import RodEnds, between, follow
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rod_geometry import RodGeometry
from gtpin.typing import Floats

PARAMETERS = ("L", "Px", "Py", "Pz", "Cx", "Cy", "Cz", "vx", "vy", "vz")
"""Length L; joint P on the platform, TCP frame; joint C on the carrier at command 0, base frame; direction v of the track, base
frame."""


@dataclass(frozen=True)
class RodStep:
    """Dependence of one rod's ends and length on one parameter.

    - ``rod``: index of the rod.
    - ``P``: (3,) motion of its joint on the platform, TCP frame, per unit of the parameter.
    - ``C``: (N, 3) motion of its joint on the carrier at each pose, base frame, per unit of the parameter.
    - ``L``: change of its length, per unit of the parameter.
    """

    rod: int
    P: Floats
    C: Floats
    L: float

    def vector(self, poses: Poses) -> Floats:
        """(N, 3) change of the rod's vector d = T + R P - C at fixed poses, base frame, per unit of the parameter."""
        return np.asarray(poses.R @ self.P - self.C)

    def slope(self, d: Floats, ends: RodEnds, poses: Poses) -> Floats:
        """(N,) derivative of the rod's closure (|d|^2 - L^2) / 2 by the parameter; d (N, 3) is its vector."""
        L = np.broadcast_to(ends.L, (len(poses), ends.L.shape[1]))[:, self.rod]
        return np.asarray(np.einsum("ni,ni->n", d, self.vector(poses)) - L * self.L)

    def poses_after(self, step: float, ends: RodEnds, poses: Poses, size: float) -> Poses:
        """Poses (N) that satisfy the closures after a step of the parameter, in the same assembly mode as ``poses`` before it.

        ``ends``: the rods at these poses; ``size``: as for :func:`~gtpin.kinematics.closures.newton`.

        Raises `ConvergenceError` if the closures have no solution.
        """
        P, C = ends.P.copy(), ends.C.copy()
        L = np.repeat(ends.L, len(poses), axis=0) if len(ends.L) == 1 else ends.L.copy()
        P[..., self.rod, :] += step * self.P
        C[:, self.rod] += step * self.C
        L[:, self.rod] += step * self.L
        after = RodEnds(P, C, L)
        moved = follow(lambda s, rows: between(ends, after, s, rows), poses, size)
        if not moved.reached.all():
            raise ConvergenceError(
                f"a step of {step:g} opens the rods at row {np.flatnonzero(~moved.reached)[0]}",
                hint="leave out commands near a singularity",
            )
        return moved


def rod_step(rods: RodGeometry, q: Floats, parameter: str, rod: int) -> RodStep | None:
    """The effect of a parameter of a rod at commands q (N, n); None for a direction where the rod's carrier has no track.

    C = C0 + q (v + dv): as in the paper, a step dv of the direction is added without normalisation, also to a measured track.
    For a carrier that turns, the parameter C is the joint's position at command 0.
    """
    zero, still = np.zeros(3), np.zeros((len(q), 3))
    if parameter == "L":
        return RodStep(rod, zero, still, 1.0)
    axis = np.eye(3)["xyz".index(parameter[1])]
    if parameter[0] == "P":
        return RodStep(rod, axis, still, 0.0)
    robot = rods.geometry.robot
    carrier = robot.rods[rod].carrier
    if parameter[0] == "C":
        travel = np.zeros(len(q)) if carrier is None else q[:, carrier] * rods.scale[rod]
        moved = rods.seats[rod].by_joint(travel, "xyz".index(parameter[1]))
        return RodStep(rod, zero, np.array(np.broadcast_to(moved, still.shape)), 0.0)
    if carrier is None or bool(robot.revolute[carrier]):
        return None
    return RodStep(rod, zero, q[:, carrier, None] * axis, 0.0)
