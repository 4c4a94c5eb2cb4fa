"""The six-rod Gantry-Tau: an own closed-chain solve by Newton's method on the rods' lengths, and the rods' forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from motion import Array, Motion, Poses, rotations

CART = np.array([0, 1, 1, 2, 2, 2])
LINKS = ("link1", "link2a", "link2b", "link3a", "link3b", "link3c")
LENGTH = np.array([2.04422, 2.04291, 2.04294, 2.04351, 2.04352, 2.04352])
PLATFORM = np.array(
    [
        [-0.04871, -0.05363, -0.10361],
        [-0.05079, -0.11527, -0.08175],
        [-0.05864, 0.00230, 0.13871],
        [-0.18926, -0.09046, 0.04200],
        [-0.04625, -0.00142, -0.14303],
        [-0.05438, 0.11726, 0.07666],
    ]
)
CARTS = np.array(
    [
        [-3.18514, -4.96829, 0.77830],
        [-3.13100, -3.52723, 0.79856],
        [-3.12578, -3.33374, 0.64030],
        [-3.32073, -4.73900, -0.59428],
        [-3.19764, -4.94939, -0.65117],
        [-3.19209, -4.75506, -0.80852],
    ]
)
TRACKS = np.array([[0.99773, -0.06636, -0.00544], [0.99752, -0.06586, -0.00553], [0.99768, -0.06601, -0.00510]])
TRACKS = TRACKS / np.linalg.norm(TRACKS, axis=1)[:, None]
HOME = (np.array([-1.30463238, -4.25858892, 0.02731677]), np.array([-1.75779449, 0.09855017, -0.04572403]))
PLATE_MASS, LINK_MASS, CENTRE, GRAVITY = 22.0, 4.1, np.array([-0.09, 0.0, 0.02]), np.array([0.0, 0.0, -9.81])


@dataclass(frozen=True)
class GantryTau:
    """Geometry: errors of 6 lengths, 18 platform and 18 cart coordinates and 6 track directions, in this order."""

    robot: str = "gantry_tau"
    sites: tuple[str, ...] = ("cart1", "cart2", "cart3")
    links: tuple[str, ...] = LINKS
    travel: tuple[tuple[float, float], ...] = ((-0.65, 0.70),) * 3
    station: tuple[float, float, float] = (1.5, -7.0, 0.3)
    overrun: tuple[float, float] = (0.005, 0.02)  # m, the way on which a stop is approached
    sliding: bool = True

    @property
    def tolerance(self) -> Array:
        return np.concatenate([np.full(24, 1e-3), np.full(18, 2e-3), np.full(6, 1e-3)])

    def parts(self, q: Array, geometry: Array, motion: Motion) -> tuple[Array, Array, Array]:
        """Rod lengths (N, 6), platform joints (6, 3) in the TCP frame, cart joints (N, 6, 3) in the base frame."""
        L = LENGTH + geometry[:6] + motion.rod
        P = PLATFORM + geometry[6:24].reshape(6, 3)
        C0 = CARTS + geometry[24:42].reshape(6, 3)
        across = np.cross(TRACKS, [0.0, 0.0, 1.0])
        across /= np.linalg.norm(across, axis=1)[:, None]
        tilts = geometry[42:].reshape(3, 2)
        v = TRACKS + tilts[:, :1] * across + tilts[:, 1:] * np.cross(TRACKS, across)
        v /= np.linalg.norm(v, axis=1)[:, None]
        centre = np.array([C0[k == CART].mean(0) for k in range(3)])[CART]
        turned = np.einsum("nkij,kj->nki", rotations(motion.body[:, CART, 3:]), C0 - centre)
        C = centre + turned + (q + motion.drive)[:, CART, None] * v[CART] + motion.body[:, CART, :3]
        return L, P, C

    def poses(self, q: Array, geometry: Array, motion: Motion, start: Poses | None = None) -> Poses:
        """TCP poses at the commands q (N, 3); NaN where Newton's method does not converge."""
        L, P, C = self.parts(q, geometry, motion)
        if start is not None:
            return close(start, L, P, C)
        p, R = np.tile(HOME[0], (len(q), 1)), np.tile(rotations(HOME[1]), (len(q), 1, 1))
        for part in np.linspace(0.125, 1.0, 8):  # continuation from home keeps the assembly mode
            p, R = close((p, R), L, P, C - ((1.0 - part) * q)[:, CART, None] * TRACKS[CART])
        return p, R

    def loads(self, q: Array, payload: Array, force: Array) -> tuple[Array, Array]:
        """Tension of each rod (N, 6), N, and force and moment of the rods on each cart (N, 3, 6), about its centre."""
        geometry, still = np.zeros(48), Motion.none(len(q), 3, 6)
        p, R = self.poses(q, geometry, still)
        _, P, C = self.parts(q, geometry, still)
        arm = np.einsum("nij,kj->nki", R, P)
        u = p[:, None] + arm - C
        u /= np.linalg.norm(u, axis=2)[..., None]
        A = np.concatenate([u, np.cross(arm, u)], axis=2).transpose(0, 2, 1)
        pull = np.tile(PLATE_MASS * GRAVITY, (len(q), 1))
        moment = np.cross(np.einsum("nij,j->ni", R, CENTRE), pull)
        half = 0.5 * LINK_MASS * GRAVITY
        moment = moment + np.cross(arm, half).sum(1)
        pull = pull + 6 * half + payload[:, None] * GRAVITY + force
        push = np.linalg.solve(A, -np.concatenate([pull, moment], axis=1)[..., None])[..., 0]
        on_cart = -push[..., None] * u + half
        centre = np.stack([C[:, k == CART].mean(1) for k in range(3)], axis=1)
        turning = np.cross(C - centre[:, CART], on_cart)
        both = np.concatenate([on_cart, turning], axis=2)
        return -push, np.stack([both[:, k == CART].sum(1) for k in range(3)], axis=1)

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Commands (count, 3) over the part of the workspace where the platform turns less than 35 degrees."""
        low, high = np.array(self.travel).T
        q = rng.uniform(low + 0.02, high - 0.02, (12 * count, 3))
        middle = rng.uniform(low[0] + 0.1, high[0] - 0.1, len(q))[:, None]
        q = np.clip(0.5 * q + 0.5 * middle + rng.uniform(-0.25, 0.25, q.shape), low + 0.005, high - 0.005)
        p, R = self.poses(q, np.zeros(48), Motion.none(len(q), 3, 6))
        turn = np.arccos(np.clip((np.einsum("nij,ij->n", R, rotations(HOME[1])) - 1.0) / 2.0, -1.0, 1.0))
        usable = np.isfinite(p).all(1) & (turn < np.radians(35.0))
        return np.asarray(q[usable][:count])


def close(start: Poses, L: Array, P: Array, C: Array) -> Poses:
    """The pose at which each rod has its length: Newton's method from `start`, at most 12 steps."""
    p, R = start[0].copy(), start[1].copy()
    with np.errstate(all="ignore"):
        for _ in range(12):
            arm = np.einsum("nij,kj->nki", R, P)
            u = p[:, None] + arm - C
            residual = 0.5 * ((u * u).sum(2) - L * L)
            J = np.concatenate([u, np.cross(arm, u)], axis=2)
            J[~np.isfinite(J).all(axis=(1, 2)) | (np.abs(np.linalg.det(np.nan_to_num(J))) < 1e-12)] = np.eye(6)
            step = -np.linalg.solve(J, residual[..., None])[..., 0]
            p, R = p + step[:, :3], rotations(np.nan_to_num(step[:, 3:])) @ R
            if np.nanmax(np.abs(step)) < 1e-13:
                break
    p[~(np.abs(residual).max(1) < 1e-9)] = np.nan
    return p, R
