"""A tree of joints whose loops close at points: the passive joints follow by Newton's method."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.errors import RobotError
from gtpin.plant.arms.tree import Placed, moved, placed
from gtpin.plant.arms.urdf import Frame, Joint, read_urdf, turn
from gtpin.plant.poses import Poses
from gtpin.plant.rotations import exp
from gtpin.robot.robot import Robot

Floats = npt.NDArray[np.float64]

STRIDES = 24
"""In which commands go from home to where they are wanted."""
STEPS = 8
CLOSED = 1e-12
"""Gap, m, at which a loop counts as closed."""
STARTS = 40
"""Postures that are tried at home."""
NUDGE = 1e-6


@dataclass(frozen=True, eq=False)
class Loops:
    """A tree of J joints, some of them driven, with L pairs of points that coincide.

    Parameters
    ----------
    joints
        The joints where they really are, parents first.
    driven, passive
        Indices of the commanded joints, and of those that follow.
    pairs
        Points that coincide.
    across
        (L, 3, 3) what closes of each gap, in the first frame of its pair: all of it, or what lies in a planar loop's plane.
    tcp
        The TCP frame.
    home_q
        (n,) commands at home.
    home
        The pose there that the URDF tells, or None.
    """

    joints: tuple[Joint, ...]
    driven: tuple[int, ...]
    passive: tuple[int, ...]
    pairs: tuple[tuple[Frame, Frame], ...]
    across: Floats
    tcp: Frame
    home_q: Floats
    home: Poses | None

    @staticmethod
    def of(robot: Robot, twists: dict[str, Floats]) -> Loops:
        """The loops of a robot whose joints are off by twists (6,), m and rad."""
        urdf = read_urdf(robot.description.xml)
        if any(joint.follows for joint in urdf.joints):
            raise RobotError("a <mimic> joint in a robot with loops", hint="the plant can't close these")
        names = [joint.name for joint in urdf.joints]
        joints = tuple(_off(joint, twists.get(joint.name)) for joint in urdf.joints)
        driven = tuple(names.index(actuator.joint) for actuator in robot.actuators)
        pairs = []
        for loop in robot.description.loops:
            ends = []
            for anchor in (loop.anchor1, loop.anchor2):
                on = urdf.links[anchor.link]
                ends.append(Frame(on.joint, on.R @ turn(anchor.rpy), on.p + on.R @ np.array(anchor.xyz)))
            pairs.append((ends[0], ends[1]))
        tcp, told = urdf.links[robot.tcp_frame], robot.description.home
        home = None if told is None else Poses(np.array(told.tcp_xyz)[None], exp(told.tcp_rotvec)[None])
        closing = {j for pair in pairs for end in pair for j in _on_the_way(joints, end.joint)}
        passive = tuple(sorted(closing - set(driven)))
        # Bearings' play takes up what a planar loop's gap has across its plane, where the package finds planes.
        planes = getattr(robot, "planes", (None,) * len(pairs))
        across = np.array([np.eye(3) if n is None else np.eye(3) - np.outer(n, n) for n in planes])
        return Loops(joints, driven, passive, tuple(pairs), across, tcp, robot.home_q, home)

    def forward(self, q: Floats) -> Poses:
        """Poses at commands q (N, n), base frame, on the assembly mode of home; NaN where the loops don't close."""
        x, open_at = self._led(q)
        poses = placed(self.joints, np.nan_to_num(x)).at(self.tcp)
        poses.T[open_at], poses.R[open_at] = np.nan, np.nan
        return poses

    def coordinate(self, joint: str, q: Floats) -> Floats:
        """(N,) coordinate of a joint at commands q (N, n), rad or m; NaN where the loops don't close."""
        x, open_at = self._led(q)
        return np.where(open_at, np.nan, x[:, [one.name for one in self.joints].index(joint)])

    def _led(self, q: Floats) -> tuple[Floats, npt.NDArray[np.bool_]]:
        """(N, J) coordinates at commands q (N, n), on the assembly mode of home, and (N,) where the loops don't close."""
        x = np.zeros((len(q), len(self.joints)))
        home = self._home()
        open_at = np.full(len(q), home is None)
        if home is not None:
            x[:] = home
            for s in np.arange(1, STRIDES + 1) / STRIDES:
                x[:, self.driven] = self.home_q + s * (q - self.home_q)
                x, closed = self._closed(x)
                open_at |= ~closed
        return x, open_at

    def command_jacobian(self, q: Floats) -> Floats:
        """(N, 6, n) derivative of the pose by the commands: position and rotation vector, base frame."""
        steps = NUDGE * np.eye(q.shape[1])
        return np.stack([self.forward(q + s).minus(self.forward(q - s)) / (2.0 * NUDGE) for s in steps], axis=2)

    def _home(self) -> Floats | None:
        """(J,) coordinates at home: the first closed ones found, next to the pose that the URDF tells."""
        rng, best, nearest = np.random.default_rng(0), None, np.inf
        starts = rng.uniform(-np.pi, np.pi, (STARTS, len(self.joints)))
        starts[0] = 0.0
        starts[:, self.driven] = self.home_q
        x = starts
        for _ in range(20):
            x, closed = self._closed(x)
        for row in np.flatnonzero(closed):
            if self.home is None:
                return np.asarray(x[row])
            off = np.abs(placed(self.joints, x[[row]]).at(self.tcp).minus(self.home)).sum()
            if off < nearest - 1e-6:
                best, nearest = np.asarray(x[row]), off
        return best

    def _closed(self, x: Floats) -> tuple[Floats, npt.NDArray[np.bool_]]:
        """Coordinates (N, J) with the passive joints moved to close the loops, and (N,) whether they do."""
        x = x.copy()
        for _ in range(STEPS):
            bodies = placed(self.joints, x)
            gaps, slopes = self._gaps(bodies), self._slopes(bodies)
            step = np.clip(-(np.linalg.pinv(slopes) @ gaps[..., None])[..., 0], -0.5, 0.5)
            x[:, self.passive] += step
        return x, np.asarray(np.abs(self._gaps(placed(self.joints, x))).max(axis=1) < CLOSED)

    def _gaps(self, bodies: Placed) -> Floats:
        """(N, 3 L) from each second point to the first, as far as it closes, in the first one's frame, m."""
        ends = [(bodies.at(one), bodies.at(other)) for one, other in self.pairs]
        gaps = [np.einsum("nji,nj->ni", one.R, one.T - other.T) for one, other in ends]
        return np.hstack([gap @ part for gap, part in zip(gaps, self.across, strict=True)])

    def _slopes(self, bodies: Placed) -> Floats:
        """(N, 3 L, p) derivative of the gaps by the passive joints where they are closed; near enough elsewhere."""
        count = len(bodies.p)
        slopes = np.zeros((count, 3 * len(self.pairs), len(self.passive)))
        for i, pair in enumerate(self.pairs):
            frame = bodies.at(pair[0]).R
            for sign, point in zip((1.0, -1.0), pair, strict=True):
                at = bodies.at(point).T
                for joint in _on_the_way(self.joints, point.joint):
                    if joint in self.passive:
                        axis = bodies.seats[:, joint] @ self.joints[joint].axis
                        slope = axis if self.joints[joint].slides else np.cross(axis, at - bodies.p[:, joint])
                        own = np.einsum("nji,nj->ni", frame, sign * slope) @ self.across[i]
                        slopes[:, 3 * i : 3 * i + 3, self.passive.index(joint)] += own
        return slopes


def _on_the_way(joints: tuple[Joint, ...], joint: int) -> list[int]:
    """Indices of the joints from one to the base."""
    found = []
    while joint >= 0:
        found.append(joint)
        joint = joints[joint].parent
    return found


def _off(joint: Joint, twist: Floats | None) -> Joint:
    if twist is None:
        return joint
    R, p = moved(joint.R, joint.p, twist)
    return replace(joint, R=R, p=p)
