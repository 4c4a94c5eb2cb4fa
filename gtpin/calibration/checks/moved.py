"""Rows with the commands of others, or measured after the instrument had moved: in a sequence of rows, or between sessions.

A large motion shows against the nominal machine. A smaller one is searched for after the fit as steps of the frame along the
rows, in the order of the file and of time, or between sessions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from gtpin.calibration.checks import limits
from gtpin.calibration.checks.recognise import expected_errors
from gtpin.calibration.checks.suspected import refuse, suspect
from gtpin.calibration.problem import FRAME_UNIT, Measured, Point, Problem, measured_poses, problem_of, rough_frame
from gtpin.data import Dataset
from gtpin.errors import DatasetError, listed
from gtpin.instruments.readings import Readings
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import frame_motions
from gtpin.model.model import Model
from gtpin.noise.estimate import ENOUGH
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.typing import Floats, Indices, Mask

OWN = "give these rows a session of their own in the column session, or leave them out"
"""What the user should do with rows that were measured after a motion of the instrument."""


def check_stretch(dataset: Dataset, measured: Measured, predicted: Poses, far: Mask, *, bumps: bool = True) -> None:
    """Suspect data in which a stretch of rows is shifted relative to its commands, or was measured from another place.

    ``measured``, ``predicted``: (N) measured poses, and poses that a model predicts at the commands of the same rows, both
    in the instrument's frame. ``far``: (N,) rows with large errors. ``bumps``: whether a motion of the instrument is
    searched for too: not before a fit, since a nominal robot that is far off looks like one.

    Raises `DatasetError` if one of the two explains a stretch; it names the rows by their lines in the file.
    """
    part = stretch(far)
    if part is None:
        return
    first, last = part.start, part.stop - 1
    off = np.linalg.norm(measured.T - predicted.T, axis=1)
    usual, before = float(np.nanmedian(off[~far])) if not far.all() else 0.0, float(np.nanmedian(off[part]))
    # A neighbour's command or a moved frame explains the whole error or nothing.
    mended = max(0.1 * before, 3.0 * usual)
    file, row, rows = dataset.file, int(dataset.row[first]), f"rows {dataset.row[first]} to {dataset.row[last]}"
    inner = slice(first + 1, last)  # the ends have no neighbour in the stretch
    for by, neighbour in ((1, "before"), (-1, "after")):  # shift of the commands, and the row from which each has them
        left = _median_off(measured.T[inner], np.roll(predicted.T, by, axis=0)[inner])
        if left < mended:
            what = f"the commands look one row off in {rows}: what was measured there fits the commands of the row {neighbour}"
            hint = "move the commands of these rows, or export the table anew"
            return suspect(DatasetError(what, file=file, row=row, hint=hint), dataset, (before, 0.0), (left, 0.0))
    if not bumps:
        return
    moved = rough_frame(predicted[part], measured.take(part))
    left = _median_off(measured.T[part], predicted[part].moved(moved.T, moved.R).T)
    if left < mended and not own_session(dataset, part):
        what = f"{rows} are {1e3 * before:.3g} mm from where the other rows say, all by the same motion: the instrument was "
        what += "bumped or set up anew"
        suspect(DatasetError(what, file=file, row=row, hint=OWN), dataset, (before, 0.0), (left, 0.0))


def stretch(far: Mask) -> slice | None:
    """The stretch of rows that contains most of the rows with large errors (``far``); None where these are few or scattered."""
    count = int(far.sum())
    if count < max(limits.STRETCH_ROWS, 0.1 * len(far)):  # scattered gross errors are a tenth at most
        return None
    # The run of largest sum where a far row counts one and another one takes one away (Kadane).
    best, here, start, found = 0, 0, 0, slice(0, 1)
    for i, value in enumerate(np.where(far, 1, -1)):
        if here <= 0:
            here, start = 0, i
        here += int(value)
        if here > best:
            best, found = here, slice(start, i + 1)
    inside = far[found]
    dense = len(inside) >= limits.STRETCH_ROWS and inside.mean() >= 0.6 and inside.sum() >= 0.6 * count
    return found if dense else None


def _median_off(one: Floats, other: Floats) -> float:
    return float(np.nanmedian(np.linalg.norm(one - other, axis=1)))


def own_session(dataset: Dataset, rows: Indices | slice) -> bool:
    """Whether some rows are most of the rows of their sessions, so that effects of sessions can account for them."""
    if "session" not in dataset.covariates:
        return False
    inside = np.zeros(len(dataset), dtype=bool)
    inside[rows] = True
    session = np.unique(dataset.covariates["session"], return_inverse=True)[1]
    share = np.bincount(session, inside) / np.bincount(session)
    return bool(len(share) > 1 and np.median(share[session[inside]]) > 0.8)


@dataclass(frozen=True)
class FrameScan:
    """Fits motions of the instrument's frame along N rows, linearly and together with the geometry; both have priors.

    J and F are the whitened derivatives by the problem's p unknowns and by the frame's six motions (mm and mrad), S the
    standard deviations of the unknowns' priors. With L L' = I + S J'J S and K = L^-1 S J', the normal equations of the
    motions, after the geometry was fitted to residuals y, are F'F - (K F)'K F and F'y - (K F)'K y.

    - ``rows``: (N,) indices of the rows in the problem, in the order of the search.
    - ``F``: (N, c, 6), and ``lengths``: (N, 3, 6) displacement of the measured positions, m, by the motions.
    - ``absorbed``, ``squares``, ``moments``: (N, p, 6) K F, (N, 6, 6) F'F and (N, 6) F'y of each row.
    - ``absorbed_y``, ``alone``: (p,) K y, and half the sum of squares of the residuals without motions.
    """

    rows: Indices
    F: Floats
    lengths: Floats
    absorbed: Floats
    squares: Floats
    moments: Floats
    absorbed_y: Floats
    alone: float

    @staticmethod
    def of(problem: Problem, point: Point, noise: ReadingNoise) -> FrameScan:
        """Linearise a problem about a point, for all rows; ``noise``: theirs, of which repeatability is not used."""
        count, c = len(point.poses), problem.measured.components
        whitening = replace(noise, repeatability=0.0).whitening(np.zeros((count, c, 1)), c)
        problem = replace(problem, whitening=whitening)
        J = np.concatenate([problem.jacobian(point, part) for part in problem.chunks()])
        motion = FRAME_UNIT * frame_motions(point.model.in_instrument_frame(point.poses).T - problem.pivot)
        F, y, flat = whitening @ motion[:, :c], problem.residual(point) + J @ point.x, J.reshape(-1, J.shape[2])
        s = np.where(problem.prior > 0.0, 1.0, limits.STEP_SIZE)
        lower = np.linalg.cholesky(np.eye(len(s)) + s[:, None] * (flat.T @ flat) * s)
        by_row = np.einsum("ncp,nci->npi", J * s, F, optimize=True)
        absorbed = solve_triangular(lower, by_row.swapaxes(0, 1).reshape(len(s), -1), lower=True)
        absorbed_y = solve_triangular(lower, s * (y.ravel() @ flat), lower=True)
        return FrameScan(
            rows=np.arange(count),
            F=F,
            lengths=motion[:, :3],
            absorbed=absorbed.reshape(len(s), count, 6).swapaxes(0, 1),
            squares=np.einsum("nci,ncj->nij", F, F, optimize=True),
            moments=np.einsum("nci,nc->ni", F, y, optimize=True),
            absorbed_y=absorbed_y,
            alone=0.5 * float((y**2).sum() - (absorbed_y**2).sum()),
        )

    def ordered(self, rows: Indices) -> FrameScan:
        """The same for the rows with these indices, in this order."""
        by_row = {name: getattr(self, name)[rows] for name in ("F", "lengths", "absorbed", "squares", "moments")}
        return replace(self, rows=rows, **by_row)

    def fitted(self, columns: Floats) -> tuple[Floats, Floats]:
        """S frames whose motions are linear in k columns each, (S, N, k).

        Returns (S,) half the sum of squares that geometry and motions leave, with their priors; and (S, k, 6) the motions for a
        unit of each column, mm and mrad.
        """
        sets, _, k = columns.shape
        X = np.einsum("snk,npi->spki", columns, self.absorbed, optimize=True).reshape(sets, -1, 6 * k)
        FF = np.einsum("snk,snl,nij->skilj", columns, columns, self.squares, optimize=True)
        Fy = np.einsum("snk,ni->ski", columns, self.moments, optimize=True).reshape(sets, 6 * k)
        b = limits.STEP_SIZE * (Fy - self.absorbed_y @ X)
        inner = FF.reshape(sets, 6 * k, 6 * k) - X.swapaxes(1, 2) @ X
        x = np.linalg.solve(np.eye(6 * k) + limits.STEP_SIZE**2 * inner, b[..., None])[..., 0]
        return self.alone - 0.5 * (b * x).sum(axis=1), limits.STEP_SIZE * x.reshape(sets, k, 6)

    def moved(self, columns: Floats) -> tuple[float, Floats, Floats]:
        """For columns (N, k): what :meth:`fitted` leaves; and (k,) the motion for a unit of each column at the median pose, in
        units of the noise and in m."""
        left, motions = self.fitted(columns[None])
        noises, metres = (
            np.median(np.linalg.norm(np.einsum("nij,kj->kni", by, motions[0]), axis=2), axis=1)
            for by in (self.F, self.lengths)
        )
        return float(left[0]), noises, metres

    def after(self, steps: Sequence[int] | Indices) -> Floats:
        """(N, k) columns of steps of the frame: 1 from the first row after each step on."""
        return (np.arange(len(self.rows))[:, None] >= np.asarray(steps)).astype(float)

    def next_step(self, steps: Sequence[int]) -> int:
        """The step that together with ``steps`` leaves the smallest residuals."""
        count = len(self.rows)
        allowed = [
            k
            for k in range(limits.STRETCH_ROWS, count - limits.STRETCH_ROWS + 1)
            if all(abs(k - step) >= limits.STRETCH_ROWS for step in steps)
        ]
        coarse = np.unique(np.linspace(0, len(allowed) - 1, 60).astype(int))

        def least(places: list[int]) -> int:
            return places[int(np.argmin(self.fitted(np.stack([self.after([*steps, k]) for k in places]))[0]))]

        place = least([allowed[i] for i in coarse])
        return least([k for k in allowed if abs(k - place) <= 1 + count // 60])


def initial_noise(measured: Readings) -> ReadingNoise:
    """The declared noise, or the instruments' usual one where none is declared."""
    known = np.zeros(len(measured.initial_sigma), dtype=bool)
    return ReadingNoise(measured.initial_sigma, measured.group, measured.row_sigma, known)


