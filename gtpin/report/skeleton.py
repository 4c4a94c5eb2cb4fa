"""A machine as points and lines in space (tracks, carts, rods, links, joints), and the camera that sees them best."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from gtpin.kinematics.kinematics import Kinematics
from gtpin.model.model import Model
from gtpin.robot.chain import moving_links
from gtpin.robot.placement_frames import frame_of_anchor, frame_of_joint, frame_of_tcp
from gtpin.typing import Floats

Kind = Literal["track", "arm", "bracket", "rod", "link", "fixed"]
"""A cart's path; from a turning actuator's axis to its joints; from a cart to its joints; a rod; a moving link of a chain; a
part that no actuator moves."""
WIDTH, HEIGHT, MARGIN = 560.0, 400.0, 46.0
"""Size of a sketch, pixels."""
ELEVATION = np.deg2rad(24.0)


@dataclass(frozen=True, eq=False)
class Line:
    """A line of a machine: its kind, its site, empty for fixed parts, and its ends (2, 3), base frame, m."""

    kind: Kind
    site: str
    ends: Floats


@dataclass(frozen=True, eq=False)
class Spot:
    """An actuator: its site and place (3,), base frame, m; of a chain's joint also the unit vector (3,) of its axis."""

    site: str
    at: Floats
    axis: Floats | None = None


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A machine at one command, base frame, m.

    - ``lines``, ``spots``: its lines, and its carts or joints.
    - ``base``, ``platform``: (m, 3) corners of the outlines of the joints on the base and on the platform; without corners
      for a chain.
    - ``tcp``: (3,) the TCP.
    - ``up``: (3,) unit vector against gravity.
    """

    lines: tuple[Line, ...]
    spots: tuple[Spot, ...]
    base: Floats
    platform: Floats
    tcp: Floats
    up: Floats

    @property
    def points(self) -> Floats:
        """(m, 3) all points."""
        spots = np.array([spot.at for spot in self.spots]).reshape(-1, 3)
        return np.vstack([*(line.ends for line in self.lines), spots, self.tcp[None]])

    @property
    def size(self) -> float:
        """The largest extent along an axis, m."""
        return float(np.ptp(self.points, axis=0).max())

    def of(self, *kinds: Kind) -> list[Line]:
        """The lines of some kinds."""
        return [line for kind in kinds for line in self.lines if line.kind == kind]


def skeleton(model: Model, q: Floats | None = None) -> Skeleton | None:
    """The skeleton at a command (n,), by default :func:`standing`; None if the pose can't be reached."""
    kinematics, robot = model.kinematics, model.robot
    q = standing(model) if q is None else q
    gravity = np.asarray(robot.model.gravity.linear, dtype=float)
    up = -gravity / np.linalg.norm(gravity) if gravity.any() else np.array([0.0, 0.0, 1.0])
    if not robot.rod_sites:
        return _of_chain(kinematics, q, up)
    pose = kinematics.forward(q[None])
    if not pose.reached.all():
        return None
    joints, seats = (ends[0] for ends in kinematics.rod_ends(q[None], pose))
    lines = [Line("rod", site, np.stack(pair)) for site, *pair in zip(robot.rod_sites, seats, joints, strict=True)]
    spots, on_base = [], set(range(len(seats)))
    for j, actuator in enumerate(robot.actuators):
        carried = list(robot.rods_on(j))
        if not carried:
            continue
        site, middle = actuator.site, seats[carried].mean(axis=0)
        spots.append(Spot(site, middle))
        own = robot.rods_at(site)
        on_base -= set(own)
        lines += [Line("bracket", site, np.stack([middle, seats[i]])) for i in own]
        if actuator.revolute:
            anchor = actuator.origin + actuator.axis * float(actuator.axis @ (middle - actuator.origin))
            lines.append(Line("arm", site, np.stack([anchor, middle])))
        else:
            there, limits = float(q[j]), (actuator.lower, actuator.upper)
            low, high = limits if np.isfinite(limits).all() else (there - 0.5, there + 0.5)
            path = np.array([middle + (end - there) * actuator.axis for end in (low, high)])
            lines.append(Line("track", site, path))
    return Skeleton(tuple(lines), tuple(spots), seats[sorted(on_base)], joints, pose.T[0], up)


