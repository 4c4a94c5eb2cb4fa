"""A robot without rods, from its URDF: a tree of joints, whose loops close at points by Newton's method."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gtpin.bench.simulator.tree import (
    STRAIGHT,
    Bending,
    Placed,
    TreeFrame,
    TreeJoint,
    placed,
    read_urdf,
    turn,
    way_from,
)
from gtpin.errors import RobotError
from gtpin.robot.chain import Chain
from gtpin.typing import Floats, Mask

TOLERANCE = 5e-4
"""Standard deviation of every placement, per axis, m and rad, where the URDF gives none."""
CARRIES = 0.2
"""Payload over moving mass, by data sheets: a UR5 has 5 kg and 18 kg, a Panda 3 kg and 16 kg, a UR10 10 kg and 27 kg."""
SHORTEST = 1.0 / 4096.0
"""Smallest stride, as a share of the way from home to commands. Where shorter ones are needed, these can't be reached."""
CHANGED = 0.5
"""Largest change of the gaps' slopes in a stride, as a share of their distance from a singularity, where it is 1."""
ZERO = 1e-9
"""Ratio to the largest singular value of the slopes below which a singular value is zero: across a planar loop."""
STEPS = 12
CLOSED = 1e-12
"""Gap, m, at which a loop counts as closed."""
NEARLY = 1e-8
"""Gap, m, below which one more of Newton's steps closes a loop to rounding errors."""
NUDGE = 1e-6


