"""A deviation of a turning joint that is kept only at the angles at which it was measured.

Many lines of a joint together describe a curve that is measured where the joint had commands. At other angles the sum of the
lines is an extrapolation that can be much larger than the deviation.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.effect import Effect
from gtpin.effects.situation import PARTS, TURN, Situation
from gtpin.typing import Floats


def part_of_turn(angle: Floats) -> npt.NDArray[np.intp]:
    """Index of the part of a turn that has each angle, rad; whole turns make no difference."""
    return np.asarray(np.floor(angle / TURN * PARTS).astype(int) % PARTS)


def where_measured(at: Situation, effect: Effect, site: str, values: tuple[float, ...]) -> Basis:
    """The basis of a turning joint's deviation, as :meth:`~gtpin.effects.effect.Effect.basis_of`, for a new calibration.

    The deviation is zero at angles that the fit did not have. The geometry absorbs a deviation of the form
    p0 + p1 cos(q) + p2 sin(q), exactly or nearly; an earlier fit determines this part badly. It is subtracted by least squares
    over the angles of the fit, so that the new geometry need not absorb it at these angles alone.
    """
    j = at.robot.sites.index(site)
    lower, upper = (float(ends[j]) for ends in at.references.commands)
    angles = _centres(at.references.angles[j], lower, upper)
    columns = _columns(_at(at, j, angles), effect, site, values)
    absorbed = np.linalg.lstsq(_absorbed(angles), columns, rcond=None)[0]
    q = _within(at.q[:, j], lower, upper)
    basis = effect.basis_of(replace(at, q=_with(at.q, j, q)), site, values)
    assert basis.command is not None
    kept = (basis.command[1] - _absorbed(q) @ absorbed) * at.references.angles[j][part_of_turn(at.q[:, j])][:, None]
    return along_track(at, site, kept, basis.sigma)


def _within(angle: Floats, lower: float, upper: float) -> Floats:
    """Angles moved by whole turns into the range of the fit where possible, else as near to it as possible."""
    middle = 0.5 * (lower + upper)
    outside = (angle < lower) | (angle > upper)
    nearest = angle - TURN * np.round((angle - middle) / TURN)
    return np.where(outside, nearest, angle)


def _centres(measured: npt.NDArray[np.bool_], lower: float, upper: float) -> Floats:
    """The middles of the measured parts of a turn, in the range of the fit, rad."""
    middles = TURN * (np.arange(PARTS) + 0.5) / PARTS
    return np.clip(_within(middles[measured], lower, upper), lower, upper)


def _absorbed(angle: Floats) -> Floats:
    """(N, 3) 1, cos(q), sin(q)."""
    return np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)


def _columns(at: Situation, effect: Effect, site: str, values: tuple[float, ...]) -> Floats:
    command = effect.basis_of(at, site, values).command
    assert command is not None
    return command[1]


def _at(at: Situation, j: int, angles: Floats) -> Situation:
    """The robot at home, with joint j at some angles, rad."""
    q = _with(np.tile(at.robot.home_q, (len(angles), 1)), j, angles)
    return replace(at, q=q, poses=at.kinematics.forward(q), covariates={}, fixed=at.references)


def _with(q: Floats, j: int, angle: Floats) -> Floats:
    changed = q.copy()
    changed[:, j] = angle
    return changed
