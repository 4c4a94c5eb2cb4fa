"""Where an instrument stood and where its target sits on the platform, from nominal and measured poses, by likelihood.

A measured position is F (p + R t) + f, a measured rotation F R X: p and R are the nominal TCP's, F and f the base frame's
rotation and origin in the instrument's frame, t and X the target's place and rotation in the TCP frame. Positions and rotations
are fitted together, each weighted by its own robust scale, from several starts. The one that ends with the largest likelihood
is taken. What the poses do not determine is fixed by weak priors on t and X alone: there the target is at the TCP, and the
frame takes up the difference.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp, left_jacobian, log, skew
from gtpin.typing import Floats

AWAY, TURN = 0.3, 2.0
"""Standard deviations of the priors of a target's coordinates about the TCP, m, and of its rotation vector, rad. Assumed: a
target is some tenths of metres from the TCP, turned in any way."""
SEEN = 0.5
"""Smallest share of the prior variance of a target's coordinate that must be taken away for the coordinate to be determined."""
ROWS, FEW = 2000, 60
"""Number of poses that are enough for the fit, and for the choice of its starts. Assumed."""
ROUNDS = 40
"""Number of Gauss-Newton steps, each with new weights and scales."""
TRIED, TRIED_ROUGHLY = 5, 2
"""Number of starts that are fitted, and of a rough result: those with the largest likelihood. Assumed."""
ROUGH = 12
"""Number of steps that choose among these starts."""
FRAME_CHANGE = 1e-7
"""Change of the log likelihood of a pose at which the fit has settled."""
LEAST = 1e-9
"""Smallest scale of residuals, m and rad."""
MEDIAN = 1.538
"""Median length of a vector of three standard normal numbers."""


@dataclass(frozen=True)
class Placement:
    """A frame and a target.

    - ``shift``, ``turn``: f (3,), m, and F (3, 3): the base frame in the instrument's frame.
    - ``at``, ``mount``: t (3,), m, and X (3, 3): the target in the TCP frame.
    - ``scale``: robust standard deviations of the residuals for each axis: positions, m, and rotations, rad (NaN without
      rotations).
    - ``at_sigma``, ``mount_sigma``: largest standard deviation of ``at`` along any direction, m, and of ``mount``, rad; at
      most those of the priors.
    - ``unseen``: (k, 3) orthogonal unit vectors of the TCP frame along which the poses do not determine ``at``.
    """

    shift: Floats
    turn: Floats
    at: Floats
    mount: Floats
    scale: tuple[float, float]
    at_sigma: float
    mount_sigma: float
    unseen: Floats

    @staticmethod
    def at_tcp(shift: Floats, turn: Floats) -> Placement:
        """A known frame, and the target at the TCP."""
        return Placement(shift, turn, np.zeros(3), np.eye(3), (0.0, 0.0), 0.0, 0.0, np.zeros((0, 3)))

    def moved(self, poses: Poses) -> Poses:
        """Poses of the target, instrument's frame, of TCP poses in the base frame."""
        return Poses(poses.T + poses.R @ self.at, poses.R @ self.mount).moved(self.shift, self.turn)


def frame_and_target(
    poses: Poses, T: Floats, R: Floats | None, *, free_frame: bool = True, rough: bool = False
) -> Placement:
    """The frame and the target with which nominal poses fit measured ones best; gross errors have little weight.

    ``poses``: (N) nominal poses of the TCP, base frame. ``T``, ``R``: (N, 3) measured positions, m, and (N, 3, 3) measured
    rotations; None: the target's rotation is set to the identity. ``free_frame``: whether the frame is unknown; otherwise
    it is the base frame. ``rough``: from few poses and starts, good enough to compare ways to read the data.
    """
    every = np.linspace(0, len(T) - 1, min(len(T), ROWS)).astype(int)
    fit = _Fit(poses[every], T[every], None if R is None else R[every], free_frame)
    some = np.linspace(0, len(every) - 1, min(len(every), FEW)).astype(int)
    few = _Fit(fit.poses[some], fit.T[some], None if fit.R is None else fit.R[some], free_frame)
    starts = sorted((few.started(F) for F in few.frames()), key=few.cost)
    best = min((few.settled(start, ROUGH) for start in starts[: TRIED_ROUGHLY if rough else TRIED]), key=few.cost)
    if rough:
        return few.placement(best)
    return fit.placement(fit.settled(best, ROUNDS))


