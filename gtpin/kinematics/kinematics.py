"""The kinematics of one geometry for many commands: Pinocchio computes every robot, with loops, rods or neither."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pinocchio as pin

from gtpin.errors import AssemblyModeError, ClosureError, ModelError, UnreachableError
from gtpin.kinematics.closing import SINGULAR, Here, LoopClosure
from gtpin.kinematics.dynamics import Loads, loads, rod_ends
from gtpin.kinematics.first_guess import FirstGuess, halvings, nodes
from gtpin.kinematics.motion import FrameMotion
from gtpin.kinematics.placed import Moves, PlacedParts, moves_of, placed_by, rotation, times, twisted
from gtpin.kinematics.poses import Poses
from gtpin.robot.assembly import NEAR, tolerance
from gtpin.robot.chain import Chain
from gtpin.robot.constrained_model import joint_axis
from gtpin.robot.export import to_urdf
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats, Ints, Mask

MANY = 1000
"""Number of poses from which a fitted first guess saves time."""
CHUNK = 256
"""Number of poses that are closed at once: large enough that Python takes little time, small enough for a processor's cache."""
KEPT, LONGEST_KEPT = 8, 20_000
"""Number of arrays of commands whose configurations are kept, and of commands in one: 28 MB of a Gantry-Tau."""
DOUBTFUL = 100.0
"""Ratio of a posture's amplification to that of home, above which it is closed again along a path from home. Assumed."""
TRUSTED = 0.3
"""A guess that was farther off, m, rad or a part of a quaternion, does not tell the assembly mode. Assumed. Joints of one loop
alone do not count: the others determine them."""
SAME, USABLE = 1e-6, 0.3
"""A guess is of use if all postures found from it at its nodes differ by less from those along paths from home, m and rad, and
if these are at least such a part of the nodes. Assumed."""

HOME_OFF = 0.1
"""Distance, m, from the home in the URDF, beyond which the loops count as closed in another assembly mode. Assumed."""
HOME_TURNED = 0.2
"""Angle, rad, from the home in the URDF, beyond which they count so too. Assumed: both are far larger than rounding errors,
and smaller than the difference of assembly modes."""


