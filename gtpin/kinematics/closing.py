"""Closes the loops of a robot at many postures: closure equations, Newton's method, and continuation along a path.

With the velocities x of the passive joints, a Newton step solves D x = -r. A closure equation is a component d . g of the gap g
between the two anchors of a loop. Its derivative by a world twist of a frame is S F . twist, with F = (d, p x d) the unit
wrench along d at the second anchor p, and S = 1, -1 or 0 where the frame carries the second anchor, the first, or both or none.

Two passive joints that belong to one loop alone are eliminated: d is then the unit vector across the motions of the anchor by
these two, and one equation is left of the loop's three. Other loops have the three components in the first anchor's frame, and
a planar loop the two in its plane.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from gtpin.kinematics.copies import copies
from gtpin.kinematics.placed import PlacedParts
from gtpin.kinematics.postures import Closed, Equations, Here
from gtpin.robot.chain import Chain
from gtpin.typing import Floats, Ints, Mask

MAX_STEPS = 12
ROUNDING = 16.0 * float(np.finfo(float).eps)
"""Closure error that counts as zero, relative to the size of the coordinates: coordinates of a few metres have rounding errors
of a few 1e-16 m each, and a loop is a sum of about ten of them."""
ON_THE_WAY = 1e-7
"""Such a closure error at postures between the ends of a path, which only show the way. Assumed."""
CONTRACTION = 0.25
"""Largest ratio of the second Newton step to the first at which the start counts as near enough (Deuflhard, Newton
Methods for Nonlinear Problems, 2011, ch. 5: the monotonicity test of path continuation)."""
TINY = 1e-8
"""Newton steps below the root of rounding errors no longer shrink; there only the closure error decides."""
CHANGE = 0.5
"""Largest relative change of D between two postures of a path; 1 could be at a singularity. Assumed."""
AIM = 0.7 * CHANGE
"""Change of D that a step aims at."""
SMALLEST_STRIDE = 1.0 / 4096.0
"""Smallest step as a fraction of the path; where a smaller one is needed, the target is given up. A line of 1 rad
that passes a limit of a five-bar of 1 m at a distance of 1 um needs no smaller ones."""
SINGULAR = 1e3
"""Ratio of a posture's amplification to that of home, above which it counts as near a singularity. Assumed."""

TRIES, LARGEST, NEARLY = 30, 0.5, 1e-3
"""Number of Newton steps, the largest motion of a joint in one, m or rad, and the gap, relative to the size of the coordinates,
that tell whether loops can be closed at all. Assumed."""

Path = Callable[[Floats, Ints], tuple[Floats, PlacedParts]]
"""Commands (m, n) and places of the parts at fractions (m,) of the way, of the postures with the indices (m,)."""


def cross(a: Floats, b: Floats) -> Floats:
    """Cross products (..., 3, n) of vectors (..., 3, n): postures last. NumPy's own makes several passes over the array."""
    out = np.empty(a.shape if a.shape == b.shape else np.broadcast_shapes(a.shape, b.shape))
    ax, ay, az = a[..., 0, :], a[..., 1, :], a[..., 2, :]
    bx, by, bz = b[..., 0, :], b[..., 1, :], b[..., 2, :]
    np.subtract(ay * bz, az * by, out=out[..., 0, :])
    np.subtract(az * bx, ax * bz, out=out[..., 1, :])
    np.subtract(ax * by, ay * bx, out=out[..., 2, :])
    return out


