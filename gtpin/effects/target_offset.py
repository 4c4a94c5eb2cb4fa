"""The target is not where the TCP is assumed to be."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis
from gtpin.effects.effect import Effect, unit
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot
from gtpin.typing import Floats


class TargetOffset(Effect):
    """dT = R p: the target is at p in the TCP frame, not at the TCP; R rotates from the TCP frame to the base frame.

    dT is the deviation of the measured position, m, base frame.

    A geometry in which all joints on the platform are moved by -p predicts the same poses. Geometry therefore absorbs the
    offset as far as the tolerances of these joints allow.

    Parameters: ``offset_x``, ``offset_y``, ``offset_z``: p, m.

    Typical size 1 mm: the tolerance of a target holder that was mounted and not measured.
    """

    id = "target_offset"
    title = "target offset"
    clause = "the target is not where the TCP is assumed to be"
    remedy = "Measure the target's place on the platform."
    coefficient = ("offset_x", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """The platform."""
        return ("platform",)

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """The position of the TCP."""
        return ("position",)

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Offsets along the TCP frame's axes."""
        twist = np.zeros((len(at), 6, 3))
        twist[:, :3] = at.poses.R
        return Basis(unit(np.ones(3), 1e-3), twist=twist)

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """The offset's components."""
        return {f"offset_{axis}": (float(c), "m") for axis, c in zip("xyz", coefficients, strict=True)}