@dataclass(frozen=True)
class Kinematics:
    """Kinematics of one geometry for many commands. All poses and derivatives are in the base frame.

    Derivatives have six rows, for the TCP's position (m) and rotation vector (rad), then three for the rotation vector (rad) of
    each of the robot's l measured links, then one row for the coordinate (rad or m) of each of its k measured joints (by
    default l = k = 0). Poses have these rotations and coordinates under ``links`` and ``joints``. Everywhere ``q`` are (N, n)
    commands, m or rad, and ``poses`` the (N) poses at them. Frames and their twists are those of
    :mod:`~gtpin.robot.placement_frames`.

    ``geometry``: the geometry.
    """

    geometry: Geometry

    @property
    def robot(self) -> Chain:
        """The robot, as its file describes it."""
        return self.geometry.robot

    @cached_property
    def loops(self) -> LoopClosure:
        """The closure equations."""
        known: LoopClosure | None = self.robot.memo.get("loops")
        if known is None:
            known = self.robot.memo["loops"] = LoopClosure(self.robot)
        return known

    @cached_property
    def placed(self) -> PlacedParts:
        """Where this geometry places the parts."""
        return placed_by(self.geometry)

    @cached_property
    def moves(self) -> Moves:
        """What the parameters of the geometry move."""
        return moves_of(self.geometry, self.placed)

    def placed_at(self, q: Floats) -> PlacedParts:
        """Where the parts are at commands q."""
        return self.placed

    def moves_at(self, q: Floats) -> Moves:
        """What the parameters move at commands q."""
        return self.moves

    def travel(self, q: Floats) -> Floats:
        """(N, n) travel of the actuators, m or rad: commands times the drives' scales."""
        return q * self.geometry.scale if self.moves.scales else q

    # ------------------------------------------------------------------------------------------- poses

    def forward(self, q: Floats, start: Poses | None = None) -> Poses:
        """Poses (N) at commands, in the assembly mode of home; NaN where the loops can't be closed.

        ``start``: poses (N) of a similar geometry at the same commands, from which the solver starts; None: it finds a start
        itself.

        Raises `ModelError` if q is not (N, n). `ClosureError` if the loops of the robot's own file are open at home.
        """
        n = self.robot.n_actuators
        if q.ndim != 2 or q.shape[1] != n:
            what = f"commands of shape {q.shape} for {self.robot.name}"
            raise ModelError(what, hint=f"give an array of shape (N, {n})")
        found, X = self._unknown(len(q))
        begin = np.zeros(len(q))
        near = None if start is None else start.configuration
        if near is None and self.loops.count:
            near = self._kept.get(q.tobytes()) if self._is_plain else nominal(self.robot).known(q)
        alone = near is None and self.loops.count
        guess = self._guess(halvings(self.robot, q)) if alone and len(q) >= MANY else None
        at_once = not alone or guess is not None
        try:
            for rows in _chunks(np.arange(len(q) if at_once else 0)):
                placed = self.placed_at(q[rows])
                if guess is None:
                    here, reached = self._first(q[rows], placed, None if near is None else near[rows])
                else:
                    here, begin[rows] = self._guessed(q[rows], placed, guess)
                    reached, X[rows] = begin[rows] == 1.0, here.X
                self._write(here, placed, reached, rows, found)
            for rows in _chunks(np.flatnonzero(~found.reached), 8 * CHUNK):
                placed = self.placed_at(q[rows])
                here, reached = self._from_home(self.travel(q[rows]), placed, X[rows], begin[rows])
                X[rows] = np.nan
                self._write(here, placed, reached, rows, found)
        except ClosureError:  # its loops are open at home: an assembly mode it has not
            if self._is_plain:
                raise  # the URDF is wrong, not the commands
        return found

    def known(self, q: Floats) -> Floats:
        """(N, nq) configurations of a robot with loops at commands; NaN where the loops can't be closed.

        Postures of similar geometries are found from these: so they do not depend on what was computed before.
        """
        kept, place = self._kept, q.tobytes()
        X = kept.get(place)
        if X is None:
            X = self.forward(q).configuration
            assert X is not None
            for oldest in list(kept)[: max(len(kept) - KEPT + 1, 0)]:  # a list: other threads may change it meanwhile
                kept.pop(oldest, None)
            if len(q) <= LONGEST_KEPT:
                kept[place] = X
        return X

    @property
    def _kept(self) -> dict[bytes, Floats]:
        kept: dict[bytes, Floats] = self.robot.memo.setdefault("known", {})
        return kept

    def displaced(self, q: Floats, plain: Poses, commands: Floats, twists: Mapping[int, Floats]) -> Poses:
        """Poses (N) at other ``commands`` (N, n), with displaced frames; exact; NaN where the loops open.

        ``plain``: the poses at q. ``twists``: by index of a frame, (N, 6) twists in its own axes, m and rad.
        """
        begin = self._configurations(q, plain)
        found, _ = self._unknown(len(q))
        for rows in _chunks(np.arange(len(q))):
            placed, moved = self.placed_at(q[rows]), {f: twist[rows] for f, twist in twists.items()}
            here, reached, placed = self._moved(q[rows], begin[rows], commands[rows], placed, moved)
            self._write(here, placed, reached, rows, found)
        return found

    @cached_property
    def home(self) -> Poses:
        """(1) pose at the home commands, base frame."""
        return self.forward(self.robot.home_q[None])

    def motion(self, q: Floats, poses: Poses) -> FrameMotion:
        """First-order motion by commands and by displaced frames."""
        placed = self.placed_at(q)
        return FrameMotion(self.loops, self.loops.at(self._configurations(q, poses), placed), placed)

    def command_jacobian(self, q: Floats, poses: Poses, at: FrameMotion | None = None) -> Floats:
        """(N, 6 + 3 l + k, n) derivative of the poses by the commands; ``at``: the motion at q, where it is known."""
        if at is None:
            moved = np.empty((len(q), self.robot.motion_size, self.robot.n_actuators))
            for rows in _chunks(np.arange(len(q))):
                moved[rows] = self.motion(q[rows], poses[rows]).by_commands
        else:
            moved = at.by_commands
        return moved * self.geometry.scale if self.moves.scales else moved

    def geometry_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6 + 3 l + k, p) derivative of the poses by the parameters of the geometry."""
        count = len(self.geometry.parameters)
        found = np.empty((len(q), self.robot.motion_size, count))
        for rows in _chunks(np.arange(len(q))):
            found[rows] = self.motion(q[rows], poses[rows]).by_parameters(self.moves_at(q[rows]), count, q[rows])
        return found

    def rod_ends(self, q: Floats, poses: Poses) -> tuple[Floats, Floats]:
        """(N, k, 3) joints of the k rods on the platform and on their carriers, base frame, m."""
        return rod_ends(self.robot, self.loops.at(self._configurations(q, poses), self.placed_at(q)))

    @property
    def tcp(self) -> pin.SE3:
        """The TCP of this geometry on the joint that carries it."""
        return pin.SE3(rotation(self.placed.tcp), self.placed.tcp[9:])

    def axis(self, actuator: int) -> Floats:
        """(3,) unit vector along or about which an actuator moves, in the placement frame of its joint."""
        joint = self.robot.actuators[actuator]
        twist = joint_axis(self.robot.model, joint.joint_id)
        return twist[3:] if joint.revolute else twist[:3]

    def loads(self, q: Floats, poses: Poses, force: Floats | None = None, payload: Floats | None = None) -> Loads:
        """Static loads from gravity, a ``force`` (N, 3) on the tool, base frame, N, and a ``payload`` (N,) at the TCP, kg."""
        placed = self.placed_at(q)
        return loads(self.loops, self.loops.at(self._configurations(q, poses), placed), placed, force, payload)

    def urdf(self, targets: Mapping[str, pin.SE3] | None = None) -> str:
        """The URDF of the robot with the geometry, as far as a URDF can represent it.

        ``targets``: places on the TCP, each of which is written as a link of its name.

        Raises `ModelError` if the loops don't close at home.
        """
        if not self.home.reached.all():
            raise ModelError(f"the loops of {self.robot.name} don't close at home", hint="check the geometry's values")
        home = self.home.T[0], self.home.R[0]
        placements = None if self.geometry.is_nominal else self.placed.placements
        return to_urdf(self.geometry, placements, self.placed.anchors, home, targets or {})

    # ------------------------------------------------------------------------------------------- closing

    def follow(
        self, start: Here, corners: Floats, placed: PlacedParts, begin: Floats | None = None
    ) -> tuple[Here, Mask, Floats]:
        """Postures at the end of polylines of travel through corners (N, c, n); see ``LoopClosure.follow``."""
        pieces = corners.shape[1] - 1

        def polyline(s: Floats, rows: Ints) -> tuple[Floats, PlacedParts]:
            piece = np.minimum((s * pieces).astype(int), pieces - 1)
            one, two = corners[rows, piece], corners[rows, piece + 1]
            travel = one + (s * pieces - piece)[:, None] * (two - one)
            return travel, self.placed_on_the_way(travel, rows, placed)

        return self.loops.follow(start, polyline, self._largest, begin=begin)

    def placed_on_the_way(self, travel: Floats, rows: Ints, placed: PlacedParts) -> PlacedParts:
        """Where the parts are at travels (m, n) on the way to some of the postures with ``placed`` parts."""
        return placed.take(rows)

    @cached_property
    def at_home(self) -> Here:
        """(1) the closed posture at home. Threads share it: what is computed of it is kept elsewhere.

        Raises `UnreachableError` if the loops don't close there. `AssemblyModeError` if the loops of the robot's own file close
        far from the home that it gives.
        """
        loops, robot, q = self.loops, self.robot, self.travel(self.robot.home_q[None])
        placed = self.placed_at(self.robot.home_q[None])
        plain = self._is_plain
        begin = robot.assembly.configuration[None] if plain else nominal(robot).at_home.X
        closing = loops.newton(loops.at(self.robot.with_commands(begin, q), placed), placed, contraction=1.0)
        if not closing.closed.all():
            if plain:
                raise _open_at_home(robot)
            raise UnreachableError(f"the loops of {robot.name} don't close at home", hint="check the geometry's values")
        if plain:
            _check_declared_home(robot, closing.here)
        return closing.here

    @property
    def _is_plain(self) -> bool:
        return self.geometry.is_nominal

    def _regularity(self, D: Floats) -> Floats:
        """(N,) squares of the determinants of D over that of home's, negative on the other side of a singularity."""
        ratio = self.loops.determinant(D) / self._determinant
        return np.asarray(ratio * np.abs(ratio))

    @cached_property
    def _determinant(self) -> float:
        """The determinant at home: assembly modes meet where it is zero."""
        return float(self.loops.determinant(self.loops.equations(self.at_home).D)[0])

    @cached_property
    def _largest(self) -> float:
        return SINGULAR * float(self.loops.amplification(self.loops.equations(self.at_home).D)[0])

    def _first(self, q: Floats, placed: PlacedParts, near: Floats | None) -> tuple[Here, Mask]:
        """Postures at commands (N, n) closed at once from those ``near`` (N, nq), and whether they were reached."""
        loops, travel = self.loops, self.travel(q)
        if near is None:
            return loops.at(self._of_tree(travel), placed), np.ones(len(q), dtype=bool)
        closing = loops.newton(loops.at(self.robot.with_commands(near, travel), placed), placed)
        sound = loops.amplification(closing.D) <= self._largest * DOUBTFUL / SINGULAR
        return closing.here, closing.closed & sound & (self._regularity(closing.D) > 0.0)

    def _guessed(self, q: Floats, placed: PlacedParts, guess: FirstGuess) -> tuple[Here, Floats]:
        """Postures closed from a guess, and how far they are on the straight lines from home to commands (N, n): 0 to 1."""
        loops, home, travel = self.loops, self.travel(self.robot.home_q[None]), self.travel(q)
        X, s = guess(travel)
        begin = self.robot.with_commands(X, np.where(s[:, None] == 1.0, travel, home + s[:, None] * (travel - home)))
        closing = loops.newton(loops.at(begin, placed), placed, contraction=1.0)
        off = np.abs(closing.here.X - begin)[:, loops.solved_q].max(axis=1)
        right = closing.closed & (off <= TRUSTED) & (self._regularity(closing.D) >= DOUBTFUL**-2)
        return closing.here, np.where(right, s, 0.0)

    def _from_home(self, q: Floats, placed: PlacedParts, X: Floats, s: Floats) -> tuple[Here, Mask]:
        """Postures at travels (N, n) along straight lines from home, or by other ways where these are blocked.

        ``X``: (N, nq) configurations that are known at fractions ``s`` (N,) of the lines; those at 0 need not be given.
        """
        home, q_home = self.at_home, self.travel(self.robot.home_q[None])
        start, known = home.take(np.zeros(len(q), dtype=int)), np.flatnonzero(s)
        if known.size:
            start.put(known, self.loops.at(X[known], placed.take(known)))
        lines = np.stack([np.broadcast_to(q_home, q.shape), q], axis=1)
        found, reached, _ = self.follow(start, lines, placed, s)
        lost = np.flatnonzero(~reached)
        if not lost.size:
            return found, reached
        ways = _ways_round(self.robot, q_home[0], q[lost])
        if not len(ways):
            return found, reached
        rows = np.tile(lost, len(ways))
        ends, there, _ = self.follow(home.take(np.zeros(len(rows), dtype=int)), np.concatenate(ways), placed.take(rows))
        first = np.unique(rows[there], return_index=True)[1]
        found.put(rows[there][first], ends.take(np.flatnonzero(there)[first]))
        reached[rows[there]] = True
        return found, reached

    def _moved(
        self, q: Floats, X: Floats, commands: Floats, placed: PlacedParts, twists: Mapping[int, Floats]
    ) -> tuple[Here, Mask, PlacedParts]:
        """Postures with displaced frames at other commands; near those X (N, nq) at q."""
        loops, robot, goal = self.loops, self.robot, self.travel(commands)
        moved = twisted(robot, placed, twists)
        closing = loops.newton(loops.at(self.robot.with_commands(X, goal), moved), moved)
        here, reached = closing.here, closing.closed
        rows = np.flatnonzero(~reached & np.isfinite(X).all(axis=1))
        if loops.count and rows.size:
            start, begin = self.travel(q[rows]), loops.at(X[rows], placed.take(rows))

            def path(s: Floats, some: Ints) -> tuple[Floats, PlacedParts]:
                at, w = rows[some], s[:, None]
                part = twisted(robot, placed.take(at), {f: w * twist[at] for f, twist in twists.items()})
                return start[some] + w * (goal[at] - start[some]), part

            again, found, _ = loops.follow(begin, path, self._largest)
            here.put(rows, again)
            reached[rows] = found
        return here, reached, moved

    def _unknown(self, n: int) -> tuple[Poses, Floats]:
        """N poses, and their (N, nq) configurations, which are those of the poses if there are loops; all NaN."""
        X, links = np.full((n, self.robot.model.nq), np.nan), self.robot.measured_links
        found = Poses.unknown(n, (joint.name for joint in self.robot.measured_joints))
        turns = {link.name: np.full((n, 3, 3), np.nan) for link in links}
        return replace(found, configuration=X if self.loops.count else None, links=turns), X

    def _write(self, here: Here, placed: PlacedParts, reached: Mask, rows: Ints, poses: Poses) -> None:
        """Write the postures that were reached, of some rows, into poses of all."""
        X, oMi = here.X[reached], here.oMi
        R, T = times(oMi[reached, self.robot.tcp_joint], placed.take(reached).tcp)
        joints = {joint.name: joint.coordinates(X) for joint in self.robot.measured_joints}
        links = {own.name: rotation(oMi[reached, own.joint_id]) @ own.rotation for own in self.robot.measured_links}
        poses.put(rows[reached], Poses(T, R, joints, X, links))

    def _configurations(self, q: Floats, poses: Poses) -> Floats:
        """(N, nq) configurations of poses at commands q."""
        if not self.loops.count:
            return self._of_tree(self.travel(q))
        X = poses.configuration if poses.configuration is not None else self.forward(q).configuration
        assert X is not None
        return X

    def _of_tree(self, travel: Floats) -> Floats:
        return self.robot.with_commands(np.tile(self.robot.neutral, (len(travel), 1)), travel)

    def _guess(self, halved: int) -> FirstGuess | None:
        """The first guess of a robot as its file describes it, for its ranges halved so often; None where it is of no use.

        Over a small part of the ranges the polynomials are so near that one or two Newton steps are enough.
        """
        known: dict[int, FirstGuess | None] = self.robot.memo.setdefault("guesses", {})
        if halved not in known:
            known[halved] = self._fitted(halved)
        return known[halved]

    def _fitted(self, halved: int) -> FirstGuess | None:
        found = nodes(self.robot, halved) if self.loops.square else None
        if found is None or (X := self.forward(found[-1]).configuration) is None:
            return None
        regularity = self._regularity(self.loops.at(X, self.placed).equations.D)
        guess = FirstGuess.fit(self.robot, found, self.at_home.X[0], X, regularity)
        if guess is None:
            return None
        here, s = self._guessed(found[-1], self.placed, guess)
        reached = s == 1.0
        right = np.abs(here.X[reached] - X[reached]).max(axis=1, initial=0.0) <= SAME
        return guess if right.all() and np.mean(reached) >= USABLE else None


