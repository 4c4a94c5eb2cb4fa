"""Usual mistakes of units, axes, signs and frames, tried on the nominal model where data do not fit it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import astuple, dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from gtpin.calibration.checks import limits, readings
from gtpin.calibration.checks.commands import CommandSearch
from gtpin.calibration.checks.readings import Reading
from gtpin.calibration.problem import Measured, rough_frame, without_target
from gtpin.data import InstrumentSection
from gtpin.data.instrument_tables import TrackerTable
from gtpin.data.names import ORIENTATION
from gtpin.instruments.frame_and_target import frame_and_target, nearest
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import log
from gtpin.model.model import Frame, Model
from gtpin.typing import Floats

_OF_TCP = ", or move the URDF's tcp link there if the TCP was measured"
_ELSEWHERE = ("the instrument looks to stand elsewhere than in the base frame", 'set frame = "free" under [instrument]')


@dataclass(frozen=True, kw_only=True)
class Interpretation(Reading):
    """A way to read the data, compared with the nominal model.

    - ``measured``, ``poses``: the measured poses of the TCP, or of a free target, read in this way, and the TCP's poses that
      the nominal model predicts, base frame.
    - ``misfit``: median distance of the measured poses from the predicted ones, m.
    - ``elsewhere``: whether the instrument is assumed to stand elsewhere, though it is not declared free.
    """

    measured: Measured
    poses: Poses
    misfit: float
    elsewhere: bool = False


def recognised(
    nominal: Model,
    poses: Poses,
    measured: Measured,
    instrument: InstrumentSection | TrackerTable,
    *,
    failed: bool = False,
) -> Interpretation | None:
    """The usual mistake that makes data fit the nominal model; None where they fit without a correction, or no mistake fits.

    ``failed``: whether a fit of the data has failed. Then any correction is named that leaves a tenth of the misfit.

    These are tried, alone and together: units of lengths, of some axes or all; axes that are swapped or reversed; quaternions
    that are inverted or along other axes, Euler angles and rotation vectors; commands in another order, sign or unit, or
    shifted; an instrument at another place than the base frame's; a target at another place than the TCP.

    ``poses``: (N) poses of the nominal model at the measured commands, base frame; NaN where it can't reach. ``instrument``:
    what is declared of its frame and target.
    """
    some = np.linspace(0, len(poses) - 1, min(len(poses), 100)).astype(int)
    search = Search(nominal, measured.take(some), poses[some], instrument, failed)
    if search.size == 0.0 or (search.misfit <= search.accepted and not failed):
        return None
    # A wrong geometry, frame or target takes up some part of a mistake, and not nine tenths of it.
    enough = min(search.misfit / 10.0, search.accepted)
    most = enough if failed else min(search.misfit / limits.BETTER, search.accepted)
    tried = [reading for reading in search.tried(min(enough, search.expected)) if reading.misfit <= most]
    if not tried:
        return None
    # A misfit like that of correct data is enough: readings with free numbers, of a frame or a rotation, always fit better.
    # But none of these leaves a fifth of it.
    least = min(reading.misfit for reading in tried)
    alike = max(limits.AS_GOOD * least + limits.CLOSE * search.size, min(search.fits, limits.MORE_MISTAKES * least))
    good = [reading for reading in tried if reading.misfit <= alike]
    fewest = min(reading.mistakes for reading in good)
    chosen = [reading for reading in good if reading.mistakes == fewest]
    # Of readings that fit equally well none is preferred: all are named, those as good as the best and the usual ones first.
    best = min(chosen, key=lambda reading: reading.misfit)
    # The workspace is that of the best reading: commands in another unit predict poses kilometres away.
    accepted = limits.ACCEPTED * _size(best.poses) + limits.ALLOWED
    close = max(limits.AS_GOOD * best.misfit, min(search.fits, accepted, limits.MORE_MISTAKES * best.misfit))
    named = [reading for reading in chosen if reading.misfit <= close]
    named.sort(key=lambda reading: reading.misfit > limits.AS_GOOD * best.misfit)
    looks, hints = readings.either(named)
    if len({reading.looks for reading in named}) > 1:
        hints += "; the data fit equally well with each: find out which is true, for parameters and causes depend on it"
    return replace(named[0], looks=looks, hint=hints)


def expected_errors(nominal: Model, q: Floats, poses: Poses) -> tuple[float, float]:
    """Median position error, m, and rotation, rad, of the nominal model that its tolerances let expect at commands (N, n)."""
    J = nominal.kinematics.geometry_jacobian(q, poses) * nominal.geometry.tolerance
    T, R = (float(np.median(np.sqrt((J[:, rows] ** 2).sum(axis=(1, 2))))) for rows in (slice(0, 3), slice(3, 6)))
    return T, R


class Search:
    """Compares data with a nominal model. A misfit is a distance, m; angles are multiplied by the workspace's size.

    A free target is placed anew for each reading: its first guess is that of the data as they are, mistakes included.
    """

    def __init__(
        self,
        nominal: Model,
        measured: Measured,
        poses: Poses,
        instrument: InstrumentSection | TrackerTable,
        failed: bool,
    ) -> None:
        target = instrument.target
        self.free_tool = any(p.kind == "platform" for p in nominal.geometry.parameters)
        self.free_target, self.declared = target == "free", target not in (None, "tcp")
        self.at = np.array(target) if isinstance(target, tuple) else np.zeros(3)
        if self.free_target:
            nominal = replace(nominal, geometry=without_target(nominal.geometry))
            poses = nominal.kinematics.forward(measured.q)
        self.nominal, self.all, self.free, self.failed = nominal, measured, instrument.frame == "free", failed
        there = poses.reached
        self.reached = float(there.mean())
        self.measured, self.poses = measured.take(there), self._of_target(poses[there])
        self.rotation = None if self.measured.R is None else Rotation.from_matrix(self.measured.R)

    @cached_property
    def size(self) -> float:
        """Size of the workspace that was measured, m: the root mean square distance of poses from their middle."""
        if len(self.all.T) < limits.FEWEST_ROWS:
            return 0.0
        if self.lost:
            return float(np.median(np.linalg.norm(self.all.T - np.median(self.all.T, axis=0), axis=1)))
        return _size(self.poses)

    @property
    def lost(self) -> bool:
        """Whether the model reaches too few of the commands to compare anything with it."""
        return self.reached <= 1.0 - limits.REACHED or len(self.poses) < limits.FEWEST_ROWS

    @property
    def fits(self) -> float:
        """Misfit, m, up to which data fit without a correction."""
        return limits.ACCEPTED * self.size + limits.ALLOWED

    @cached_property
    def misfit(self) -> float:
        """Median distance of the uncorrected data from the nominal model, m; infinite where the model reaches few of them."""
        return np.inf if self.lost else self._misfit(self.measured, self.poses, self.free)

    @cached_property
    def _line(self) -> bool:
        """Whether the poses are so nearly on a line that positions do not determine the rotation of a frame."""
        spread = np.linalg.svd(self.poses.T - self.poses.T.mean(axis=0), compute_uv=False)
        return bool(spread[1] < limits.LINE * spread[0])

    @cached_property
    def expected(self) -> float:
        """Median error of the nominal model, m, that its tolerances let expect."""
        if self.lost:
            return limits.ACCEPTED * self.size
        T, R = expected_errors(self.nominal, self.measured.q, self.poses)
        return float(np.hypot(T, self.size * R if self.rotation is not None else 0.0))

    @property
    def accepted(self) -> float:
        """Largest misfit, m, of correct data of this robot."""
        return self.fits + min(self.expected, 0.5 * self.size)

    @property
    def far(self) -> bool:
        """Whether a fit has failed, or the misfit is larger than the tolerances explain.

        Within the tolerances, a geometry looks much like another frame.
        """
        return self.failed or self.misfit > self.fits + 3.0 * self.expected

    def tried(self, enough: float) -> Iterator[Interpretation]:
        """All readings that can be compared with the model.

        Readings with several mistakes in the commands are tried where no other one leaves less than ``enough``, m.
        """
        found = list(self._in_frame(self.free))
        yield from found
        # Another frame is tried after those: geometry within its tolerances moves poses in a similar way. A target at another
        # place is tried last: where the platform rotates little, it moves poses as another frame does.
        others: list[Interpretation] = []
        if self.far and not self.free and all(r.misfit > self.fits or r.mistakes > 1 for r in found):
            others += [*self._in_frame(True), *self._targets(True)]
        if self.far:
            others += self._targets(self.free)
        yield from others
        # The number of readings grows with the square of the drives, and a pose of six loops takes ten times that of an arm.
        if self.nominal.kinematics.loops.count and self.nominal.robot.n_actuators > 2:
            return
        for turned in dict.fromkeys((self.free, True)):
            if all(r.misfit > enough or r.mistakes > 1 for r in (*found, *others)):
                several = list(self._commands(readings.several_mistakes(self.nominal.robot.revolute), turned))
                others += several
                yield from several

    def _in_frame(self, turned: bool) -> Iterator[Interpretation]:
        measured = list(self._measurements(turned))
        yield from measured
        # Where the orientations alone must be read otherwise, the positions show that the commands are right.
        if not any(r.misfit <= self.accepted and r.columns == " ".join(ORIENTATION) for r in measured):
            yield from self._commands(readings.one_mistake(self.nominal.robot.revolute), turned)

    def _read(
        self, reading: Reading, measured: Measured, poses: Poses, turned: bool, misfit: float | None = None
    ) -> Interpretation:
        """A reading with its misfit, and with the mistake of another frame than declared."""
        looks, hint, mistakes, columns = astuple(reading)
        elsewhere = turned and not self.free
        if elsewhere:
            columns = columns if looks else "x y z"
            looks, hint = (f"{b}, and {a}" if a else b for a, b in zip((looks, hint), _ELSEWHERE, strict=True))
            mistakes += 1
        if not looks:
            misfit = np.inf
        elif misfit is None:
            misfit = self._misfit(measured, poses, turned)
        return Interpretation(
            looks, hint, mistakes, columns, measured=measured, poses=poses, misfit=misfit, elsewhere=elsewhere
        )

    def _measurements(self, turned: bool) -> Iterator[Interpretation]:
        """Readings of the measured poses: ways to read positions that come near the model, each with all ways to read
        orientations."""
        q, poses, rotation = self.measured.q, self.poses, self.rotation
        if self.lost:
            return
        near = min(self.misfit / limits.BETTER, self.accepted)
        misread = [] if rotation is None else [*readings.misread(rotation)]
        for p, matrix in readings.position_readings(turned=turned, alone=rotation is None):
            T = self.measured.T @ matrix.T
            seen = self._seen(poses, Measured(q, T, None), turned)
            if float(np.median(np.linalg.norm(T - seen.T, axis=1))) > near:
                continue
            if rotation is None:
                yield self._read(p, Measured(q, T, None), poses, turned)
                continue
            # Other axes of the target are a free target.
            ways = readings.rotation_readings(rotation, np.sign(matrix), turned=turned, fixed_target=not self.free_tool)
            for o, R in (*ways, *misread):
                mount = nearest((np.swapaxes(seen.R, 1, 2) @ R).sum(axis=0)) if self.free_target else np.eye(3)
                # Where positions determine the frame, orientations are compared in it.
                if not self._line and self.size * _apart(R, seen.R @ mount) > near + limits.CLOSE * self.size:
                    continue
                looks, hint = (", and ".join(filter(None, pair)) for pair in ((p.looks, o.looks), (p.hint, o.hint)))
                both = Reading(looks, hint, p.mistakes + o.mistakes, p.columns or " ".join(ORIENTATION))
                yield self._read(both, Measured(q, T, R), poses, turned)
        if rotation is not None:
            inverse = Measured(q, -rotation.inv().apply(self.measured.T), rotation.inv().as_matrix())
            what = "the poses look inverted (the instrument in the target's frame)"
            read = Reading(what, "give the inverse of each", columns="x y z qw qx qy qz")
            yield self._read(read, inverse, poses, turned)

    def _commands(self, ways: Iterable[readings.CommandReading], turned: bool) -> Iterator[Interpretation]:
        """Readings of the commands, with zeros of drives that are fitted to what was measured."""
        # For poses that are close together, other commands look like a geometry within its tolerances.
        if not self.far:
            return
        kinematics = self.nominal.kinematics
        search = CommandSearch(kinematics, self.all, self.size, turned, self.free_target, self.at)
        for misfit, reading, z in search.found(ways):
            q = self.all.q @ reading.matrix.T + z
            poses = self._of_target(kinematics.forward(q))
            there = poses.reached
            read = reading.words(z, kinematics.robot.revolute)
            yield self._read(read, replace(self.all, q=q).take(there), poses[there], turned, misfit)

    def _targets(self, turned: bool) -> Iterator[Interpretation]:
        """Readings by which the target is not at the TCP on the platform: displaced, rotated, or both."""
        if self.lost or self.free_target:
            return
        q, T, R = self.measured.q, self.measured.T, self.measured.R
        if self.free_tool:
            place = frame_and_target(self.poses, T, R, free_frame=turned)
            looks = f"the target looks to sit at {_metres(place.at)} m in the TCP's frame"
            if R is not None:
                looks += f", turned by the rotation vector {_degrees(place.mount)} degrees"
            tcp = Measured(q, T - self.poses.R @ place.at @ place.turn.T, None if R is None else R @ place.mount.T)
            read = Reading(looks, 'set target = "free" under [instrument]', columns="x y z")
            yield self._read(read, tcp, self.poses, turned)
            return
        seen = self._seen(self.poses, Measured(q, T, None), turned)
        aside = np.median(np.einsum("nji,nj->ni", seen.R, T - seen.T), axis=0)
        shifted = T - seen.R @ aside
        at = f"the target looks to sit at {_metres(self.at + aside)} m in the TCP's frame"
        if not turned:
            hint = f"write this as target under [instrument]{_OF_TCP * (not self.declared)}"
            read = Reading(at, hint, columns="x y z")
            yield self._read(read, Measured(q, shifted, R), self.poses, turned)
        if R is None:
            return
        turn = _middle(np.swapaxes(seen.R, 1, 2) @ R)
        way = f"the target looks turned by the rotation vector {_degrees(turn)} degrees in the TCP's frame"
        read = Reading(way, "turn the URDF's tcp link so", 2, "qw qx qy qz")
        yield self._read(read, Measured(q, T, R @ turn.T), self.poses, turned)
        if not turned:
            read = Reading(f"{at}, and {way}", "move and turn the URDF's tcp link", 3, "x y z qw qx qy qz")
            yield self._read(read, Measured(q, shifted, R @ turn.T), self.poses, turned)

    def _of_target(self, poses: Poses) -> Poses:
        """Poses of the target at its declared place, from those of the TCP."""
        return replace(poses, T=poses.T + poses.R @ self.at)

    def _misfit(self, measured: Measured, poses: Poses, turned: bool) -> float:
        """Median distance of what was measured from what is predicted, m, in the frame that fits best if ``turned``."""
        seen = self._seen(poses, measured, turned)
        off = float(np.median(np.linalg.norm(measured.T - seen.T, axis=1)))
        return off if measured.R is None else float(np.hypot(off, self.size * _apart(measured.R, seen.R)))

    def _seen(self, poses: Poses, measured: Measured, turned: bool) -> Poses:
        """What is predicted of the TCP or a free target, instrument's frame, in the frame that fits best if ``turned``."""
        if self.free_target:
            return frame_and_target(poses, measured.T, measured.R, free_frame=turned, rough=True).moved(poses)
        frame = rough_frame(poses, measured) if turned else Frame()
        return poses.moved(frame.T, frame.R)


def _size(poses: Poses) -> float:
    """Root mean square distance of poses from their middle, m."""
    return float(np.sqrt(((poses.T - poses.T.mean(axis=0)) ** 2).sum(axis=1).mean()))


def _metres(at: Floats) -> str:
    return f"({', '.join(f'{v:.3g}' for v in at)})"


def _degrees(turn: Floats) -> str:
    return f"({', '.join(f'{v:.1f}' for v in np.degrees(log(turn[None])[0]))})"


def _apart(one: Floats, other: Floats) -> float:
    """Median angle, rad, between rotations (N, 3, 3)."""
    cosine = (np.einsum("nij,nij->n", one, other) - 1.0) / 2.0
    return float(np.median(np.arccos(np.clip(cosine, -1.0, 1.0))))


def _middle(rotations: Floats) -> Floats:
    """(3, 3) the rotation of (N, 3, 3) from which the others are nearest in the median."""
    some = rotations[np.linspace(0, len(rotations) - 1, min(len(rotations), 30)).astype(int)]
    off = [np.median(np.linalg.norm(log(rotations @ one.T), axis=1)) for one in some]
    return np.asarray(some[int(np.argmin(off))])
