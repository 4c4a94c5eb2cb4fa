"""Closes the loops of a robot at many postures: closure equations, Newton's method, and continuation along a path.

With the velocities x of the passive joints, a Newton step solves D x = -r. A closure equation is a component d . g of the gap g
between the two anchors of a loop. Its derivative by a world twist of a frame is S F . twist, with F = (d, p x d) the unit
wrench along d at the second anchor p, and S = 1, -1 or 0 where the frame carries the second anchor, the first, or both or none.

Two passive joints that belong to one loop alone are eliminated: d is then the unit vector across the motions a, b of the anchor
by these two, and one equation is left of the loop's three. With n = a x b, the components of the gap along b x n / n^2 and
n x a / n^2 give the motions of these joints afterwards. Other loops have the three components in the first anchor's frame, and
a planar loop the two in its plane.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from gtpin.kinematics.copies import copies
from gtpin.kinematics.placed import PlacedParts
from gtpin.robot.chain import Chain
from gtpin.typing import Floats, Ints, Mask

MAX_STEPS = 12
ROUNDING = 16.0 * float(np.finfo(float).eps)
"""Closure error that counts as zero, relative to the size of the coordinates: coordinates of a few metres have rounding errors
of a few 1e-16 m each, and a loop is a sum of about ten of them."""
CONTRACTION = 0.25
"""Largest ratio of the second Newton step to the first at which the start counts as near enough (Deuflhard, Newton
Methods for Nonlinear Problems, 2011, ch. 5: the monotonicity test of path continuation)."""
TINY = 1e-8
"""Newton steps below the root of rounding errors no longer shrink; there only the closure error decides."""
CHANGE = 0.5
"""Largest relative change of D between two postures of a path; 1 could be at a singularity. Assumed."""
FARTHEST = 1.0
"""Largest motion of a joint in one step, m or rad: after a turn, D could be what it was. Assumed."""
AIM = 0.7
"""Part of these limits that a step aims at."""
MOST_GROWTH = 4.0
"""Largest growth of these, per length, from one step to the next, for which a step is shortened: towards a singularity they
grow at each step."""
SMALLEST_STRIDE = 1.0 / 4096.0
"""Smallest step as a fraction of the path; where a smaller one is needed, the target is given up. A line of 1 rad
that passes a limit of a five-bar of 1 m at a distance of 1 um needs no smaller ones."""
NEARLY_THERE = 8.0
"""Number of steps to the end below which it is not given up, however small they are."""
SHORTEST_FIRST = 0.1
"""First step, as a fraction of a path, below which it is not followed again with a shorter one."""
SINGULAR = 1e3
"""Ratio of a posture's amplification to that of home, above which it counts as near a singularity. Assumed."""

YZX, ZXY = np.array([1, 2, 0]), np.array([2, 0, 1])

Path = Callable[[Floats, Ints], tuple[Floats, PlacedParts]]
"""Commands (m, n) and places of the parts at fractions (m,) of the way, of the postures with the indices (m,)."""


def cross(a: Floats, b: Floats) -> Floats:
    """Cross products (..., 3, n) of vectors (..., 3, n): postures last. Twice as fast as NumPy's own."""
    found: Floats = a.take(YZX, -2) * b.take(ZXY, -2)
    found -= a.take(ZXY, -2) * b.take(YZX, -2)
    return found


class Rows:
    """Arrays of N postures, with what was computed from them: one row for each, of the arrays `LAST` in their last index."""

    def take(self, rows: Ints | Mask) -> Self:
        """Some of the postures."""
        taken = copy(self)
        for name, x in list(vars(self).items()):
            if isinstance(x, Rows):
                vars(taken)[name] = x.take(rows)
            elif isinstance(x, np.ndarray):
                vars(taken)[name] = x[..., rows] if name in LAST else x[rows]
        return taken

    def put(self, rows: Ints, some: Rows) -> None:
        """Write some postures into these arrays; what was not computed of them is no longer known of these."""
        for name, x in list(vars(self).items()):
            new = vars(some).get(name)
            if new is None:
                del vars(self)[name]
            elif isinstance(x, Rows):
                x.put(rows, new)
            elif isinstance(x, np.ndarray):
                x[(..., rows) if name in LAST else rows] = new


