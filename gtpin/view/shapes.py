"""The shapes of a model for Pinocchio's visualizers: the URDF's own, rods coloured by their share of the gap."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from gtpin.model.model import Model
from gtpin.model.model_folder import calibrated_urdf
from gtpin.robot.description import Description
from gtpin.robot.robot import Robot
from gtpin.view.colors import of_share
from gtpin.view.meshes import with_its_meshes
from gtpin.view.parts import rod_tip

RADIUS = 0.012
"""Radius of rods without a shape in the URDF, over a quarter of the robot's size."""


def robot_as_modelled(model: Model) -> Robot:
    """A robot with the model's geometry, as far as a URDF can carry it."""
    return Robot(Description.parse(calibrated_urdf(model), model.robot.description.source))


def shapes(robot: Robot, share: Mapping[str, float]) -> Any:
    """A ``pinocchio.GeometryModel`` of the shapes to draw.

    Parameters
    ----------
    robot
        The robot; its shapes are those of its URDF, and a rod without any becomes a cylinder.
    share
        Each rod's share of the gap, 0 to 1, by site, which determines its colour. If empty, all shapes keep their colours.
    """
    found = pin.buildGeomFromUrdfString(robot.model, with_its_meshes(robot.description), pin.GeometryType.VISUAL)
    rods = {rod.link: rod for rod in robot.rods}
    drawn = set()
    for shape in found.geometryObjects:
        link = robot.model.frames[shape.parentFrame].name
        if link in rods:
            drawn.add(link)
            if share:
                shape.meshColor = np.append(of_share(share.get(rods[link].site, 0.0)), 1.0)
    for link, rod in rods.items():
        if link not in drawn:
            found.addGeometryObject(_cylinder(robot, rod.loop, rod.rod_end, rod.site, share))
    return found


def _cylinder(robot: Robot, loop: int, end: int, site: str, share: Mapping[str, float]) -> Any:
    """A cylinder for a rod, from the joint that moves it to its free end."""
    import coal

    joint, tip = rod_tip(robot, loop, end)
    length = float(np.linalg.norm(tip))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), tip / max(length, 1e-12)).matrix()
    shape = pin.GeometryObject(site, joint, pin.SE3(turn, tip / 2.0), coal.Cylinder(RADIUS * robot.size / 4.0, length))
    shape.meshColor = np.append(of_share(share.get(site, 0.0)), 1.0)
    return shape
