"""The parts and shapes of a machine in 3-D: names and places of its parts, its meshes, and its shapes for Pinocchio's
visualizers, rods coloured by their share of the gap."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import tostring

import numpy as np
import pinocchio as pin

from gtpin.errors import warn
from gtpin.model.model import Model
from gtpin.model.model_folder import calibrated_urdf
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
            found.addGeometryObject(_cylinder(robot, site, share))
    return found


def _cylinder(robot: Chain, site: str, share: Mapping[str, float]) -> Any:
    import coal

    _, joint, tip = robot.rod_tips[site]
    length = float(np.linalg.norm(tip))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), tip / max(length, 1e-12)).matrix()
    shape = pin.GeometryObject(site, joint, pin.SE3(turn, tip / 2.0), coal.Cylinder(RADIUS * robot.size / 4.0, length))
    shape.meshColor = np.append(of_share(share.get(site, 0.0)), 1.0)
    return shape


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