LAST = ("p", "g", "d", "alone")
"""Names of the arrays with the postures in their last index."""


@dataclass(frozen=True)
class Here(Rows):
    """N postures: configurations X (N, nq), world twists J (N, nv, 6) of the velocities, placements oMi (N, J + 1, 12) of the
    joints, second anchors p (L, 3, N), and gaps g (L, 3, N) from the first anchors to them, m."""

    loops: LoopClosure
    X: Floats
    J: Floats
    oMi: Floats  # noqa: N815 (Pinocchio's name)
    p: Floats
    g: Floats

    def __len__(self) -> int:
        return len(self.X)

    @cached_property
    def equations(self) -> Equations:
        """The closure equations."""
        return self.loops.equations(self)

    @cached_property
    def inverse(self) -> Floats:
        """(N, e, E) inverses of the equations' D; see :meth:`LoopClosure.inverse`."""
        return self.loops.inverse(self.equations.D)


@dataclass(frozen=True)
class Equations(Rows):
    """The E closure equations at N postures: directions d (E, 3, N), wrenches F (N, E, 6) along these, derivative D (N, E, e)
    by the solved velocities, and components r (N, E) of the gaps, m.

    ``alone``: (L, 2, 3, N) directions of the gap that one eliminated velocity alone closes, per unit of this velocity.
    """

    d: Floats
    F: Floats
    D: Floats
    r: Floats
    alone: Floats


@dataclass(frozen=True)
class Closed:
    """Result of Newton's method for N starts: the last iterates, (N,) whether their loops are closed and all steps contracted,
    (N,) the number of steps, and D (N, E, e) where the last one began."""

    here: Here
    closed: Mask
    steps: Ints
    D: Floats


