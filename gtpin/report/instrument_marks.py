"""Instruments in a drawing of the machine: stations with wires, planes, sockets with known distances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import escape

from gtpin.report.camera import Camera
from gtpin.report.instrument_places import InstrumentPlaces, patch
from gtpin.typing import Floats

NEAR = 1.0
"""Largest distance of a drawn instrument from the machine, over the machine's size: farther ones would make the machine
small."""
PATCH = 0.12
"""Half the side of a plane's patch, over the machine's size."""
LOOK = "stroke:var(--accent);stroke-width:1.2"


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
        corners = [patch(point, n, self._half).reshape(-1, 3) for point, n in self._planes.values()]
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
    def _half(self) -> float:
        return PATCH * self._size

    @property
    def _planes(self) -> dict[str, tuple[Floats, Floats]]:
        return {name: plane for name, plane in self.places.planes.items() if self._near(plane[0])}

    def _near(self, at: Floats) -> bool:
        outside = np.maximum(self.machine.min(axis=0) - at, at - self.machine.max(axis=0))
        return bool(np.linalg.norm(np.maximum(outside, 0.0)) <= NEAR * self._size)

    def _plane(self, at: Camera, name: str, point: Floats, normal: Floats) -> str:
        outline = " ".join(f"{x:.1f},{y:.1f}" for x, y in at(patch(point, normal, self._half)))
        (x, y), (u, v) = at(np.stack([point, point + 0.7 * self._half * normal]))
        line = f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{u:.1f}" y2="{v:.1f}" style="{LOOK}"/>'
        shape = f'<polygon points="{outline}" style="fill:var(--accent);fill-opacity:.12;{LOOK}"/>'
        return f"{shape}{line}{_name(u, v - 3.0, name)}"


def _dashed(at: Camera, one: Floats, two: Floats) -> str:
    (x, y), (u, v) = at(np.stack([one, two]))
    return f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{u:.1f}" y2="{v:.1f}" style="{LOOK};stroke-dasharray:4 3;opacity:.6"/>'


def _name(x: float, y: float, name: str) -> str:
    return f'<text class="rod" x="{x:.1f}" y="{y:.1f}" text-anchor="middle">{escape(name)}</text>'
