"""What every chain can be asked, whatever closes its loops: poses, derivatives, loads, and motion by displaced parts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gtpin.kinematics.poses import Poses
from gtpin.robot.chain import Chain
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats


@dataclass(frozen=True)
class Bodies:
    """First-order motion of the TCP by its chain's F displaced frames, at N postures and constant commands.

    Of a robot without rods the frames are those of J Pinocchio joints ("universe" is not counted), of the TCP, and of the 2 L
    anchors of L loops: a joint's *placement frame* is its frame on its parent, before its own motion. Joint j has the index
    j - 1, the TCP, on the body that carries it, the index J, the anchors the indices J + 1 to J + 2 L. Of a robot with rods
    they are the rods' joints on their carriers, in the order of the rods, with the base frame's axes.

    ``response``: (N, 6 + k, F, 6) motion of the TCP (position, m, rotation vector, rad; base frame), then of the
    coordinates of the robot's k measured joints (rad or m), by a twist (m, rad) of each frame in its own axes. (N, 6 + k,
    F, 3) for frames whose rotation moves nothing. ``R``, ``T``: (N, F', 3, 3) and (N, F', 3), m: the first F' of these
    frames in the base frame.
    """

    response: Floats
    R: Floats
    T: Floats

    def by_twist(self, index: int, twist: Floats) -> Floats:
        """(N, 6 + k, m) motion of the TCP and the measured joints by twists (N, 6, m) of one frame."""
        return np.asarray(self.response[:, :, index] @ twist[:, : self.response.shape[3]])


@dataclass(frozen=True)
class SmallError:
    """A small error of one part of a chain at N poses.

    ``parameter``, ``link``: its name (``L``, ``Px``, ``rx``), and the name of the part. ``rate``: (N, 6) motion of the TCP
    per unit of the parameter, base frame. ``after``: gives the poses (N) after an error of a size, m or rad, in the same
    assembly mode.
    """

    parameter: str
    link: str
    rate: Floats
    after: Callable[[float], Poses]


class Kinematics(Protocol):
    """Kinematics of one geometry for many commands. All poses and derivatives are in the base frame.

    Derivatives have six rows, for the TCP's position (m) and rotation vector (rad), then one row for the coordinate (rad or m)
    of each of the robot's k measured joints (by default k = 0). Poses have these coordinates under ``joints``. Everywhere
    ``q`` are (N, n) commands, m or rad, and ``poses`` the (N) poses at them. Arrays over rods are empty for a robot without
    rods.
    """

    @property
    def geometry(self) -> Geometry:
        """The geometry of these kinematics."""

    @property
    def robot(self) -> Chain:
        """The robot, for a geometry of joints with its displaced joints, anchors and TCP."""

    @property
    def home(self) -> Poses:
        """(1) pose at the home commands, base frame."""

    def forward(self, q: Floats, start: Poses | None = None) -> Poses:
        """Poses (N) at commands; NaN where the loops can't be closed.

        ``start``: poses (N) near the wanted ones, from which the solver starts; None: it finds a start itself.
        """

    def displaced(
        self, q: Floats, plain: Poses, commands: Floats, twists: Mapping[int, Floats], lengths: Floats
    ) -> Poses:
        """Poses (N) at other ``commands`` (N, n), with displaced frames and longer rods; exact; NaN where the loops open.

        ``plain``: the poses at q. ``twists``: by index of a frame, (N, 6) twists in its own axes, m and rad. ``lengths``:
        (N, r) changes of the rods' lengths, m.
        """

    def command_jacobian(self, q: Floats, poses: Poses, at: Bodies | None = None) -> Floats:
        """(N, 6 + k, n) derivative of the poses by the commands; ``at``: the bodies at q, where they are known."""

    def geometry_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6 + k, p) derivative of the poses by the parameters of the geometry."""

    def bodies(self, q: Floats, poses: Poses) -> Bodies:
        """Motion of the TCP by displaced frames, to first order."""

    def carried(self, actuator: int) -> tuple[int, ...]:
        """Indices of the frames that move with what an actuator drives: a joint's own, or those of the rods on a cart."""

    def axis(self, actuator: int) -> Floats:
        """(3,) unit vector along or about which an actuator moves, in the axes of the frames that it carries."""

    def loads(self, q: Floats, poses: Poses, force: Floats | None = None, payload: Floats | None = None) -> Floats:
        """(N, F', 6) static force, N, and moment, N m, on each frame about its origin, in its own axes.

        From gravity, a ``force`` (N, 3) on the tool, base frame, N, and a ``payload`` (N,) at the TCP, kg.
        """

    def rod_vectors(self, q: Floats, poses: Poses) -> tuple[Floats, Floats]:
        """(N, r, 3) vectors of the rods, carrier to platform, and R P: :func:`~gtpin.kinematics.closures.rod_vectors`."""

    def rod_forces(self, q: Floats, poses: Poses, force: Floats | None, payload: Floats | None) -> Floats:
        """(N, r) axial forces of the rods, N, tension positive; the load as for :meth:`loads`."""

    def length_response(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6 + k, r) motion of the TCP and the measured joints per change of each rod's length."""

    def singularity(self, q: Floats, poses: Poses) -> tuple[Floats, str]:
        """(N,) relative distances from a singularity, 0 at one, and where they are 1: ``home`` or ``best`` of these poses."""

    def small_errors(self, q: Floats, poses: Poses) -> Iterator[SmallError]:
        """Small errors of each part, one parameter at a time."""

    def urdf(self) -> str:
        """The URDF of the robot with the geometry, as far as a URDF can represent it."""
