"""Readings of instruments that can't be the robot's without a correction: other units, other signs, sockets visited once."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gtpin.calibration.checks import limits
from gtpin.calibration.checks.readings import UNITS, Reading, table_readings
from gtpin.calibration.checks.recognise import Interpretation, recognised
from gtpin.calibration.checks.suspected import NO_FIT, Size, refuse, suspect
from gtpin.calibration.problem import Measured, with_unknowns
from gtpin.data import Dataset
from gtpin.data.instrument_tables import PlaneTable, TrackerTable
from gtpin.errors import ConvergenceError, DatasetError, warn
from gtpin.instruments.readings import Readings, instruments_of
from gtpin.instruments.socket import Socket
from gtpin.instruments.tracker import Tracker
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.robot.chain import Chain

LOOK = "check the order of q1 .. qn, that rows have their own commands, units, and where instrument and target stood"
"""What the user should do where no usual mistake explains the readings."""


@dataclass(frozen=True)
class Misfit:
    """Errors of an instrument's readings relative to the nominal robot, with the unknowns' values that fit best.

    ``off``: largest median error of its components, m and rad. ``deviation``: largest deviation of an unknown with a prior, in
    prior sigmas.
    """

    off: Size
    deviation: float

    @staticmethod
    def of(readings: Readings, poses: Poses, index: int) -> Misfit:
        """The misfit of an instrument, by its index."""
        one, rows = readings.instruments[index], readings.rows
        mine = rows.rows_of(index)
        residual = np.abs(readings.residual_at(poses)[mine])
        off = {"m": 0.0, "rad": 0.0}
        for k, component in enumerate(one.components):
            single = readings.components == 1 and len(one.components) > 1
            own = residual[rows.component[mine] == k, 0] if single else residual[:, k]
            if len(own):
                size = float(np.median(own))
                off[component.unit] = max(off[component.unit], size if np.isfinite(size) else np.inf)
        deviation = [abs(u) / o.sigma for u, o in zip(readings.own(index), one.unknowns, strict=True)]
        return Misfit((off["m"], off["rad"]), max(deviation, default=0.0))

    def exceeds(self, reach: float, share: float = 1.0) -> bool:
        """Whether errors are larger than a share of those of robots within their tolerances, which move the TCP by ``reach``,
        m, and turn it by 0.2 rad at most (assumed)."""
        return self.off[0] > share * reach or self.off[1] > share * 0.2

    @property
    def size(self) -> float:
        """The largest of the errors, in the usual error of a nominal robot (1 mm, 1 mrad), and of ``deviation``."""
        return max(max(self.off) / 1e-3, self.deviation)

    def __str__(self) -> str:
        return f"{1e3 * max(self.off):.3g} {'mm' if self.off[0] >= self.off[1] else 'mrad'}"


def check_readable(
    dataset: Dataset,
    readings: Readings,
    nominal: Model,
    poses: Poses,
    reach: float,
    fitted: Callable[..., Misfit | None],
) -> None:
    """Suspect readings whose errors relative to the nominal robot are larger than its tolerances allow.

    ``readings``: with the unknowns' values that fit best. ``nominal``, ``poses``: the nominal robot, and its poses (N), base
    frame. ``reach``: largest displacement of the TCP by deviations within the tolerances, m. ``fitted``: gives the misfit of an
    instrument, of readings and its index, after a fit of the geometry (a rough one with ``rough=True``); None where it fails.

    Raises `DatasetError` if such readings can't be fitted; it names the unit or the sign with which they can, where there
    is one. Warns: if they can be fitted as they are.
    """
    for i, one in enumerate(readings.instruments):
        now = Misfit.of(readings, poses, i)
        if not now.exceeds(reach, limits.READ_SUSPECT) and now.deviation <= 10.0:
            continue
        tried = list(_read_otherwise(readings, poses, i))
        least = min((misfit.size for misfit, *_ in tried), default=np.inf)
        # The first way that is about as good as the best: the usual and simple ones come first.
        found = next((way for way in tried if way[0].size <= limits.AS_GOOD * least), None)
        if found is not None and not found[0].exceeds(reach) and found[0].size < now.size / limits.READ_BETTER:
            best, read, other = found
            by = f"{now} off, read so {best}" if now.size > now.deviation else "possible only far from what is declared"
            error = _error(dataset, readings, i, other, f"as it stands, readings are {by}")
            suspect(error, dataset, _size(fitted(readings, i, True)), _size(fitted(read, i, True)))
        elif now.exceeds(reach):
            check_heights(dataset, readings, poses, reach, fitted)
            what, column = f"readings of {one.name} are {now} off what the nominal robot gives", None
            hint = "check units, signs, commands, and where instrument and target stood"
            if looks := _recognised(readings, nominal, poses, i):
                what, column, hint = f"{what}: {looks.looks}", looks.columns, looks.hint
            after = fitted(readings, i)
            error = DatasetError(what, file=readings.rows.files[i], column=column, hint=hint)
            refuse(error, dataset, sure=after is None or after.exceeds(limits.READ_LEFT * reach))


def _recognised(readings: Readings, nominal: Model, poses: Poses, index: int) -> Interpretation | None:
    """The usual mistake in commands or poses with which the readings of a tracker of a single target fit the nominal robot."""
    one, table, mine = readings.instruments[index], readings.rows.tables[index], readings.rows.rows_of(index)
    if not isinstance(one, Tracker) or not isinstance(table, TrackerTable) or table.stations or table.targets:
        return None
    if (readings.rows.component[mine] >= 0).any():
        return None
    measured = Measured(readings.q[mine], one.positions, one.rotations)
    return recognised(nominal, poses[mine], measured, table)


def check_heights(
    dataset: Dataset, readings: Readings, poses: Poses, reach: float, fitted: Callable[..., Misfit | None]
) -> None:
    """Suspect heights over planes that a fit explains only in another unit, or with the other sign.

    Heights of touches are often smaller than the nominal robot's own errors: only fits show how they must be read.
    ``dataset`` to ``fitted``: as for :func:`check_readable`.
    """
    for i, one in enumerate(readings.instruments):
        if not (isinstance(one.table, PlaneTable) and "height" in one.read.numbers):
            continue
        before = _size(fitted(readings, i, True))
        # A unit that makes heights vanish leaves less than noise, and is no better than one that leaves the noise.
        noise = float(readings.initial_sigma[readings.group[readings.rows.rows_of(i)[0], 0]])
        ways = _read_otherwise(readings, poses, i, varied=False)
        tried = [(_size(fitted(read, i, True)), other) for misfit, read, other in ways if not misfit.exceeds(reach)]
        sizes = [max(after[0], noise) for after, _ in tried]
        for size, (after, other) in zip(sizes, tried, strict=True):
            if size <= limits.AS_GOOD * min(sizes) and size < before[0] / limits.READ_BETTER:
                now = f"and {1e3 * before[0]:.3g} mm" if np.isfinite(before[0]) else "and no fit"
                by = f"a fit leaves {1e3 * after[0]:.3g} mm, {now} as it stands"
                suspect(_error(dataset, readings, i, other, by), dataset, before, after)
                break


def _error(dataset: Dataset, readings: Readings, index: int, other: Reading, by: str) -> DatasetError:
    """The error of an instrument that must be read in another way. ``by``: what shows it."""
    what = f"{readings.instruments[index].name}: {other.looks} ({by})"
    where = dataset.toml if other.columns.startswith("instrument.") else readings.rows.files[index]
    return DatasetError(what, file=where, column=other.columns, hint=other.hint)


@contextlib.contextmanager
def explained(readings: Readings, poses: Poses) -> Iterator[None]:
    """Context of a fit: if it fails, the error names the instrument whose readings had large errors before the fit, if any."""
    try:
        yield
    except ConvergenceError as error:
        numbers, unknowns = len(readings.rows) * readings.components, len(readings.unknowns)
        if numbers <= unknowns:
            what = f"the fit does not converge: {numbers} readings for {unknowns} unknowns of the instruments alone"
            hint = "measure more, or give smaller prior sigmas"
            raise DatasetError(what, file=readings.rows.files[0], hint=hint) from None
        found = [Misfit.of(readings, poses, i) for i in range(len(readings.instruments))]
        worst = max(range(len(found)), key=lambda i: found[i].size)
        if found[worst].size < limits.READ_BETTER:
            raise
        by = f"the nominal robot gives others, by {found[worst]} and {found[worst].deviation:.2g} prior sigmas of its unknowns"
        what = f"readings of {readings.instruments[worst].name} can't be fitted ({error.what}); {by}"
        raise ConvergenceError(what, file=readings.rows.files[worst], hint=LOOK) from None


def check_fitted(dataset: Dataset, readings: Readings, poses: Poses, reach: float, before: Sequence[Misfit]) -> None:
    """Refuse readings with large errors at the fitted poses (N), base frame: the fit has not found their minimum.

    ``before``: the misfit of each instrument before the fit; an instrument that the fit makes far worse has such errors.
    """
    for i, one in enumerate(readings.instruments):
        now, was = Misfit.of(readings, poses, i), before[i]
        worse = any(off > limits.READ_BETTER * before for off, before in zip(now.off, was.off, strict=True))
        if now.exceeds(limits.READ_LEFT * reach) or (worse and now.exceeds(reach, limits.READ_SUSPECT)):
            what = f"readings of {one.name} are {now} off what the calibrated robot gives"
            what += f", and {was} off what the nominal robot gives" if worse else ""
            refuse(DatasetError(what, file=readings.rows.files[i], hint=LOOK), dataset)


def _size(misfit: Misfit | None) -> Size:
    """Residuals after a fit; `NO_FIT` where it failed, or needs unknowns more than 30 sigmas from what is declared."""
    if misfit is None or misfit.deviation > 30.0:
        return NO_FIT
    return misfit.off


def _read_otherwise(
    readings: Readings, poses: Poses, index: int, *, varied: bool = True
) -> Iterator[tuple[Misfit, Readings, Reading]]:
    """The readings with an instrument that is read in other ways, each with its misfit, without those that are not accepted.

    ``varied``: whether numbers that get smaller must still vary by more than the nominal robot's errors.
    """
    rows, unit = readings.rows, readings.instruments[index].components[0].unit
    mine = rows.rows_of(index)
    for other, read in table_readings(rows, index, unit):
        columns = [name for name in other.columns.split() if name in rows.columns]
        before, after = (
            max((float(np.std(r.columns[name][mine])) for name in columns), default=0.0) for r in (rows, read)
        )
        try:
            found = replace(readings, rows=read, u=np.zeros(0))
            found = found.at(np.zeros(len(found.unknowns)))
            found = with_unknowns(found.at(found.start(poses)), poses)
            misfit = Misfit.of(found, poses, index)
        except (DatasetError, np.linalg.LinAlgError):
            continue
        if not (varied and after < 0.5 * before and misfit.off[unit == "rad"] > limits.VARIATION * after):
            yield misfit, found, other


def check_sockets(dataset: Dataset, robot: Chain) -> None:
    """Refuse sockets that are visited once each, and warn of some that are.

    A visit of a socket whose point is declared, or whose distance from another one is known, says something by itself.

    Raises `DatasetError` if no socket is visited twice, and nothing is known of any.
    """
    rows = dataset.readings
    sockets = ((i, one) for i, one in enumerate(instruments_of(rows, robot)) if isinstance(one, Socket))
    for i, one in sockets:
        counts = np.bincount(one.socket, minlength=len(one.names))
        known = {*one.table.sockets, *(name for distance in one.table.distances for name in distance[:2])}
        once = [name for k, name in enumerate(one.names) if counts[k] == 1 and name not in known]
        if once and (counts <= 1).all() and not known:
            hint = "visit each socket from several poses: a point that is unknown takes the first visit"
            raise DatasetError("every socket is visited once", file=rows.files[i], column="socket", hint=hint)
        if once:
            warn(f"{rows.files[i]}: visited once, which gives no information: sockets {', '.join(once)}")


def check_stations(dataset: Dataset) -> None:
    """Refuse a session with fewer poses than its frame needs to be determined: three positions, or two with orientations.

    Raises `DatasetError` with its first row.
    """
    rows = dataset.readings
    for i in np.flatnonzero(rows.stations):
        least = 3 if "qw" in rows.lacking[i] or "qw" not in rows.columns else 2
        for name in rows.known[i]["session"]:
            mine = np.flatnonzero((rows.of == i) & (rows.columns["session"] == name))
            count = len(np.unique(dataset.q[mine], axis=0))
            if count < least:
                file, line = rows.place(int(mine[0]))
                what = f"session {name} has {count} different pose{'s' if count > 1 else ''}: a frame of its own takes {least}"
                hint = "measure more poses there, or leave these rows out"
                raise DatasetError(what, file=file, row=line, column="session", hint=hint)


def check_distances(dataset: Dataset, robot: Chain, poses: Poses, reach: float) -> None:
    """Refuse known distances of sockets that are far from those of the nominal robot; the error names a unit that fits.

    ``robot``: the nominal robot. ``poses``, ``reach``: as in :func:`check_readable`.
    """
    readings = Readings.of(dataset, robot)
    readings = readings.at(readings.start(poses))  # with the sockets' points from the nominal robot
    for i, one in enumerate(readings.instruments):
        if not isinstance(one, Socket):
            continue
        for k, (a, b, given, _) in enumerate(one.table.distances):
            if {a, b} & set(one.table.sockets):  # their declared points may be wrong instead
                continue
            found = float(np.linalg.norm(one.at(readings.own(i), a) - one.at(readings.own(i), b)))
            if abs(given - found) <= reach:
                continue
            mine = readings.rows.rows_of(i)[np.isin(one.socket, [one.names.index(name) for name in (a, b)])]
            residual = np.abs(readings.residual_at(poses)[mine])
            missed = residual[readings.rows.component[mine] < 3, 0] if readings.components == 1 else residual[:, :3]
            if missed.size and np.median(missed) > reach:  # something else is wrong than their distance
                continue
            like = [(unit, factor) for unit, factor in UNITS if abs(given * factor - found) < min(reach, 0.2 * found)]
            hint = "check it, and the rows' sockets"
            if like:
                hint = f"it looks like {like[0][0]}: multiply by {like[0][1]:g}"
            what = f"{one.name}: {a} and {b} are {given:.6g} m apart here, for the nominal robot {found:.3g} m"
            column = f"instrument.{i}.distances.{k}"
            refuse(DatasetError(what, file=dataset.toml, column=column, hint=hint), dataset)
