"""Positions of a model's instruments: stations, planes, sockets, and the targets and sensors on the platform."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gtpin.data.instrument_tables import PlaneTable, RangeTable, SocketTable, TiltTable, TrackerTable
from gtpin.kinematics.rotations import exp
from gtpin.model.model import FittedInstrument
from gtpin.robot.parameters import rotation_axes
from gtpin.typing import Floats

LENGTHS, TURNS = ("x", "y", "z"), ("rx", "ry", "rz")


@dataclass(frozen=True, eq=False)
class InstrumentPlaces:
    """Positions of instruments, by names such as ``wire A``; the id is left out where an instrument has only one.

    - ``stations``: (3,) centres of stations, and origins of trackers, base frame, m.
    - ``targets``: (3,) targets, TCP frame, m.
    - ``wires``: names of a station and of a target that it measures.
    - ``planes``: (3,) a point of each plane, base frame, m, and (3,) its unit normal, base frame.
    - ``sockets``: (3,) points of sockets, base frame, m.
    - ``distances``: names of two sockets, and their known distance, m.
    - ``tilts``: (3, 3) axes of tilt sensors as columns, TCP frame.
    - ``encoders``: names in the URDF of the passive joints that encoders read.
    """

    stations: Mapping[str, Floats]
    targets: Mapping[str, Floats]
    wires: tuple[tuple[str, str], ...]
    planes: Mapping[str, tuple[Floats, Floats]]
    sockets: Mapping[str, Floats]
    distances: tuple[tuple[str, str, float], ...]
    tilts: Mapping[str, Floats]
    encoders: Mapping[str, str]

    def __bool__(self) -> bool:
        return any((self.stations, self.targets, self.planes, self.sockets, self.tilts, self.encoders))

    @property
    def fixed(self) -> Floats:
        """(m, 3) all places that do not move with the platform, base frame, m."""
        places = [*self.stations.values(), *(point for point, _ in self.planes.values()), *self.sockets.values()]
        return np.array(places).reshape(-1, 3)

    @staticmethod
    def of(instruments: Sequence[FittedInstrument]) -> InstrumentPlaces:
        """Places of instruments with the values of their unknowns."""
        found = InstrumentPlaces({}, {}, (), {}, {}, (), {}, {})
        parts = [found, *(_places(one) for one in instruments)]
        return InstrumentPlaces(
            {name: at for part in parts for name, at in part.stations.items()},
            {name: at for part in parts for name, at in part.targets.items()},
            tuple(wire for part in parts for wire in part.wires),
            {name: plane for part in parts for name, plane in part.planes.items()},
            {name: at for part in parts for name, at in part.sockets.items()},
            tuple(one for part in parts for one in part.distances),
            {name: axes for part in parts for name, axes in part.tilts.items()},
            {name: joint for part in parts for name, joint in part.encoders.items()},
        )


def _places(one: FittedInstrument) -> InstrumentPlaces:
    table, name = one.table, one.name
    stations: dict[str, Floats] = {}
    planes, sockets, tilts = {}, {}, {}
    distances: tuple[tuple[str, str, float], ...] = ()
    targets = _targets(one)
    match table:
        case RangeTable():
            stations = {
                _label(name, key, table.stations): np.array(at) + _deviation(one, f"station[{key}]")
                for key, at in table.stations.items()
            }
        case TrackerTable(frame="free"):
            turn = exp(_deviation(one, "frame", TURNS))
            stations = {name: -_deviation(one, "frame") @ turn}
        case TrackerTable():
            stations = {} if table.station is None else {name: np.array(table.station)}
        case PlaneTable():
            for key, plane in table.planes.items():
                normal = np.array(plane.normal) / np.linalg.norm(plane.normal)
                height, a, b = _deviation(one, f"plane[{key}]", ("height", "a", "b"))
                normal = exp(np.array([a, b]) @ rotation_axes(normal)[:2]) @ normal
                planes[_label(name, key, table.planes)] = (np.array(plane.point) + height * normal, normal)
        case SocketTable():
            names = dict.fromkeys([*one.known.get("socket", ()), *table.sockets])
            for key in names:
                at = np.array(table.sockets.get(key, (0.0, 0.0, 0.0))) + _deviation(one, f"point[{key}]")
                sockets[_label(name, key, names)] = at
            distances = tuple(
                (_label(name, a, names), _label(name, b, names), float(length)) for a, b, length, *_ in table.distances
            )
        case TiltTable():
            targets = {}
            tilts = {name: np.asarray(exp(_deviation(one, "mount", TURNS)))}
        case _:
            targets = {}
    wires = tuple((station, target) for station in stations for target in targets)
    encoders = {_label(name, joint, dict.fromkeys(table.measured_joints)): joint for joint in table.measured_joints}
    return InstrumentPlaces(stations, targets, wires, planes, sockets, distances, tilts, encoders)


def _targets(one: FittedInstrument) -> dict[str, Floats]:
    """(3,) targets by their labels, TCP frame, m."""
    known = one.table.fixed_targets
    return {
        _label(one.name, key, known): np.array(at) + _deviation(one, f"target[{key}]" if key else "target")
        for key, at in known.items()
    }


def _deviation(one: FittedInstrument, what: str, parts: tuple[str, ...] = LENGTHS) -> Floats:
    """Deviations of some unknowns from their declared values; zeros for those that are known."""
    return np.array([one.unknowns.get(f"{one.name}.{what}.{part}", 0.0) for part in parts])


def _label(name: str, key: str, known: Mapping[str, object]) -> str:
    return f"{name} {key}" if len(known) > 1 else name


def patch(point: Floats, normal: Floats, half: float) -> Floats:
    """(4, 3) corners of a square about a point of a plane, base frame, m, counterclockwise about the normal.

    ``point``, ``normal``: (3,) middle of the square, m, and its unit normal. ``half``: half its side, m.
    """
    first, second = rotation_axes(normal)[:2]
    return np.array(
        [point + half * (a * first + b * second) for a, b in ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))]
    )
