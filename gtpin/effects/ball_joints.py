"""Joints of links: play, and balls that are not round."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import ClassVar

import numpy as np

from gtpin.effects.displacement import Displacement, along_track, of_lengths, rods_of
from gtpin.effects.effect import ChainWords, Effect, ParameterRange, Parameters, unit
from gtpin.effects.joints import loaded, no_load
from gtpin.effects.modulation import MODULATION
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import links, loaded_along
from gtpin.effects.smooth import drive_sizes, loads_of
from gtpin.effects.untestable import Untestable
from gtpin.typing import Floats

FEWEST = 2
"""Smallest number of poses with the rarer sign of the force: a single pose can't be distinguished from a gross error."""


class JointClearance(Effect):
    """dL = c sign(F); dL is the change of the link's length, m, and F its axial force, N, tension positive.

    In tension the link is longer by c than in the middle of the play. In compression it is shorter by c. The modulation: where
    the force is small, the ball can be anywhere within the play; under larger forces the socket also deforms.

    At a joint of a robot without rods: dq = c sign(M). dq is the deviation of the joint from its command, rad or m. M is the
    moment about the joint's axis, N m, or the force along it, N, positive towards larger commands. The sign of the load
    decides at which side of the play the joint rests. Where the direction of approach decides it, the effect is ``backlash``.

    Parameters: ``half_play`` c, m, positive for real play; ``play`` = 2 c, m; ``yielding``, m: further change of length,
    beyond the play, when the force changes by one spread. The spread is the standard deviation over the poses of the fit; at a
    joint of a robot without rods, the absolute mean is added to it. Where a joint turns, the parameters are in rad.

    Typical size 15 um in each direction. It is a guess for a worn ball joint; new ball joints are preloaded and have no play.
    """

    id = "joint_clearance"
    title = "joint play"
    clause = "a joint of {site} has play"
    of_chains = ChainWords(
        clause="{site} has play, which its load takes up", remedy="Replace the gear or bearing, or preload it."
    )
    remedy = "Replace or preload the joint."
    coefficient = ("half_play", "m")
    acts_at = staticmethod(loaded_along)
    depends_on = ("load",)
    core = (0,)
    of_travel = True
    plausible: ClassVar[Mapping[str, ParameterRange]] = {
        "half_play": ParameterRange(0.0, np.inf, "play makes a link longer in tension, not shorter")
    }

    def untestable(self, at: OperatingPoints, site: str) -> Untestable | None:
        """``one_sign``, ``no_load`` or ``no_masses``: play can be observed only where the force changes its sign."""
        if not loaded(at, site):
            return no_load(at)
        pulled = int((loads_of(at, site)[0] > 0.0).sum())
        return None if min(pulled, len(at) - pulled) >= FEWEST else Untestable("one_sign")

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        """The sign of the force, a smooth transition where the force is small, and yielding."""
        rods, (load, mean, spread) = rods_of(at, site), (values[..., 0] for values in loads_of(at, site))
        scale, sign = spread if rods else np.maximum(np.abs(mean) + spread, 1e-9), np.sign(load)
        columns = np.stack([sign, np.tanh(load / (0.2 * scale)) - sign, load / scale], axis=1)
        sizes = drive_sizes(at, site, [1.0, MODULATION.soft_clearance, MODULATION.yielding], 1.5e-5)
        return of_lengths(at, rods, columns[:, None], sizes) if rods else along_track(at, site, columns, sizes)

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        half, yielding = float(coefficients[0]), float(coefficients[2])
        return {"half_play": (half, "m"), "play": (2.0 * half, "m"), "yielding": (yielding, "m")}


ORDERS = [(m, n) for m, n in product(range(6), repeat=2) if 1 <= m + n <= 5]
"""Orders (m, n) of the products of cosines over the two angles of a link."""


class JointRunout(Effect):
    """dL = f(a, b); dL is the change of the link's length, m, positive where it is longer.

    a and b are the two small angles, rad, between the link and its mean direction over the poses of the fit. f is a sum of
    products of cosines. Cosines of long wavelength have larger typical sizes. Geometry absorbs the part of f that is constant
    or linear in the angles.

    Parameters: ``rms``, root mean square of f over the range of directions, m; ``largest_wave``, the largest absolute
    coefficient of f, m.

    Typical size 15 um. Balls of grade 100 are round to 2.5 um, of grade 200 to 5 um (ISO 3290). Machined or worn sockets are
    less round.
    """

    id = "joint_runout"
    title = "out-of-round ball"
    clause = "a ball of {site} is out of round"
    remedy = "Have the ball and its socket measured, or replaced."
    coefficient = ("first_wave", "m")
    acts_at = staticmethod(links)
    depends_on = ("direction",)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        """Products of cosines over the two angles of the link about its mean direction."""
        i = rods_of(at, site)[0]
        a, b = (np.clip(at.tilt[:, i, c] / 2.5, -1.5, 1.5) for c in (0, 1))
        waves = [np.cos(np.pi / 2.0 * m * (a + 1.0)) * np.cos(np.pi / 2.0 * n * (b + 1.0)) for m, n in ORDERS]
        size = np.array([(m + n) ** -1.2 for m, n in ORDERS])
        size *= 2.0 / np.linalg.norm(size)
        return of_lengths(at, [i], np.stack(waves, axis=1)[:, None, :], unit(size, 1.5e-5))

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        # The mean square of a cosine is 1/2, that of a product of two cosines 1/4.
        square = np.array([0.25 if m and n else 0.5 for m, n in ORDERS])
        rms = float(np.sqrt(square @ coefficients**2))
        return {"rms": (rms, "m"), "largest_wave": (float(np.abs(coefficients).max()), "m")}
