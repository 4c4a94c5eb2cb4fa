"""A robot without rods in the 3-D page: its meshes by yourdfpy, or lines from joint to joint."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np
import pinocchio as pin
from defusedxml.ElementTree import fromstring

from gtpin.robot.robot import Robot
from gtpin.typing import Floats
from gtpin.view.shapes import with_its_meshes

LINE, POINT = (90, 105, 125), (200, 40, 30)
"""Colours of links and of joints, 0 to 255."""


class ChainDisplay:
    """A robot without rods in a page of :class:`~gtpin.view.scene.Scene`.

    Parameters
    ----------
    server
        The page's viser server.
    robot
        The robot to show.

    Attributes
    ----------
    data : pinocchio.Data
        The joints' placements in the shown posture.

    Warns
    -----
    GtpinWarning
        If meshes are missing: their shapes are left out. If no shape is left, lines are drawn.
    """

    def __init__(self, server: Any, robot: Robot) -> None:
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
        """A viewer of the URDF's shapes; None if it has none."""
        xml = with_its_meshes(self.robot.description)
        if not fromstring(xml).findall("link/visual"):
            return None
        import yourdfpy
        from viser.extras import ViserUrdf

        def handler(fname: str) -> str:
            return fname  # with_its_meshes has already put the files' paths into the URDF

        urdf = yourdfpy.URDF.load(BytesIO(xml.encode()), filename_handler=handler)
        self._names = tuple(urdf.actuated_joint_names)
        return ViserUrdf(self._server, urdf)

    def _angle(self, name: str, configuration: Floats) -> float:
        """The position of a joint by its name in the URDF, m or rad; 0 if the Pinocchio model does not have this joint."""
        model = self.robot.model
        if not model.existJointName(name):
            return 0.0
        j = model.getJointId(name)
        at = model.idx_qs[j]
        if model.nqs[j] == 2:
            return float(np.arctan2(configuration[at + 1], configuration[at]))
        return float(configuration[at])

    def _lines(self) -> None:
        model = self.robot.model
        origins = [self.data.oMi[j].translation for j in range(model.njoints)]
        ends = [(origins[model.parents[j]], origins[j]) for j in range(1, model.njoints)]
        tcp = (self.data.oMi[self.robot.tcp_joint] * self.robot.tcp_placement).translation
        lines = np.array([*ends, (origins[self.robot.tcp_joint], tcp)])
        scene = self._server.scene
        scene.add_line_segments("/chain/links", lines, colors=LINE)
        scene.add_point_cloud("/chain/joints", lines[:, 1], colors=POINT, point_size=0.02, point_shape="circle")
