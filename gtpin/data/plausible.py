"""Whether a dataset can be of the robot that it names: ranges, units, the order of quaternions, reach."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import permutations
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from gtpin.data.commands import Commands
from gtpin.data.dataset import Dataset
from gtpin.data.files import warn_of
from gtpin.errors import DatasetError, warn
from gtpin.typing import Floats, Mask

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Doubt = Callable[[DatasetError, Any], None]
"""Decides on a suspected mistake, by its error and the rows without the mistake: it raises the error, or returns."""

_NEARLY_ALL = 0.95
"""Share of a column's values that must fit another unit for the message that they look like it. Assumed."""
TURNS = 3.0
"""Turns from zero, in either direction, beyond which commands of a joint without limits look like degrees. Assumed."""
ONCE = 2.0 * np.pi
"""Angle, rad, by which a command may be off its range for whole turns to be taken off: one turn. Assumed: controllers count
from 0 to 360 degrees or to either side; commands in degrees are farther off."""
_SEVERAL = 6
"""Fewest rows out of range for the message that a part of a column is in another unit. Assumed."""
_AS_NAMED = "wxyz"
_OFF = 0.05
"""Median angle, rad, up to which quaternions are used as they are. Assumed."""
_FAR_BETTER = 4.0
"""Factor by which the median angle of another order must be smaller than that of ``wxyz``. Assumed."""
_AGREES = np.deg2rad(20.0)
"""Median angle, rad, within which an order of the columns agrees with the robot. Assumed."""
_ALIKE = 0.01
"""Orders whose median angles, rad, differ by less can't be distinguished. Assumed."""


def certainly(error: DatasetError, _: Any) -> None:
    """Raise the error: no mistake is doubted."""
    raise error


Rows = TypeVar("Rows", Dataset, Commands)


def without_whole_turns(
    rows: Rows, *, names: Sequence[str], lower: ArrayLike, upper: ArrayLike, revolute: ArrayLike
) -> Rows:
    """The rows with commands outside their ranges less a whole turn, in columns that fit their ranges then.

    A controller may count from 0 to 360 degrees where the robot's file has a range about 0. Columns with values that are
    more than a turn off the range, as degrees are, stay as they are. ``names`` to ``revolute``: as for :func:`check_commands`.

    Warns: names the column and the number of rows.
    """
    low, high = np.asarray(lower, float), np.asarray(upper, float)
    turns = np.asarray(revolute, bool) & np.isfinite(high - low)
    if rows.n_actuators != len(names) or not turns.any():
        return rows
    middle, half = np.where(turns, (low + high) / 2.0, 0.0), np.where(turns, (high - low) / 2.0, np.inf)
    off = rows.q - middle
    whole = np.where(turns & (np.abs(off) > half), np.round(off / (2.0 * np.pi)), 0.0)
    inside = np.abs(off - 2.0 * np.pi * whole) <= half
    whole[:, (inside.mean(axis=0) < _NEARLY_ALL) | (np.abs(off) > ONCE + half).any(axis=0)] = 0.0
    whole[~inside] = 0.0
    if not whole.any():
        return rows
    q = rows.q - 2.0 * np.pi * whole
    for j in map(int, np.flatnonzero(whole.any(axis=0))):
        first, count = int(np.argmax(whole[:, j] != 0.0)), int(np.count_nonzero(whole[:, j]))
        warn_of(
            rows.file,
            f"q{j + 1}: a whole turn is taken off in {count} of {len(q)} rows, since {names[j]} turns from {low[j]:g} to "
            f"{high[j]:g} rad (in row {rows.place(first)[1]}, {rows.q[first, j]:g} becomes {q[first, j]:.6g})",
        )
    return replace(rows, q=q)


def check_commands(
    rows: Dataset | Commands,
    *,
    names: Sequence[str],
    lower: ArrayLike,
    upper: ArrayLike,
    revolute: ArrayLike,
    suspect: Doubt = certainly,
) -> None:
    """Check commands against the ranges of a robot's n actuators.

    Parameters
    ----------
    names
        Names of the actuators for messages, in the order of q.
    lower, upper, revolute
        (n,) ends of each range, m or rad, and whether the actuator turns.
    suspect
        What is done where most commands of a joint without limits are more than `TURNS` turns from zero, as degrees are.

    Raises `DatasetError` for another number of actuators, and for a command that is outside its range by more than the range's
    width, with the unit that it looks like; of a trusted dataset it only warns. Warns of poses that are outside by less.
    """
    low, high, turns = np.asarray(lower, float), np.asarray(upper, float), np.asarray(revolute, bool)
    if rows.n_actuators != len(names):
        what = f"{rows.n_actuators} columns of commands, but the robot has {len(names)} actuators ({', '.join(names)})"
        hint = "name the robot that was measured, or give one column for each actuator"
        if rows.n_actuators < len(names):
            hint += ", or name those that were commanded: actuators = [...] in dataset.toml"
        raise DatasetError(what, file=rows.file, column=f"q{rows.n_actuators}", hint=hint)
    beyond = np.maximum(low - rows.q, rows.q - high)
    far = beyond > high - low
    if far.any():
        index, actuator = (int(i) for i in np.argwhere(far)[0])
        limits = (low[actuator], high[actuator])
        error = _far_outside(rows, index, actuator, names[actuator], *limits, turns[actuator], far[:, actuator])
        if not getattr(rows, "trusted", False):
            raise error
        warn(str(error))
    _check_endless(rows, names, turns & ~np.isfinite(high - low), suspect)
    outside = (beyond > 1e-9 * np.where(np.isfinite(high - low), high - low, 0.0)).any(axis=1)
    if outside.any():
        warn_of(rows.file, f"commands a little outside the robot's range: {_poses(rows, outside)}")


