"""Instruments, and robots without rods, in the 3-D page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import tostring

import numpy as np
import pinocchio as pin
from defusedxml.ElementTree import fromstring

from gtpin.errors import warn
from gtpin.kinematics.rotations import to_quaternions
from gtpin.model.model import Model
from gtpin.model.model_folder import calibrated_urdf
from gtpin.report.instrument_places import InstrumentPlaces, patch
from gtpin.robot.chain import Chain
from gtpin.robot.description import RobotDescription, parse_xml
from gtpin.robot.library import package_folder
from gtpin.typing import Floats

RADIUS = 0.012
"""Radius of rods without a shape in the URDF, over a quarter of the robot's size."""
SCHEMES = ("package://", "model://")
GREY, BLUE, RED = np.array([0.60, 0.64, 0.69]), np.array([0.48, 0.64, 0.82]), np.array([0.71, 0.14, 0.09])
"""Colours of small, medium and large values."""


def of_share(share: float) -> Floats:
    """(3,) colour of a share of the gap, from grey at 0 to red at 0.5 and above."""
    part = min(2.0 * max(share, 0.0), 1.0)
    return np.asarray((1.0 - part) * GREY + part * RED)


def of_errors(lengths: Floats) -> Floats:
    """(N, 3) colours of error sizes (N,), from grey at 0 over blue to red at the 95 % quantile and above."""
    part = np.clip(lengths / max(float(np.quantile(lengths, 0.95)), 1e-300), 0.0, 1.0)[:, None]
    low = np.minimum(2.0 * part, 1.0)
    high = np.maximum(2.0 * part - 1.0, 0.0)
    return np.asarray((1.0 - high) * ((1.0 - low) * GREY + low * BLUE) + high * RED)


@dataclass(frozen=True, eq=False)
class NamedPart:
    """A part: its name, the number of the Pinocchio joint that it moves with, and its place (3,) in that joint's frame, m."""

    name: str
    joint: int
    at: Floats

    def place(self, data: Any) -> Floats:
        """(3,) place of the name in the base frame, m, with the joints' placements in a ``pinocchio.Data``."""
        return np.asarray(data.oMi[self.joint].act(self.at))


def parts(robot: Chain) -> tuple[NamedPart, ...]:
    """The parts of a robot. Their names are drawn at the TCP (the platform), at the actuators' joints, and at the rods'
    middles."""
    found = {platform_name(robot): (robot.tcp_joint, robot.tcp_placement.translation)}
    found |= {actuator.site: (actuator.joint_id, np.zeros(3)) for actuator in robot.actuators}
    # A leg is an actuator and a rod: its name is drawn only once, at its middle.
    found |= {site: (joint, tip / 2.0) for site, (_, joint, tip) in robot.rod_tips.items()}
    return tuple(NamedPart(name, int(joint), np.array(at)) for name, (joint, at) in found.items())


def platform_name(robot: Chain) -> str:
    """The name of the link that carries the TCP."""
    bodies = (f for f in robot.model.frames if f.type == pin.FrameType.BODY and f.parentJoint == robot.tcp_joint)
    return str(next((frame.name for frame in bodies), robot.tcp_frame))


def joint_places(robot: Chain, data: Any, names: Iterable[str]) -> dict[str, Floats]:
    """(3,) where joints are in the base frame, m, by their names, from the placements in a ``pinocchio.Data``."""
    return {name: np.array(data.oMi[robot.model.getJointId(name)].translation) for name in names}


def robot_as_modelled(model: Model) -> Chain:
    """A robot with the model's geometry, as far as a URDF can carry it."""
    return Chain(RobotDescription.parse(calibrated_urdf(model), model.robot.description.source))


def shapes(robot: Chain, share: Mapping[str, float]) -> Any:
    """A ``pinocchio.GeometryModel`` of the shapes to draw.

    ``robot``: the robot; its shapes are those of its URDF, and a rod without any becomes a cylinder. ``share``: each rod's
    share of the gap, 0 to 1, by site, which determines its colour. If empty, all shapes keep their colours.
    """
    found = pin.buildGeomFromUrdfString(robot.model, with_its_meshes(robot.description), pin.GeometryType.VISUAL)
    rods = {link: site for site, (link, *_) in robot.rod_tips.items()}
    drawn = set()
    for shape in found.geometryObjects:
        link = robot.model.frames[shape.parentFrame].name
        if link in rods:
            drawn.add(link)
            if share:
                shape.meshColor = np.append(of_share(share.get(rods[link], 0.0)), 1.0)
    for link, site in rods.items():
        if link not in drawn:
            import coal

            _, joint, tip = robot.rod_tips[site]
            length = float(np.linalg.norm(tip))
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), tip / max(length, 1e-12)).matrix()
            cylinder = coal.Cylinder(RADIUS * robot.size / 4.0, length)
            shape = pin.GeometryObject(site, joint, pin.SE3(turn, tip / 2.0), cylinder)
            shape.meshColor = np.append(of_share(share.get(site, 0.0)), 1.0)
            found.addGeometryObject(shape)
    return found


def with_its_meshes(description: RobotDescription) -> str:
    """The URDF's text with absolute paths of its visual meshes, and without the shapes whose mesh is missing.

    ``package://`` paths are looked for in all folders that contain the URDF, and in that of example-robot-data.

    Warns: if meshes are missing: their number, and the first one.
    """
    root = parse_xml(description.xml, description.source)
    folders = list(Path(description.source).absolute().parents)
    folders += [shared] if (shared := package_folder()) is not None else []
    missing = []
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            mesh = visual.find("geometry/mesh")
            if mesh is None:
                continue
            name = mesh.get("filename", "")
            if file := _found(name, folders):
                mesh.set("filename", str(file))
            else:
                missing.append(name)
                link.remove(visual)
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        warn(f"{description.source}: shapes are left out, for their meshes are missing: {missing[0]}{more}")
    return tostring(root, encoding="unicode")


def _found(name: str, folders: list[Path]) -> Path | None:
    scheme = next((scheme for scheme in SCHEMES if name.startswith(scheme)), None)
    plain = name.removeprefix("file://") if scheme is None else name.removeprefix(scheme)
    places = folders[:1] if scheme is None else folders  # a relative path starts at the URDF
    return next((place / plain for place in places if plain and (place / plain).is_file()), None)


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
            found, model = (
                np.zeros(len(self._names)),
                self.robot.model,
            )  # 0 for a joint that the Pinocchio model does not have
            for i, name in enumerate(self._names):
                if model.existJointName(name):
                    joint = model.joints[model.getJointId(name)]
                    own = configuration[joint.idx_q : joint.idx_q + joint.nq]
                    found[i] = np.arctan2(own[1], own[0]) if joint.nq == 2 else own[0]
            self._meshes.update_cfg(found)

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

    def _lines(self) -> None:
        model = self.robot.model
        origins = [self.data.oMi[j].translation for j in range(model.njoints)]
        ends = [(origins[model.parents[j]], origins[j]) for j in range(1, model.njoints)]
        tcp = (self.data.oMi[self.robot.tcp_joint] * self.robot.tcp_placement).translation
        lines = np.array([*ends, (origins[self.robot.tcp_joint], tcp)])
        scene = self._server.scene
        scene.add_line_segments("/chain/links", lines, colors=LINE)
        scene.add_point_cloud("/chain/joints", lines[:, 1], colors=POINT, point_size=0.02, point_shape="circle")
