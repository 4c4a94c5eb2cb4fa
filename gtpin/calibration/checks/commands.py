"""Other readings of commands: q is read as A q + z.

A has signs, units, orders and couplings of columns; z has zeros of drives. They are fitted with the instrument frame (F, f) and
the target's place t and rotation X, where these are free. Measured are the positions F (p + R t) + f and the rotations F R X,
with p and R the nominal TCP's at A q + z.

For given A and z the frame follows in closed form (Kabsch 1976), and t as the mean of R' (F' (T - f) - p), in alternation.
The zeros of joints that turn start from a grid over the whole turn. The best starts are refined by Gauss-Newton steps in z
alone, of the residuals after frame and target (variable projection, Golub and Pereyra 1973).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, combinations, product

import numpy as np

from gtpin.calibration.checks import limits
from gtpin.calibration.checks.readings import UNITS
from gtpin.calibration.problem import Measured
from gtpin.data.names import command_names
from gtpin.instruments.frame_and_target import nearest
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.rotations import log
from gtpin.robot.parameters import TOLERANCE
from gtpin.typing import Floats, Mask

QUARTER = np.pi / 2.0
"""Angle, rad, by whole numbers of which conventions of a joint's zero differ."""


@dataclass(frozen=True)
class CommandReading:
    """A way to read commands: ``matrix @ q``, plus a fitted zero for each of the columns with the indices ``zeros``.

    ``looks``, ``hints``: the mistakes in ``matrix``, each as the two texts of a message. ``columns``: those that are read in
    another way.
    """

    columns: str
    looks: tuple[str, ...]
    hints: tuple[str, ...]
    matrix: Floats
    zeros: tuple[int, ...] = ()

    @property
    def mistakes(self) -> int:
        """Number of mistakes that it assumes."""
        return len(self.looks) + len(self.zeros)

    def words(self, z: Floats, revolute: Mask) -> tuple[str, str]:
        """What the commands look like and what the user should do, with zeros z (n,), m or rad."""
        looks, hints = list(self.looks), list(self.hints)
        for j in self.zeros:
            degrees = f", {np.degrees(z[j]):+.4g} degrees" if revolute[j] else ""
            looks.append(f"q{j + 1} looks shifted by {z[j]:+.3g} (the drive's zero{degrees})")
            quarters = np.round(z[j] / QUARTER) if revolute[j] else 0.0
            # A convention differs by whole quarters of a turn: what is beyond is the zero, which a calibration finds.
            whole = quarters != 0.0 and abs(z[j] - quarters * QUARTER) < TOLERANCE["zero"]
            off = quarters * QUARTER if whole else z[j]
            hints.append(f"add {off:.6g} to q{j + 1}" + (f" ({90.0 * quarters:+.0f} degrees)" if whole else ""))
        return ", and ".join(looks), ", then ".join(hints)


def one_mistake(revolute: Mask) -> Iterator[CommandReading]:
    """Readings with one mistake: one column or all with the other sign or in another unit; two columns swapped; all columns in
    reverse order, or shifted by one; a joint counted from the one before it; a zero.

    ``revolute``: (n,) whether an actuator turns.
    """
    count, one = len(revolute), np.eye(len(revolute))
    names = command_names(count)
    everything = " ".join(names)
    for some in [*([i] for i in range(count)), *([list(range(count))] if count > 1 else [])]:
        columns, look = " ".join(names[i] for i in some), "looks" if len(some) == 1 else "look"
        units: tuple[tuple[str, float], ...] = () if revolute[some].any() else UNITS
        if revolute[some].all():
            units = (("degrees", float(np.pi / 180.0)),)
        for unit, factor in (("reversed", -1.0), *units):
            scale = np.ones(count)
            scale[some] = factor
            hint = f"change the sign of {columns}" if factor < 0.0 else f"multiply {columns} by {factor:.6g}"
            looks = f"{columns} {look} {'like ' if factor > 0.0 else ''}{unit}"
            yield CommandReading(columns, (looks,), (hint,), np.diag(scale))
    for i, j in combinations(range(count), 2):
        order = np.arange(count)
        order[[i, j]] = j, i
        looks = f"{names[i]} and {names[j]} look swapped"
        yield CommandReading(f"{names[i]} {names[j]}", (looks,), ("swap them",), one[order])
    if count > 2:
        if count > 3:  # of three, the first and the last are swapped
            yield CommandReading(everything, ("q1 .. qn look to be in reverse order",), ("reverse them",), one[::-1])
        for by in (1, -1):
            order = np.roll(range(count), by)
            assigned = ", ".join(f"{names[i]} = {names[j]}" for i, j in enumerate(order))
            yield CommandReading(
                everything, (f"{everything} look shifted by one",), (f"write ({assigned})",), one[order]
            )
    for j in range(1, count):
        if revolute[j - 1 : j + 1].all():
            yield from (_of_two(count, (j - 1, j), (1, 1), coupling, ()) for coupling in (1, -1))
    yield from (CommandReading(names[j], (), (), one, (j,)) for j in range(count))