@dataclass(frozen=True)
class _State:
    """An iterate: the middle of the nominal positions is the origin of the base frame here."""

    f: Floats
    F: Floats
    t: Floats
    X: Floats


@dataclass(frozen=True)
class _Fit:
    poses: Poses
    T: Floats
    R: Floats | None
    free: bool

    @property
    def middle(self) -> Floats:
        """(3,) the origin about which a free frame turns."""
        return np.asarray(np.median(self.poses.T, axis=0)) if self.free else np.zeros(3)

    def frames(self) -> list[Floats]:
        """First guesses of F: from positions without a target, from rotations, from both numbers of positions; and turned."""
        if not self.free:
            return [np.eye(3)]
        found = [_kabsch(self.poses.T, self.T)]
        if self.R is not None:
            found.append(_from_rotations(self.poses.R, self.R))
        if len(self.T) >= 14:
            found.append(_bilinear(self.poses, self.T))
        turns = [exp(np.pi / 2.0 * k * np.eye(3)[axis]) for axis, k in product(range(3), (1, 2, 3))]
        return [*found, *(F @ turn for F in found for turn in turns)]

    def started(self, F: Floats) -> _State:
        """The state with a given F, the rest by linear least squares."""
        X = np.eye(3)
        if self.R is not None:
            turns = np.swapaxes(F @ self.poses.R, 1, 2) @ self.R
            X = nearest(turns.sum(axis=0))
            weight = 1.0 / np.maximum(np.linalg.norm(turns - X, axis=(1, 2)), 1e-2)
            X = nearest((weight[:, None, None] * turns).sum(axis=0))
        A, residual = F @ self.poses.R, self.T - (self.poses.T - self.middle) @ F.T
        weight, t, f = np.ones(len(residual)), np.zeros(3), -F @ self.middle
        for _ in range(5):
            f = np.average(residual - A @ t, axis=0, weights=weight) if self.free else f
            mean = np.average(A, axis=0, weights=weight) if self.free else np.zeros((3, 3))
            centre = np.average(residual, axis=0, weights=weight) if self.free else np.zeros(3)
            B, b = A - mean, residual - centre
            inner = np.einsum("n,nji,njk->ik", weight, B, B) + np.eye(3) * (1e-2 / AWAY) ** 2
            t = np.linalg.solve(inner, np.einsum("n,nji,nj->i", weight, B, b))
            off = np.linalg.norm(b - B @ t, axis=1)
            weight = 1.0 / np.maximum(off / max(float(np.median(off)), LEAST), 1.0)
        f = np.average(residual - A @ t, axis=0, weights=weight) if self.free else np.zeros(3)
        return _State(f, F, t, X)

    def residuals(self, s: _State) -> tuple[Floats, Floats | None]:
        """(N, 3) position residuals, m, and (N, 3) rotation residuals, rad, or None; instrument's frame."""
        at = (self.poses.T - self.middle + self.poses.R @ s.t) @ s.F.T + s.f
        turns = None if self.R is None else log(self.R @ np.swapaxes(s.F @ self.poses.R @ s.X, 1, 2))
        return self.T - at, turns

    def cost(self, s: _State) -> float:
        """Negative log likelihood with the scales that fit best, and the priors."""
        position, rotation = self.residuals(s)
        size = _scale(position)
        found = 3.0 * len(position) * np.log(size)
        if rotation is not None:
            found += 3.0 * len(rotation) * np.log(_scale(rotation))
        return float(found + 0.5 * (s.t @ s.t) / AWAY**2 + 0.5 * float((log(s.X[None])[0] ** 2).sum()) / TURN**2)

    def settled(self, s: _State, rounds: int) -> _State:
        """The state after Gauss-Newton steps; the one with the largest likelihood on the way."""
        best, least = s, self.cost(s)
        for _ in range(rounds):
            normal, gradient = self.normal(s)
            step = np.asarray(np.linalg.solve(normal + 1e-9 * np.diag(np.diag(normal)), gradient), dtype=np.float64)
            s = self.stepped(s, step)
            cost = self.cost(s)
            still = abs(cost - least) < FRAME_CHANGE * len(self.T)
            if cost < least:
                best, least = s, cost
            if still:
                break
        return best

    def stepped(self, s: _State, step: Floats) -> _State:
        f, F = s.f, s.F
        if self.free:
            f, F, step = f + step[:3], exp(step[3:6]) @ F, step[6:]
        return _State(f, F, s.t + step[:3], s.X if self.R is None else exp(step[3:6]) @ s.X)

    def normal(self, s: _State) -> tuple[Floats, Floats]:
        """Normal equations in (f, F, t, X), of what is free, with the priors."""
        position, rotation = self.residuals(s)
        A = s.F @ self.poses.R
        arm = (self.poses.T - self.middle + self.poses.R @ s.t) @ s.F.T
        one = np.broadcast_to(np.eye(3), A.shape)
        columns = [one, -skew(arm), A] if self.free else [A]
        places = [np.concatenate([*columns, np.zeros_like(A)][: len(columns) + (rotation is not None)], axis=2)]
        parts = [position]
        if rotation is not None:
            zero = np.zeros_like(A)
            places.append(np.concatenate([zero, one, zero, A] if self.free else [zero, A], axis=2))
            parts.append(rotation)
        size = places[0].shape[2]
        normal, gradient = np.zeros((size, size)), np.zeros(size)
        for J, r in zip(places, parts, strict=True):
            off = np.linalg.norm(r, axis=1)
            weight = 1.0 / np.maximum(off / max(float(np.median(off)), LEAST), 1.0) / _scale(r) ** 2
            flat = (np.sqrt(weight)[:, None, None] * J).reshape(-1, size)
            normal += flat.T @ flat
            gradient += flat.T @ (np.sqrt(weight)[:, None] * r).ravel()
        first = 6 if self.free else 0
        normal[first : first + 3, first : first + 3] += np.eye(3) / AWAY**2
        gradient[first : first + 3] -= s.t / AWAY**2
        if rotation is not None:
            vector = log(s.X[None])[0]
            inverse = np.linalg.inv(left_jacobian(vector))  # change of the vector by a turn in the TCP frame
            normal[first + 3 :, first + 3 :] += inverse.T @ inverse / TURN**2
            gradient[first + 3 :] -= inverse.T @ vector / TURN**2
        return normal, gradient

    def placement(self, s: _State) -> Placement:
        """The result of a state."""
        position, rotation = self.residuals(s)
        covariance = np.linalg.inv(self.normal(s)[0])
        first = 6 if self.free else 0
        values, vectors = np.linalg.eigh(covariance[first : first + 3, first : first + 3])
        turned = np.linalg.eigvalsh(covariance[first + 3 :, first + 3 :])[-1] if rotation is not None else TURN**2
        return Placement(
            shift=s.f - s.F @ self.middle if self.free else np.zeros(3),
            turn=s.F,
            at=s.t,
            mount=s.X,
            scale=(_scale(position), np.nan if rotation is None else _scale(rotation)),
            at_sigma=float(np.sqrt(values[-1])),
            mount_sigma=float(np.sqrt(turned)),
            unseen=vectors[:, values > (1.0 - SEEN) * AWAY**2].T,
        )


