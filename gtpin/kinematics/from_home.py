"""The home of a robot's own file, and the ways from home to other commands."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from gtpin.errors import AssemblyModeError, UnreachableError
from gtpin.kinematics.placed import rotation
from gtpin.kinematics.postures import Here
from gtpin.robot.assembly import NEAR, tolerance
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

HOME_OFF = 0.1
"""Distance, m, from the home in the URDF, beyond which the loops count as closed in another assembly mode. Assumed."""
HOME_TURNED = 0.2
"""Angle, rad, from the home in the URDF, beyond which they count so too. Assumed: both are far larger than rounding errors,
and smaller than the difference of assembly modes."""


def open_at_home(robot: Chain) -> UnreachableError:
    """The error of loops that can't be closed at home."""
    described, gap = robot.description, robot.assembly.gap
    what = f"the loops of {robot.name} don't close at its home"
    if described.home is None or gap <= NEAR:
        what += f": {gap:.3g} m is the smallest gap found between their anchors (up to {tolerance(robot):.2g} m is rounding)"
    hint = "mend the joints or the loops' anchors"
    if described.home is not None:
        hint = "mend <home> or the loops' anchors"
    elif described.kind == "mjcf":
        hint = "mend the joints, the places of its equality constraints, or its keyframe"
    return UnreachableError(what, hint=hint)


def check_declared_home(robot: Chain, here: Here) -> None:
    """Raise `AssemblyModeError` if the posture at home is far from the home that the robot's file gives."""
    declared = robot.description.home
    if declared is None:
        return
    carrier = here.oMi[0, robot.home_joint]
    there = pin.SE3(rotation(carrier), carrier[9:]) * robot.home_placement
    off = float(np.linalg.norm(there.translation - np.array(declared.tcp_xyz)))
    turned = float(np.linalg.norm(pin.log3(there.rotation @ pin.exp3(np.array(declared.tcp_rotvec)).T)))
    if off > HOME_OFF or turned > HOME_TURNED:
        far = f"{off:.3g} m" if off > HOME_OFF else f"{turned:.3g} rad"
        raise AssemblyModeError(
            f"the loops of {robot.name} close {far} from the home that its URDF tells", hint="mend <home>"
        )


def ways_round(robot: Chain, home_q: Floats, q: Floats) -> list[Floats]:
    """Other ways from home to commands (N, n) than the straight line: corners (N, n + 2, n) of polylines.

    The same angle within half a turn of home, for actuators without limits; then the actuators one after the other, in their
    order and in the reverse order.
    """
    turns, count = 2.0 * np.pi, robot.n_actuators
    near = np.where(robot.endless, q - turns * np.round((q - home_q) / turns), q)
    orders = [np.zeros(count, dtype=int)] if (near != q).any() else []
    if count > 1:
        orders += [np.arange(count), np.arange(count)[::-1]]
    moved = [[order < stop for stop in range(count + 1)] + [np.ones(count, dtype=bool)] for order in orders]
    return [np.stack([np.where(there, near, home_q) for there in way], axis=1) for way in moved]