class LoopClosure:
    """The closure equations of a robot. E of them determine e velocities, the *solved* ones; a loop with private joints has two
    passive velocities more, which follow from the solved ones.

    ``signs``: (L, J + 1) the S of each joint's frame for each loop. ``moves_tcp``: (J + 1,) whether a joint moves the TCP.
    ``loop_of``: (E,) the loop of each equation.
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
        self.passive = np.arange(model.nv)[robot.passive]
        self.fold = np.eye(model.nv)
        for follower in robot.followers:
            self.fold[follower.index_v, follower.master_v] = follower.multiplier
        self.follows = bool(robot.followers)
        self.private = self._private()
        self.reduced = len(self.private) > 0
        self.solved = np.setdiff1d(self.passive, self.private)
        self.rank = robot.rank - self.private.size
        local = np.zeros((0, 3))
        if not self.reduced and self.count:
            parts = [np.eye(3) if axes is None else axes for axes in robot.plane_axes]
            local = np.concatenate(parts)
            self.loop_of = np.repeat(np.arange(self.count), [len(part) for part in parts])
            turned = np.array([np.asarray(M.rotation) for _, M in robot.anchors[::2]])
            local = np.einsum("eij,ej->ei", turned[self.loop_of], local)
        else:
            self.loop_of = np.arange(self.count)
        self._local = local
        """(E, 3) direction of each equation in the frame of the joint that carries the loop's first anchor."""
        self._in_plane = any(axes is not None for axes in robot.plane_axes)

    def _private(self) -> Ints:
        """(L, 2) the two passive velocities of each loop that move nothing else; (0, 2) unless all loops have two."""
        none, measured = np.zeros((0, 2), dtype=int), self.robot.measured_joints
        if not self.count or self.follows or self.robot.rank < self.robot.n_passive or measured:
            return none
        used = self.S[:, self.passive] != 0.0
        alone = (used.sum(axis=0) == 1) & (self.tcp[self.passive] == 0.0)
        own = [self.passive[used[loop] & alone] for loop in range(self.count)]
        if any(axes is not None for axes in self.robot.plane_axes) or any(len(two) != 2 for two in own):
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
        return Here(X, J, oMi, point[1::2], point[1::2] - point[::2])

    def equations(self, here: Here) -> Equations:
        """The equations at postures."""
        private = np.zeros((0, 2, 3, len(here)))
        if self.reduced:
            C = np.ascontiguousarray(here.J[:, self.private].transpose(1, 2, 3, 0))
            private = cross(C[:, :, 3:], here.p[:, None]) + C[:, :, :3]
            normal = cross(private[:, 0], private[:, 1])
            d = normal / np.sqrt((normal * normal).sum(axis=1, keepdims=True))
        else:
            R = here.oMi[:, self.carriers[::2], :9].transpose(1, 2, 0)[self.loop_of]
            local = self._local[:, :, None, None]
            d = R[:, :3] * local[:, 0] + R[:, 3:6] * local[:, 1] + R[:, 6:] * local[:, 2]
        F = np.empty((len(here), len(d), 6))
        F[..., :3] = d.transpose(2, 0, 1)
        F[..., 3:] = cross(here.p[self.loop_of], d).transpose(2, 0, 1)
        r = (d * here.g[self.loop_of]).sum(axis=1).T
        return Equations(d, F, self.by_velocities(here, F, self.solved), np.asarray(r), private)

    def gap(self, here: Here, equations: Equations | None = None) -> Floats:
        """(N,) largest component of what is open, m; of planar loops in their planes."""
        if self._in_plane:
            r = (self.equations(here) if equations is None else equations).r
            return np.asarray(np.abs(r).max(axis=1, initial=0.0))
        return np.asarray(np.abs(here.g).max(axis=(0, 1), initial=0.0))

    def by_velocities(self, here: Here, F: Floats, columns: Ints) -> Floats:
        """(N, E, c) derivative of the equations by some velocities; those of masters move their followers."""
        if self.follows:
            whole = self.S[self.loop_of] * (F @ here.J.transpose(0, 2, 1))
            return np.asarray(whole @ self.fold[:, columns])
        return np.asarray(self.S[np.ix_(self.loop_of, columns)] * (F @ here.J[:, columns].transpose(0, 2, 1)))

    def inverse(self, D: Floats) -> Floats:
        """(N, e, E) inverses of D, or pseudoinverses of its rank; NaN where there is none."""
        n, equations, unknowns = D.shape
        if not D.size:
            return np.zeros((n, unknowns, equations))
        if equations == unknowns == self.rank:
            try:
                return np.asarray(np.linalg.inv(D))
            except np.linalg.LinAlgError:  # numpy inverts none of them if one is singular
                return np.array([_inverted(one) for one in D])
        found = np.full((n, unknowns, equations), np.nan)
        sound = np.isfinite(D).all(axis=(1, 2))
        left, sizes, rows = np.linalg.svd(D[sound], full_matrices=False)
        with np.errstate(divide="ignore", invalid="ignore"):
            scaled = np.swapaxes(rows[:, : self.rank], 1, 2) / sizes[:, None, : self.rank]
            found[sound] = scaled @ np.swapaxes(left[:, :, : self.rank], 1, 2)
        return found

    def step(self, here: Here, equations: Equations, dq: Floats | None = None) -> Floats:
        """(N, nv) velocities that close the loops to first order, while the commands move by dq (N, n); None: not at all."""
        V, r = np.zeros((len(here), self.robot.model.nv)), equations.r
        if dq is not None:
            V[:, self.driven] = dq
            r = r + (self.by_velocities(here, equations.F, self.driven) @ dq[..., None])[..., 0]
        V[:, self.solved] = self._solve(equations.D, -r)
        if self.reduced:
            self._close_private(here, equations.private, V, self._alike if dq is not None else self._alike_solved)
        return V @ self.fold.T if self.follows else V

    def _solve(self, D: Floats, right: Floats) -> Floats:
        if D.shape[1] == D.shape[2] == self.rank:
            try:
                return np.asarray(np.linalg.solve(D, right[..., None])[..., 0])
            except np.linalg.LinAlgError:
                pass
        return np.asarray((self.inverse(D) @ right[..., None])[..., 0])

    @cached_property
    def _alike(self) -> list[tuple[Ints, Ints, Floats]]:
        """The velocities that move the loops alike: columns, loops, and signs (l, 1, 1)."""
        return self._in_groups(np.setdiff1d(np.arange(self.S.shape[1]), self.private))

    @cached_property
    def _alike_solved(self) -> list[tuple[Ints, Ints, Floats]]:
        """The solved ones of them."""
        return self._in_groups(self.solved)

    def _in_groups(self, some: Ints) -> list[tuple[Ints, Ints, Floats]]:
        found = []
        for sign in np.unique(self.S[:, some], axis=1).T:
            loops = np.flatnonzero(sign)
            if loops.size:
                columns = some[(self.S[:, some] == sign[:, None]).all(axis=0)]
                found.append((columns, loops, sign[loops, None, None]))
        return found

    def _close_private(self, here: Here, a: Floats, V: Floats, groups: list[tuple[Ints, Ints, Floats]]) -> None:
        """Write the private velocities that close what the other velocities V (N, nv) leave of the gaps."""
        w, normal = -here.g, cross(a[:, 0], a[:, 1])
        for columns, loops, sign in groups:
            t = np.ascontiguousarray((V[:, None, columns] @ here.J[:, columns])[:, 0].T)
            w[loops] -= sign * (t[:3] + cross(t[3:], here.p[loops]))
        own = self.S[np.arange(self.count), self.private[:, 0]][:, None]
        size = own / (normal * normal).sum(axis=1)
        V[:, self.private[:, 0]] = (size * (cross(w, a[:, 1]) * normal).sum(axis=1)).T
        V[:, self.private[:, 1]] = (size * (cross(a[:, 0], w) * normal).sum(axis=1)).T

    # ------------------------------------------------------------------------------------------- closing

    def commanded(self, X: Floats, q: Floats) -> Floats:
        """Configurations X (N, nq) with the actuators, and what follows them, at commands q (N, n)."""
        X, robot = X.copy(), self.robot
        for i, actuator in enumerate(robot.actuators):
            _put(X, actuator.index_q, q[:, i], robot.model.nqs[actuator.joint_id] == 2)
        for i, follower in robot.led:
            _put(X, follower.index_q, follower.multiplier * q[:, i] + follower.offset, follower.continuous)
        return X

    def newton(
        self, X: Floats, placed: PlacedParts, contraction: float = CONTRACTION, tolerance: Floats | float = ROUNDING
    ) -> Closed:
        """Close the loops by Newton's method on the passive velocities, at constant commands.

        ``tolerance``: closure error that counts as zero, relative to the size of the coordinates; of all or (N,) of each.
        """
        n, error = len(X), np.broadcast_to(tolerance, len(X)) * self.size
        closed, steps, last = np.zeros(n, dtype=bool), np.zeros(n, dtype=int), np.full(n, np.inf)
        whole = here = self.at(X, placed)
        rows, first = np.arange(n), None
        for number in range(MAX_STEPS + 1):
            equations = self.equations(here) if self._in_plane else None
            done = self.gap(here, equations) <= error[rows]
            closed[rows[done]] = True
            if done.all() or number == MAX_STEPS:
                break
            if number and 2 * done.sum() > len(done):  # fewer copies than at each row that closes
                left = np.flatnonzero(~done)
                rows, last, done, here = rows[left], last[left], done[left], here.take(left)
                equations = None if equations is None else equations.take(left)
            equations = self.equations(here) if equations is None else equations
            first = equations.D if first is None else first
            V = self.step(here, equations)
            V[done] = 0.0
            size = np.sqrt(np.einsum("ni,ni->n", V, V))
            good = (size <= TINY) | (size <= contraction * last)
            if not good.all():
                rows, V, size, done, here = rows[good], V[good], size[good], done[good], here.take(good)
                if not rows.size:
                    break
            last = size
            steps[rows[~done]] += 1
            here = self.at(copies(self.robot).integrate(here.X, V), placed.take(rows) if len(rows) < n else placed)
            if len(rows) == n:
                whole = here
            else:
                whole = whole.copy() if whole.X is X else whole
                whole.put(rows, here)
        return Closed(whole, closed, steps, first)

    def can_close(self, X: Floats, placed: PlacedParts) -> Mask:
        """(N,) whether the loops nearly close at the commands of X (N, nq), in any assembly mode that Newton's method finds."""
        found = np.zeros(len(X), dtype=bool)
        for _ in range(TRIES):
            here = self.at(X, placed)
            equations = self.equations(here)
            found |= self.gap(here, equations) <= NEARLY * self.size
            if found.all():
                break
            V = self.step(here, equations)
            V[~np.isfinite(V).all(axis=1) | found] = 0.0
            V /= np.maximum(1.0, np.abs(V).max(axis=1, keepdims=True) / LARGEST)
            X = copies(self.robot).integrate(X, V)
        return found

    def side(self, D: Floats) -> Floats:
        """(N,) sign of the determinant of D (N, E, e); 1 where it is not square or the loops leave motions free."""
        if D.shape[1] != D.shape[2] or self.rank < D.shape[2]:
            return np.ones(len(D))
        with np.errstate(invalid="ignore"):  # of postures that are NaN
            return np.asarray(np.sign(np.linalg.det(D)))

    def amplification(self, inverse: Floats) -> Floats:
        """(N,) Frobenius norms of inverses of D: motion by unit closure errors; infinite where D is singular."""
        found = np.sqrt(np.einsum("nij,nij->n", inverse, inverse))
        return np.where(np.isfinite(found), found, np.inf)

    def follow(self, start: Here, path: Path, largest: float) -> tuple[Here, Mask, Floats]:
        """Closed postures at the end of a path, in the assembly mode of its beginning.

        Each posture follows the path in steps so short that Newton's method contracts, and that D changes little in comparison
        with its distance from a singularity. ``start``: (N) closed postures at the beginning. ``largest``: amplification from
        which on a posture is too near a singularity.

        Returns the last postures that were reached, (N,) whether they are those of the end, and (N,) their fractions of the
        path.
        """
        n = len(start)
        done, stride = np.zeros(n), np.ones(n)
        now, rows = start.copy(), np.arange(n)
        known = self.equations(now)
        inverse = self.inverse(known.D)
        q = path(done, rows)[0].copy()
        lost = np.zeros(n, dtype=bool)
        while rows.size:
            reach = np.minimum(1.0, done[rows] + stride[rows])
            goal, placed = path(reach, rows)
            whole = len(rows) == n
            here, its = (now, known) if whole else (now.take(rows), known.take(rows))
            V = self.step(here, its, goal - q[rows])
            V[~np.isfinite(V).all(axis=1)] = 0.0
            ahead = self.commanded(copies(self.robot).integrate(here.X, V), goal)
            closing = self.newton(ahead, placed, tolerance=np.where(reach < 1.0, ON_THE_WAY, ROUNDING))
            there = self.equations(closing.here)
            other = [there.D] if closing.first is None else [closing.first, there.D]
            change = np.max([_norm(inverse[rows] @ (D - its.D)) for D in other], axis=0)
            ok = closing.closed & (change <= CHANGE)
            inverses = self.inverse(there.D)
            ok &= self.amplification(inverses) <= largest
            share = AIM / np.maximum(np.where(np.isfinite(change), change, np.inf), 1e-3)
            gone = rows[ok]
            if whole and ok.all():
                now, known, inverse = closing.here, there, inverses
            else:
                now.put(gone, closing.here.take(ok))
                known.put(gone, there.take(ok))
                inverse[gone] = inverses[ok]
            q[gone], done[gone] = goal[ok], reach[ok]
            stride[rows] *= np.where(ok, np.clip(share, 0.5, 4.0), np.clip(share, 0.1, 0.5))
            lost |= stride < SMALLEST_STRIDE
            rows = np.flatnonzero((done < 1.0) & ~lost)
        return now, done == 1.0, done


def _norm(matrices: Floats) -> Floats:
    found = np.sqrt(np.einsum("nij,nij->n", matrices, matrices))
    return np.where(np.isfinite(found), found, np.inf)


def _inverted(matrix: Floats) -> Floats:
    try:
        return np.asarray(np.linalg.inv(matrix))
    except np.linalg.LinAlgError:
        return np.full(matrix.shape, np.nan)


def _put(X: Floats, index: int, values: Floats, continuous: bool) -> None:
    if continuous:
        X[:, index], X[:, index + 1] = np.cos(values), np.sin(values)
    else:
        X[:, index] = values