@dataclass(frozen=True, eq=False)
class Arm:
    """A tree of J joints, n of them commanded, with L pairs of points that coincide: the nominal robot, or one as it was built.

    An open chain has no such points.
    """

    name: str
    joints: tuple[TreeJoint, ...]  # All moving joints, parents first
    tcp: TreeFrame
    counted: tuple[int, ...]  # Indices of the commanded joints, in the order of q
    passive: tuple[int, ...]  # Indices of the other joints of the loops
    pairs: tuple[tuple[TreeFrame, TreeFrame], ...]  # Pairs of points that coincide
    ends: tuple[str, ...]  # Names (``pin.left_far``: loop and link) of the 2 L points, first and second of each pair
    axes: Floats  # (2 L, 3, 3) rotations from the frames of these links to the frames of their joints
    # (L, 3, 3) projection of each gap, in the first frame of its pair, on the part that closes: the whole gap, or that
    # in the plane of a planar loop
    across: Floats
    home_q: Floats  # (n,) commands at home
    start: Floats  # (J,) coordinates of the nominal robot at home. They choose the assembly mode.
    gravity: Floats  # (3,) acceleration of gravity, base frame, m/s^2
    tolerance: Floats  # (6,) standard deviation of the placement of each joint and of the tool, m and rad

    @staticmethod
    def of(robot: Chain) -> Arm:
        """The nominal robot. Names and the choice of joints are from ``robot``, numbers from the URDF's text.

        Raises RobotError if a joint mimics another one in a robot with loops.
        """
        urdf = read_urdf(robot.description.xml)
        if robot.description.loops and any(joint.follows for joint in urdf.joints):
            raise RobotError("a <mimic> joint in a robot with loops", hint="the simulator can't close these")
        names = [joint.name for joint in urdf.joints]
        counted = tuple(names.index(actuator.joint) for actuator in robot.actuators)
        points, ends, axes = [], [], []
        for loop in robot.description.loops:
            for anchor in (loop.anchor1, loop.anchor2):
                on = urdf.links[anchor.link]
                points.append(TreeFrame(on.joint, on.R @ turn(anchor.rpy), on.p + on.R @ np.array(anchor.xyz)))
                ends.append(f"{getattr(loop, 'point_of', '') or loop.name}.{anchor.link}")
                axes.append(on.R)
        closing = {j for point in points for j in way_from(urdf.joints, point.joint)}
        # Across the plane of a planar loop the play of bearings closes the gap. `planes`: where the package finds such loops.
        planes = getattr(robot, "planes", (np.zeros((0, 3)),) * (len(points) // 2))
        position, rotation = (robot.tolerance.get(f"placement_{of}", TOLERANCE) for of in ("position", "rotation"))
        return Arm(
            name=robot.name,
            joints=urdf.joints,
            tcp=urdf.links[robot.tcp_frame],
            counted=counted,
            passive=tuple(sorted(closing - set(counted))),
            pairs=tuple(zip(points[::2], points[1::2], strict=True)),
            ends=tuple(ends),
            axes=np.array(axes).reshape(-1, 3, 3),
            across=np.array([np.eye(3) - np.transpose(n) @ n for n in planes]),
            home_q=robot.home_q,
            start=np.array([robot.home_coordinates.get(name, 0.0) for name in names]),
            gravity=np.array(robot.description.gravity),
            tolerance=np.array([position] * 3 + [rotation] * 3),
        )

    @property
    def n_actuators(self) -> int:
        return len(self.counted)

    @cached_property
    def sites(self) -> tuple[str, ...]:
        return tuple(self.joints[j].name for j in self.counted)

    @cached_property
    def link_sites(self) -> tuple[str, ...]:
        """Names of the links that the commanded joints move."""
        return tuple(self.joints[j].link for j in self.counted)

    @cached_property
    def pins(self) -> tuple[int, ...]:
        """Indices of the passive revolute joints of loops."""
        return tuple(j for j in self.passive if not self.joints[j].slides)

    @property
    def pin_sites(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(self.joints[j].name for j in self.pins)

    @cached_property
    def lower(self) -> Floats:
        """(n,) lower ends of the ranges, rad or m."""
        return np.array([self.joints[j].lower for j in self.counted])

    @cached_property
    def upper(self) -> Floats:
        """(n,) their upper ends."""
        return np.array([self.joints[j].upper for j in self.counted])

    @cached_property
    def slides(self) -> Mask:
        """(n,) whether a commanded joint is prismatic."""
        return np.array([self.joints[j].slides for j in self.counted])

    @cached_property
    def way(self) -> tuple[int, ...]:
        """Indices of all joints from the base to the TCP, called the way below."""
        return tuple(reversed(way_from(self.joints, self.tcp.joint)))

    @cached_property
    def moving(self) -> tuple[int, ...]:
        """Indices of the joints that move the TCP: those on the way, and those of the loops."""
        closing = (j for pair in self.pairs for end in pair for j in way_from(self.joints, end.joint))
        return tuple(sorted({*self.way, *closing}))

    @property
    def placed(self) -> tuple[int, ...]:
        """Indices of the joints whose placements a calibration identifies."""
        return self.moving if self.pairs else self.counted

    @property
    def placements(self) -> tuple[str, ...]:
        """Names of these placements, and of the tool's."""
        return (*(f"placement[{self.joints[j].name}]" for j in self.placed), "platform")

    @cached_property
    def acting(self) -> tuple[int, ...]:
        """Indices of the commands that move the TCP."""
        return tuple(c for c, j in enumerate(self.counted) if j in self.moving)

    @cached_property
    def linked(self) -> tuple[int, ...]:
        """Indices of the commands whose link reaches to a next joint or the TCP, not only to where a loop closes."""
        return tuple(c for c in self.acting if self.counted[c] == self.tcp.joint or self._beyond(self.counted[c]))

    def _beyond(self, joint: int) -> tuple[int, ...]:
        return tuple(j for j, other in enumerate(self.joints) if other.parent == joint)

    def onward(self, joint: int) -> tuple[int, ...]:
        """Indices of a joint and of those beyond it: on the way, or up to the end of its loop."""
        if joint in self.way:
            return self.way[self.way.index(joint) :]
        found = [joint]
        while beyond := self._beyond(found[-1]):
            found.append(beyond[0])
        return tuple(found)

    def next_frame(self, joint: int) -> TreeFrame:
        """End of a joint's body, as a frame on that body: at the next joint, at the TCP, or where the loop closes."""
        line = self.onward(joint)
        if len(line) > 1:
            following = self.joints[line[1]]
            return TreeFrame(joint, following.R, following.p)
        if joint == self.tcp.joint:
            return self.tcp
        ends = [end for pair in self.pairs for end in pair if end.joint == joint]
        return ends[0] if ends else TreeFrame(joint, np.eye(3), np.zeros(3))

    def length(self, joint: int) -> float:
        """Length of the body of a joint, m: the housings of a wrist are longer than the offsets between its axes."""
        return max(float(np.linalg.norm(self.next_frame(joint).p)), 0.05)

    @cached_property
    def capacity(self) -> float:
        """Payload that it may carry, kg, from its moving mass, in steps of 0.5 kg."""
        mass = sum(joint.mass for joint in self.joints)
        return max(0.5, round(2.0 * CARRIES * mass) / 2.0)

    def usual_moment(self, joint: int) -> float:
        """Usual load of a joint, N m (N if prismatic): 0.4 of that with the arm stretched out and full payload."""
        g, moment, way = float(np.linalg.norm(self.gravity)) or 9.81, 0.0, 0.0
        if self.joints[joint].slides:
            behind = sum(self.joints[j].mass for j in self.onward(joint))
            return 0.4 * g * (behind + self.capacity)
        for j in self.onward(joint):
            moment += self.joints[j].mass * (way + 0.5 * self.length(j))
            way += self.length(j)
        return 0.4 * g * (moment + self.capacity * way)

    # ------------------------------------------------------------------------------------------------ closed loops

    def led(self, q: Floats) -> Floats:
        """(N, J) coordinates at commands q (N, n), on home's assembly mode; NaN where straight lines do not lead there.

        Each row follows the straight line of commands from home. A stride along it is shortened where the slopes of the gaps
        change by a large part of their distance from a singularity, so that no stride jumps over one.
        """
        home = self._home
        if home is None:
            return np.full((len(q), len(self.joints)), np.nan)
        x, at, stride = np.tile(home, (len(q), 1)), np.zeros(len(q)), np.ones(len(q))
        rows = np.flatnonzero(np.isfinite(q).all(axis=1))
        at[np.setdiff1d(np.arange(len(q)), rows)] = np.nan
        while rows.size:
            goal = np.minimum(1.0, at[rows] + stride[rows])
            there = self.home_q + goal[:, None] * (q[rows] - self.home_q)
            found, change = self._strode(x[rows], there)
            good = np.isfinite(found[:, 0])
            on, off = rows[good], rows[~good]
            x[on], at[on] = found[good], goal[good]
            share = 0.7 * CHANGED / np.maximum(change, 1e-3)  # the change grows with the stride
            stride[rows] *= np.where(good, np.clip(share, 0.5, 4.0), np.clip(share, 0.1, 0.5))
            at[off[stride[off] < SHORTEST]] = np.nan
            rows = np.flatnonzero(at < 1.0)
        x[np.isnan(at)] = np.nan
        return x

    def _strode(self, x: Floats, driven: Floats) -> tuple[Floats, Floats]:
        """(N, J) closed coordinates a stride away from closed ones x, NaN: too far; (N,) change of the gaps' slopes."""
        here = placed(self.joints, x)
        before = self._slopes(here, STRAIGHT, self._ends(here, STRAIGHT))
        inverse = np.linalg.pinv(before, rcond=ZERO)
        # The passive joints' motion to first order, from the gaps that the driven joints open.
        ahead = x.copy()
        ahead[:, self.counted] = driven
        along = x.copy()
        along[:, self.counted] += NUDGE * (driven - x[:, self.counted])
        gaps = self._gaps(placed(self.joints, along), STRAIGHT) / NUDGE
        ahead[:, self.passive] -= (inverse @ gaps[..., None])[..., 0]
        found, change = np.full(x.shape, np.nan), np.zeros(len(x))
        rows, after = np.arange(len(x)), ahead
        for closing in (True, False):
            bodies = placed(self.joints, after)
            slopes = self._slopes(bodies, STRAIGHT, self._ends(bodies, STRAIGHT)) - before[rows]
            change[rows] = np.maximum(change[rows], np.linalg.norm(inverse[rows] @ slopes, axis=(1, 2)))
            if closing:
                rows = np.flatnonzero(change <= CHANGED)
                after = self.closed(ahead[rows], driven[rows])
                rows, after = rows[np.isfinite(after[:, 0])], after[np.isfinite(after[:, 0])]
                found[rows] = after
        found[~(change <= CHANGED)] = np.nan
        return found, change

    @cached_property
    def _home(self) -> Floats | None:
        """(J,) coordinates at home, closed from those of the nominal robot; None where the loops don't close."""
        x = self.closed(self.start[None], self.home_q[None], steps=160)[0]
        return x if np.isfinite(x).all() else None

    def closed(self, x: Floats, driven: Floats, bending: Bending = STRAIGHT, steps: int = STEPS) -> Floats:
        """(N, J) coordinates that close the loops at ``driven`` ones (N, n), from nearby ones x; NaN where none are found."""
        x = x.copy()
        x[:, self.counted] = driven
        rows = np.flatnonzero(np.isfinite(x).all(axis=1))
        done = np.zeros(len(x), dtype=bool)
        for _ in range(steps):
            some = bending.take(rows)
            bodies = placed(self.joints, x[rows], some)
            gaps = self._gaps(bodies, some)
            step = -(np.linalg.pinv(self._slopes(bodies, some, self._ends(bodies, some))) @ gaps[..., None])[..., 0]
            x[np.ix_(rows, np.array(self.passive, dtype=int))] += np.clip(step, -0.5, 0.5)
            done[rows] = np.abs(gaps).max(axis=1) < NEARLY
            rows = rows[~done[rows]]
            if not rows.size:
                break
        rows = np.flatnonzero(done)
        some = bending.take(rows)
        done[rows] = np.abs(self._gaps(placed(self.joints, x[rows], some), some)).max(axis=1) < CLOSED
        x[~done] = np.nan
        return x

    def pulls(self, bodies: Placed, bending: Bending, loads: Floats) -> tuple[Floats, Floats]:
        """(N, L, 3) forces on the first bodies of the pairs, N, that balance the passive joints, and the points where they act.

        By virtual work: ``loads`` (N, p) are the loads of the passive joints along their coordinates, N m or N, and the
        derivatives of the gaps are the levers of the forces. There is no force across the plane of a planar loop. The force
        acts in the middle of the two points, (N, L, 3), m, which play can separate. Forces and points are in the base frame.
        """
        middle = self._ends(bodies, bending).mean(axis=1)
        levers = np.swapaxes(self._slopes(bodies, bending, np.stack([middle, middle], axis=1)), 1, 2)
        own = -(np.linalg.pinv(levers) @ loads[..., None])[..., 0].reshape(len(loads), -1, 3)
        frames = np.stack([bodies.at(first, bending).R for first, _ in self.pairs], axis=1)
        return np.einsum("nlij,ljk,nlk->nli", frames, self.across, own), middle

    def _gaps(self, bodies: Placed, bending: Bending) -> Floats:
        """(N, 3 L) vectors from each second point to the first, projected on the part that closes, first point's frame, m."""
        ends = [(bodies.at(one, bending), bodies.at(other, bending)) for one, other in self.pairs]
        gaps = [np.einsum("nji,nj->ni", one.R, one.T - other.T) for one, other in ends]
        return np.hstack([gap @ part for gap, part in zip(gaps, self.across, strict=True)])

    def _ends(self, bodies: Placed, bending: Bending) -> Floats:
        """(N, 2, L, 3) the first and the second points, base frame, m."""
        return np.stack(
            [np.stack([bodies.at(end, bending).T for end in ends], axis=1) for ends in zip(*self.pairs, strict=True)],
            axis=1,
        )

    def _slopes(self, bodies: Placed, bending: Bending, ends: Floats) -> Floats:
        """(N, 3 L, p) derivative of the gaps by the passive joints.

        ``ends`` (N, 2, L, 3) are the points, base frame, m.
        """
        count = len(bodies.p)
        slopes = np.zeros((count, 3 * len(self.pairs), len(self.passive)))
        for i, pair in enumerate(self.pairs):
            frame = bodies.at(pair[0], bending).R
            for sign, point in zip((1.0, -1.0), pair, strict=True):
                at = ends[:, 1, i]  # of both sides: the frame turns about the first body, and gaps can stay open
                for joint in way_from(self.joints, point.joint):
                    if joint in self.passive:
                        axis = bodies.seats[:, joint] @ self.joints[joint].axis
                        slope = axis if self.joints[joint].slides else np.cross(axis, at - bodies.p[:, joint])
                        own = np.einsum("nji,nj->ni", frame, sign * slope) @ self.across[i]
                        slopes[:, 3 * i : 3 * i + 3, self.passive.index(joint)] += own
        return slopes
