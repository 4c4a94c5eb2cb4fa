"""The parameters of the paper's sensitivity analysis: the effect of a step in one of them on its rod."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.errors import ConvergenceError
from gtpin.kinematics.closures import RodEnds, follow
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.typing import Floats

PARAMETERS = ("L", "Px", "Py", "Pz", "Cx", "Cy", "Cz", "vx", "vy", "vz")
"""Length L; joint P on the platform, TCP frame; joint C on the carrier at command 0, base frame; direction v of the track, base
frame."""
STEP = 5e-5
"""The paper's step: 50 um, or 5e-5 in a component of a unit vector."""


@dataclass(frozen=True)
class RodStep:
    """Dependence of one rod's ends and length on one parameter.

    Parameters
    ----------
    rod
        Index of the rod.
    P
        (3,) motion of its joint on the platform, TCP frame, per unit of the parameter.
    C
        (N, 3) motion of its joint on the carrier at each pose, base frame, per unit of the parameter.
    L
        Change of its length, per unit of the parameter.
    """

    rod: int
    P: Floats
    C: Floats
    L: float

    def vector(self, poses: Poses) -> Floats:
        """(N, 3) change of the rod's vector d = T + R P - C at fixed poses, base frame, per unit of the parameter."""
        return np.asarray(poses.R @ self.P - self.C)

    def applied(self, ends: RodEnds, step: float, poses: int) -> RodEnds:
        """The rods' ends (N poses) after a step of the parameter."""
        P, C = ends.P.copy(), ends.C.copy()
        L = np.repeat(ends.L, poses, axis=0) if len(ends.L) == 1 else ends.L.copy()
        P[..., self.rod, :] += step * self.P
        C[:, self.rod] += step * self.C
        L[:, self.rod] += step * self.L
        return RodEnds(P, C, L)


def rod_step(kinematics: RodKinematics, q: Floats, parameter: str, rod: int) -> RodStep | None:
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
    robot = kinematics.geometry.robot
    carrier = robot.rods[rod].carrier
    turns = carrier is not None and bool(robot.revolute[carrier])
    travel = np.zeros(len(q)) if carrier is None else q[:, carrier] * kinematics.scale[rod]
    if parameter[0] == "C":
        moved = kinematics.seats[rod].by_joint(travel, "xyz".index(parameter[1]))
        return RodStep(rod, zero, np.array(np.broadcast_to(moved, still.shape)), 0.0)
    if carrier is None or turns:
        return None
    return RodStep(rod, zero, q[:, carrier, None] * axis, 0.0)


def poses_after(kinematics: RodKinematics, ends: RodEnds, poses: Poses, change: RodStep, step: float) -> Poses:
    """Poses (N), base frame, that satisfy the closures after a step, in the same assembly mode as the poses before it.

    Raises
    ------
    ConvergenceError
        If the closures have no solution.
    """
    after = change.applied(ends, step, len(poses))

    def path(s: Floats, rows: npt.NDArray[np.int_]) -> RodEnds:
        one, two = ends.take(rows), after.take(rows)
        w = s[:, None]
        C, L = one.C + w[..., None] * (two.C - one.C), one.L + w * (two.L - one.L)
        return RodEnds(one.P + w[..., None] * (two.P - one.P), C, L)

    moved = follow(path, poses, kinematics.geometry.robot.size)
    if not moved.reached.all():
        raise ConvergenceError(
            f"a step of {step:g} opens the rods at row {np.flatnonzero(~moved.reached)[0]}",
            hint="leave out commands near a singularity",
        )
    return moved
