"""An instrument that moved once, or for a while, during the measurement: steps of its frame, sought along the rows.

As in :mod:`gtpin.calibration.checks.strain`, with a motion of the frame from some row on, and back from another: rows in
the order of the file, and by time where it was recorded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.calibration.checks.shifted_rows import FEWEST, own_session
from gtpin.calibration.checks.strain import motions
from gtpin.calibration.problem import Point, Problem
from gtpin.calibration.rounds import ENOUGH
from gtpin.data import Dataset
from gtpin.errors import DatasetError
from gtpin.noise.noise import Noise

Floats = npt.NDArray[np.float64]

RATIO = 2.0
"""Power of the residuals without steps over that with them from which steps are the reason. A stated assumption: a moved frame
accounts for all that is left, other causes for a part."""
LARGE = 4.0
"""Size of the step at the median pose, in standard deviations of what is left, from which data are refused. A stated
assumption: smaller ones are left to a diagnosis, which weighs them against drift and other causes."""
AHEAD = 1.2
"""Power that the best rival leaves over that which steps leave, from which it is steps: a motion of the frame in proportion to
time (to its third power), temperatures, payload or another recorded column that changes slowly. A stated assumption; with 150
poses of six numbers it is 80 nats."""
SIZE = 30.0
"""Prior size of a step, mm and mrad; so wide that its value hardly matters beside thousands of nats."""
GRID = 60
"""Rows that are tried at first; then those around the best."""
EDGE = FEWEST
"""Rows that are left on either side of a step, at least."""


def check_bumped(dataset: Dataset, problem: Problem, point: Point, noise: Noise) -> None:
    """Refuse data during which the instrument moved by much more than its noise.

    Parameters
    ----------
    dataset
        The rows of the problem.
    problem, point
        What is fitted, and a point about which all is linear.
    noise
        Of these rows; the drives' scatter is left out, since a step between visits of one pose looks like it.

    Raises
    ------
    DatasetError
        If one or two steps of the frame explain what the geometry leaves; it names the rows.
    """
    if len(dataset) < 4 * EDGE:
        return
    if len(dataset) > ENOUGH:  # an even part of very many
        rows = np.arange(0, len(dataset), 1 + len(dataset) // ENOUGH)
        dataset, noise = dataset.take(rows), noise.take(rows)
        problem = replace(problem, measured=problem.measured.take(rows), whitening=problem.whitening[rows])
        point = replace(point, poses=point.poses[rows])
    orders = {"": np.arange(len(dataset))}
    if "time" in dataset.covariates:
        orders[", in the order of the column time,"] = np.argsort(dataset.covariates["time"], kind="stable")
    whole = _Scan.of(problem, point, noise)
    for words, order in orders.items():
        scan = whole.ordered(order)
        steps: list[int] = []
        while len(steps) < 2 and scan.ratio(steps) < RATIO:
            steps = sorted([*steps, scan.best(steps)])
        rows = scan.rows[steps[0] : steps[1] if len(steps) > 1 else None]
        size, moved = scan.size(steps)
        if scan.ratio(steps) < RATIO or size < LARGE or own_session(dataset, rows):
            continue
        if scan.left_by(_rivals(dataset, scan.rows)) < AHEAD * scan.left(steps):
            continue
        lines = dataset.row[rows]
        raise DatasetError(
            f"rows {lines[0]} to {lines[-1]}{words} read {moved * 1e3:.2g} mm off what the others say, all by the same motion: "
            "the instrument was bumped or set up anew, or a drive's zero moved",
            file=dataset.file,
            row=int(lines[0]),
            hint="give these rows a session of their own in the column session, or leave them out",
        )


def _rivals(dataset: Dataset, rows: npt.NDArray[np.intp]) -> Floats:
    """(M, k) what may move the frame instead of steps: powers of the rows' order, and every numeric column but the moves'."""
    t = np.linspace(-1.0, 1.0, len(rows))
    columns = [t, t**2, t**3]
    for name, values in dataset.covariates.items():
        if name != "session" and not name.startswith(("approach", "speed")):
            column = np.asarray(values, dtype=float)[rows]
            spread = float(column.std())
            columns += [(column - column.mean()) / spread] if spread > 0.0 else []
    return np.stack(columns, axis=1)


@dataclass(frozen=True)
class _Scan:
    """Whitened derivatives by the geometry (N, c, p) and by the frame (N, c, 6), and residuals at nominal (N, c), in order."""

    rows: npt.NDArray[np.intp]
    J: Floats
    F: Floats
    y: Floats
    prior: Floats
    lengths: Floats

    @staticmethod
    def of(problem: Problem, point: Point, noise: Noise) -> _Scan:
        """All rows of a problem, linear about a point."""
        parts = problem.chunks()
        J = np.concatenate([problem.jacobian(point, part) for part in parts])
        F = np.concatenate([motions(problem, point, part)[:, :, :6] for part in parts])
        y = problem.residual(point) + J @ point.x
        colour = np.linalg.inv(problem.whitening)
        plain = replace(noise, repeatability=0.0, lack=0.0)
        again = plain.whitening(np.zeros((len(y), 6, 1)), problem.measured.components) @ colour
        lengths = colour[:, :3, :] @ F
        rows = np.arange(len(y))
        return _Scan(rows, again @ J, again @ F, np.einsum("nij,nj->ni", again, y), problem.prior, lengths)

    def ordered(self, rows: npt.NDArray[np.intp]) -> _Scan:
        """Some of the rows, in some order."""
        return _Scan(rows, self.J[rows], self.F[rows], self.y[rows], self.prior, self.lengths[rows])

    def best(self, steps: Sequence[int]) -> int:
        """The place of one more step that explains most."""
        count = len(self.rows)
        coarse = np.unique(np.linspace(EDGE, count - EDGE, GRID).astype(int))
        place = min(coarse, key=lambda k: self.left((*steps, int(k))))
        width = 1 + count // GRID
        near = range(max(EDGE, place - width), min(count - EDGE, place + width) + 1)
        return int(min(near, key=lambda k: self.left((*steps, k))))

    def ratio(self, steps: Sequence[int]) -> float:
        """Power of the residuals without steps over that with them."""
        return self.left(()) / max(self.left(steps), 1e-300)

    def left_by(self, rivals: Floats) -> float:
        """The same of a frame that moves in proportion to some columns (M, k)."""
        F = (self.F[:, :, None, :] * rivals[:, None, :, None]).reshape(*self.F.shape[:2], -1)
        J = np.concatenate([self.J, F], axis=2).reshape(-1, self.J.shape[2] + F.shape[2])
        s = np.concatenate([self._scale(0), np.full(F.shape[2], SIZE)])
        b = s * (J.T @ self.y.ravel())
        inner = np.eye(len(s)) + s[:, None] * (J.T @ J) * s
        return 0.5 * (float((self.y**2).sum()) - float(b @ np.linalg.solve(inner, b)))

    def size(self, steps: Sequence[int]) -> tuple[float, float]:
        """The first step: in standard deviations of what is left, and in m, at the median pose."""
        s = self._scale(len(steps))
        A, b, _ = self._normal(steps)
        delta = (s * np.linalg.solve(np.eye(len(s)) + s[:, None] * A * s, s * b))[len(self.prior) :][:6]
        moved = np.linalg.norm(self.F @ delta, axis=1)
        left = np.sqrt(2.0 * self.left(steps) / self.y.size)
        return float(np.median(moved)) / left, float(np.median(np.linalg.norm(self.lengths @ delta, axis=1)))

    @cached_property
    def _sums(self) -> tuple[Floats, Floats, Floats]:
        """(N + 1, 6, p), (N + 1, 6, 6), (N + 1, 6): products of the frame's derivative from each row on."""
        each = (
            np.einsum("nci,ncp->nip", self.F, self.J, optimize=True),
            np.einsum("nci,ncj->nij", self.F, self.F, optimize=True),
            np.einsum("nci,nc->ni", self.F, self.y, optimize=True),
        )
        return tuple(np.concatenate([np.cumsum(part[::-1], axis=0)[::-1], np.zeros_like(part[:1])]) for part in each)  # type: ignore[return-value]

    @cached_property
    def _geometry(self) -> tuple[Floats, Floats]:
        flat = self.J.reshape(-1, self.J.shape[2])
        return flat.T @ flat, flat.T @ self.y.ravel()

    def _scale(self, steps: int) -> Floats:
        return np.concatenate([np.where(self.prior > 0.0, 1.0, SIZE), np.full(6 * steps, SIZE)])

    def _normal(self, steps: Sequence[int]) -> tuple[Floats, Floats, float]:
        with_J, with_F, with_y = self._sums
        GG, Gy = self._geometry
        FJ = [with_J[k] for k in steps]
        FF = [[with_F[max(a, b)] for b in steps] for a in steps]
        A = np.block([[GG, *(f.T for f in FJ)], *([f, *row] for f, row in zip(FJ, FF, strict=True))]) if steps else GG
        b = np.concatenate([Gy, *(with_y[k] for k in steps)])
        return A, b, float((self.y**2).sum())

    def left(self, steps: Sequence[int]) -> float:
        """Half the power of the residuals that geometry and steps leave, each held to its prior."""
        A, b, power = self._normal(steps)
        s = self._scale(len(steps))
        inner = np.eye(len(s)) + s[:, None] * A * s
        return 0.5 * (power - float((s * b) @ np.linalg.solve(inner, s * b)))