class LoopClosure:
    """The closure equations of a robot. E of them determine e velocities, the *solved* ones; a loop with private joints has two
    passive velocities more, which follow from the solved ones.

    ``signs``: (L, J + 1) the S of each joint's frame for each loop. ``moves_tcp``: (J + 1,) whether a joint moves the TCP.
    ``kept``: the velocities but the private ones. ``solved_q``: coordinates of the joints with solved velocities.
    ``lead``: (L, 2) the S of the private velocities. ``loop_of``: (E,) the loop of each equation. ``square``: whether E = e,
    and the loops determine all motions.
    """

    def __init__(self, robot: Chain) -> None:
        model = robot.model
        self.robot, self.count = robot, len(robot.constraints)
        self.size = robot.size
        up = [set(model.supports[j]) for j in range(model.njoints)]
        self.carriers = np.array([joint for joint, _ in robot.anchors], dtype=int)
        pairs = self.carriers.reshape(-1, 2)
        frames = range(model.njoints)
        self.signs = np.array([[float(j in up[b]) - (j in up[a]) for j in frames] for a, b in pairs])
        self.signs = self.signs.reshape(self.count, model.njoints)
        self.moves_tcp = np.array([j in up[robot.tcp_joint] for j in frames])
        self.joint_of = np.repeat(np.arange(model.njoints), model.nvs)
        self.S, self.tcp = self.signs[:, self.joint_of], self.moves_tcp[self.joint_of].astype(float)
        self.parents = [int(parent) for parent in model.parents]
        self.driven = np.array(robot.driven, dtype=int)
        self.fold, self.follows = robot.fold, bool(robot.followers)
        self.private = self._private()
        self.reduced = len(self.private) > 0
        self.solved = np.setdiff1d(robot.passive, self.private)
        self.kept = np.setdiff1d(np.arange(model.nv), self.private)
        own = [int(joint) for joint in np.unique(self.joint_of[self.solved])]
        self.solved_q = np.concatenate([np.zeros(0, int), *(model.idx_qs[j] + np.arange(model.nqs[j]) for j in own)])
        self.rank = robot.rank - self.private.size
        equations = [1 if self.reduced else len(axes) for axes in robot.closed_axes]
        self.loop_of = np.repeat(np.arange(self.count), np.array(equations, dtype=int))
        self.square = len(self.loop_of) == len(self.solved) == self.rank
        self._rows = self.S[self.loop_of]
        self.lead = self.S[np.arange(len(self.private))[:, None], self.private]
        turned = (axes @ M.rotation.T for axes, (_, M) in zip(robot.closed_axes, robot.anchors[::2], strict=True))
        self._local = np.vstack([np.zeros((0, 3)), *turned])
        """(E, 3) direction of each equation, unless reduced, in the frame of the joint that carries the first anchor."""
        self._in_plane = any(map(len, robot.planes))

    def _private(self) -> Ints:
        """(L, 2) the two passive velocities of each loop that move nothing else; (0, 2) unless all loops have two."""
        none, measured = np.zeros((0, 2), dtype=int), (*self.robot.measured_joints, *self.robot.measured_links)
        if not self.count or self.follows or self.robot.rank < self.robot.n_passive or measured:
            return none
        passive = self.robot.passive
        used = self.S[:, passive] != 0.0
        alone = (used.sum(axis=0) == 1) & (self.tcp[passive] == 0.0)
        own = [passive[used[loop] & alone] for loop in range(self.count)]
        if any(map(len, self.robot.planes)) or any(len(two) != 2 for two in own):
            return none
        return np.array(own)

    # ------------------------------------------------------------------------------------------- one posture each

    def at(self, X: Floats, placed: PlacedParts) -> Here:
        """Placements, twists and gaps at configurations X (N, nq)."""
        oMi, J = copies(self.robot).joints(X, placed.placements)
        M = np.ascontiguousarray(oMi[:, self.carriers].transpose(1, 2, 0))
        at = placed.anchors[..., None] if placed.anchors.ndim == 2 else placed.anchors.transpose(1, 2, 0)
        point = M[:, 9:].copy()
        for i in range(3):
            point += M[:, 3 * i : 3 * i + 3] * at[:, i, None]
        return Here(self, X, J, oMi, point[1::2], point[1::2] - point[::2])

    def equations(self, here: Here) -> Equations:
        """The equations at postures: ``here.equations`` keeps them."""
        alone = np.zeros((0, 2, 3, len(here)))
        if self.reduced:
            C = np.ascontiguousarray(here.J[:, self.private].transpose(1, 2, 3, 0))
            private = cross(C[:, :, 3:], here.p[:, None]) + C[:, :, :3]
            one, two = private[:, 0], private[:, 1]
            normal = cross(one, two)
            square = (normal * normal).sum(axis=1, keepdims=True)
            d = normal / np.sqrt(square)
            normal /= square
            alone = np.empty_like(private)
            alone[:, 0], alone[:, 1] = cross(two, normal), cross(normal, one)
        else:
            R = here.oMi[:, self.carriers[::2], :9].transpose(1, 2, 0)[self.loop_of]
            local = self._local[:, :, None, None]
            d = R[:, :3] * local[:, 0] + R[:, 3:6] * local[:, 1] + R[:, 6:] * local[:, 2]
        F = np.empty((len(here), len(d), 6))
        F[..., :3] = d.transpose(2, 0, 1)
        F[..., 3:] = cross(here.p[self.loop_of], d).transpose(2, 0, 1)
        r = (d * here.g[self.loop_of]).sum(axis=1).T
        return Equations(d, F, self.by_velocities(here, F, self.solved), r, alone)

    def gap(self, here: Here) -> Floats:
        """(N,) largest component of what is open, m; of planar loops in their planes."""
        if self._in_plane:
            return np.asarray(np.abs(here.equations.r).max(axis=1, initial=0.0))
        return np.asarray(np.abs(here.g).max(axis=(0, 1), initial=0.0))

    def by_velocities(self, here: Here, F: Floats, columns: Ints) -> Floats:
        """(N, E, c) derivative of the equations by some velocities; those of masters move their followers."""
        if self.follows:
            return np.asarray((self._rows * (F @ here.J.transpose(0, 2, 1))) @ self.fold[:, columns])
        return np.asarray(self._rows[:, columns] * (F @ here.J[:, columns].transpose(0, 2, 1)))

    def inverse(self, D: Floats) -> Floats:
        """(N, e, E) inverses of D, or pseudoinverses of its rank; NaN where there is none."""
        n, equations, unknowns = D.shape
        if not D.size:
            return np.zeros((n, unknowns, equations))
        if self.square:
            try:
                return np.asarray(np.linalg.inv(D))
            except np.linalg.LinAlgError:  # numpy inverts none of them if one is singular
                pass
        found = np.full((n, unknowns, equations), np.nan)
        sound = np.isfinite(D).all(axis=(1, 2))
        left, sizes, rows = np.linalg.svd(D[sound], full_matrices=False)
        with np.errstate(divide="ignore", invalid="ignore"):
            scaled = np.swapaxes(rows[:, : self.rank], 1, 2) / sizes[:, None, : self.rank]
            found[sound] = scaled @ np.swapaxes(left[:, :, : self.rank], 1, 2)
        return found

    def step(self, here: Here, dq: Floats | None = None) -> Floats:
        """(N, nv) velocities that close the loops to first order, while the commands move by dq (N, n); None: not at all."""
        equations = here.equations
        V, r = np.zeros((len(here), self.robot.model.nv)), equations.r
        if dq is not None:
            V[:, self.driven] = dq
            r = r + (self.by_velocities(here, equations.F, self.driven) @ dq[..., None])[..., 0]
        V[:, self.solved] = solved = self._solve(here, -r)
        if self.reduced:
            columns, moved = (self.solved, solved) if dq is None else (self.kept, V[:, self.kept])
            left = (equations.alone * self._opened(here, moved, columns)[:, None]).sum(axis=2)
            V[:, self.private] = -self.lead * left.transpose(2, 0, 1)
        return V @ self.fold.T if self.follows else V

    def _opened(self, here: Here, v: Floats, columns: Ints) -> Floats:
        """(L, 3, N) gaps after some velocities v (N, c), to first order; those of masters move their followers."""
        if self.follows:
            columns, v = np.arange(len(self.fold)), v @ self.fold[:, columns].T
        moved = ((self.S[:, columns] * v[:, None]) @ here.J[:, columns]).transpose(1, 2, 0)
        return np.asarray(here.g + moved[:, :3] + cross(moved[:, 3:], here.p))

    def _solve(self, here: Here, right: Floats) -> Floats:
        if self.square and "inverse" not in vars(here):
            try:
                return np.asarray(np.linalg.solve(here.equations.D, right[..., None])[..., 0])
            except np.linalg.LinAlgError:
                pass
        return np.asarray((here.inverse @ right[..., None])[..., 0])

    # ------------------------------------------------------------------------------------------- closing

    def newton(self, here: Here, placed: PlacedParts, contraction: float = CONTRACTION) -> Closed:
        """Close the loops by Newton's method on the passive velocities, at constant commands.

        ``here``: (N) postures to start from, which stay as they are.
        """
        n = len(here)
        closed, lost, steps, last = np.zeros(n, bool), np.zeros(n, bool), np.zeros(n, int), np.full(n, np.inf)
        whole, rows, D = here, np.arange(n), here.equations.D.copy()
        for number in range(MAX_STEPS + 1):
            shut = ~lost & (self.gap(here) <= ROUNDING * self.size)
            closed[rows[shut]] = True
            done = shut | lost
            if done.all() or number == MAX_STEPS:
                break
            if number and 2 * done.sum() > len(done):  # fewer copies than at each row that is done
                if len(rows) < n:
                    whole.put(rows, here)
                left = np.flatnonzero(~done)
                rows, last, lost, done, here = rows[left], last[left], lost[left], done[left], here.take(left)
            D[rows] = here.equations.D
            V = self.step(here)
            size = np.sqrt(np.einsum("ni,ni->n", V, V))
            lost |= ~done & ~((size <= TINY) | (size <= contraction * last))
            V[done | lost] = 0.0
            last = size
            steps[rows[~(done | lost)]] += 1
            here = self.at(copies(self.robot).integrate(here.X, V), placed.take(rows) if len(rows) < n else placed)
            if len(rows) == n:
                whole = here
        if len(rows) < n:
            whole.put(rows, here)
        return Closed(whole, closed, steps, D)

    def determinant(self, D: Floats) -> Floats:
        """(N,) determinants of D (N, E, e); 1 where it is not ``square``."""
        if not self.square:
            return np.ones(len(D))
        with np.errstate(invalid="ignore"):  # of postures that are NaN
            return np.asarray(np.linalg.det(D))

    def amplification(self, D: Floats) -> Floats:
        """(N,) motion by unit closure errors: Frobenius norms of the inverses of D; infinite where it is singular."""
        return _norm(self.inverse(D))

    def follow(
        self, start: Here, path: Path, largest: float, first: float = 1.0, begin: Floats | None = None
    ) -> tuple[Here, Mask, Floats]:
        """Closed postures at the end of a path, in the assembly mode of its beginning.

        Each posture follows the path by tangents, each of which also corrects what the one before it left open; Newton's method
        closes the loops at the end. A step is so short that its correction is small in comparison with it, and that D changes
        little in comparison with its distance from a singularity. ``start``: (N) closed postures at the fractions ``begin`` of
        the path; None: at its beginning. ``largest``: amplification from which on a posture is too near a singularity.
        ``first``: length of the first step, as a fraction of the path; where Newton's method ends far from the tangents, the
        path is followed again with an eighth of it.

        Returns the last postures on the way, (N,) whether they are those of the end, and (N,) their fractions of the path.
        """
        n = len(start)
        begin = np.zeros(n) if begin is None else begin
        done, stride, error, rate = begin.copy(), np.full(n, first), np.zeros(n), np.full(n, np.inf)
        rows, here = np.arange(n), start
        ends, q = start.take(rows), path(done, rows)[0]
        while rows.size:
            reach = np.minimum(1.0, done[rows] + stride[rows])
            goal, placed = path(reach, rows)
            inverse, parts_move = here.inverse, placed.anchors.ndim == 3 or placed.placements.ndim == 3
            V = self.step(self.at(here.X, placed) if parts_move else here, goal - q)
            V[~np.isfinite(V).all(axis=1)] = 0.0
            there = self.at(self.robot.with_commands(copies(self.robot).integrate(here.X, V), goal), placed)
            near = _norm(there.inverse) <= largest
            change = _norm(inverse @ (there.equations.D - here.equations.D))
            left = _norm(self.step(there)[..., None])
            allowed = np.maximum(TINY, np.maximum(CONTRACTION * _norm(V[..., None]), CHANGE * error[rows]))
            excess = np.maximum(change / CHANGE, np.maximum(left / allowed, np.abs(V).max(axis=1) / FARTHEST))
            ok = (excess <= 1.0) & near
            excess = np.maximum(excess, 1e-3)
            now = excess / stride[rows]
            growth = np.clip(now / rate[rows], 1.0, MOST_GROWTH)
            gone, back = rows[ok], np.flatnonzero(~ok)
            done[gone], error[gone], rate[gone] = reach[ok], left[ok], now[ok]
            share, own = AIM / excess, stride[rows]
            least = np.minimum(SMALLEST_STRIDE, own * np.maximum(share, 0.5))  # growth alone gives no path up
            longer = np.maximum(own * np.minimum(share / growth, 4.0), least)
            stride[rows] = np.where(ok, longer, own * np.clip(share, 0.1, 0.5))
            if back.size:
                there.put(back, here.take(back))
                goal[back] = q[back]
            here, q = there, goal
            left_over = 1.0 - done[rows]
            on = (left_over > 0.0) & (stride[rows] >= np.minimum(SMALLEST_STRIDE, left_over / NEARLY_THERE))
            if len(on) == n and not on.any():
                ends, rows = here, rows[on]  # all at once, as one posture: their equations are known
            elif not on.all():
                ends.put(rows[~on], here.take(~on))
                rows, here, q = rows[on], here.take(on), q[on]
        rows = np.flatnonzero(done == 1.0)
        here = (here if len(here) == n else ends).take(rows)
        closing = self.newton(here, path(done[rows], rows)[1])
        change = _norm(here.inverse @ (closing.D - here.equations.D))
        reached = np.zeros(n, dtype=bool)
        reached[rows] = closing.closed & (change <= CHANGE) & (self.amplification(closing.D) <= largest)
        ends.put(rows[reached[rows]], closing.here.take(reached[rows]))
        again = rows[~reached[rows]]
        if again.size and first > SHORTEST_FIRST:
            others, reached[again], done[again] = self.follow(
                start.take(again), lambda s, some: path(s, again[some]), largest, first / 8.0, begin[again]
            )
            ends.put(again, others)
        return ends, reached, done


def _norm(matrices: Floats) -> Floats:
    """(N,) Frobenius norms; infinite where they are not finite."""
    found = np.sqrt(np.einsum("nij,nij->n", matrices, matrices))
    return np.where(np.isfinite(found), found, np.inf)