def several_mistakes(revolute: Mask) -> Iterator[CommandReading]:
    """Readings with several mistakes in two columns: signs, zeros and, of neighbouring joints that turn, a coupling."""
    count = len(revolute)
    for pair in combinations(range(count), 2):
        coupled = pair[1] == pair[0] + 1 and revolute[list(pair)].all()
        subsets = chain.from_iterable(combinations(pair, k) for k in range(3))
        for zeros, *signs, coupling in product(subsets, (1, -1), (1, -1), (0, 1, -1) if coupled else (0,)):
            reading = _of_two(count, pair, (signs[0], signs[1]), coupling, zeros)
            if reading.mistakes > 1:
                yield reading


def _of_two(
    count: int, pair: tuple[int, int], signs: tuple[int, int], coupling: int, zeros: tuple[int, ...]
) -> CommandReading:
    """The reading with two columns of some signs, and the first one, as it stands, added to or taken from the second one."""
    matrix, names, looks, hints = np.eye(count), command_names(count), list[str](), list[str]()
    for j, sign in zip(pair, signs, strict=True):
        matrix[j, j] = sign
        if sign < 0:
            looks.append(f"{names[j]} looks reversed")
            hints.append(f"change the sign of {names[j]}")
    if coupling:
        matrix[pair[1], pair[0]] = coupling
        one, two = (names[j] for j in pair)
        total = f"{'-' * (signs[1] < 0)}{two} {'+' if coupling > 0 else '-'} {one}"
        looks.append(
            f"{two} looks counted from a fixed direction (as the horizontal) and not from the link before it: the joint turns "
            f"by {total}"
        )
        hints = [*hints[: signs[0] < 0], f"write {total} under {two}"]
        if signs[0] < 0:
            hints[0], hints[-1] = f"{hints[-1]} ({one} as it is now)", hints[0]
    changed = [names[j] for j in pair if j in zeros or (matrix[j] != np.eye(count)[j]).any()]
    return CommandReading(" ".join(changed), tuple(looks), tuple(hints), matrix, zeros)


