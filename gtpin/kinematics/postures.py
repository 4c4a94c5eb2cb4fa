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
        for name in ("X", "J", "oMi"):
            getattr(self, name)[rows] = getattr(some, name)
        self.p[..., rows], self.g[..., rows] = some.p, some.g


@dataclass(frozen=True)
class Equations:
    """The closure equations at N postures: directions d (E, 3, N), unit wrenches F (N, E, 6), their derivative D (N, E, e) by
    the solved velocities, residuals r (N, E), m; and (L, 2, 3, N) the motions of the anchors by eliminated velocities."""

    d: Floats
    F: Floats
    D: Floats
    r: Floats
    private: Floats

    def take(self, rows: Ints | Mask) -> Equations:
        """Those of some of the postures."""
        return Equations(self.d[..., rows], self.F[rows], self.D[rows], self.r[rows], self.private[..., rows])

    def put(self, rows: Ints, some: Equations) -> None:
        """Write those of some postures into these arrays."""
        self.F[rows], self.D[rows], self.r[rows] = some.F, some.D, some.r
        self.d[..., rows], self.private[..., rows] = some.d, some.private


@dataclass(frozen=True)
class Closed:
    """Result of Newton's method for N starts: the last iterates, (N,) whether their loops are closed and all steps contracted,
    (N,) the number of steps, and D (N, E, e) at the start; None where all starts were closed."""

    here: Here
    closed: Mask
    steps: Ints
    first: Floats | None
