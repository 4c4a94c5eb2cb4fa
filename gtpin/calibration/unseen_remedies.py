"""Which measurement would make an unobservable direction observable: each is tried on the calibrated robot, to first order."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gtpin.calibration.gauss_newton import Fit
from gtpin.calibration.observability import UNSEEN
from gtpin.calibration.problem import Problem
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import frame_motions, skew
from gtpin.typing import Floats

POSES = 12
"""Number of poses, evenly distributed over those of the data, at which each measurement is tried."""
RANGE, TOUCH, TILT, TRACKED = 2e-5, 1e-5, 5e-5, (2e-5, 5e-5)
"""Usual noise, m and rad, of a draw wire or ball bar, a touch probe, a tilt sensor, and a laser tracker. Assumed; only the
orders of magnitude matter."""
STATION, HEIGHT, TILTED, MOUNT = 0.5, 5e-3, 5e-3, 1e-2
"""Prior sigmas, m and rad, of the unknowns of these instruments: coordinates of a station, height and tilts of a plane, and
mounting of a tilt sensor. They are the defaults of dataset.toml."""
ALONG = (
    ((1.0, 0.0, 0.0), "x"),
    ((0.0, 1.0, 0.0), "y"),
    ((0.0, 0.0, 1.0), "z"),
)


@dataclass(frozen=True)
class Remedy:
    """A measurement that would make a direction of the geometry observable.

    ``what``: what is measured. ``count``: number of poses, evenly distributed over those of the data. ``axis``: for
    ``touches``, the axis of the base frame along which the plane's normal is; else empty.
    """

    what: Literal["touches", "distances", "tilts", "positions", "poses"]
    count: int
    axis: str = ""


@dataclass(frozen=True)
class Candidate:
    """A measurement that could be made.

    ``remedy``: its description. ``by_pose``: (M, c, 6) whitened derivative by the platform's motion. ``by_unknown``: (M, c,
    k) whitened derivative by the measurement's own unknowns, in units of their prior sigmas.
    """

    remedy: Remedy
    by_pose: Floats
    by_unknown: Floats


def remedies(fitted: Fit[Problem], directions: Floats, up: Floats) -> tuple[Remedy | None, ...]:
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
    for candidate in _candidates(poses, up):
        open_ = [i for i, remedy in enumerate(found) if remedy is None]
        if not open_:
            break
        seen = (candidate.by_pose @ J).reshape(-1, p)
        own = candidate.by_unknown.reshape(len(seen), -1)
        absorbed = np.linalg.solve(np.eye(own.shape[1]) + own.T @ own, own.T @ seen)
        more = information.copy()
        more[:p, :p] += seen.T @ seen - (seen.T @ own) @ absorbed
        covariance = np.linalg.inv(more)[:p, :p]
        for i in open_:
            d = directions[:, i]
            if 1.0 - float(d @ covariance @ d) >= UNSEEN:
                found[i] = candidate.remedy
    return tuple(found)


def _candidates(poses: Poses, up: Floats) -> Iterator[Candidate]:
    """Measurements at some poses, the simplest first."""
    count, middle = len(poses), poses.T.mean(axis=0)
    shift = np.zeros((count, 3, 6))
    shift[:, :, :3] = np.eye(3)
    for normal, name in ALONG:
        n = np.array(normal)
        axes = np.eye(3)[[i for i in range(3) if n[i] == 0.0]]
        tilts = (poses.T - middle) @ np.cross(axes, n).T * TILTED
        unknown = np.concatenate([np.full((count, 1), HEIGHT), tilts], axis=1)[:, None]
        yield Candidate(Remedy("touches", count, name), n[None, None] @ shift / TOUCH, unknown / TOUCH)
    sight = poses.T - (middle + np.array([2.0, 1.0, 1.0]))
    sight = (sight / np.linalg.norm(sight, axis=1)[:, None])[:, None]
    yield Candidate(Remedy("distances", count), sight @ shift / RANGE, -sight * STATION / RANGE)
    seen = np.swapaxes(poses.R, 1, 2)
    turned = np.zeros((count, 2, 6))
    turned[:, :, 3:] = (seen @ skew(up))[:, :2]
    mount = skew(seen @ up)[:, :2] * MOUNT
    yield Candidate(Remedy("tilts", count), turned / TILT, mount / TILT)
    frame = frame_motions(poses.T - middle)
    yield Candidate(Remedy("positions", count), shift / TRACKED[0], frame[:, :3] / TRACKED[0])
    sigma = np.array([TRACKED[0]] * 3 + [TRACKED[1]] * 3)[:, None]
    whole = np.broadcast_to(np.eye(6) / sigma, frame.shape)
    yield Candidate(Remedy("poses", count), whole, frame / sigma)
