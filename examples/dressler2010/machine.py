"""A virtual twin of the machine of Dressler, Brogårdh and Robertsson (ICRA 2010): their geometry, and carts and rods that err.

README.md says which number is the paper's and which is assumed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

import gtpin
from gtpin.kinematics.poses import Poses
from gtpin.paper.geometry import PaperGeometry
from gtpin.paper.kinematics import PaperKinematics, RodEnds

Floats = npt.NDArray[np.float64]

RANGE = (-0.65, 0.70)  # m, the commands at which the carts were measured
DIRECTION = (  # travel of the six rods' joints per commanded metre, base frame: Table II, model 3, as printed
    [(0.99773, -0.06636, -0.00544)],
    [(0.99761, -0.06584, -0.00544), (0.99744, -0.06589, -0.00562)],
    [(0.99766, -0.06600, -0.00515), (0.99764, -0.06607, -0.00507), (0.99774, -0.06597, -0.00507)],
)

# Assumed. Sizes for carts 1 to 3: rms of what a linear function does not explain.
ALONG = (8e-6, 45e-6, 12e-6)  # m along the track, over the cart's own command
ACROSS = (6e-6, 35e-6, 10e-6)  # m across it, each of two directions
TURN = (20e-6, 40e-6, 20e-6)  # rad, roll, pitch and yaw, over the cart's own command
SHIFT = (5e-6, 30e-6, 10e-6)  # m along the track, over where the other carts are
SWAY = (6e-6, 35e-6, 15e-6)  # m across it, likewise
STRETCH = (64e-6, 35e-6, 12e-6)  # m of a cluster's rods, likewise: the fewer rods, the less stiff they are
RACK = (3e-6, 10e-6, 5e-6)  # m, amplitude of a wave along the track at every tooth of the rack
TOOTH = 0.0209  # m
OWN, OTHERS = (0.25, 0.9), (0.5, 1.2)  # m, shortest and longest waves over a cart's own command, and over the others'
# m, where the T-Mac sat, from the mean of the cart's joints: between the two of cart 2, beyond 3c on cart 3.
TARGET = ((0.05, -0.10, 0.05), (0.08, 0.03, -0.02), (0.08, 0.09, -0.19))


@dataclass(frozen=True)
class Waves:
    """A random function of points (N, d), m: five waves, whose rms about a linear function is given."""

    vectors: Floats
    phases: Floats
    weights: Floats

    @staticmethod
    def draw(rng: np.random.Generator, rms: float, lengths: tuple[float, float], d: int) -> Waves:
        directions = rng.standard_normal((5, d))
        directions *= 2 * np.pi / rng.uniform(*lengths, (5, 1)) / np.linalg.norm(directions, axis=1, keepdims=True)
        raw = Waves(directions, rng.uniform(0, 2 * np.pi, 5), rng.standard_normal(5))
        points = np.stack(np.meshgrid(*[np.linspace(*RANGE, 28)] * d), axis=-1).reshape(-1, d)
        linear = np.column_stack([np.ones(len(points)), points])
        values = raw(points)
        left = values - linear @ np.linalg.lstsq(linear, values, rcond=None)[0]
        return Waves(raw.vectors, raw.phases, raw.weights * rms / left.std())

    def __call__(self, points: Floats) -> Floats:
        return np.asarray(np.sin(points @ self.vectors.T + self.phases) @ self.weights)


class Twin:
    """The machine: one draw of its errors for each seed."""

    def __init__(self, seed: int = 2010) -> None:
        rng = np.random.default_rng(seed)
        self.robot = gtpin.load_robot("gantry_tau")
        self.rods = PaperKinematics(PaperGeometry.nominal(self.robot))
        self.P = np.array([rod.P for rod in self.robot.rods])
        self.C0 = np.array([rod.C for rod in self.robot.rods])
        self.L0 = np.array([rod.L for rod in self.robot.rods])
        self.carrier = np.array([rod.carrier for rod in self.robot.rods])
        self.middle = np.array([self.C0[self.carrier == c].mean(axis=0) for c in range(3)])
        self.direction = [np.mean(directions, axis=0) for directions in DIRECTION]
        self.turning = [self._turning(c) for c in range(3)]
        self.along = [Waves.draw(rng, rms, OWN, 1) for rms in ALONG]
        self.across = [[Waves.draw(rng, rms, OWN, 1) for _ in "yz"] for rms in ACROSS]
        self.turns = [[Waves.draw(rng, rms, OWN, 1) for _ in "xyz"] for rms in TURN]
        self.shift = [Waves.draw(rng, rms, OTHERS, 2) for rms in SHIFT]
        self.sway = [[Waves.draw(rng, rms, OTHERS, 2) for _ in "yz"] for rms in SWAY]
        self.stretch = [Waves.draw(rng, rms, OTHERS, 2) for rms in STRETCH]
        self.phase = rng.uniform(0, 2 * np.pi, 3)

    def on_cart(self, cart: int, q: Floats, point: Floats) -> Floats:
        """(N, 3) where a point of a cart is at commands q (N, 3); the point is given at zero, base frame, m."""
        own, others = q[:, [cart]], ahead(cart, q)
        rack = RACK[cart] * np.sin(2 * np.pi * q[:, cart] / TOOTH + self.phase[cart])
        along = q[:, cart] + self.along[cart](own) + self.shift[cart](others) + rack
        # The tracks follow x to four degrees, so that y and z are across them.
        across = [f(own) + g(others) for f, g in zip(self.across[cart], self.sway[cart], strict=True)]
        moved = point + along[:, None] * self.direction[cart]
        moved[:, 1:] += np.stack(across, axis=1)
        return moved + np.cross(self.turn(cart, q), point - self.middle[cart])

    def turn(self, cart: int, q: Floats) -> Floats:
        """(N, 3) small rotation of a cart about the mean of its joints, base frame, rad."""
        own = q[:, [cart]]
        return np.asarray(own * self.turning[cart] + np.stack([f(own) for f in self.turns[cart]], axis=1))

    def _turning(self, cart: int) -> Floats:
        """(3,) rad/m: how a rigid cart turns on its way, so that its joints' directions are closest to the printed ones."""
        lever = self.C0[self.carrier == cart] - self.middle[cart]
        by_turn = np.concatenate([np.cross(np.eye(3), r).T for r in lever])
        apart = np.asarray(DIRECTION[cart]) - self.direction[cart]
        return np.asarray(np.linalg.lstsq(by_turn, apart.ravel(), rcond=1e-6)[0])

    def ends(self, q: Floats) -> RodEnds:
        """The rods' ends at commands (N, 3)."""
        C = np.stack([self.on_cart(c, q, self.C0[i]) for i, c in enumerate(self.carrier)], axis=1)
        stretch = [self.stretch[c](ahead(c, q)) for c in self.carrier]
        return RodEnds(self.P, C, self.L0 + np.stack(stretch, axis=1))

    def poses(self, q: Floats) -> Poses:
        """True poses at commands (N, 3), base frame: the exact closures, followed from home."""
        return _TrueKinematics(self.rods.geometry, self).forward(q)


@dataclass(frozen=True)
class _TrueKinematics(PaperKinematics):
    twin: Twin

    def ends(self, q: Floats) -> RodEnds:
        return self.twin.ends(q)


def ahead(cart: int, q: Floats) -> Floats:
    """(N, 2) how far the other two carts are ahead of one, m: the arm's posture, and with it the load."""
    return np.delete(q, cart, axis=1) - q[:, [cart]]
