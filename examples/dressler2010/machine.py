"""A virtual twin of the machine of Dressler, Brogårdh and Robertsson (ICRA 2010): its geometry is the paper's, its carts err.

The paper's numbers: geometry (Table II, model 3), the size of the carts' errors (cart 2 between 25 and 140 micrometres, cart 1
most linear), a shift along the track that depends on where the other carts are, 28 points a cart, 150 random poses.
Assumed: the shapes of the errors, the carts' rotations, the rods' lengths changing with the arm's posture, where the target sat,
the noise. The assumed sizes are such that the costs by link come out like Table II's last column; Table I is not used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

import gtpin
from gtpin.kinematics.closures import RodEnds, follow
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rod_kinematics import RodKinematics

Floats = npt.NDArray[np.float64]

ALONG = (10e-6, 80e-6, 15e-6)  # m, rms of the smooth error along tracks 1 to 3
ACROSS = (8e-6, 20e-6, 12e-6)  # m, rms of the smooth error across
ROTATION = (15e-6, 40e-6, 150e-6)  # rad, rms of roll, pitch and yaw of carts 1 to 3
COUPLING = (10e-6, 120e-6, 30e-6)  # m of shift along the track per metre that the other carts are ahead
LENGTH = (
    65e-6,
    50e-6,
    20e-6,
)  # m, rms change of a rod's length with the arm's posture, by cart: fewer rods, less stiff
RACK = (5e-6, 10e-6, 5e-6)  # m, amplitude at the rack's tooth, which 28 points can't see
TOOTH = 0.0209  # m
TARGET = ((0.05, -0.10, 0.05), (0.05, 0.12, -0.12), (0.05, 0.08, -0.15))  # m, from the joints' mean: by 2b and by 3c


@dataclass(frozen=True)
class Smooth:
    """A random smooth function of a cart's command: a few waves of 0.5 to 3 m, as straightness and linearity errors are."""

    waves: Floats
    phases: Floats
    weights: Floats

    @staticmethod
    def draw(rng: np.random.Generator, rms: float) -> Smooth:
        weights = rng.standard_normal(5)
        return Smooth(
            1 / rng.uniform(0.5, 3.0, 5),
            rng.uniform(0, 2 * np.pi, 5),
            rms * np.sqrt(2) * weights / np.linalg.norm(weights),
        )

    def __call__(self, q: Floats) -> Floats:
        return np.asarray(np.sin(2 * np.pi * q[..., None] * self.waves + self.phases) @ self.weights)


class Twin:
    """The machine."""

    def __init__(self, seed: int = 2010) -> None:
        rng = np.random.default_rng(seed)
        self.robot = gtpin.load_robot("gantry_tau")
        self.rods = RodKinematics(gtpin.Geometry.nominal(self.robot))
        self.carrier = np.array([rod.carrier for rod in self.robot.rods])
        self.middle = np.array([self.rods.C0[self.carrier == c].mean(axis=0) for c in range(3)])
        self.along = [Smooth.draw(rng, rms) for rms in ALONG]
        self.across = [[Smooth.draw(rng, rms) for _ in range(3)] for rms in ACROSS]
        self.rotation = [[Smooth.draw(rng, rms) for _ in range(3)] for rms in ROTATION]
        self.length = [Smooth.draw(rng, LENGTH[c]) for c in self.carrier]
        self.phase = rng.uniform(0, 2 * np.pi, 3)

    def on_cart(self, cart: int, q: Floats, point: Floats) -> Floats:
        """(N, 3) where a point of a cart is at commands q (N, 3); the point is given at zero, base frame, m."""
        v, s = self.robot.actuators[cart].axis, q[:, cart]
        others = self.ahead(cart, q)
        along = (
            self.along[cart](s)
            + COUPLING[cart] * others
            + RACK[cart] * np.sin(2 * np.pi * s / TOOTH + self.phase[cart])
        )
        across = np.stack([f(s) for f in self.across[cart]], axis=1)
        turn = np.stack([f(s) for f in self.rotation[cart]], axis=1)
        across -= (across @ v)[:, None] * v
        return np.asarray(point + (s + along)[:, None] * v + across + np.cross(turn, point - self.middle[cart]))

    def ends(self, q: Floats) -> RodEnds:
        """The rods' ends at commands (N, 3)."""
        C = np.stack([self.on_cart(c, q, self.rods.C0[i]) for i, c in enumerate(self.carrier)], axis=1)
        stretch = [self.length[i](self.ahead(c, q)) for i, c in enumerate(self.carrier)]
        return RodEnds(self.rods.P, C, self.rods.L0 + np.stack(stretch, axis=1))

    @staticmethod
    def ahead(cart: int, q: Floats) -> Floats:
        """(N,) how far the other carts are ahead of one, m."""
        return np.asarray(q[:, [c for c in range(3) if c != cart]].mean(axis=1) - q[:, cart])

    def poses(self, q: Floats) -> Poses:
        """True poses at commands (N, 3), base frame: the exact closures, followed from home."""
        home = self.rods.home
        start = follow(lambda s, rows: self.ends(0.0 * q[:1]), home, 5.0)
        begin = Poses(np.tile(start.T, (len(q), 1)), np.tile(start.R, (len(q), 1, 1)))
        return follow(lambda s, rows: self.ends(s[:, None] * q[rows]), begin, 5.0)