def nominal(robot: Chain) -> Kinematics:
    """The kinematics of a robot as its file describes it; they keep what does not depend on a geometry."""
    known: Kinematics | None = robot.memo.get("kinematics")
    if known is None:
        known = robot.memo["kinematics"] = Kinematics(Geometry(robot, (), np.zeros(0)))
    return known


def reached_poses(kinematics: Kinematics, q: Floats) -> Poses:
    """Poses (N), base frame, at commands q (N, n).

    Raises `ModelError` if there are no commands, or they do not have that shape. `UnreachableError` if one can't be
    reached; the message names its row, counted from 0.
    """
    poses = kinematics.forward(q)
    if not len(poses):
        raise ModelError("no commands", hint="give at least one")
    lost = np.flatnonzero(~poses.reached)
    if lost.size:
        name = kinematics.geometry.robot.name
        raise UnreachableError(f"{name} can't reach the commands in row {lost[0]}", hint="leave them out")
    return poses


def _open_at_home(robot: Chain) -> UnreachableError:
    """The error of loops that can't be closed at home."""
    described, gap = robot.description, robot.assembly.gap
    what = f"the loops of {robot.name} don't close at its home"
    if described.home is None or gap <= NEAR:
        what += f": {gap:.3g} m is the smallest gap found between their anchors (up to {tolerance(robot):.2g} m is rounding)"
    hint = "mend the joints or the loops' anchors"
    if described.home is not None:
        hint = "mend <home> or the loops' anchors"
    elif described.kind == "mjcf":
        hint = "mend the joints, the places of its equality constraints, or its keyframe"
    return UnreachableError(what, hint=hint)