def standing(model: Model) -> Floats:
    """(n,) default command of a drawing, m or rad: for a robot with rods mid-range, where it can be reached; else home."""
    kinematics, robot = model.kinematics, model.robot
    middle = (robot.lower + robot.upper) / 2.0
    known = bool(robot.rod_sites) and np.isfinite(middle).all()
    return np.asarray(middle) if known and kinematics.forward(middle[None]).reached.all() else robot.home_q


def _of_chain(kinematics: Kinematics, q: Floats, up: Floats) -> Skeleton | None:
    robot, pose = kinematics.robot, kinematics.forward(q[None])
    if not pose.reached.all():
        return None
    motion, J = kinematics.motion(q[None], pose), frame_of_tcp(robot)
    T = np.array([motion.frame(index)[1][0] for index in range(J + 1 + len(robot.anchors))])
    spots = []
    for number, actuator in enumerate(robot.actuators):
        index = frame_of_joint(actuator.joint_id)
        spots.append(Spot(actuator.site, T[index], motion.frame(index)[0][0] @ kinematics.axis(number)))
    links = [Line("link", link.name, T[[frame_of_joint(link.joint_id), link.tip]]) for link in moving_links(robot)]
    drawn = {(tuple(line.ends[0]), tuple(line.ends[1])) for line in links}
    # From each joint's parent to the joint, from the last joint to the TCP, and to the points that loops join.
    ends = [(int(robot.model.parents[j]), T[frame_of_joint(j)]) for j in range(1, robot.model.njoints)]
    anchors = [(joint, T[frame_of_anchor(robot, a)]) for a, (joint, _) in enumerate(robot.anchors)]
    parts = [*ends, (int(robot.tcp_joint), T[J]), *anchors]
    bones = [np.stack([T[frame_of_joint(parent)] if parent else np.zeros(3), end]) for parent, end in parts]
    fixed = [Line("fixed", "", bone) for bone in bones if (tuple(bone[0]), tuple(bone[1])) not in drawn]
    nothing = np.empty((0, 3))
    return Skeleton((*links, *fixed), tuple(spots), nothing, nothing, T[J], up)


@dataclass(frozen=True)
class Camera:
    """Projects points in space to pixels, x to the right and y down."""

    axes: Floats
    centre: Floats
    scale: float

    @staticmethod
    def of(machine: Skeleton, beyond: Floats | None = None) -> Camera:
        """A camera a little above the machine, in the direction in which its lines hide each other least.

        ``beyond``: (m, 3) further points that must be in the picture, m.
        """
        views = [_axes(machine.up, azimuth) for azimuth in np.deg2rad(np.arange(0.0, 360.0, 10.0))]
        best = max(views, key=lambda axes: _open(machine, axes))
        flat = (machine.points if beyond is None else np.vstack([machine.points, beyond])) @ best.T
        size = np.ptp(flat, axis=0)
        room = np.array([WIDTH - 2.0 * MARGIN, HEIGHT - 2.0 * MARGIN])
        return Camera(best, (flat.max(axis=0) + flat.min(axis=0)) / 2.0, float((room / np.maximum(size, 1e-9)).min()))

    def __call__(self, points: Floats) -> Floats:
        """(m, 2) pixels of points (m, 3)."""
        flat = (np.atleast_2d(points) @ self.axes.T - self.centre) * self.scale
        return np.asarray(flat * [1.0, -1.0] + [WIDTH / 2.0, HEIGHT / 2.0])


def _axes(up: Floats, azimuth: float) -> Floats:
    """(2, 3) unit vectors to the right and upwards in a picture, for an azimuth about the vertical, rad."""
    side = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
    side /= np.linalg.norm(side)
    right = np.cos(azimuth) * side + np.sin(azimuth) * np.cross(up, side)
    into = np.cross(up, right)
    return np.array([right, np.cos(ELEVATION) * up + np.sin(ELEVATION) * into])


def _open(machine: Skeleton, axes: Floats) -> float:
    """Score of a view: larger where the lines' ends and middles are farther apart in the picture, and it is less flat."""
    lines = np.array([line.ends for line in machine.of("rod", "link", "fixed")]) @ axes.T
    flat = np.vstack([lines[:, 0], lines.mean(axis=1)])
    apart = np.linalg.norm(flat[:, None] - flat[None, :], axis=2)[np.triu_indices(len(flat), 1)]
    size = np.ptp(machine.points @ axes.T, axis=0)
    return float(np.log(apart / np.linalg.norm(size) + 0.01).mean() + np.log(size.min() / size.max() + 0.1))
