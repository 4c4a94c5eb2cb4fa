"""The effect of a small error of each rod's parameters on the TCP: Table III of the paper, for any robot with rods."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.special import ndtr

from gtpin.accuracy.rods import reached_poses, rod_kinematics
from gtpin.accuracy.steps import PARAMETERS, STEP, RodStep, poses_after, rod_step
from gtpin.errors import ModelError, warn
from gtpin.kinematics.closures import RodEnds, pose_jacobian, rod_vectors
from gtpin.kinematics.euler import well_defined, zyz_change, zyz_rates
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.model.model import Model
from gtpin.typing import Floats

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Sums:
    """Changes summed over poses and both signs of the step, (10, k) by parameter and link; NaN where a link has none.

    Parameters
    ----------
    position
        \\|T - T+\\| + \\|T - T-\\|, m, with T+ and T- the TCP's positions after a step to each side (Dressler et al. 2010, eq.
        7).
    rotation
        Absolute changes of the three ZYZ Euler angles, rad; NaN where these are not well defined, as near the identity.
    cost
        Absolute changes of the link's own squared closure residual (\\|d\\|^2 - L^2)^2, m^4, with d the vector between its
        joints and L its length; None where residuals are not known.
    """

    position: Floats
    rotation: Floats
    cost: Floats | None


@dataclass(frozen=True)
class Sensitivity:
    """The sensitivity of a model at given commands.

    Parameters
    ----------
    links
        Names of the k rods.
    poses
        Number of commands that were summed over.
    step
        The step, m, or m/m for directions.
    exact
        Changes from the forward kinematics, solved again after the step.
    linear
        Changes from the Jacobian.
    """

    links: tuple[str, ...]
    poses: int
    step: float
    exact: Sums
    linear: Sums

    def to_table(self, way: Literal["exact", "linear"] = "exact") -> pd.DataFrame:
        """The columns ``parameter link position_mm rotation_rad cost_m4``, a row for each parameter that a link has.

        ``cost_m4`` is NaN where residuals are not known. A rod whose carrier has no track has no rows ``vx vy vz``.
        """
        import pandas as pd

        sums = self.exact if way == "exact" else self.linear
        cost = np.full(sums.position.shape, np.nan) if sums.cost is None else sums.cost
        table = pd.DataFrame(
            {
                "parameter": np.repeat(PARAMETERS, len(self.links)),
                "link": np.tile(self.links, len(PARAMETERS)),
                "position_mm": 1e3 * sums.position.ravel(),
                "rotation_rad": sums.rotation.ravel(),
                "cost_m4": cost.ravel(),
            }
        )
        return table.dropna(subset=["position_mm"]).reset_index(drop=True)


def sensitivity(
    model: Model,
    q: Floats,
    *,
    sigmas: Floats | None = None,
    measured: Poses | None = None,
    step: float = STEP,
) -> Sensitivity:
    """Change every rod's parameters, one at a time, by a step to both sides.

    Parameters
    ----------
    q
        (N, n) commands, m or rad.
    sigmas
        (k,) standard deviations of the rods' closure residuals \\|d\\|^2 - L^2, m^2: the changes of the cost are then
        expectations over Gaussian residuals. The paper's Table II gives each rod's
        final cost f, m^4, the sum of the squared residuals over M poses: sigma = sqrt(f / M).
    measured
        (N) measured poses, instrument's frame: the changes of the cost are then those of the actual residuals.
    step
        m; for directions m/m.

    Raises
    ------
    ModelError
        If the robot has no rods, or both ``sigmas`` and ``measured`` are given, or a wrong number of sigmas.
    UnreachableError
        If the commands can't be reached.
    ConvergenceError
        If the closures have no solution after a step, as may happen near a singularity.

    Warns
    -----
    GtpinWarning
        If the TCP's z axis is nearly parallel to the base's, so that ZYZ angles are singular at
        a pose: ``rotation`` is then NaN.
    """
    kinematics = rod_kinematics(model)
    poses = reached_poses(kinematics, q)
    links = tuple(rod.name for rod in model.robot.rods)
    seen = poses
    if measured is not None:
        if sigmas is not None or len(measured) != len(q):
            raise ModelError(
                "closure residuals are not clear", hint="give sigmas, or one measured pose for each command"
            )
        seen = measured.moved(-model.frame.R.T @ model.frame.T, model.frame.R.T)
    elif sigmas is not None and np.shape(sigmas) != (len(links),):
        raise ModelError(f"{np.size(sigmas)} closure sigmas", hint=f"give one for each of the {len(links)} rods")
    ends = kinematics.ends(q)
    d, RP = rod_vectors(poses, ends)
    response = np.linalg.inv(pose_jacobian(d, RP))
    defined = well_defined(poses.R)
    if not defined:
        warn("changes of orientation are left out: ZYZ angles jump at these poses")
    rates = zyz_rates(poses.R) if defined else np.full((len(q), 3, 3), np.nan)
    exact, linear = (np.full((3, len(PARAMETERS), len(links)), np.nan) for _ in range(2))
    for row, parameter in enumerate(PARAMETERS):
        for rod in range(len(links)):
            change = rod_step(kinematics, q, parameter, rod)
            if change is None:
                continue
            motion = -step * response[:, :, rod] * _gap(change, d[:, rod], ends, poses)[:, None]
            linear[0, row, rod] = 2.0 * np.linalg.norm(motion[:, :3], axis=1).sum()
            linear[1, row, rod] = 2.0 * np.abs(np.einsum("nij,nj->ni", rates, motion[:, 3:])).sum()
            both = [_exact(kinematics, ends, poses, change, sign * step) for sign in (1.0, -1.0)]
            exact[:2, row, rod] = both[0] + both[1]
            if measured is not None or sigmas is not None:
                sigma = None if sigmas is None else float(sigmas[rod])
                exact[2, row, rod], linear[2, row, rod] = _cost(change, ends, seen, step, sigma)
    known = measured is not None or sigmas is not None
    sums = [Sums(s[0], s[1], s[2] if known else None) for s in (exact, linear)]
    return Sensitivity(links, len(q), step, sums[0], sums[1])


def step_slopes(model: Model, q: Floats, poses: Poses, parameters: tuple[str, ...]) -> tuple[Floats, Floats]:
    """Size of the TCP's motion per unit of each parameter of each rod, from the Jacobian.

    Parameters
    ----------
    q, poses
        (N, n) commands, m or rad, and (N) their poses, base frame.
    parameters
        Some of :data:`~gtpin.accuracy.steps.PARAMETERS`; results are NaN where a rod has no such parameter.

    Returns
    -------
    position, rotation
        (N, len(parameters), k) each: length of the TCP's displacement, and sum of the absolute changes of the ZYZ angles.
    """
    kinematics = rod_kinematics(model)
    ends = kinematics.ends(q)
    d, RP = rod_vectors(poses, ends)
    response = np.linalg.inv(pose_jacobian(d, RP))
    length = np.linalg.norm(response[:, :3], axis=1)
    angles = np.abs(np.einsum("nij,njk->nik", zyz_rates(poses.R), response[:, 3:])).sum(axis=1)
    by_gap = np.full((len(q), len(parameters), d.shape[1]), np.nan)
    for row, parameter in enumerate(parameters):
        for rod in range(d.shape[1]):
            change = rod_step(kinematics, q, parameter, rod)
            if change is not None:
                by_gap[:, row, rod] = np.abs(_gap(change, d[:, rod], ends, poses))
    return by_gap * length[:, None], by_gap * angles[:, None]


def step_sums(kinematics: RodKinematics, q: Floats, poses: Poses, change: RodStep, sigma: float, step: float) -> Floats:
    """(3,) exact sums of :class:`Sums` over poses (N) and both signs of a step of any change of one rod.

    Parameters
    ----------
    sigma
        Standard deviation of the rod's closure residual, m^2.
    """
    ends = kinematics.ends(q)
    both = [_exact(kinematics, ends, poses, change, sign * step) for sign in (1.0, -1.0)]
    return np.array([*(both[0] + both[1]), _cost(change, ends, poses, step, sigma)[0]])


def _gap(change: RodStep, d: Floats, ends: RodEnds, poses: Poses) -> Floats:
    """(N,) derivative of the rod's closure (|d|^2 - L^2) / 2 by the parameter, d (N, 3)."""
    L = np.broadcast_to(ends.L, (len(poses), ends.L.shape[1]))[:, change.rod]
    return np.asarray(np.einsum("ni,ni->n", d, change.vector(poses)) - L * change.L)