def check_instrument_steps(dataset: Dataset, problem: Problem, point: Point, noise: ReadingNoise) -> None:
    """Suspect data during which the instrument moved by much more than its noise; an error names the rows.

    ``dataset``, ``noise``: the rows of the problem, and their noise. ``point``: about which the problem is linearised.
    """
    if len(dataset) < 4 * limits.STRETCH_ROWS:
        return
    if len(dataset) > ENOUGH:  # of very many rows, evenly spaced ones are enough
        rows = np.arange(0, len(dataset), 1 + len(dataset) // ENOUGH)
        dataset, noise = dataset.take(rows), noise.take(rows)
        problem = problem.take(rows, problem.whitening[rows])
        point = replace(point, poses=point.poses[rows])
    orders = {"": np.arange(len(dataset))}
    if "time" in dataset.covariates:
        orders[", in the order of the column time,"] = np.argsort(dataset.covariates["time"], kind="stable")
    whole = FrameScan.of(problem, point, noise)
    numbers = whole.F[..., 0].size
    for words, order in orders.items():
        scan = whole.ordered(order)
        steps, left, size, moved = list[int](), scan.alone, 0.0, 0.0
        while len(steps) < 2 and scan.alone < limits.STEP_RATIO * left:
            steps = sorted([*steps, scan.next_step(steps)])
            left, (size, *_), (moved, *_) = scan.moved(scan.after(steps))
        rows = scan.rows[steps[0] : steps[1] if len(steps) > 1 else None]
        # Smaller steps are left to a diagnosis, which compares them with drift and other causes.
        small = scan.alone < limits.STEP_RATIO * left or size < 4.0 * np.sqrt(2.0 * left / numbers)
        if small or own_session(dataset, rows):
            continue
        # With 150 poses of six numbers, a ratio of 1.2 is a log likelihood ratio of 80 nats.
        if scan.moved(_alternatives(dataset, scan.rows))[0] < 1.2 * left:
            continue
        lines = dataset.row[rows]
        what = (
            f"rows {lines[0]} to {lines[-1]}{words} read {moved * 1e3:.2g} mm off what the others say, all by the same "
        )
        what += "motion: the instrument was bumped or set up anew, or a drive's zero moved"
        error = DatasetError(what, file=dataset.file, row=int(lines[0]), hint=OWN)
        sigmas = float(noise.sigma[0]), float(noise.sigma[1]) if whole.F.shape[1] == 6 else 0.0
        before, after = ([size * np.sqrt(2.0 * power / numbers) for size in sigmas] for power in (scan.alone, left))
        return suspect(error, dataset, (before[0], before[1]), (after[0], after[1]))


def _alternatives(dataset: Dataset, rows: Indices) -> Floats:
    """(M, k) alternatives to steps: powers of the rows' order, and all numeric columns but directions and speeds."""
    t = np.linspace(-1.0, 1.0, len(rows))
    columns = [t, t**2, t**3]
    for name, values in dataset.covariates.items():
        if name != "session" and not name.startswith(("approach", "speed")):
            column = np.asarray(values, dtype=float)[rows]
            spread = float(column.std())
            columns += [(column - column.mean()) / spread] if spread > 0.0 else []
    return np.stack(columns, axis=1)


def check_sessions(dataset: Dataset, nominal: Model, poses: Poses) -> None:
    """Check that the instrument had the same pose in all sessions.

    ``poses``: (N) poses of the nominal model at the dataset's commands, base frame; NaN where it can't reach.

    Raises `DatasetError` if the pose differs; it names the sessions, and the distance of each from the largest one, m.
    """
    there = np.flatnonzero(poses.reached)
    if not len(there):
        return
    part, poses = dataset.take(there), poses[there]
    moved = _moved(part, nominal, poses)
    if limits.SESSION_FAR <= max(moved.values(), default=0.0) < 0.1:  # m: more is no error of the geometry
        moved = _moved_linear(part, problem_of(part, poses, nominal, free=dataset.instrument.frame == "free"), poses)
    _suspect(dataset, moved, limits.SESSION_FAR)


def check_sessions_linear(dataset: Dataset, problem: Problem, near: Poses, least: float) -> None:
    """As :func:`check_sessions`, after a fit: with one geometry for all sessions, it finds smaller motions.

    ``problem``, ``near``: the problem about the nominal machine, and the machine's poses, base frame. ``least``: smallest
    motion, m, for which data are refused.

    Raises `DatasetError` if motions of the frame between sessions explain most of the power of the residuals.
    """
    _suspect(dataset, _moved_linear(dataset, problem, near), least)


def _moved_linear(dataset: Dataset, problem: Problem, near: Poses) -> dict[str, float]:
    """As `_moved`, by a linear fit of one geometry and of each session's frame."""
    sessions, names = _sessions(dataset)
    if len(names) < 2:
        return {}
    rows = np.arange(0, len(dataset), 1 + len(dataset) // ENOUGH)
    thin = problem.take(rows, problem.whitening[rows])
    scan = FrameScan.of(thin, thin.point(np.zeros(thin.size), near[rows]), initial_noise(thin.measured))
    columns = (sessions[rows, None] == np.array(names[1:])).astype(float)
    left, _, moved = scan.moved(columns)
    return {} if scan.alone < 4.0 * left else dict(zip(names, [0.0, *moved.tolist()], strict=True))


def _suspect(dataset: Dataset, moved: dict[str, float], least: float) -> None:
    """Suspect an instrument that moved by ``least`` m or more; ``moved``: distances from the first session, m."""
    first, *others = moved or [""]
    far = sorted((name for name in others if moved[name] >= least), key=lambda name: -moved[name])
    if not far:
        return
    moves = listed([f"{1e3 * moved[name]:.3g} mm in session {name}" for name in far], limits.NAMED)
    moves += " sessions" * (len(far) > limits.NAMED)
    what = f"the instrument moved between sessions: from where it stood in session {first} by {moves}"
    hint = 'set stations = "session" under [instrument]: the frame of each session is found too; or register the sessions to '
    hint += "common marks and give all poses in one frame"
    refuse(DatasetError(what, file=dataset.file, column="session", hint=hint), dataset)


def _sessions(dataset: Dataset) -> tuple[NDArray[np.str_], list[str]]:
    """The session of each row, and the names of the sessions with at least `limits.FEWEST_ROWS` rows, the largest first."""
    if "session" not in dataset.covariates:
        return np.full(len(dataset), ""), []
    sessions = np.array([str(name) for name in dataset.covariates["session"]])
    names, counts = np.unique(sessions, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    return sessions, [str(names[k]) for k in order if counts[k] >= limits.FEWEST_ROWS]


def _moved(dataset: Dataset, nominal: Model, poses: Poses) -> dict[str, float]:
    """Distance, m, of each session's poses from where the frame of the largest session puts them; empty where not clear."""
    measured = measured_poses(dataset)
    sessions, names = _sessions(dataset)
    places, left = {}, np.full(len(poses), np.nan)
    for name in names:
        own = sessions == name
        wide, narrow = (
            np.linalg.svd(T - T.mean(axis=0), compute_uv=False) / len(T) ** 0.5 for T in (poses.T, poses.T[own])
        )
        if measured.R is None and narrow[1] <= limits.LINE * wide[0]:  # positions on a line do not determine a frame
            continue
        places[name] = frame = rough_frame(poses[own], measured.take(own))
        left[own] = np.linalg.norm(measured.T[own] - poses[own].moved(frame.T, frame.R).T, axis=1)
    if len(places) < 2:
        return {}
    first = next(iter(places.values()))
    moved = {
        name: _median_off(poses.T[sessions == name] @ (frame.R - first.R).T, first.T - frame.T)
        for name, frame in places.items()
    }
    some = np.linspace(0, len(poses) - 1, min(len(poses), 100)).astype(int)
    expected = expected_errors(nominal, measured.q[some], poses[some])[0]
    # The best frame for a part of the workspace absorbs errors of the nominal model.
    clear = max(4.0 * float(np.nanmedian(left)), 3.0 * expected)
    return moved if max(moved.values()) > clear else {}