def _scale(r: Floats) -> float:
    """Robust standard deviation of residuals (N, 3) along each axis."""
    return max(float(np.median(np.linalg.norm(r, axis=1))) / MEDIAN, LEAST)


def nearest(matrices: Floats) -> Floats:
    """(..., 3, 3) the rotations that are nearest to matrices."""
    U, _, Vt = np.linalg.svd(matrices)
    U[..., 2] *= np.linalg.det(U @ Vt)[..., None]
    return np.asarray(U @ Vt)


def _kabsch(at: Floats, T: Floats) -> Floats:
    """The rotation that takes positions to others (Kabsch 1976), without those that are far from all others."""
    far = np.linalg.norm(T - np.median(T, axis=0), axis=1)
    near = far <= 10.0 * np.median(far)
    a, b = at[near] - np.median(at[near], axis=0), T[near] - np.median(T[near], axis=0)
    return nearest(b.T @ a)


def _from_rotations(R: Floats, seen: Floats) -> Floats:
    """F with seen = F R X: from the nearest Kronecker product (Van Loan and Pitsianis 1993), then by alternating fits."""
    # vec(F R X) = (F kron X') vec(R), rows stacked: the matrix by least squares, its factors by a singular vector.
    matrix = np.linalg.lstsq(R.reshape(-1, 9), seen.reshape(-1, 9), rcond=None)[0].T
    parts = matrix.reshape(3, 3, 3, 3).transpose(0, 2, 1, 3).reshape(9, 9)
    first = np.linalg.svd(parts)[0][:, 0].reshape(3, 3)
    F = nearest(first * np.sign(np.linalg.det(first)))
    weight = np.ones(len(R))
    for _ in range(20):
        X = nearest(np.einsum("n,nji,njk->ik", weight, F @ R, seen))
        F = nearest(np.einsum("n,nij,nkj->ik", weight, seen, R @ X))
        angle = np.linalg.norm(seen - F @ R @ X, axis=(1, 2))
        weight = 1.0 / np.maximum(angle / max(float(np.median(angle)), 1e-9), 1.0)
    return F