def _exact(kinematics: RodKinematics, ends: RodEnds, poses: Poses, change: RodStep, step: float) -> Floats:
    """(2,) sums over the poses of the changes of position, m, and of the ZYZ angles, rad."""
    moved = poses_after(kinematics, ends, poses, change, step)
    position = np.linalg.norm(moved.T - poses.T, axis=1).sum()
    rotation = np.abs(zyz_change(moved.R, poses.R)).sum() if well_defined(poses.R) else np.nan
    return np.array([position, rotation])


def closure_change(change: RodStep, ends: RodEnds, poses: Poses, step: float) -> tuple[Floats, Floats]:
    """A rod's closure |d|^2 - L^2 at fixed poses (N,), m^2, and its change by a step."""
    d = rod_vectors(poses, ends)[0][:, change.rod]
    L = np.broadcast_to(ends.L, (len(poses), ends.L.shape[1]))[:, change.rod]
    move, grown = step * change.vector(poses), step * change.L
    before = np.einsum("ni,ni->n", d, d) - L**2
    # Expanded: a difference of two squares of lengths of about 2 m would lose seven digits.
    return before, np.einsum("ni,ni->n", 2.0 * d + move, move) - (2.0 * L + grown) * grown


def _cost(change: RodStep, ends: RodEnds, poses: Poses, step: float, sigma: float | None) -> tuple[float, float]:
    """Exact and linear sums over poses and signs of the changes of the squared closure."""
    sums = np.zeros(2)
    gap = _gap(change, rod_vectors(poses, ends)[0][:, change.rod], ends, poses)
    for sign in (1.0, -1.0):
        c, exact = closure_change(change, ends, poses, sign * step)
        for i, by in enumerate((exact, 2.0 * sign * step * gap)):
            sums[i] += (np.abs(by * (2.0 * c + by)) if sigma is None else _expected_change(by, sigma)).sum()
    return float(sums[0]), float(sums[1])


def _expected_change(by: Floats, sigma: float) -> Floats:
    """(N,) expectation of |(c + by)^2 - c^2| for c ~ N(0, sigma^2): the mean of a folded normal distribution."""
    mean, spread = by**2, 2.0 * np.abs(by) * sigma
    safe = np.where(spread > 0.0, spread, 1.0)
    ratio = mean / safe
    folded = spread * np.sqrt(2.0 / np.pi) * np.exp(-0.5 * ratio**2) + mean * (1.0 - 2.0 * ndtr(-ratio))
    return np.where(spread > 0.0, folded, mean)
