"""Positions of a model's instruments: stations, planes, sockets, targets and sensors; and their marks in a drawing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from markupsafe import escape

from gtpin.data.instrument_tables import PlaneTable, RangeTable, SocketTable, TiltTable, TrackerTable
from gtpin.kinematics.rotations import exp
from gtpin.model.model import FittedInstrument
from gtpin.report.skeleton import Camera
from gtpin.robot.parameters import rotation_axes
from gtpin.typing import Floats

NEAR = 1.0
"""Largest distance of a drawn instrument from the machine, over the machine's size: farther ones would make the machine
small."""
PATCH = 0.12
"""Half the side of a plane's patch, over the machine's size."""
LOOK = "stroke:var(--accent);stroke-width:1.2"
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

    @staticmethod
    def of(instruments: Sequence[FittedInstrument]) -> InstrumentPlaces:
        """Places of instruments with the values of their unknowns."""
        found = InstrumentPlaces()
        for one in instruments:
            found._add(one)
        return found

    def _add(self, one: FittedInstrument) -> None:
        table, name, known = one.table, one.name, one.table.fixed_targets
        stations: dict[str, Floats] = {}
        targets = {
            _label(name, key, known): np.array(at) + _deviation(one, f"target[{key}]" if key else "target")
            for key, at in known.items()
        }
        match table:
            case RangeTable():
                stations = {
                    _label(name, key, table.stations): np.array(at) + _deviation(one, f"station[{key}]")
                    for key, at in table.stations.items()
                }
            case TrackerTable(frame="free"):
                stations = {name: -_deviation(one, "frame") @ exp(_deviation(one, "frame", TURNS))}
            case TrackerTable():
                stations = {} if table.station is None else {name: np.array(table.station)}
            case PlaneTable():
                for key, plane in table.planes.items():
                    normal = np.array(plane.normal) / np.linalg.norm(plane.normal)
                    height, a, b = _deviation(one, f"plane[{key}]", ("height", "a", "b"))
                    normal = exp(np.array([a, b]) @ rotation_axes(normal)[:2]) @ normal
                    self.planes[_label(name, key, table.planes)] = (np.array(plane.point) + height * normal, normal)
            case SocketTable():
                names = dict.fromkeys([*one.known.get("socket", ()), *table.sockets])
                for key in names:
                    at = np.array(table.sockets.get(key, (0.0, 0.0, 0.0))) + _deviation(one, f"point[{key}]")
                    self.sockets[_label(name, key, names)] = at
                self.distances.extend(
                    (_label(name, a, names), _label(name, b, names), float(length))
                    for a, b, length, *_ in table.distances
                )
            case TiltTable():
                targets = {}
                self.tilts[name] = np.asarray(exp(_deviation(one, "mount", TURNS)))
            case _:
                targets = {}
        self.stations.update(stations)
        self.targets.update(targets)
        self.wires.extend((station, target) for station in stations for target in targets)
        joints = dict.fromkeys(table.measured_joints)
        self.encoders.update({_label(name, joint, joints): joint for joint in joints})


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


@dataclass(frozen=True, eq=False)
class InstrumentMarks:
    """Instruments near a machine.

    ``places``: positions of the instruments. ``machine``: (m, 3) the machine's points, base frame, m. ``tcp``: (3,) the
    TCP, at which wires end, base frame, m.
    """

    places: InstrumentPlaces
    machine: Floats
    tcp: Floats

    @property
    def points(self) -> Floats:
        """(k, 3) positions of the drawn instruments, base frame, m."""
        drawn = [at for at in self.places.fixed if self._near(at)]
        corners = [patch(point, n, PATCH * self._size).reshape(-1, 3) for point, n in self._planes.values()]
        return np.vstack([np.array(drawn).reshape(-1, 3), *corners])

    def draw(self, at: Camera) -> str:
        """SVG of the instruments, seen by a camera."""
        made = [self._plane(at, name, *plane) for name, plane in self._planes.items()]
        stations = {name: place for name, place in self.places.stations.items() if self._near(place)}
        sockets = {name: place for name, place in self.places.sockets.items() if self._near(place)}
        made += [_dashed(at, place, self.tcp) for place in stations.values()]
        made += [
            _dashed(at, sockets[a], sockets[b]) for a, b, _ in self.places.distances if a in sockets and b in sockets
        ]
        for name, place in stations.items():
            x, y = at(place)[0]
            corners = f"{x:.1f},{y - 7.0:.1f} {x + 6.0:.1f},{y + 5.0:.1f} {x - 6.0:.1f},{y + 5.0:.1f}"
            made.append(f'<polygon points="{corners}" style="fill:var(--accent)"/>{_name(x, y + 17.0, name)}')
        for name, place in sockets.items():
            x, y = at(place)[0]
            look = f"fill:var(--paper);{LOOK}"
            title = f"<title>{escape(name)}</title>"  # sockets are too close together for names
            made.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" style="{look}">{title}</circle>')
        return "".join(made)

    @property
    def _size(self) -> float:
        return float(np.ptp(self.machine, axis=0).max())

    @property
    def _planes(self) -> dict[str, tuple[Floats, Floats]]:
        return {name: plane for name, plane in self.places.planes.items() if self._near(plane[0])}

    def _near(self, at: Floats) -> bool:
        outside = np.maximum(self.machine.min(axis=0) - at, at - self.machine.max(axis=0))
        return bool(np.linalg.norm(np.maximum(outside, 0.0)) <= NEAR * self._size)

    def _plane(self, at: Camera, name: str, point: Floats, normal: Floats) -> str:
        outline = " ".join(f"{x:.1f},{y:.1f}" for x, y in at(patch(point, normal, PATCH * self._size)))
        (x, y), (u, v) = at(np.stack([point, point + 0.7 * PATCH * self._size * normal]))
        line = f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{u:.1f}" y2="{v:.1f}" style="{LOOK}"/>'
        shape = f'<polygon points="{outline}" style="fill:var(--accent);fill-opacity:.12;{LOOK}"/>'
        return f"{shape}{line}{_name(u, v - 3.0, name)}"


def _dashed(at: Camera, one: Floats, two: Floats) -> str:
    (x, y), (u, v) = at(np.stack([one, two]))
    return f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{u:.1f}" y2="{v:.1f}" style="{LOOK};stroke-dasharray:4 3;opacity:.6"/>'


def _name(x: float, y: float, name: str) -> str:
    return f'<text class="rod" x="{x:.1f}" y="{y:.1f}" text-anchor="middle">{escape(name)}</text>'