def _check_declared_home(robot: Chain, here: Here) -> None:
    """Raise `AssemblyModeError` if the posture at home is far from the home that the robot's file gives."""
    declared = robot.description.home
    if declared is None:
        return
    carrier = here.oMi[0, robot.home_joint]
    there = pin.SE3(rotation(carrier), carrier[9:]) * robot.home_placement
    off = float(np.linalg.norm(there.translation - np.array(declared.tcp_xyz)))
    turned = float(np.linalg.norm(pin.log3(there.rotation @ pin.exp3(np.array(declared.tcp_rotvec)).T)))
    if off > HOME_OFF or turned > HOME_TURNED:
        far = f"{off:.3g} m" if off > HOME_OFF else f"{turned:.3g} rad"
        what = f"the loops of {robot.name} close {far} from the home that its URDF tells"
        raise AssemblyModeError(what, hint="mend <home>")


def _ways_round(robot: Chain, home_q: Floats, q: Floats) -> list[Floats]:
    """Other ways from home to commands (N, n) than the straight line: corners (N, n + 2, n) of polylines.

    The same angle within half a turn of home, for actuators without limits; then the actuators one after the other, in their
    order and in the reverse order.
    """
    turns, count = 2.0 * np.pi, robot.n_actuators
    near = np.where(robot.endless, q - turns * np.round((q - home_q) / turns), q)
    orders = [np.zeros(count, dtype=int)] if (near != q).any() else []
    if count > 1:
        orders += [np.arange(count), np.arange(count)[::-1]]
    moved = [[order < stop for stop in range(count + 1)] + [np.ones(count, dtype=bool)] for order in orders]
    return [np.stack([np.where(there, near, home_q) for there in way], axis=1) for way in moved]


def _chunks(rows: Ints, size: int = CHUNK) -> Iterator[Ints]:
    """The rows in parts that are closed at once; larger ones along paths, of which a few are much longer than the others."""
    for a in range(0, len(rows), size):
        yield rows[a : a + size]
