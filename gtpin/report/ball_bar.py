"""Circular tests in a dataset's ranges: deviations of the radius along circles about a station, as ball bars measure them.

The quantities are those of ISO 230-4, Circular tests for numerically controlled machine tools.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gtpin.instruments.range import Range
from gtpin.report.circles import Run, plane_axes, runs
from gtpin.report.residuals import Residuals
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats, Indices

Direction = Literal["counterclockwise", "clockwise"]
Layer = Literal["measured", "before", "after"]

DIRECTIONS: tuple[Direction, ...] = ("counterclockwise", "clockwise")
SAME_PLANE = np.cos(np.deg2rad(5.0))
"""Smallest cosine of the angle between the planes of two runs along one circle."""
SAME_RADIUS = 0.05
"""Largest difference of the radii, and of the heights of the planes, of two runs along one circle, over the radius."""
ALONG_AXIS = np.cos(np.deg2rad(5.0))
"""Smallest cosine of the angle between the normal of a plane that is called XY, YZ or ZX, and the axis normal to it."""
STEPS = 20
"""Largest number of steps of the fit of a centre."""
SMALLEST = 1e-12
"""Step, m, below which the fit has converged."""


@dataclass(frozen=True, eq=False)
class Trace:
    """Deviations of the radius on one run along a circle.

    Parameters
    ----------
    direction
        Direction of travel; counterclockwise: from the circle's first axis to its second.
    rows
        (m,) rows of the residuals, in the order of travel.
    angle
        (m,) commanded angle from the first axis to the second, rad.
    deviation
        By layer (m,), m, positive away from the centre. ``measured``: about the least-squares circle of all runs along it.
        ``before`` and ``after``: residuals of geometry alone and of geometry with the causes.
    """

    direction: Direction
    rows: Indices
    angle: Floats
    deviation: Mapping[Layer, Floats]


@dataclass(frozen=True, eq=False)
class Circle:
    """A circular test: readings of one station and target along one circle.

    Parameters
    ----------
    instrument, station, target
        Names of the instrument, station and target; the latter two are "" where there is only one.
    normal
        (3,) unit normal of its plane, base frame.
    radius
        Commanded radius, m.
    traces
        The runs along it.
    """

    instrument: str
    station: str
    target: str
    normal: Floats
    radius: float
    traces: tuple[Trace, ...]

    @property
    def plane(self) -> str:
        """Name of its plane: ``XY``, ``YZ`` or ``ZX``; of other planes the normal: ``normal (0.34, 0.00, 0.94)``."""
        axis = int(np.argmax(self.normal))
        if self.normal[axis] >= ALONG_AXIS:
            return ("YZ", "ZX", "XY")[axis]
        return f"normal ({', '.join(f'{v + 0.0:.2f}' for v in self.normal)})"

    @property
    def axes(self) -> tuple[str, str]:
        """Names of its first and second axis; in a plane that is not XY, YZ or ZX, of the base axes nearest to them."""
        axis = int(np.argmax(self.normal))
        return ("YZ", "ZX", "XY")[axis][0], ("YZ", "ZX", "XY")[axis][1]

    @property
    def directions(self) -> tuple[Direction, ...]:
        """The directions of travel that were measured."""
        return tuple(d for d in DIRECTIONS if any(trace.direction == d for trace in self.traces))

    def radial(self, layer: Layer, direction: Direction) -> tuple[float, float]:
        """Radial deviations F of a direction: the smallest and the largest, m."""
        values = np.concatenate([t.deviation[layer] for t in self.traces if t.direction == direction])
        return float(values.min()), float(values.max())

    def circular(self, layer: Layer, direction: Direction | None = None) -> float:
        """Circular deviation G, m: the range of the deviations of a direction; None: of both, the bidirectional deviation
        G(b)."""
        ends = [self.radial(layer, d) for d in ((direction,) if direction else self.directions)]
        return max(high for _, high in ends) - min(low for low, _ in ends)


def circles(residuals: Residuals) -> tuple[Circle, ...]:
    """The circular tests among the readings of ``range`` instruments; empty where there are none.

    Rows are taken in the order of ``time``, where there is one, else in that of the table.
    """
    instruments = residuals.readings.instruments
    return tuple(
        circle
        for index, one in enumerate(instruments)
        if isinstance(one, Range)
        for circle in _of_instrument(residuals, index, one)
    )


def _of_instrument(residuals: Residuals, index: int, one: Range) -> list[Circle]:
    readings = residuals.readings
    mine = readings.rows.rows_of(index)
    away = one.away(residuals.poses[mine], readings.own(index))
    order = np.asarray(residuals.dataset.covariates.get("time", readings.rows.line), dtype=float)[mine]
    found = []
    for station, target in np.unique(np.column_stack([one.station, one.targets.of]), axis=0):
        own = np.flatnonzero((one.station == station) & (one.targets.of == target))
        own = own[np.argsort(order[own], kind="stable")]
        names = (_named(one.table.stations, station), _named(one.table.fixed_targets, target))
        for same in _groups(runs(away[own]), away[own]):
            found.append(_circle(residuals, mine, one, [replace(run, rows=own[run.rows]) for run in same], names))
    return found


def _named(known: Mapping[str, object], index: int) -> str:
    """The id of a station or target; "" where there is only one."""
    return list(known)[index] if len(known) > 1 else ""


def _groups(found: list[Run], away: Floats) -> list[list[Run]]:
    """The runs, grouped by circle."""
    groups: list[list[Run]] = []
    for run in found:
        for group in groups:
            if _alike(run, group[0], away):
                group.append(run)
                break
        else:
            groups.append([run])
    return groups


def _alike(one: Run, two: Run, away: Floats) -> bool:
    """Whether two runs are along one circle."""
    if abs(float(one.normal @ two.normal)) < SAME_PLANE:
        return False
    radii = [float(np.linalg.norm(away[run.rows], axis=1).mean()) for run in (one, two)]
    heights = [float((away[run.rows] @ one.normal).mean()) for run in (one, two)]
    most = SAME_RADIUS * radii[0]
    return abs(radii[0] - radii[1]) < most and abs(heights[0] - heights[1]) < most


def _circle(residuals: Residuals, mine: Indices, one: Range, same: list[Run], names: tuple[str, str]) -> Circle:
    """The circle of the runs ``same``. Their rows are indices into ``mine``, the instrument's rows."""
    normal = same[0].normal * np.sign(same[0].normal[np.argmax(np.abs(same[0].normal))])
    rows = np.concatenate([run.rows for run in same])
    model = residuals.model
    nominal = replace(model, geometry=Geometry.nominal(model.robot), effects=())
    poses = nominal.kinematics.forward(residuals.dataset.q[mine])
    commanded = one.away(poses, np.zeros(len(one.unknowns)))[rows]
    first, second = plane_axes(normal)
    flat = np.column_stack([commanded @ first, commanded @ second])
    height = float((commanded @ normal).mean())
    middle = middle_of(flat)
    angle = np.arctan2(*(flat - middle).T[::-1])
    measured = centred(flat, height, one.measured()[rows, 0], middle)
    traces, start = [], 0
    for run in same:
        part = slice(start, start + len(run.rows))
        start = part.stop
        deviation: dict[Layer, Floats] = {
            "measured": measured[part],
            "before": residuals.before[mine[run.rows], 0],
            "after": residuals.after[mine[run.rows], 0],
        }
        direction: Direction = "counterclockwise" if float(run.normal @ normal) > 0.0 else "clockwise"
        traces.append(Trace(direction, mine[run.rows], angle[part], deviation))
    radius = float(np.linalg.norm(flat - middle, axis=1).mean())
    return Circle(one.name, *names, normal, radius, tuple(traces))


def middle_of(flat: Floats) -> Floats:
    """(2,) centre c of the circle that fits points p (N, 2) by least squares of |p|^2 = 2 p . c + k."""
    matrix = np.column_stack([2.0 * flat, np.ones(len(flat))])
    return np.asarray(np.linalg.lstsq(matrix, (flat**2).sum(axis=1), rcond=None)[0][:2])


def centred(flat: Floats, height: float, measured: Floats, start: Floats) -> Floats:
    """(N,) deviations of the ranges about their least-squares circle, m.

    They are the measured ranges less |p - s| - o, with the centre s, in the plane, and the offset o that fit best.

    Parameters
    ----------
    flat, height
        (N, 2) the commanded path p along the axes of its plane, and the plane's height over the station, m.
    start
        (2,) first guess of s.
    """
    s = start.copy()
    for _ in range(STEPS):
        off = flat - s
        distance = np.sqrt((off**2).sum(axis=1) + height**2)
        J = np.column_stack([-off / distance[:, None], np.ones(len(flat))])
        left = measured - distance
        step = np.linalg.lstsq(J, left, rcond=None)[0]
        s = s + step[:2]
        if np.abs(step[:2]).max() < SMALLEST:
            break
    return np.asarray(left - J @ step)