def check_measurements(
    dataset: Dataset,
    *,
    predicted_position: ArrayLike,
    predicted_rotation: ArrayLike,
    reach: float,
    suspect: Doubt = certainly,
) -> Mask:
    """Check measurements against a nominal prediction; give the (N,) mask of rows that the robot can reach.

    Parameters
    ----------
    predicted_position, predicted_rotation
        (N, 3) m and (N, 3, 3): pose of the TCP by the nominal model, base frame; NaN where it can't reach the commands.
    reach
        Largest displacement of the TCP that deviations of the geometry within its tolerances cause, m.
    suspect
        What is done with a suspected mistake.

    Raises `DatasetError` for measurements that look like millimetres or quaternions in another order than qw qx qy qz,
    and where no pose at all can be reached. Warns of the poses that are set aside. Gross errors of single rows are accepted.
    """
    position, rotation = np.asarray(predicted_position, float), np.asarray(predicted_rotation, float)
    keep: Mask = np.isfinite(position).all(axis=1) & np.isfinite(rotation).all(axis=(1, 2))
    if not keep.any():
        hint = "check that dataset.toml names the robot that was measured"
        raise DatasetError("the robot can reach none of the poses", file=dataset.file, hint=hint)
    free = dataset.instrument.frame == "free"
    if _looks_like_millimetres(dataset.position[keep], position[keep], reach, free):
        hint = "divide x, y and z by 1000"
        what = "the measured position looks like millimetres"
        error = DatasetError(what, file=dataset.file, column="x y z", hint=hint)
        suspect(error, replace(dataset, position=dataset.position / 1000.0))
    at = (dataset.position[keep], position[keep]) if free else None
    if dataset.orientation is not None:
        order = misplaced_order(dataset.orientation[keep], rotation[keep], at)
        if order is not None:
            suspect(misplaced(dataset, order), replace(dataset, orientation=in_order(dataset.orientation, order)))
    if not keep.all():
        warn_of(dataset.file, f"set aside, for the robot can't reach them: {_poses(dataset, ~keep)}")
    return keep


def misplaced(dataset: Dataset, order: str) -> DatasetError:
    """The error that the numbers of quaternions stand in another order, with the first that is not in its own column."""
    part = next(part for part, there in zip(_AS_NAMED, order, strict=True) if part != there)
    under = _AS_NAMED[order.index(part)]
    what = f"the measured orientation looks like {order} quaternions, as if {part} were under q{under}"
    hint = "give qw qx qy qz in that order of meaning, scalar first"
    return DatasetError(what, file=dataset.file, column="qw qx qy qz", hint=hint)


def _check_endless(rows: Dataset | Commands, names: Sequence[str], endless: Mask, suspect: Doubt) -> None:
    """Suspect commands of joints without limits, mostly `TURNS` turns and more from zero, nearly all within 360 degrees."""
    turn = 2.0 * np.pi
    for actuator in map(int, np.flatnonzero(endless)):
        q = np.abs(rows.q[:, actuator])
        if (q > TURNS * turn).mean() > 0.5 and (np.deg2rad(q) <= turn).mean() >= _NEARLY_ALL:
            index = int(np.argmax(q > TURNS * turn))
            what = f"most commands of {names[actuator]} are more than {TURNS:g} turns from zero, and look like degrees"
            hint = "write commands in rad; if the joint did turn so often, take whole turns away"
            file, line = rows.place(index)
            scaled = rows.q.copy()
            scaled[:, actuator] = np.deg2rad(scaled[:, actuator])
            error = DatasetError(what, file=file, row=line, column=f"q{actuator + 1}", hint=hint)
            suspect(error, replace(rows, q=scaled))


def _far_outside(
    rows: Dataset | Commands,
    index: int,
    actuator: int,
    name: str,
    low: float,
    high: float,
    turns: bool,
    far: Mask,
) -> DatasetError:
    right, other, factor = ("rad", "degrees", 180.0 / np.pi) if turns else ("m", "millimetres", 1000.0)
    q = rows.q[:, actuator]
    as_is, scaled = (float(np.mean((x >= low) & (x <= high))) for x in (q, q / factor))
    # Where most commands fit without a conversion, the others are separate errors, not a matter of units.
    looks = f", and the column looks like {other}" if scaled >= _NEARLY_ALL and as_is < 0.5 else ""
    what = f"{q[index]:g} is far outside the range of {name} ({low:g} to {high:g} {right})"
    hint = f"write commands in {right}" if looks else "correct the row, or leave it out"
    part = q[far] / factor
    if not looks and far.sum() >= _SEVERAL and ((part >= low) & (part <= high)).mean() >= _NEARLY_ALL:
        lines = [rows.place(int(i))[1] for i in np.flatnonzero(far)]
        looks = (
            f", and so are {far.sum()} of {len(q)} rows, the first in line {min(lines)} and the last in line {max(lines)} of "
            f"the file, which look like {other}"
        )
        hint = f"write commands of these rows in {right}"
    file, line = rows.place(index)
    return DatasetError(what + looks, file=file, row=line, column=f"q{actuator + 1}", hint=hint)


