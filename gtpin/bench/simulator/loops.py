"""A tree of joints whose loops close at points: the passive joints' coordinates are solved by Newton's method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gtpin.bench.simulator.tree import STRAIGHT, Bending, Placed, TreeFrame, TreeJoint, placed, read_urdf, turn
from gtpin.errors import RobotError
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

SHORTEST = 1.0 / 4096.0
"""Smallest stride, as a share of the way from home to commands. Where shorter ones are needed, these can't be reached."""
CHANGED = 0.5
"""Largest change of the gaps' slopes in a stride, as a share of their distance from a singularity, where it is 1."""
ZERO = 1e-9
"""Ratio to the largest singular value of the slopes below which a singular value is zero: across a planar loop."""
STEPS = 12
HOMING = 160
"""Largest number of Newton's steps at home."""
CLOSED = 1e-12
"""Gap, m, at which a loop counts as closed."""
NEARLY = 1e-8
"""Gap, m, below which one more of Newton's steps closes a loop to rounding errors."""
NUDGE = 1e-6


@dataclass(frozen=True, eq=False)
class Loops:
    """A tree of J joints, some of them driven, with L pairs of points that coincide."""

    joints: tuple[TreeJoint, ...]  # The joints with their true placements, parents first
    driven: tuple[int, ...]  # Indices of the commanded joints
    passive: tuple[int, ...]
    pairs: tuple[tuple[TreeFrame, TreeFrame], ...]  # Pairs of points that coincide
    ends: tuple[str, ...]  # Names (``pin.left_far``: loop and link) of the 2 L points, first and second of each pair
    axes: Floats  # (2 L, 3, 3) rotations from the frames of these links to the frames of their joints
    # (L, 3, 3) projection of each gap, in the first frame of its pair, on the part that closes: the whole gap, or that
    # in the plane of a planar loop
    across: Floats
    tcp: TreeFrame
    home_q: Floats  # (n,) commands at home
    start: Floats  # (J,) coordinates of the nominal robot at home. They choose the assembly mode.

    @staticmethod
    def of(robot: Chain) -> Loops:
        """The tree of a robot, and its loops, as in the URDF."""
        urdf = read_urdf(robot.description.xml)
        if robot.description.loops and any(joint.follows for joint in urdf.joints):
            raise RobotError("a <mimic> joint in a robot with loops", hint="the simulator can't close these")
        names = [joint.name for joint in urdf.joints]
        driven = tuple(names.index(actuator.joint) for actuator in robot.actuators)
        points, ends, axes = [], [], []
        for loop in robot.description.loops:
            for anchor in (loop.anchor1, loop.anchor2):
                on = urdf.links[anchor.link]
                points.append(TreeFrame(on.joint, on.R @ turn(anchor.rpy), on.p + on.R @ np.array(anchor.xyz)))
                ends.append(f"{getattr(loop, 'point_of', '') or loop.name}.{anchor.link}")
                axes.append(on.R)
        pairs = list(zip(points[::2], points[1::2], strict=True))
        passive = tuple(sorted(_closing(urdf.joints, pairs) - set(driven)))
        # Across the plane of a planar loop the play of bearings closes the gap. `planes`: where the package finds such loops.
        planes = getattr(robot, "planes", (np.zeros((0, 3)),) * len(pairs))
        across = np.array([np.eye(3) - np.transpose(n) @ n for n in planes])
        return Loops(
            joints=urdf.joints,
            driven=driven,
            passive=passive,
            pairs=tuple(pairs),
            ends=tuple(ends),
            axes=np.array(axes).reshape(-1, 3, 3),
            across=across,
            tcp=urdf.links[robot.tcp_frame],
            home_q=robot.home_q,
            start=np.array([robot.home_coordinates.get(name, 0.0) for name in names]),
        )

    @cached_property
    def closing(self) -> tuple[int, ...]:
        """Indices of the joints of the loops."""
        return tuple(sorted(_closing(self.joints, self.pairs)))

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
        ahead[:, self.driven] = driven
        along = x.copy()
        along[:, self.driven] += NUDGE * (driven - x[:, self.driven])
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
        x = self.closed(self.start[None], self.home_q[None], steps=HOMING)[0]
        return x if np.isfinite(x).all() else None

    def closed(self, x: Floats, driven: Floats, bending: Bending = STRAIGHT, steps: int = STEPS) -> Floats:
        """(N, J) coordinates that close the loops at ``driven`` ones (N, n), from nearby ones x; NaN where none are found."""
        x = x.copy()
        x[:, self.driven] = driven
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
                for joint in _on_the_way(self.joints, point.joint):
                    if joint in self.passive:
                        axis = bodies.seats[:, joint] @ self.joints[joint].axis
                        slope = axis if self.joints[joint].slides else np.cross(axis, at - bodies.p[:, joint])
                        own = np.einsum("nji,nj->ni", frame, sign * slope) @ self.across[i]
                        slopes[:, 3 * i : 3 * i + 3, self.passive.index(joint)] += own
        return slopes


def _on_the_way(joints: tuple[TreeJoint, ...], joint: int) -> list[int]:
    """Indices of the joints from a joint to the base."""
    found = []
    while joint >= 0:
        found.append(joint)
        joint = joints[joint].parent
    return found


def _closing(joints: tuple[TreeJoint, ...], pairs: Sequence[tuple[TreeFrame, TreeFrame]]) -> set[int]:
    return {j for pair in pairs for end in pair for j in _on_the_way(joints, end.joint)}
