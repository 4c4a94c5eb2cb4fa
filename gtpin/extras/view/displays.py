"""Instruments, and robots without rods, in the 3-D page."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from typing import Any

import numpy as np
import pinocchio as pin
from defusedxml.ElementTree import fromstring

from gtpin.extras.view.shapes import with_its_meshes
from gtpin.kinematics.rotations import to_quaternions
from gtpin.report.instrument_places import InstrumentPlaces, patch
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

STATION, SOCKET, TARGET, WIRE = (31, 95, 168), (154, 103, 0), (194, 65, 12), (120, 140, 165)
ENCODER = (126, 58, 160)
PLANE = (26, 127, 75)
"""Colours, 0 to 255."""
BALL, PATCH, AXIS = 0.008, 0.12, 0.08
"""Radius of a ball, half the side of a plane's patch, and length of a sensor's axes, over the machine's size."""
LINE, POINT = (90, 105, 125), (200, 40, 30)
"""Colours of links and of joints, 0 to 255."""


class InstrumentDisplay:
    """Instruments in a page of :class:`~gtpin.extras.view.scene.Scene`; ``size``: that of the machine, m.

    ``drawn``: viser's handles of the drawn parts, by their names in the scene, which end with the names in ``places``;
    ``labels``: those of their labels.
    """

    def __init__(self, server: Any, places: InstrumentPlaces, size: float) -> None:
        self.places, self.drawn, self.labels = places, dict[str, Any](), list[Any]()
        self._scene, self._size, self._moving = server.scene, size, dict[str, Any]()
        for name, at in places.stations.items():
            self._ball(f"/instruments/stations/{name}", at, 1.5 * BALL, STATION, name)
        for name, at in places.sockets.items():
            self._ball(f"/instruments/sockets/{name}", at, BALL, SOCKET, name)
        for name, (point, normal) in places.planes.items():
            key, side = f"/instruments/planes/{name}", PATCH * size
            corners, faces = patch(point, normal, side), np.array([[0, 1, 2], [0, 2, 3]])
            self.drawn[key] = self._scene.add_mesh_simple(key, corners, faces, color=PLANE, opacity=0.35, side="double")
            tip = point + 0.5 * side * normal
            self.drawn[f"{key}/normal"] = self._lines(f"/instruments/normals/{name}", [[point, tip]], PLANE, 3.0)
            self._label(key, name, tip)
        for one, two, length in places.distances:
            key, ends = f"/instruments/distances/{one} {two}", [places.sockets[one], places.sockets[two]]
            self.drawn[key] = self._lines(key, [ends], SOCKET, 2.0)
            self._label(key, f"{1e3 * length:g} mm", np.mean(ends, axis=0))

    def show(self, T: Floats, R: Floats, joints: Mapping[str, Floats]) -> None:
        """Draw the targets, wires, tilt sensors and encoders for a pose.

        ``T``, ``R``: pose of the TCP: position (3,), m, and orientation (3, 3), base frame. ``joints``: (3,) positions of
        the encoders' joints by their names in the URDF, base frame, m.
        """
        targets = {name: T + R @ at for name, at in self.places.targets.items()}
        for name, at in targets.items():
            key = f"/instruments/targets/{name}"
            if key not in self.drawn:
                self._ball(key, at, 0.7 * BALL, TARGET)
            self.drawn[key].position = at
        if self.places.wires:
            ends = [[self.places.stations[a], targets[b]] for a, b in self.places.wires]
            self.drawn["/instruments/wires"] = self._lines("/instruments/wires", ends, WIRE, 1.5)
        for name, axes in self.places.tilts.items():
            key, size = f"/instruments/tilts/{name}", AXIS * self._size
            if key not in self.drawn:
                self.drawn[key] = self._scene.add_frame(key, axes_length=size, axes_radius=0.04 * size)
            self.drawn[key].position = T
            self.drawn[key].wxyz = to_quaternions((R @ axes)[None])[0]
        for name, joint in self.places.encoders.items():
            key = f"/instruments/encoders/{name}"
            if key not in self.drawn:
                self._ball(key, joints[joint], 1.2 * BALL, ENCODER)
                self._moving[key] = self._label(key, name, joints[joint])
            self.drawn[key].position = self._moving[key].position = joints[joint]

    def _ball(self, key: str, at: Floats, radius: float, color: tuple[int, int, int], label: str = "") -> None:
        self.drawn[key] = self._scene.add_icosphere(key, radius * self._size, color, position=at)
        if label:
            self._label(key, label, at)

    def _label(self, key: str, words: str, at: Floats) -> Any:
        self.labels.append(self._scene.add_label(f"/names{key}", words, position=at))
        return self.labels[-1]

    def _lines(self, key: str, ends: list[list[Floats]], color: tuple[int, int, int], thickness: float) -> Any:
        look = {"thickness": thickness, "thickness_units": "screen"}
        return self._scene.add_line_segments(key, np.array(ends), color, **look)


class ChainDisplay:
    """A robot without rods in a page of :class:`~gtpin.extras.view.scene.Scene`: its meshes by yourdfpy, or lines.

    ``data``: the joints' placements in the shown posture. Warns if meshes are missing: their shapes are left out. If no shape
    is left, lines are drawn.
    """

    def __init__(self, server: Any, robot: Chain) -> None:
        self.robot, self.data = robot, robot.model.createData()
        self._server = server
        self._meshes = self._load()

    def display(self, configuration: Floats) -> None:
        """Show the robot in a Pinocchio configuration."""
        pin.forwardKinematics(self.robot.model, self.data, configuration)
        if self._meshes is None:
            self._lines()
        else:
            self._meshes.update_cfg(np.array([self._angle(name, configuration) for name in self._names]))

    def _load(self) -> Any:
        xml = with_its_meshes(self.robot.description)
        if not fromstring(xml).findall("link/visual"):
            return None
        import yourdfpy
        from viser.extras import ViserUrdf

        # with_its_meshes has already put the files' paths into the URDF.
        urdf = yourdfpy.URDF.load(BytesIO(xml.encode()), filename_handler=lambda fname: fname)
        self._names = tuple(urdf.actuated_joint_names)
        return ViserUrdf(self._server, urdf)

    def _angle(self, name: str, configuration: Floats) -> float:
        """The position of a joint by its name in the URDF, m or rad; 0 if the Pinocchio model does not have this joint."""
        model = self.robot.model
        if not model.existJointName(name):
            return 0.0
        joint = model.joints[model.getJointId(name)]
        own = configuration[joint.idx_q : joint.idx_q + joint.nq]
        return float(np.arctan2(own[1], own[0]) if joint.nq == 2 else own[0])

    def _lines(self) -> None:
        model = self.robot.model
        origins = [self.data.oMi[j].translation for j in range(model.njoints)]
        ends = [(origins[model.parents[j]], origins[j]) for j in range(1, model.njoints)]
        tcp = (self.data.oMi[self.robot.tcp_joint] * self.robot.tcp_placement).translation
        lines = np.array([*ends, (origins[self.robot.tcp_joint], tcp)])
        scene = self._server.scene
        scene.add_line_segments("/chain/links", lines, colors=LINE)
        scene.add_point_cloud("/chain/joints", lines[:, 1], colors=POINT, point_size=0.02, point_shape="circle")