def _looks_like_millimetres(measured: Floats, predicted: Floats, reach: float, free: bool) -> bool:
    if not free:
        off = np.median(np.linalg.norm(measured - predicted, axis=1))
        scaled = np.median(np.linalg.norm(measured / 1000.0 - predicted, axis=1))
        return bool(off > reach and scaled <= reach)
    # Medians, so that a gross error in a few rows does not look like another unit.
    spread = [np.median(np.linalg.norm(x - np.median(x, axis=0), axis=1)) for x in (measured, predicted)]
    if not 500.0 * spread[1] < spread[0] < 2000.0 * spread[1]:
        return False
    # One axis in millimetres spreads positions along that axis only, and is another mistake: here all axes are.
    wide, wider = (np.linalg.svd(x, compute_uv=False) for x in _about_medians(measured, predicted))
    there = wide > 0.05 * wide[0]
    return bool((wider[there] > 100.0 * wide[there]).all())


def _poses(rows: Any, mask: Mask, shown: int = 10) -> str:
    poses = list(dict.fromkeys(rows.pose[mask]))
    more = f" and {len(poses) - shown} more" if len(poses) > shown else ""
    return f"pose{'s' if len(poses) > 1 else ''} {', '.join(poses[:shown])}{more}"


def misplaced_order(quaternion: Floats, predicted: Floats, free: tuple[Floats, Floats] | None) -> str | None:
    """The actual content of the columns qw, qx, qy and qz, such as ``xyzw``; None where it is ``wxyz``, or no order fits.

    ``quaternion``: (N, 4) unit quaternions as measured. ``predicted``: (N, 3, 3) rotations of the nominal model, base
    frame. ``free``: for a free frame: (N, 3) measured and predicted positions, m, from which the frame's rotation is found;
    else None.
    """
    from scipy.spatial.transform import Rotation

    expected = Rotation.from_matrix(predicted)
    if free is not None:
        turned = _turn(*free)
        if turned is None:
            return None
        expected = turned * expected
    wanted = expected.as_quat(scalar_first=True)
    return order_that_fits(lambda order: _off(quaternion, wanted, order))


def order_that_fits(off: Callable[[str], float]) -> str | None:
    """The order of w, x, y and z that fits far better than ``wxyz``; None where ``wxyz`` fits, or where no order does so.

    ``off``: function that gives, for an order of the columns, how far measured poses are from expected ones: the median
    angle between orientations, rad, to which a median distance may be added, converted to an angle.
    """
    as_named = off(_AS_NAMED)
    if as_named <= _OFF:
        return None
    orders = ["xyzw", *("".join(order) for order in permutations(_AS_NAMED))]  # the usual one is first, and wins a tie
    found = np.array([off(order) for order in orders])
    if found.min() > min(_AGREES, as_named / _FAR_BETTER):
        return None
    return orders[int(np.argmax(found <= found.min() + _ALIKE))]


def in_order(quaternion: Floats, order: str) -> Floats:
    """(N, 4) quaternions wxyz, from columns that have the content ``order``, such as ``xyzw``."""
    return quaternion[:, [order.index(part) for part in _AS_NAMED]]


def _off(quaternion: Floats, wanted: Floats, order: str) -> float:
    """Median angle, rad, between wanted quaternions wxyz and measured ones whose columns have the content ``order``."""
    read = in_order(quaternion, order)
    # Medians, so that gross errors in a few rows decide nothing.
    return float(np.median(2.0 * np.arccos(np.minimum(np.abs((read * wanted).sum(axis=1)), 1.0))))


def _turn(measured: Floats, predicted: Floats) -> Rotation | None:
    """Rotation that takes predicted positions to measured ones; None where they do not determine it, as on one line."""
    from scipy.spatial.transform import Rotation

    a, b = _about_medians(measured, predicted)
    if len(a) < 3 or np.linalg.svd(a, compute_uv=False)[1] < 0.01:
        return None
    return Rotation.align_vectors(b, a)[0]


def _about_medians(measured: Floats, predicted: Floats) -> tuple[Floats, Floats]:
    """Predicted and measured positions, each less its median, without gross errors of the measured ones."""
    a, b = predicted - np.median(predicted, axis=0), measured - np.median(measured, axis=0)
    near = np.linalg.norm(b, axis=1) <= 10.0 * np.median(np.linalg.norm(b, axis=1))
    return a[near], b[near]