@dataclass(frozen=True)
class CommandSearch:
    """Fits zeros, with the frame and the target where these are free, to measured poses.

    ``size``: size of the workspace, m: angles times this are compared with lengths. ``at``: (3,) place of the target, TCP
    frame, m; of a free target the first guess.
    """

    kinematics: Kinematics
    measured: Measured
    size: float
    free_frame: bool
    free_target: bool
    at: Floats

    def found(self, readings: Iterable[CommandReading]) -> Iterator[tuple[float, CommandReading, Floats]]:
        """The readings that come nearest to the measured poses: misfit, m, reading, and zeros z (n,), m or rad."""
        starts = [(reading, z) for reading in readings for z in self._grid(reading)]
        if not starts:  # several mistakes of one drive
            return
        some, zeros = [reading for reading, _ in starts], np.stack([z for _, z in starts])
        few = self._few(limits.START_ROWS)
        misfits = _misfits(
            self._residuals(few, np.stack([reading.matrix for reading in some]), zeros, limits.ROUGH_ALIGNMENTS)
        )
        for rows, keep, steps, rounds in (
            (few, limits.POLISHED, limits.ROUGH_ALIGNMENTS, limits.ROUGH_ALIGNMENTS),
            (self._few(limits.REFINED_ROWS), limits.REFINED, limits.ZERO_STEPS, limits.ALIGNMENTS),
        ):
            best = [k for k in np.argsort(misfits)[:keep] if np.isfinite(misfits[k])]
            if not best:
                return
            some = [some[k] for k in best]
            misfits, zeros = self._refined(some, zeros[best], rows, steps, rounds)
        named = set[int]()
        for k in np.argsort(misfits):  # of each reading the best start
            if id(some[k]) not in named:
                named.add(id(some[k]))
                yield float(misfits[k]), some[k], zeros[k]

    def _grid(self, reading: CommandReading) -> Iterator[Floats]:
        revolute = self.kinematics.robot.revolute
        # With loops, from another home only: their poses take longer.
        several = not self.kinematics.loops.count or (reading.matrix == np.eye(len(revolute))).all()
        grids = [limits.ZEROS if several and revolute[j] else np.zeros(1) for j in reading.zeros]
        for values in product(*grids):
            z = np.zeros(len(revolute))
            z[list(reading.zeros)] = values
            yield z

    def _few(self, count: int) -> Measured:
        """Some of the rows."""
        return self.measured.take(
            np.linspace(0, len(self.measured.T) - 1, min(len(self.measured.T), count)).astype(int)
        )

    def _residuals(self, measured: Measured, matrices: Floats, zeros: Floats, rounds: int) -> Floats:
        """(K, N, c) measured less predicted poses with K readings of the commands, m; NaN where one can't be reached.

        ``rounds``: number of alternating fits of frame and target, each with new weights of the rows.
        """
        T, R = measured.T, measured.R
        q = measured.q @ np.swapaxes(matrices, 1, 2) + zeros[:, None]
        poses = self.kinematics.forward(q.reshape(-1, q.shape[2]))
        p, turned = poses.T.reshape(len(q), -1, 3), poses.R.reshape(len(q), -1, 3, 3)
        reached = np.isfinite(p[..., 0])
        good = reached.mean(axis=1) > limits.REACHED
        reached = reached[good]
        p, turned = np.nan_to_num(p[good]), np.where(reached[..., None, None], turned[good], np.eye(3))
        far = np.linalg.norm(T - np.median(T, axis=0), axis=1)
        weight = (reached & (far <= limits.GROSS * np.median(far)))[..., None].astype(float)
        F, f, t = np.broadcast_to(np.eye(3), (len(p), 3, 3)), np.zeros((len(p), 1, 3)), np.tile(self.at, (len(p), 1, 1))
        for _ in range(rounds):
            weight = weight / weight.sum(axis=1, keepdims=True)
            at = p + (turned @ t[..., None])[..., 0]
            if self.free_frame:
                middle, seen = (weight * at).sum(axis=1, keepdims=True), (weight * T).sum(axis=1, keepdims=True)
                F = nearest(np.swapaxes(weight * (T - seen), 1, 2) @ (at - middle))
                f = seen - middle @ np.swapaxes(F, 1, 2)
            if self.free_target:
                aside = (np.swapaxes(turned, 2, 3) @ ((T - f) @ F - p)[..., None])[..., 0]
                t = (weight * aside).sum(axis=1, keepdims=True)
                at = p + (turned @ t[..., None])[..., 0]
            r = T - f - at @ np.swapaxes(F, 1, 2)
            off = np.linalg.norm(r, axis=2, keepdims=True)
            off = np.where(reached[..., None], off, np.nan)
            weight = np.nan_to_num(
                1.0 / np.maximum(off / np.maximum(np.nanmedian(off, axis=1, keepdims=True), limits.LEAST_MISFIT), 1.0)
            )
        if R is not None:
            seen = F[:, None] @ turned
            X = nearest((np.swapaxes(seen, 2, 3) @ R).sum(axis=1))[:, None] if self.free_target else np.eye(3)
            r = np.concatenate([r, self.size * log(R @ np.swapaxes(seen @ X, 2, 3))], axis=2)
        found = np.full((len(q), *r.shape[1:]), np.nan)
        found[good] = np.where(reached[..., None], r, np.nan)
        return found

    def _refined(
        self, readings: Sequence[CommandReading], z: Floats, measured: Measured, steps: int, rounds: int
    ) -> tuple[Floats, Floats]:
        """(K,) the smallest misfit, m, on the way of Gauss-Newton steps from zeros z (K, n), and (K, n) its zeros."""
        matrices = np.stack([reading.matrix for reading in readings])
        ways = np.zeros((max(len(reading.zeros) for reading in readings), *z.shape))
        for i, reading in enumerate(readings):
            for k, j in enumerate(reading.zeros):
                ways[k, i, j] = 1.0
        best, least = z, np.full(len(z), np.inf)
        for _ in range(steps):
            r = self._residuals(measured, matrices, z, rounds)
            misfit = _misfits(r)
            better = misfit < least
            best, least = np.where(better[:, None], z, best), np.where(better, misfit, least)
            changes = [self._residuals(measured, matrices, z + limits.ZERO_STEP * way, rounds) - r for way in ways]
            if not changes:  # no zeros
                break
            off = np.linalg.norm(r, axis=2, keepdims=True)
            weight = np.sqrt(1.0 / np.maximum(off / np.maximum(misfit[:, None, None], limits.LEAST_MISFIT), 1.0))
            J = np.nan_to_num(np.stack(changes, axis=3) * weight[..., None]).reshape(len(z), -1, len(ways))
            y = np.nan_to_num(r * weight).reshape(len(z), -1, 1)
            normal = np.swapaxes(J, 1, 2) @ J
            normal += (limits.RIDGE * np.trace(normal, axis1=1, axis2=2)[:, None, None] + limits.TINY) * np.eye(
                len(ways)
            )
            z = z - limits.ZERO_STEP * np.einsum(
                "kin,ik->in", ways, np.linalg.solve(normal, np.swapaxes(J, 1, 2) @ y)[:, :, 0]
            )
        turns = 2.0 * np.pi * np.round(best / (2.0 * np.pi))
        return least, np.where(self.kinematics.robot.revolute, best - turns, best)


def _misfits(residuals: Floats) -> Floats:
    """(K,) median length of residuals (K, N, c), m; infinite without any."""
    off = np.linalg.norm(residuals, axis=2)
    none = np.isnan(off).all(axis=1)
    return np.where(none, np.inf, np.nanmedian(np.where(none[:, None], 0.0, off), axis=1))
