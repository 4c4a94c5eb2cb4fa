"""The robot: its closed chain, its rods, and the names of its sites."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from gtpin.robot.chain import Chain
from gtpin.robot.description import Description
from gtpin.robot.rods import Rod, rods

Floats = npt.NDArray[np.float64]
Placements = tuple[tuple[Floats, Floats], ...]
"""Rotation and translation of every joint's placement, then of the TCP's on its body."""


class Robot(Chain):
    """A robot, built from its URDF alone.

    Parameters
    ----------
    description, tcp
        As for :class:`~gtpin.robot.chain.Chain`.

    Attributes
    ----------
    rods : tuple of Rod
        In the order of the URDF's ``<rod>`` elements; empty for a robot without rods.

    Raises
    ------
    RobotError
        If the URDF does not describe a complete robot.

    Examples
    --------
    >>> import gtpin
    >>> robot = gtpin.load_robot("gantry_tau")
    >>> robot.n_actuators, robot.sites, robot.rod_sites
    (3, ('cart1', 'cart2', 'cart3'), ('link1', 'link2a', 'link2b', 'link3a', 'link3b', 'link3c'))
    """

    def __init__(self, description: Description, tcp: str | None = None) -> None:
        super().__init__(description, tcp)
        self.rods: tuple[Rod, ...] = rods(self)

    @staticmethod
    def from_urdf(path: str | Path, tcp: str | None = None) -> Robot:
        """Build the robot of a URDF file. ``tcp`` names the link or frame of the TCP; None: the one that the URDF names."""
        return Robot(Description.read(Path(path)), tcp)

    @property
    def rod_sites(self) -> tuple[str, ...]:
        """Names of the rods' sites."""
        return tuple(rod.site for rod in self.rods)

    def with_placements(self, twists: Floats, platform: Floats | None = None) -> Robot:
        """A copy with joints moved: each placement times the exponential of its twist (njoints, 6), m and rad.

        ``platform`` (6,) is the twist of the TCP on the body that carries it.
        """
        other = copy.copy(self)
        other.model = self.model.copy()
        if platform is not None:
            other.tcp_placement = self.tcp_placement * pin.exp6(platform)
        for joint_id in range(1, self.model.njoints):
            other.model.jointPlacements[joint_id] = self.model.jointPlacements[joint_id] * pin.exp6(twists[joint_id])
        other.data = other.model.createData()
        other.prepare_constraints()
        return other

    def __reduce__(self) -> tuple[type[Robot], tuple[Description, str], Placements]:
        moved = (*self.model.jointPlacements, self.tcp_placement)
        placements = tuple((M.rotation.copy(), M.translation.copy()) for M in moved)
        return Robot, (self.description, self.tcp_frame), placements

    def __setstate__(self, placements: Placements) -> None:
        # The URDF knows nothing of joints that were moved.
        for joint_id, (R, T) in enumerate(placements[:-1]):
            self.model.jointPlacements[joint_id] = pin.SE3(R, T)
        self.tcp_placement = pin.SE3(*placements[-1])

    def __repr__(self) -> str:
        return f"Robot({self.name!r}, {self.n_actuators} actuators, {len(self.constraints)} loops)"
