"""Instruments in the 3-D page: stations, wires, planes with normals, sockets, known distances, tilt sensors, encoders."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gtpin.kinematics.rotations import to_quaternions
from gtpin.report.instrument_places import InstrumentPlaces, patch
from gtpin.typing import Floats

STATION, SOCKET, TARGET, WIRE = (31, 95, 168), (154, 103, 0), (194, 65, 12), (120, 140, 165)
ENCODER = (126, 58, 160)
PLANE = (26, 127, 75)
"""Colours, 0 to 255."""
BALL, PATCH, AXIS = 0.008, 0.12, 0.08
"""Radius of a ball, half the side of a plane's patch, and length of a sensor's axes, over the machine's size."""


class InstrumentDisplay:
    """Instruments in a page of :class:`~gtpin.view.scene.Scene`.

    Parameters
    ----------
    server
        The page's viser server.
    places
        Where the instruments and their parts are.
    size
        Size of the machine, m.

    Attributes
    ----------
    drawn : dict of str to handle
        viser's handles of the drawn parts, by their names in the scene, which end with the names in ``places``.
    labels : list of handle
        viser's handles of the parts' labels.
    """

    def __init__(self, server: Any, places: InstrumentPlaces, size: float) -> None:
        self.places, self.drawn, self.labels = places, dict[str, Any](), list[Any]()
        self._scene, self._size = server.scene, size
        self._moving = dict[str, Any]()
        for name, at in places.stations.items():
            self._ball(f"/instruments/stations/{name}", at, 1.5 * BALL, STATION, name)
        for name, at in places.sockets.items():
            self._ball(f"/instruments/sockets/{name}", at, BALL, SOCKET, name)
        for name, (point, normal) in places.planes.items():
            self._plane(name, point, normal)
        for one, two, length in places.distances:
            self._distance(one, two, length)

    def show(self, T: Floats, R: Floats, joints: Mapping[str, Floats]) -> None:
        """Draw the targets, wires, tilt sensors and encoders for a pose.

        ``T``, ``R``: pose of the TCP: position (3,), m, and orientation (3, 3), base frame. ``joints``: (3,) positions of
        the encoders' joints by their names in the URDF, base frame, m.
        """
        scene, size = self._scene, self._size
        targets = {name: T + R @ at for name, at in self.places.targets.items()}
        for name, at in targets.items():
            key = f"/instruments/targets/{name}"
            if key not in self.drawn:
                self._ball(key, at, 0.7 * BALL, TARGET)
            self.drawn[key].position = at
        if self.places.wires:
            ends = np.array([[self.places.stations[a], targets[b]] for a, b in self.places.wires])
            self.drawn["/instruments/wires"] = scene.add_line_segments(
                "/instruments/wires", ends, WIRE, thickness=1.5, thickness_units="screen"
            )
        for name, axes in self.places.tilts.items():
            key = f"/instruments/tilts/{name}"
            if key not in self.drawn:
                self.drawn[key] = scene.add_frame(key, axes_length=AXIS * size, axes_radius=0.04 * AXIS * size)
            self.drawn[key].position = T
            self.drawn[key].wxyz = to_quaternions((R @ axes)[None])[0]
        for name, joint in self.places.encoders.items():
            key = f"/instruments/encoders/{name}"
            if key not in self.drawn:
                self._ball(key, joints[joint], 1.2 * BALL, ENCODER)
                self._moving[key] = scene.add_label(f"/names{key}", name)
                self.labels.append(self._moving[key])
            self.drawn[key].position = self._moving[key].position = joints[joint]

    def _ball(self, key: str, at: Floats, radius: float, color: tuple[int, int, int], label: str = "") -> None:
        self.drawn[key] = self._scene.add_icosphere(key, radius * self._size, color, position=at)
        if label:
            self.labels.append(self._scene.add_label(f"/names{key}", label, position=at))

    def _plane(self, name: str, point: Floats, normal: Floats) -> None:
        key, side = f"/instruments/planes/{name}", PATCH * self._size
        corners = patch(point, normal, side)
        self.drawn[key] = self._scene.add_mesh_simple(
            key, corners, np.array([[0, 1, 2], [0, 2, 3]]), color=PLANE, opacity=0.35, side="double"
        )
        line = np.array([[point, point + 0.5 * side * normal]])
        self.drawn[f"{key}/normal"] = self._scene.add_line_segments(
            f"/instruments/normals/{name}", line, PLANE, thickness=3.0, thickness_units="screen"
        )
        self.labels.append(self._scene.add_label(f"/names{key}", name, position=line[0, 1]))

    def _distance(self, one: str, two: str, length: float) -> None:
        key = f"/instruments/distances/{one} {two}"
        ends = np.array([[self.places.sockets[one], self.places.sockets[two]]])
        self.drawn[key] = self._scene.add_line_segments(key, ends, SOCKET, thickness=2.0, thickness_units="screen")
        self.labels.append(self._scene.add_label(f"/names{key}", f"{1e3 * length:g} mm", position=ends[0].mean(axis=0)))
