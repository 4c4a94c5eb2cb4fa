"""Kinematics of the paper's geometries: each rod's joint on its carrier follows a path of its own (eqs. 2 and 4)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
import pinocchio as pin

from gtpin.errors import ModelError
from gtpin.kinematics.closing import Here
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.motion import FrameMotion
from gtpin.kinematics.placed import Moves, PlacedParts, numbers, own_placements
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp, left_jacobian, skew
from gtpin.paper.geometry import PaperGeometry
from gtpin.paper.tracks import MeasuredTrack
from gtpin.robot.chain import Chain
from gtpin.robot.export import to_urdf
from gtpin.robot.geometry import Geometry
from gtpin.robot.parameters import DIRECTIONS, JOINTS, rotation_axes
from gtpin.robot.placement_frames import frame_of_anchor, frame_of_joint
from gtpin.robot.rods import Rod
from gtpin.typing import Floats, Ints, Mask


@dataclass(frozen=True)
class Seat:
    """A rod's joint on its carrier: C(q) = C0 + R p(q) + (exp(R w(q)) - 1) lever, base frame.

    The path p and the rotation vector w of the carrier: of a cart on a straight track q ``axis`` and 0 (eq. 2); of an arm 0 and
    q ``axis``; of a cart whose guideway was measured those of the ``track`` (eq. 4). ``lever`` goes from the point about which
    the carrier turns to the joint. R is the rotation of path and axis as a whole, by three small angles. Everywhere ``travel``
    (N,) is in m or rad.

    ``C0``: (3,) position at the command 0, m. ``axis``: (3,) nominal unit direction; zero where nothing moves the joint.
    ``axes``, ``angles``: (3, 3) unit vectors, one per row, and (3,) angles a, b and c about them, rad; c: about the track.
    ``origin``: (3,) a point of an arm's axis, m; None: the carrier slides. ``track``: the measured track; None: there is none.
    """

    C0: Floats
    axis: Floats
    axes: Floats
    angles: Floats
    origin: Floats | None = None
    track: MeasuredTrack | None = None

    @cached_property
    def R(self) -> Floats:
        """(3, 3) the rotation of the carrier's path."""
        return exp(self.angles @ self.axes)

    @cached_property
    def v(self) -> Floats:
        """(3,) unit direction of the track (of a measured one, of its chord) or axis; zero where nothing moves the joint."""
        along = self.R @ (self.axis if self.track is None else self.track.path[-1] - self.track.path[0])
        return np.asarray(along if self.track is None else along / np.linalg.norm(along))

    def position(self, travel: Floats) -> Floats:
        """(N, 3) the paper's C(q), m."""
        moved, turn = self.C0 + self._path(travel), self._turn(travel)
        return np.asarray(moved if turn is None else moved + turn @ self._lever - self._lever)

    def by_travel(self, travel: Floats) -> Floats:
        """(N, 3) derivative of the position by the travel."""
        turn = self._turn(travel)
        if turn is None:
            return np.broadcast_to(self.v, (len(travel), 3))
        if self.track is None:
            return np.cross(self.v, turn @ self._lever)
        along, turning = self.track.slope(travel) @ self.R.T, self.track.turn_slope(travel) @ self.R.T
        # Carts rotate by fractions of a milliradian: the derivative of the rotation vector is taken for that of the rotation.
        return np.asarray(along + np.cross(turning, self._lever))

    def by_joint(self, travel: Floats, component: int) -> Floats:
        """(N, 3) derivative of the position by a component, base frame, of the joint's position at the command 0."""
        turn = self._turn(travel)
        return np.broadcast_to(np.eye(3)[component], (len(travel), 3)) if turn is None else turn[:, :, component]

    def by_turn(self, travel: Floats, component: int) -> Floats:
        """(N, 3) derivative of the position by one of the angles; the joint at the command 0 stays."""
        across = skew(left_jacobian(self.angles @ self.axes) @ self.axes[component]).T
        path, turn = self._path(travel) @ across, self._turn(travel)
        return np.asarray(path if turn is None else path + turn @ self._lever @ across - turn @ (self._lever @ across))

    @cached_property
    def _lever(self) -> Floats:
        origin = self.origin if self.track is None else self.track.origin
        assert origin is not None
        return np.asarray(self.C0 - origin)

    def _path(self, travel: Floats) -> Floats:
        if self.track is not None:
            return np.asarray(self.track.displacement(travel) @ self.R.T)
        return np.asarray((travel if self.origin is None else 0.0 * travel)[:, None] * self.v)

    def _turn(self, travel: Floats) -> Floats | None:
        """(N, 3, 3) rotation of the carrier since the command 0; None: it slides along a straight track."""
        if self.track is not None:
            return exp(self.track.turn(travel) @ self.R.T)
        return None if self.origin is None else exp(travel[:, None] * self.v)


