"""Observability of the geometry: variance reduction by direction, what the data can't see, and what would show it.

Each measurement that may make an unobservable direction observable is tried on the calibrated robot, to first order."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gtpin.calibration.gauss_newton import Fit
from gtpin.errors import renamed
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import frame_motions, skew
from gtpin.typing import Floats

UNSEEN = 0.5
"""A direction counts as unobservable if its variance reduction is below this value. Assumed."""
POSES = 12
"""Number of poses, evenly distributed over those of the data, at which each measurement is tried."""
RANGE, TOUCH, TILT, TRACKED = 2e-5, 1e-5, 5e-5, (2e-5, 5e-5)
"""Usual noise, m and rad, of a draw wire or ball bar, a touch probe, a tilt sensor, and a laser tracker. Assumed; only the
orders of magnitude matter."""
STATION, HEIGHT, TILTED, MOUNT = 0.5, 5e-3, 5e-3, 1e-2
"""Prior sigmas, m and rad, of the unknowns of these instruments: coordinates of a station, height and tilts of a plane, and
mounting of a tilt sensor. They are the defaults of dataset.toml."""


@dataclass(frozen=True)
class Direction:
    """A direction in parameter space.

    ``weights``: by parameter name: component of the direction's unit vector, in units of the tolerances. The largest first;
    absolute values below 0.1 are left out. ``variance_reduction``: 1 minus posterior variance over prior variance, along the
    direction.
    """

    weights: dict[str, float]
    variance_reduction: float
    learned = renamed("learned", "variance_reduction")


@dataclass(frozen=True)
class Observability:
    """Observability of the geometry, in units of tolerance.

    ``variance_reduction``: (p,) along each principal direction, smallest first. ``directions``: (p, p) the
    principal directions, one per column. ``indices``: O1 to O5 of the scaled whitened Jacobian's singular values s_1 >= ...
    >= s_p of m rows: (prod s)^(1/p) / sqrt(m), s_p / s_1, s_p, s_p^2 / s_1, 1 / sum(1 / s) (Borm and Menq 1991; Driels and
    Pathre 1990; Nahvi et al. 1994; Nahvi and Hollerbach 1996; Sun and Hollerbach 2008).
    """

    variance_reduction: Floats
    directions: Floats
    indices: dict[str, float]
    learned = renamed("learned", "variance_reduction")

    def unobservable(self, names: tuple[str, ...]) -> tuple[Direction, ...]:
        """Directions with a variance reduction below 0.5, the smallest first; ``names`` are those of the p parameters."""
        found = []
        for k in np.flatnonzero(self.variance_reduction < UNSEEN):
            vector = self.directions[:, k]
            vector = vector * np.sign(vector[np.argmax(np.abs(vector))])
            order = np.argsort(-np.abs(vector))
            weights = {names[i]: float(vector[i]) for i in order if abs(vector[i]) >= 0.1}
            found.append(Direction(weights, float(self.variance_reduction[k])))
        return tuple(found)


def observability(factor: Floats, n_geometry: int, rows: int) -> Observability:
    """Compute the observability from the whitened derivatives.

    ``factor``: (r, size) any matrix F with F'F = J'J, such as J or its triangular factor. J is the whitened derivative of
    the data by the geometry, in units of the tolerances, and then by unknowns without a prior. ``n_geometry``: number of
    columns of the geometry. ``rows``: number of measured components.
    """
    _, s, Vt = np.linalg.svd(of_geometry(factor, n_geometry))
    s = np.concatenate([s, np.zeros(n_geometry - len(s))])
    order, indices = np.argsort(s), {}
    if s.size:
        regular = bool(s[-1] > 1e-14 * s[0])
        indices = {
            "O1": float(np.exp(np.log(s).mean()) / np.sqrt(rows)) if regular else 0.0,
            "O2": float(s[-1] / s[0]) if s[0] > 0.0 else 0.0,
            "O3": float(s[-1]),
            "O4": float(s[-1] ** 2 / s[0]) if s[0] > 0.0 else 0.0,
            "O5": float(1.0 / (1.0 / s).sum()) if regular else 0.0,
        }
    return Observability((s**2 / (1.0 + s**2))[order], Vt.T[:, order], indices)


def with_priors(fitted: Fit) -> Floats:
    """Triangular factor of a fit's derivative, with a row for the prior of each unknown: it is information on this unknown."""
    priors = np.diag(fitted.problem.prior)[fitted.problem.n_geometry :]
    return np.vstack([fitted.factor, priors[priors.any(axis=1)]])