def _bilinear(poses: Poses, T: Floats) -> Floats:
    """F from positions alone: T = F p + F R t + f is linear in F, in the products of the numbers of F and t, and in f."""
    rows = np.hstack([poses.T, poses.R.reshape(-1, 9), np.ones((len(T), 1))])
    found = np.asarray(np.linalg.lstsq(rows, T, rcond=None)[0], dtype=np.float64)
    return nearest(found[:3].T)


ALIGNMENTS = 20
"""Number of fits, each with new weights of the poses. Assumed."""


def alignment(poses: Poses, T: Floats, R: Floats | None) -> tuple[Floats, Floats]:
    """Position (3,), m, and rotation (3, 3) of the frame of poses in the frame of measured positions and rotations.

    By least squares from a singular value decomposition (Kabsch 1976), of the positions T (N, 3), m, and, where given, of the
    rotations R (N, 3, 3). Gross errors have little weight.
    """
    far = np.linalg.norm(T - np.median(T, axis=0), axis=1)
    weight = (far <= 10.0 * np.median(far)).astype(float)
    for _ in range(ALIGNMENTS):
        shift, turn = aligned(poses, T, R, weight)
        off = np.linalg.norm(T - poses.moved(shift, turn).T, axis=1)
        weight = 1.0 / np.maximum(off / max(float(np.median(off)), 1e-9), 1.0)
    return shift, turn


def aligned(poses: Poses, T: Floats, R: Floats | None, weight: Floats, radian: float = 1.0) -> tuple[Floats, Floats]:
    """As :func:`alignment`, with given weights (N,); 1 rad counts as much as ``radian``, m."""
    w = weight / weight.sum()
    centre_a, centre_b = w @ poses.T, w @ T
    a, b = poses.T - centre_a, T - centre_b
    # Orientations determine the rotation even if positions don't.
    turns = np.zeros((3, 3)) if R is None else radian**2 * np.einsum("n,nij,nkj->ik", w, R, poses.R)
    turn = nearest((w[:, None] * b).T @ a + turns)
    return centre_b - turn @ centre_a, turn
