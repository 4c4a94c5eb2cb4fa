"""What the tests read out of other software's models, and the closures solved by the tests' own Newton."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

Array = np.ndarray


@dataclass(frozen=True)
class Placed:
    """A frame: rotation and origin."""

    R: Array
    T: Array

    def __matmul__(self, other: Placed) -> Placed:
        return Placed(self.R @ other.R, self.T + self.R @ other.T)

    def at(self, point: Array) -> Array:
        return self.T + self.R @ point

    def inverse(self) -> Placed:
        return Placed(self.R.T, -self.R.T @ self.T)

    @staticmethod
    def of(numbers: str) -> Placed:
        """Six numbers of an SDF: x y z roll pitch yaw."""
        x = np.array([float(word) for word in numbers.split()])
        return Placed(Rotation.from_euler("xyz", x[3:]).as_matrix(), x[:3])


@dataclass(frozen=True)
class Moves:
    """A joint's axis through a point, at home, in the world."""

    kind: Literal["slide", "hinge"]
    axis: Array
    point: Array


@dataclass(frozen=True)
class GraphRod:
    """A rod at home, in the world: where it hangs on the platform, where it is seated, what moves either end."""

    hangs: Array
    seat: Array
    carrier: tuple[int, Moves] | None
    stretch: int | None


def solve(platform: Placed, rods: list[GraphRod], travel: Array) -> list[Placed]:
    """Where the platform is at each row of the drives' travels (N, n) from home, in small strides from home."""
    lengths = np.array([np.linalg.norm(rod.hangs - rod.seat) for rod in rods])
    own = np.array([platform.inverse().at(rod.hangs) for rod in rods])
    found = []
    for row in travel:
        now = platform
        for share in np.linspace(0.0, 1.0, 21)[1:]:
            seats = np.array([_seat(rod, share * row) for rod in rods])
            L = lengths + [0.0 if rod.stretch is None else share * row[rod.stretch] for rod in rods]
            now = _close(now, own, seats, L)
        found.append(now)
    return found


def _seat(rod: GraphRod, travel: Array) -> Array:
    if rod.carrier is None:
        return rod.seat
    drive, moves = rod.carrier
    if moves.kind == "slide":
        return rod.seat + travel[drive] * moves.axis
    return moves.point + Rotation.from_rotvec(travel[drive] * moves.axis).apply(rod.seat - moves.point)


def _close(now: Placed, own: Array, seats: Array, L: Array) -> Placed:
    for _ in range(20):
        lever = own @ now.R.T
        d = now.T + lever - seats
        gap = (d**2).sum(axis=1) - L**2
        step = np.linalg.solve(2.0 * np.hstack([d, np.cross(lever, d)]), -gap)
        now = Placed(Rotation.from_rotvec(step[3:]).as_matrix() @ now.R, now.T + step[:3])
        if np.abs(step).max() < 1e-13:
            return now
    raise AssertionError("the loops don't close")


def worst(found: list[Placed], T: Array, R: Array) -> tuple[float, float]:
    """Largest difference to poses T (N, 3), R (N, 3, 3): m and rad."""
    position = max(float(np.abs(f.T - t).max()) for f, t in zip(found, T, strict=True))
    turns = Rotation.from_matrix(np.array([f.R @ r.T for f, r in zip(found, R, strict=True)])).magnitude()
    return position, float(turns.max())
