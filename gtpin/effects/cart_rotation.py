"""Smooth roll, pitch and yaw of a cart along its track (ISO 230-1: EAX, EBX, ECX)."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis
from gtpin.effects.chain_motions import joint_frame, of_joint
from gtpin.effects.effect import Effect, unit
from gtpin.effects.sites import sliding_carts
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import cosines, extent
from gtpin.effects.untestable import Untestable
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

ORDERS, DECAY = 20, 1.2
"""Number of cosines along the track for each axis, and the power p: the size of order k is proportional to k^-p."""


class CartRotation(Effect):
    """dC = w(q) x (C - M), M the mean of the cart's joints. ISO 230-1: EAX, EBX and ECX of a track X.

    C are the positions of the cart's joints, base frame, m, and dC their displacements. w is a small right-handed rotation
    vector, rad, base frame: about the track (roll) and about the axes a and b across it (pitch and yaw;
    :class:`~gtpin.effects.straightness.Straightness` defines a and b). It is a smooth function of the command q. The rotation
    of a cart with a single joint has no effect on the TCP.

    Parameters: ``rms_roll``, ``rms_a``, ``rms_b`` and ``peak_to_valley_roll``, ``_a``, ``_b``, rad, each after the best
    straight line along the track is subtracted.

    Typical size 0.1 mrad: a straightness deviation of 40 um (typical size of ``straightness``) over the 0.4 m between two
    runner blocks.
    """

    id = "cart_rotation"
    nature = "profile"
    title = "roll, pitch and yaw along the track"
    clause = "{site} rolls, pitches or yaws along its track"
    remedy = "Check the guideway's parallelism and the carriage's preload, or use the corrected model."
    coefficient = ("first_wave", "rad")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator that slides a carrier along a track."""
        return sliding_carts(robot)

    def untestable(self, at: Situation, site: str) -> Untestable | None:
        """``single_joint`` where the cart has one joint, because a rotation of the cart about it does not move it."""
        return None if len(joint_frame(at, site).indices) > 1 else Untestable("single_joint")

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Rotations about the track, a and b, each a sum of cosines along the track."""
        j = at.robot.sites.index(site)
        waves, size = cosines(at.travel[:, j], 1, ORDERS, DECAY)
        frame, ways = joint_frame(at, site), np.zeros((6, 3))
        ways[3:] = np.vstack([frame.axis, frame.across]).T
        columns = np.broadcast_to(waves[:, None, :], (len(at), 3, waves.shape[1]))
        return of_joint(at, site, ways, columns, unit(np.tile(size, 3), 1e-4))

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Root mean square and peak to valley of the rotation about each axis."""
        found: dict[str, tuple[float, str]] = {}
        for axis, part in zip(("roll", "a", "b"), np.split(coefficients, 3), strict=True):
            rms, span = extent(part)
            found |= {f"rms_{axis}": (rms, "rad"), f"peak_to_valley_{axis}": (span, "rad")}
        return found