def of_geometry(factor: Floats, n_geometry: int) -> Floats:
    """Triangular factor of the information on the geometry alone, from that of all unknowns, as :func:`observability` has it.

    Unknowns without a prior (a free frame) absorb a part of the information: their columns come first and are eliminated.
    """
    free = factor.shape[1] - n_geometry
    whole = np.asarray(np.linalg.qr(np.hstack([factor[:, n_geometry:], factor[:, :n_geometry]]), mode="r"))
    return whole[free:, free:]


@dataclass(frozen=True)
class Remedy:
    """A measurement that would make a direction of the geometry observable.

    ``what``: what is measured. ``count``: number of poses, evenly distributed over those of the data. ``axis``: for
    ``touches``, the axis of the base frame along which the plane's normal is; else empty.
    """

    what: Literal["touches", "distances", "tilts", "positions", "poses"]
    count: int
    axis: str = ""


def remedies(fitted: Fit, directions: Floats, up: Floats) -> tuple[Remedy | None, ...]:
    """The simplest measurement that makes each direction observable; None where no candidate does.

    ``fitted``: the calibration's fit. ``directions``: (p, m) unit vectors in parameter space, in units of the tolerances.
    ``up``: (3,) unit vector against gravity, base frame.
    """
    problem, point = fitted.problem, fitted.point
    count = len(point.poses)
    rows = np.unique(np.linspace(0, count - 1, min(POSES, count)).astype(np.intp))
    poses = point.poses[rows]
    geometry = point.model.geometry
    # Only the six rows of the platform: the coordinates of measured joints are read already.
    J = point.model.kinematics.geometry_jacobian(problem.measured.q[rows], poses)[:, :6] * geometry.tolerance
    p = problem.n_geometry
    information = fitted.information + np.diag(problem.prior)
    found: list[Remedy | None] = [None] * directions.shape[1]
    for remedy, by_pose, by_unknown in _candidates(poses, up):
        open_ = [i for i, known in enumerate(found) if known is None]
        if not open_:
            break
        seen = (by_pose @ J).reshape(-1, p)
        own = by_unknown.reshape(len(seen), -1)
        absorbed = np.linalg.solve(np.eye(own.shape[1]) + own.T @ own, own.T @ seen)
        more = information.copy()
        more[:p, :p] += seen.T @ seen - (seen.T @ own) @ absorbed
        covariance = np.linalg.inv(more)[:p, :p]
        for i in open_:
            d = directions[:, i]
            if 1.0 - float(d @ covariance @ d) >= UNSEEN:
                found[i] = remedy
    return tuple(found)


def _candidates(poses: Poses, up: Floats) -> Iterator[tuple[Remedy, Floats, Floats]]:
    """Measurements at M poses, the simplest first: whitened derivatives by the platform's motion (M, c, 6), and by the
    measurement's own unknowns in units of their prior sigmas (M, c, k)."""
    count, middle = len(poses), poses.T.mean(axis=0)
    shift = np.zeros((count, 3, 6))
    shift[:, :, :3] = np.eye(3)
    for n, name in zip(np.eye(3), "xyz", strict=True):
        axes = np.eye(3)[n == 0.0]
        tilts = (poses.T - middle) @ np.cross(axes, n).T * TILTED
        unknown = np.concatenate([np.full((count, 1), HEIGHT), tilts], axis=1)[:, None]
        yield Remedy("touches", count, name), n[None, None] @ shift / TOUCH, unknown / TOUCH
    sight = poses.T - (middle + np.array([2.0, 1.0, 1.0]))
    sight = (sight / np.linalg.norm(sight, axis=1)[:, None])[:, None]
    yield Remedy("distances", count), sight @ shift / RANGE, -sight * STATION / RANGE
    seen = np.swapaxes(poses.R, 1, 2)
    turned = np.zeros((count, 2, 6))
    turned[:, :, 3:] = (seen @ skew(up))[:, :2]
    mount = skew(seen @ up)[:, :2] * MOUNT
    yield Remedy("tilts", count), turned / TILT, mount / TILT
    frame = frame_motions(poses.T - middle)
    yield Remedy("positions", count), shift / TRACKED[0], frame[:, :3] / TRACKED[0]
    sigma = np.array([TRACKED[0]] * 3 + [TRACKED[1]] * 3)[:, None]
    whole = np.broadcast_to(np.eye(6) / sigma, frame.shape)
    yield Remedy("poses", count), whole, frame / sigma
