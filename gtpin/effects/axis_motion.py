"""The axis of a joint shifts and tilts as the joint turns or slides."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis
from gtpin.effects.chain_motions import joint_frame, of_joint
from gtpin.effects.effect import Effect, unit
from gtpin.effects.sites import joints, turns
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import cosines
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

HARMONICS, DECAY = 4, 1.0
"""Number of harmonics of a turning joint's angle, and the power p: the size of harmonic k is proportional to k^-p."""
ORDERS = 6
"""Number of cosines along the travel of a sliding joint."""
LOWEST = 3
"""Number of lowest cosines along a sliding joint's travel that are a bent guide's form. Assumed."""
SHIFT, TILT = 2e-5, 8e-5
"""Typical sizes of shifts, m, and tilts, rad."""


class AxisMotion(Effect):
    """Error motions of a joint's axis (ISO 230-7): shift or tilt = sum_k c_k cos(k q) + s_k sin(k q), k = 1 to 4.

    q is the angle of the joint, rad; c_k and s_k are coefficients, m or rad. A turning joint has five error motions: radial
    along a and along b, axial, and tilts about a and about b. The unit vectors a and b are perpendicular to the axis, and
    fixed to the part that carries the joint. A sliding joint has straightness along a and b, and roll, pitch and yaw, smooth
    along its travel (ISO 230-1).

    Parameters: ``radial``, m, root mean square over a turn of both radial motions together; ``axial``, m, root mean square
    over a turn; ``tilt``, rad, root mean square over a turn of both tilts together. Of a sliding joint: ``straightness``, m,
    and ``rotation``, rad, root mean squares over its travel. Geometry absorbs a part of the first harmonic (k = 1), which an
    eccentric part causes.

    Typical sizes 20 um and 0.08 mrad. They are a guess for the crossed roller bearings and flanges of robots' joints, whose
    run-out is given as 10 to 20 um on radii of 0.1 m.
    """

    id = "axis_motion"
    nature = "description"
    title = "error motion of the axis"
    clause = "the axis of {site} moves as the joint moves"
    remedy = "Check the bearing and its seat for run-out; or use the corrected model."
    coefficient = ("radial", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuated joint of a robot without rods."""
        return joints(robot)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Five error motions: harmonics of a turning joint's angle, or cosines along a sliding joint's travel."""
        j = at.robot.sites.index(site)
        frame = joint_frame(at, site)
        ways = np.zeros((6, 5))
        ways[:3, :2] = ways[3:, 3:] = frame.across.T
        if turns(at.robot, site):
            ways[:3, 2] = frame.axis
            k = np.arange(1, HARMONICS + 1)
            waves = np.hstack([np.cos(k * at.q[:, [j]]), np.sin(k * at.q[:, [j]])])
            relative = np.tile(k**-DECAY / np.sqrt((k ** (-2.0 * DECAY)).sum()), 2)
        else:
            ways[3:, 2] = frame.axis
            waves, relative = cosines(at.travel[:, j], 1, ORDERS, DECAY)
        sizes = [SHIFT, SHIFT, SHIFT if turns(at.robot, site) else TILT, TILT, TILT]
        columns = np.broadcast_to(waves[:, None, :], (len(at), 5, waves.shape[1]))
        return of_joint(at, site, ways, columns, unit(np.outer(sizes, relative).ravel(), 1.0))

    def forms(self, robot: Robot, site: str) -> list[list[int]]:
        """One harmonic, or the lowest cosines along a sliding joint's travel, of one kind of error motion."""
        motions = ((0, 1), (2,), (3, 4))
        if turns(robot, site):
            waves = [(k, k + HARMONICS) for k in range(HARMONICS)]
            return [[2 * HARMONICS * m + w for m in ms for w in wave] for ms in motions for wave in waves]
        return [[ORDERS * m + w for m in ms for w in range(LOWEST)] for ms in motions]

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Sizes of the error motions: root mean squares over a turn."""
        a, b, c, tilt_a, tilt_b = (float(v) for v in np.sqrt((coefficients.reshape(5, -1) ** 2).sum(axis=1) / 2.0))
        return {
            "radial": (float(np.hypot(a, b)), "m"),
            "axial": (c, "m"),
            "tilt": (float(np.hypot(tilt_a, tilt_b)), "rad"),
        }

    def parameters_at(
        self, robot: Robot, site: str, coefficients: Floats, nonlinear: float | None
    ) -> dict[str, tuple[float, str]]:
        """The parameters at a site; for a sliding joint straightness and rotation."""
        if turns(robot, site):
            return self.parameters(coefficients, nonlinear)
        squares = (coefficients.reshape(5, -1) ** 2).sum(axis=1) / 2.0
        return {
            "straightness": (float(np.sqrt(squares[:2].sum())), "m"),
            "rotation": (float(np.sqrt(squares[2:].sum())), "rad"),
        }
