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
    """The E closure equations at N postures: directions d (E, 3, N), wrenches F (N, E, 6) along these, derivative D (N, E, e)
    by the solved velocities, and components r (N, E) of the gaps, m.

    ``alone``: (L, 2, 3, N) directions of the gap that one eliminated velocity alone closes, per unit of this velocity.
    """

    d: Floats
    F: Floats
    D: Floats
    r: Floats
    alone: Floats

    def take(self, rows: Ints | Mask) -> Equations:
        """Those of some of the postures."""
        return Equations(self.d[..., rows], self.F[rows], self.D[rows], self.r[rows], self.alone[..., rows])

    def put(self, rows: Ints, some: Equations) -> None:
        """Write those of some postures into these arrays."""
        self.F[rows], self.D[rows], self.r[rows] = some.F, some.D, some.r
        self.d[..., rows], self.alone[..., rows] = some.d, some.alone


@dataclass(frozen=True)
class Closed:
    """Result of Newton's method for N starts: the last iterates, (N,) whether their loops are closed and all steps contracted,
    (N,) the number of steps, and D (N, E, e) where the last one began."""

    here: Here
    closed: Mask
    steps: Ints
    D: Floats