@dataclass(frozen=True)
class RodEnds:
    """Ends of the k rods: P (k, 3) on the platform, TCP frame; C (N, k, 3) on the carriers, base frame; lengths L (k,) or
    (N, k), without what actuators add; all in m.
    """

    P: Floats
    C: Floats
    L: Floats

    def vectors(self, poses: Poses) -> Floats:
        """(N, k, 3) vectors T + R P - C(q) from the joints on the carriers to those on the platform (eq. 5), base frame, m."""
        return np.asarray(poses.T[:, None] + self.P @ np.swapaxes(poses.R, 1, 2) - self.C)


@dataclass(frozen=True)
class PaperKinematics(Kinematics):
    """Kinematics whose joints on the carriers are at the paper's C(q), wherever Pinocchio's carriers are at the commands q."""

    geometry: PaperGeometry

    @cached_property
    def seats(self) -> tuple[Seat, ...]:
        """The motion of each rod's joint on its carrier."""
        robot, geometry = self.robot, self.geometry
        C0 = np.array([rod.C for rod in robot.rods]) + geometry.by_rod(JOINTS[1:], "xyz")
        turns, found = geometry.by_rod(DIRECTIONS, "abc"), []
        for i, rod in enumerate(robot.rods):
            if rod.carrier is None:
                found.append(Seat(C0[i], np.zeros(3), np.eye(3), np.zeros(3)))
                continue
            actuator, track = robot.actuators[rod.carrier], geometry.tracks[i] if geometry.tracks else None
            origin = actuator.origin if actuator.revolute and track is None else None
            found.append(Seat(C0[i], actuator.axis, rotation_axes(actuator.axis), turns[i], origin, track))
        return tuple(found)

    def ends(self, q: Floats) -> RodEnds:
        """The rods' ends at commands q (N, n)."""
        C = np.stack([seat.position(self._own(i, q)) for i, seat in enumerate(self.seats)], axis=1)
        return replace(self._still, C=C)

    @cached_property
    def placed(self) -> PlacedParts:
        """Where the parts are with all commands zero; anchors are (2 L, 3)."""
        at_zero = self.placed_at(np.zeros((1, self.robot.n_actuators)))
        return replace(at_zero, anchors=at_zero.anchors[0])

    def placed_at(self, q: Floats) -> PlacedParts:
        """Where the parts are at commands q: the anchors on the carriers at C(q)."""
        return places(self.robot, q, self.ends(q))

    def changes(self, q: Floats) -> Iterator[tuple[int, int, Literal["P", "C", "L"], Floats]]:
        """What each parameter changes at commands q (N, n): its column, the rod, which of `RodEnds`, and the derivative (3,),
        (N, 3) or (1,)."""
        for column, p in enumerate(self.geometry.parameters):
            for i in self.geometry.moved_by(p):
                seat, travel = self.seats[i], self._own(i, q)
                if p.kind == "platform_joint":
                    yield column, i, "P", np.eye(3)[p.component]
                elif p.kind in JOINTS:
                    yield column, i, "C", seat.by_joint(travel, p.component)
                elif p.kind in DIRECTIONS:
                    yield column, i, "C", seat.by_turn(travel, p.component)
                elif p.kind == "length":
                    yield column, i, "L", np.ones(1)
                else:
                    driver, extension = self.robot.rods[i].driver, self.robot.rods[i].extension
                    by_travel = np.ones((len(q), 1)) if extension is not None else seat.by_travel(travel)
                    yield column, i, "C" if extension is None else "L", by_travel * q[:, driver, None]

    def moves_at(self, q: Floats) -> Moves:
        """What the parameters move at commands q."""
        robot = self.robot
        found: dict[int, list[tuple[int, Floats]]] = {}
        for column, i, what, change in self.changes(q):
            rod = robot.rods[i]
            if what == "P":
                R = np.asarray(robot.model.jointPlacements[rod.joint_id].rotation.T @ robot.tcp_placement.rotation)
                frame, moved = frame_of_joint(rod.joint_id), R @ change
            elif what == "L":
                frame, moved = frame_of_anchor(robot, rod.tip), change * (robot.anchor_axes[rod.tip].T @ rod.along)
            else:
                frame, moved = frame_of_anchor(robot, rod.seat), _on_carrier(robot, rod, q, change)
            twist = np.concatenate([moved, np.zeros_like(moved)], axis=-1)
            found.setdefault(frame, []).append((column, np.broadcast_to(twist, (len(q), 6))))
        frames = ((f, np.array([c for c, _ in own]), np.stack([t for _, t in own], axis=2)) for f, own in found.items())
        return Moves(tuple(frames), ())

    def travel(self, q: Floats) -> Floats:
        """(N, n) coordinates of the actuators' joints: the commands, times the scale where they change a rod's length."""
        return q * self._drives

    def command_jacobian(self, q: Floats, poses: Poses, at: FrameMotion | None = None) -> Floats:
        """As that of `Kinematics`: the motion of Pinocchio's carriers, and what C(q) has beside it."""
        at = self.motion(q, poses) if at is None else at
        moved = at.by_commands * self._drives
        for i, rod in enumerate(self.robot.rods):
            if rod.carrier is not None:
                travel, seat = self._own(i, q), self.seats[i]
                beside = self._scale[i] * seat.by_travel(travel) - _carried(self.robot, rod, seat.position(travel))
                own = _on_carrier(self.robot, rod, q, beside)
                twist = np.concatenate([own, np.zeros_like(own)], axis=1)[..., None]
                moved[:, :, rod.carrier] += at.by_twist(frame_of_anchor(self.robot, rod.seat), twist)[..., 0]
        return np.asarray(moved)

    def placed_on_the_way(self, travel: Floats, rows: Ints, placed: PlacedParts) -> PlacedParts:
        """The joints on the carriers at C(q) all along the way."""
        return self.placed_at(travel / self._drives)

    def _from_home(self, q: Floats, placed: PlacedParts, X: Floats, s: Floats) -> tuple[Here, Mask]:
        rows, reached = np.flatnonzero(~self.geometry.outside(q)), np.zeros(len(q), dtype=bool)
        found = self.at_home.take(np.zeros(len(q), dtype=int))
        if rows.size:
            closed, reached[rows] = super()._from_home(q[rows], placed.take(rows), X[rows], s[rows])
            found.put(rows, closed)
        return found, reached

    def urdf(self, targets: Mapping[str, pin.SE3] | None = None) -> str:
        """The URDF of the robot with the geometry: its joints at the commands zero, and each cart's mean direction.

        ``targets``: places on the TCP, each of which is written as a link of its name.

        Raises `ModelError` if the loops don't close at home.
        """
        robot = self.robot
        if not self.home.reached.all():
            raise ModelError(f"the loops of {robot.name} don't close at home", hint="check the geometry's values")
        assert self.placed.placements is not None
        placements, anchors = self.placed.placements.copy(), self.placed.anchors.copy()
        for a, actuator in enumerate(robot.actuators):
            if carried := robot.rods_on(a):
                mean = np.mean([self.seats[i].v for i in carried], axis=0)
                across = np.cross(actuator.axis, mean)
                angle = np.arctan2(np.linalg.norm(across), actuator.axis @ mean)
                turn = exp(across * (angle / max(float(np.linalg.norm(across)), np.finfo(float).tiny)))
                R = np.asarray(robot.model.jointPlacements[actuator.joint_id].rotation)
                placements[actuator.joint_id - 1, :9] = (turn @ R).T.ravel()
                for i in carried:
                    anchors[robot.rods[i].seat] = (turn @ R).T @ R @ anchors[robot.rods[i].seat]
        return to_urdf(self.geometry, placements, anchors, (self.home.T[0], self.home.R[0]), targets or {})

    @property
    def _is_plain(self) -> bool:
        return not self.geometry.tracks and self.geometry.is_nominal

    def _own(self, i: int, q: Floats) -> Floats:
        """(N,) travel of a rod's own actuator, m or rad; zero where it has none."""
        driver = self.robot.rods[i].driver
        return np.zeros(len(q)) if driver is None else q[:, driver] * self._scale[i]

    @cached_property
    def _scale(self) -> Floats:
        """(k,) travel of each rod's own actuator per commanded unit."""
        return np.asarray(1.0 + self.geometry.by_rod(["scale"])[:, 0])

    @cached_property
    def _drives(self) -> Floats:
        """(n,) the same of the actuators that change a rod's length; 1 for all others, whose travel is in C(q)."""
        found = np.ones(self.robot.n_actuators)
        for i, rod in enumerate(self.robot.rods):
            if rod.extension is not None:
                found[rod.extension] = self._scale[i]
        return found

    @cached_property
    def _still(self) -> RodEnds:
        """The ends that commands do not move; C is empty."""
        rods, geometry = self.robot.rods, self.geometry
        P = np.array([rod.P for rod in rods]) + geometry.by_rod(JOINTS[:1], "xyz")
        return RodEnds(
            P, np.zeros((0, len(rods), 3)), np.array([rod.L for rod in rods]) + geometry.by_rod(["length"])[:, 0]
        )


