"""Ranges: distances from stations to a target, as draw wires and laser tracers read them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gtpin.bench.simulator.instruments.gauge import Gauge, Hidden
from gtpin.bench.simulator.instruments.layout import Layout
from gtpin.bench.simulator.instruments.targets import Targets, labels
from gtpin.bench.simulator.poses import Poses
from gtpin.data.table import Column
from gtpin.typing import Floats, Ints

SIGMA, OFFSET_SIGMA = 2e-5, 1e-3
"""Noise of a draw wire's reading, and standard deviation of its offset, m."""
OFF = (5e-3, 0.1)
"""Range from which the standard deviation of the stations' positions, per axis, m, is drawn: they are measured with a tape."""
STATION_SIGMA = 0.5
"""Prior sigma of a station's position, per axis, m, that a dataset has by default."""
OUTSIDE, CLEAR = 1.2, 0.3
"""Distance of the stations from the centre: the first number times the workspace's radius, plus the second, m."""
BAR_SIGMA, BAR_OFFSET_SIGMA = 1e-6, 1e-4
"""Noise of a ball bar's reading, and standard deviation of its length before it is calibrated, m."""
PIVOT_SIGMA = 5e-3
"""Standard deviation of the pivot's position, per axis, m: it is set up by the machine's coordinates."""


@dataclass(frozen=True, eq=False)
class Range(Gauge):
    """z = |p - s| + o, with target p, the station's centre s and its offset o, m.

    Parameters
    ----------
    targets, stations
        The targets and stations as the dataset declares them: positions, m, by id.
    station
        (M,) index of each row's station.
    sigmas
        Noise of the reading, and prior sigmas of the stations' positions, per axis, and of the offsets, m.
    """

    kind: ClassVar[str] = "range"

    targets: Targets
    stations: dict[str, tuple[float, float, float]]
    station: Ints
    sigmas: tuple[float, float, float]

    @staticmethod
    def drawn(layout: Layout, stops: Ints, declared: bool, rng: np.random.Generator) -> Range:
        """Four stations around the workspace, each of which reads at all stops."""
        name, targets = "wire", Targets.one()
        away = OUTSIDE * layout.radius + CLEAR
        stations = {
            letter: layout.around(np.pi / 4.0 + i * np.pi / 2.0, (-1.0) ** i * 0.4 * layout.radius, away)
            for i, letter in enumerate("ABCD")
        }
        tape = float(np.exp(rng.uniform(*np.log(OFF))))
        sigmas = (SIGMA, STATION_SIGMA, OFFSET_SIGMA)
        hidden = (*targets.drawn(name, rng), *_off(name, stations, tape, sigmas, rng))
        station = np.tile(np.arange(len(stations)), len(stops))
        return Range(name, np.repeat(stops, len(stations)), hidden, declared, targets, stations, station, sigmas)

    @staticmethod
    def bar(layout: Layout, stops: Ints, declared: bool, rng: np.random.Generator) -> Range:
        """A ball bar from a pivot at the workspace's centre, which reads at all stops."""
        name, targets, stations = "ballbar", Targets.one(), {"pivot": layout.at(0.0, 0.0, 0.0)}
        sigmas = (BAR_SIGMA, PIVOT_SIGMA, BAR_OFFSET_SIGMA)
        hidden = (*targets.drawn(name, rng), *_off(name, stations, PIVOT_SIGMA, sigmas, rng))
        return Range(name, stops, hidden, declared, targets, stations, np.zeros(len(stops), dtype=int), sigmas)

    @property
    def sigma(self) -> Floats:
        """See :class:`Gauge`."""
        return np.full((len(self.stop), 1), self.sigmas[0])

    def readings(self, poses: Poses, u: Floats) -> Floats:
        """See :class:`Gauge`."""
        first = 3 * len(self.targets)
        centres = u[first : first + 3 * len(self.stations)].reshape(-1, 3)
        offsets = u[first + 3 * len(self.stations) :]
        p = self.targets.positions(poses, u, np.zeros(len(poses), dtype=int))
        away = np.linalg.norm(p - centres[self.station], axis=1)
        return np.asarray(away + offsets[self.station])[:, None]

    def table(self) -> dict[str, Any]:
        """See :class:`Gauge`."""
        stations = {name: list(place) for name, place in self.stations.items()}
        stated = {} if self.sigmas[1] == STATION_SIGMA else {"station_sigma": self.sigmas[1]}
        return {**self.targets.table(), "stations": stations, **stated, "offset_sigma": self.sigmas[2]}

    def columns(self, poses: Poses, errors: Floats) -> dict[str, Column]:
        """See :class:`Gauge`."""
        values = self.readings(poses, self.truth) + errors
        return {"station": labels(tuple(self.stations), self.station), "range": values[:, 0]}

    def ids(self) -> dict[str, tuple[str, ...]]:
        """See :class:`Gauge`."""
        return {"station": tuple(self.stations)}

    @classmethod
    def by_row(cls) -> tuple[str, ...]:
        """See :class:`Gauge`."""
        return "stop", "station"


def _off(
    name: str,
    stations: dict[str, tuple[float, float, float]],
    tape: float,
    sigmas: tuple[float, float, float],
    rng: np.random.Generator,
) -> tuple[Hidden, ...]:
    """True positions of the stations, with a random error of standard deviation ``tape``, m, and their offsets."""
    centres = [
        Hidden(f"{name}.station[{station}].{axis}", at + tape * rng.standard_normal(), sigmas[1])
        for station, place in stations.items()
        for axis, at in zip("xyz", place, strict=True)
    ]
    offsets = [Hidden(f"{name}.offset[{one}]", sigmas[2] * rng.standard_normal(), sigmas[2]) for one in stations]
    return (*centres, *offsets)
