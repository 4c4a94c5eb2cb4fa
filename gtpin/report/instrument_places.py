"""Positions of a model's instruments: stations, planes, sockets, targets and sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from gtpin.data.instrument_tables import PlaneTable, RangeTable, SocketTable, TiltTable, TrackerTable
from gtpin.kinematics.rotations import exp
from gtpin.model.model import FittedInstrument
from gtpin.robot.parameters import rotation_axes
from gtpin.typing import Floats

NEAR = 1.0
"""Largest distance of a drawn instrument from the machine, over the machine's size: farther ones would make the machine
small."""
TURNS = ("rx", "ry", "rz")


@dataclass(frozen=True, eq=False)
class InstrumentPlaces:
    """Positions of instruments, by names such as ``wire A``; the id is left out where an instrument has only one.

    - ``stations``: (3,) centres of stations, and origins of trackers, base frame, m.
    - ``targets``: (3,) targets, TCP frame, m.
    - ``wires``: names of a station and of a target that it measures.
    - ``planes``: (3,) a point of each plane, base frame, m, and (3,) its unit normal, base frame.
    - ``sockets``: (3,) points of sockets, base frame, m.
    - ``distances``: names of two sockets, and their known distance, m.
    - ``tilts``: (3, 3) axes of tilt sensors on the platform as columns, TCP frame.
    - ``encoders``: names in the URDF of the passive joints that encoders read.
    """

    stations: dict[str, Floats] = field(default_factory=dict)
    targets: dict[str, Floats] = field(default_factory=dict)
    wires: list[tuple[str, str]] = field(default_factory=list)
    planes: dict[str, tuple[Floats, Floats]] = field(default_factory=dict)
    sockets: dict[str, Floats] = field(default_factory=dict)
    distances: list[tuple[str, str, float]] = field(default_factory=list)
    tilts: dict[str, Floats] = field(default_factory=dict)
    encoders: dict[str, str] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return any((self.stations, self.targets, self.planes, self.sockets, self.tilts, self.encoders))

    @property
    def fixed(self) -> Floats:
        """(m, 3) all places that do not move with the platform, base frame, m."""
        places = [*self.stations.values(), *(point for point, _ in self.planes.values()), *self.sockets.values()]
        return np.array(places).reshape(-1, 3)

    def near(self, machine: Floats) -> InstrumentPlaces:
        """The stations, planes, sockets and distances near a machine with the points (m, 3), base frame, m."""
        low, high = machine.min(axis=0), machine.max(axis=0)

        def is_near(at: Floats) -> bool:
            outside = np.maximum(np.maximum(low - at, at - high), 0.0)
            return bool(np.linalg.norm(outside) <= NEAR * (high - low).max())

        sockets = {name: at for name, at in self.sockets.items() if is_near(at)}
        return InstrumentPlaces(
            stations={name: at for name, at in self.stations.items() if is_near(at)},
            planes={name: plane for name, plane in self.planes.items() if is_near(plane[0])},
            sockets=sockets,
            distances=[one for one in self.distances if {*one[:2]} <= {*sockets}],
        )

    @staticmethod
    def of(instruments: Sequence[FittedInstrument]) -> InstrumentPlaces:
        """Places of instruments with the values of their unknowns."""
        found = InstrumentPlaces()
        for one in instruments:
            found._add(one)
        return found

    def _add(self, one: FittedInstrument) -> None:
        table, name = one.table, one.name
        stations: dict[str, Floats] = {}
        targets = {_label(name, key, one.targets): at for key, at in one.targets.items()}
        match table:
            case RangeTable():
                stations = {
                    _label(name, key, table.stations): np.array(at) + one.deviation(f"station[{key}]")
                    for key, at in table.stations.items()
                }
            case TrackerTable(frame="free"):
                sessions = dict.fromkeys(one.known.get("session", ("",)))
                for key in sessions:
                    frame = f"frame[{key}]" if table.stations else "frame"
                    at = -one.deviation(frame) @ exp(one.deviation(frame, TURNS))
                    stations[_label(name, key, sessions)] = at
            case TrackerTable():
                stations = {} if table.station is None else {name: np.array(table.station)}
            case PlaneTable():
                for key, plane in table.planes.items():
                    normal = np.array(plane.normal) / np.linalg.norm(plane.normal)
                    height, a, b = one.deviation(f"plane[{key}]", ("height", "a", "b"))
                    normal = exp(np.array([a, b]) @ rotation_axes(normal)[:2]) @ normal
                    self.planes[_label(name, key, table.planes)] = (np.array(plane.point) + height * normal, normal)
            case SocketTable():
                names = dict.fromkeys([*one.known.get("socket", ()), *table.sockets])
                for key in names:
                    at = np.array(table.sockets.get(key, (0.0, 0.0, 0.0))) + one.deviation(f"point[{key}]")
                    self.sockets[_label(name, key, names)] = at
                self.distances.extend(
                    (_label(name, a, names), _label(name, b, names), float(length))
                    for a, b, length, *_ in table.distances
                )
            case TiltTable():
                if table.link is None:
                    self.tilts[name] = np.asarray(exp(one.deviation("mount", TURNS)))
        self.stations.update(stations)
        self.targets.update(targets)
        self.wires.extend((station, target) for station in stations for target in targets)
        joints = dict.fromkeys(table.measured_joints)
        self.encoders.update({_label(name, joint, joints): joint for joint in joints})


def _label(name: str, key: str, known: Mapping[str, object]) -> str:
    return f"{name} {key}" if len(known) > 1 else name


def patch(point: Floats, normal: Floats, half: float) -> Floats:
    """(4, 3) corners of a square about a point of a plane, base frame, m, counterclockwise about the normal.

    ``point``, ``normal``: (3,) middle of the square, m, and its unit normal. ``half``: half its side, m.
    """
    first, second = rotation_axes(normal)[:2]
    corners = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
    return np.array([point + half * (a * first + b * second) for a, b in corners])