def kinematics_of(geometry: Geometry) -> Kinematics:
    """The kinematics of a geometry, the paper's or any other."""
    return PaperKinematics(geometry) if isinstance(geometry, PaperGeometry) else Kinematics(geometry)


def places(robot: Chain, q: Floats, ends: RodEnds) -> PlacedParts:
    """The places of the parts that put the rods' ends where they are at commands q (N, n); anchors are (N, 2 L, 3)."""
    placements, R_tcp = own_placements(robot), np.asarray(robot.tcp_placement.rotation)
    anchors = np.tile([M.translation for _, M in robot.anchors], (len(q), 1, 1))
    for i, rod in enumerate(robot.rods):
        placements[rod.joint_id - 1, 9:] += R_tcp @ (ends.P[i] - rod.P)
        anchors[:, rod.tip] += (ends.L[..., i, None] - rod.L) * rod.along
        R, p = _carrier(robot, rod, q)
        anchors[:, rod.seat] = ((ends.C[:, i] - p)[:, None] @ R)[:, 0]
    return PlacedParts(placements, anchors, numbers(robot.tcp_placement))


def _carrier(robot: Chain, rod: Rod, q: Floats) -> tuple[Floats, Floats]:
    """Rotation (3, 3) or (N, 3, 3), and position (3,) or (N, 3), m, of the joint with a rod's seat at commands q (N, n)."""
    if rod.carrier is None:
        return np.eye(3), np.zeros(3)
    actuator = robot.actuators[rod.carrier]
    M, moved = robot.model.jointPlacements[actuator.joint_id], q[:, rod.carrier, None] * actuator.axis
    R, p = np.asarray(M.rotation), np.asarray(M.translation)
    return (exp(moved) @ R, p) if actuator.revolute else (R, p + moved)


def _carried(robot: Chain, rod: Rod, C: Floats) -> Floats:
    """(N, 3) motion of points C (N, 3) with Pinocchio's carrier of a rod, per unit of its command, base frame."""
    assert rod.carrier is not None
    actuator = robot.actuators[rod.carrier]
    return np.asarray(np.cross(actuator.axis, C - actuator.origin) if actuator.revolute else actuator.axis)


def _on_carrier(robot: Chain, rod: Rod, q: Floats, motion: Floats) -> Floats:
    """(N, 3) a motion (N, 3) of a rod's seat, base frame, in the axes of the link that has this anchor."""
    R, _ = _carrier(robot, rod, q)
    return np.asarray((motion[:, None] @ R @ robot.anchor_axes[rod.seat])[:, 0])
