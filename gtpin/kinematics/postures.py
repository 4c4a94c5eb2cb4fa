"""Many postures at once: configurations with what Pinocchio computes there, and the closure equations at them."""

from __future__ import annotations

from dataclasses import dataclass

from gtpin.typing import Floats, Ints, Mask


@dataclass(frozen=True)
class Here:
    """N postures: configurations X (N, nq), world twists J (N, nv, 6) of the velocities, placements oMi (N, J + 1, 12) of the
    joints, second anchors p (L, 3, N), and gaps g (L, 3, N) from the first anchors to them, m."""

    X: Floats
    J: Floats
    oMi: Floats  # noqa: N815 (Pinocchio's name)
    p: Floats
    g: Floats

    def __len__(self) -> int:
        return len(self.X)

    def take(self, rows: Ints | Mask) -> Here:
        """Some of the postures."""
        return Here(self.X[rows], self.J[rows], self.oMi[rows], self.p[..., rows], self.g[..., rows])

    def copy(self) -> Here:
        """The same in arrays of its own."""
        return Here(*(x.copy() for x in (self.X, self.J, self.oMi, self.p, self.g)))

    def put(self, rows: Ints, some: Here) -> None:
        """Write some postures into these arrays."""
        self.X[rows], self.J[rows], self.oMi[rows] = some.X, some.J, some.oMi
        self.p[..., rows], self.g[..., rows] = some.p, some.g


@dataclass(frozen=True)
class Equations:
    """The closure equations at N postures, E of the solved velocities and then those of the eliminated ones, in all M.

    Their directions (M, 3, N), wrenches (N, M, 6) along these, derivative ``rates`` (N, M, e) by the solved velocities, and
    components ``open`` (N, M) of the gaps; ``private``: (L, 2, 3, N) the motions of the anchors by eliminated velocities.
    """

    count: int
    directions: Floats
    wrenches: Floats
    rates: Floats
    open: Floats
    private: Floats

    @property
    def d(self) -> Floats:
        """(E, 3, N) directions of the first E."""
        return self.directions[: self.count]

    @property
    def F(self) -> Floats:
        """(N, E, 6) their wrenches."""
        return self.wrenches[:, : self.count]

    @property
    def D(self) -> Floats:
        """(N, E, e) their derivative."""
        return self.rates[:, : self.count]

    @property
    def r(self) -> Floats:
        """(N, E) their components of the gaps, m."""
        return self.open[:, : self.count]

    def take(self, rows: Ints | Mask) -> Equations:
        """Those of some of the postures."""
        d, private = self.directions[..., rows], self.private[..., rows]
        return Equations(self.count, d, self.wrenches[rows], self.rates[rows], self.open[rows], private)

    def put(self, rows: Ints, some: Equations) -> None:
        """Write those of some postures into these arrays."""
        self.wrenches[rows], self.rates[rows], self.open[rows] = some.wrenches, some.rates, some.open
        self.directions[..., rows], self.private[..., rows] = some.directions, some.private


@dataclass(frozen=True)
class Closed:
    """Result of Newton's method for N starts: the last iterates, (N,) whether their loops are closed and all steps contracted,
    (N,) the number of steps, and D (N, E, e) where the last one began."""

    here: Here
    closed: Mask
    steps: Ints
    D: Floats
