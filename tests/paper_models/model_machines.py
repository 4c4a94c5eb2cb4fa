"""Machines of the tests' own that are exactly of one of the paper's models: closures, tracks and tracker written down again.

Only the nominal numbers come from gtpin.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.data import CartMeasurements, InstrumentSection

Floats = np.ndarray
Path = Callable[[Floats], Floats]

ROBOT = gtpin.load_robot("gantry_tau")
CART = np.array([0, 1, 1, 2, 2, 2])
P0, C0 = np.array([rod.P for rod in ROBOT.rods]), np.array([rod.C for rod in ROBOT.rods])
L0 = np.array([rod.L for rod in ROBOT.rods])
AXES = np.array([actuator.axis for actuator in ROBOT.actuators])
HOME_T = np.array(ROBOT.description.home.tcp_xyz)
HOME_R = Rotation.from_rotvec(ROBOT.description.home.tcp_rotvec).as_matrix()
POINTS = np.linspace(-0.65, 0.70, 28)
"""Commands at which carts are measured, m."""


def straight(direction: Floats) -> Path:
    """The path of a joint from its place at zero: (N, 3) at commands (N,)."""
    return lambda q: q[:, None] * direction


def bent(direction: Floats, residual: Floats) -> Path:
    """A straight path and, by pieces between POINTS, residuals (28, 3) less that at zero."""
    at_zero = np.array([np.interp(0.0, POINTS, column) for column in residual.T])
    return lambda q: (
        q[:, None] * direction + np.stack([np.interp(q, POINTS, column) for column in residual.T], axis=1) - at_zero
    )


def wavy(rms: float, seed: int) -> Floats:
    """(28, 3) smooth random residuals at POINTS, m, without a linear part."""
    rng = np.random.default_rng(seed)
    waves = [np.sin(2 * np.pi * POINTS / length + rng.uniform(0, 6)) for length in rng.uniform(0.3, 0.8, 4)]
    values = np.array(waves).T @ rng.standard_normal((4, 3))
    values -= np.polynomial.polynomial.polyval(POINTS, np.polynomial.polynomial.polyfit(POINTS, values, 1)).T
    return rms * values / np.sqrt((values**2).mean())


@dataclass(frozen=True)
class Machine:
    """|T + R P - C0 - path(q)| = L for six rods, or, with a plate that never turns, for three (R given, P zero)."""

    P: Floats
    C: Floats
    L: Floats
    paths: tuple[Path, ...]
    R: Floats | None = None

    @staticmethod
    def nominal() -> "Machine":
        return Machine(P0, C0, L0, tuple(straight(AXES[c]) for c in CART))

    def off(self, seed: int) -> "Machine":
        """The machine with joints and lengths off by about the manufacturing tolerances."""
        rng = np.random.default_rng(seed)
        return replace(
            self,
            P=self.P + 0.5e-3 * rng.standard_normal(self.P.shape) * (self.R is None),
            C=self.C + 1e-3 * rng.standard_normal(self.C.shape),
            L=self.L + 0.5e-3 * rng.standard_normal(self.L.shape),
        )

    def poses(self, q: Floats) -> tuple[Floats, Floats]:
        """Positions (N, 3) and rotations (N, 3, 3) at commands q (N, 3), by Newton's method in ten strides from home."""
        T = np.tile(HOME_T, (len(q), 1))
        R = np.tile(HOME_R if self.R is None else self.R, (len(q), 1, 1))
        for stride in np.linspace(0.1, 1.0, 10):
            for _ in range(8):
                T, R = self._step(stride * q, T, R)
        assert np.abs(self._gap(q, T, R)[0]).max() < 1e-12
        return T, R

    def _gap(self, q: Floats, T: Floats, R: Floats) -> tuple[Floats, Floats, Floats]:
        carts = CART if len(self.paths) == 6 else np.arange(3)
        C = self.C + np.stack([path(q[:, c]) for c, path in zip(carts, self.paths, strict=True)], axis=1)
        RP = np.einsum("nij,kj->nki", R, self.P)
        d = T[:, None] + RP - C
        return np.linalg.norm(d, axis=2) - self.L, d / np.linalg.norm(d, axis=2, keepdims=True), RP

    def _step(self, q: Floats, T: Floats, R: Floats) -> tuple[Floats, Floats]:
        gap, u, RP = self._gap(q, T, R)
        if self.R is not None:
            return T - np.linalg.solve(u, gap[..., None])[..., 0], R
        step = -np.linalg.solve(np.concatenate([u, np.cross(RP, u)], axis=2), gap[..., None])[..., 0]
        return T + step[:, :3], Rotation.from_rotvec(step[:, 3:]).as_matrix() @ R

    def dataset(
        self,
        q: Floats,
        position_sigma: float,
        orientation_sigma: float,
        seed: int,
        carts: CartMeasurements | None = None,
    ) -> gtpin.Dataset:
        """What a tracker in the base frame measures."""
        rng = np.random.default_rng(seed)
        T, R = self.poses(q)
        turned = Rotation.from_rotvec(orientation_sigma * rng.standard_normal(T.shape)) * Rotation.from_matrix(R)
        return gtpin.Dataset(
            robot="gantry_tau",
            pose=np.arange(len(q)).astype(str).astype(object),
            q=q,
            position=T + position_sigma * rng.standard_normal(T.shape),
            orientation=turned.as_quat(scalar_first=True),
            instrument=InstrumentSection(position_sigma=position_sigma, orientation_sigma=orientation_sigma),
            carts=carts,
        )


def reduced(seed: int, paths: tuple[Path, Path, Path] | None = None) -> "Machine":
    """Three rods to one point and a plate that keeps its turn (eqs. 1 to 3), near the Gantry-Tau, off by the tolerances."""
    C = np.array([(C0 - P0 @ HOME_R.T)[c == CART].mean(axis=0) for c in range(3)])
    L = np.array([L0[c == CART].mean() for c in range(3)])
    ways = tuple(straight(axis) for axis in AXES) if paths is None else paths
    return Machine(np.zeros((3, 3)), C, L, ways, HOME_R).off(seed)


def carts_of(
    paths: tuple[Path, Path, Path],
    *,
    turn: Rotation | None = None,
    shift: tuple[float, float, float] = (3.0, -1.0, 0.5),
    targets: Floats | None = None,
    turns: tuple[Path, Path, Path] | None = None,
) -> CartMeasurements:
    """Noiseless carts.csv of the paths, seen from a frame turned and shifted; targets (3, 3), m, from each cart's joints."""
    turn = Rotation.from_rotvec([0.3, -1.2, 2.0]) if turn is None else turn
    targets = np.zeros((3, 3)) if targets is None else targets
    positions, rotations = [], []
    for c, path in enumerate(paths):
        R = Rotation.from_rotvec(np.zeros((len(POINTS), 3)) if turns is None else turns[c](POINTS))
        place = C0[c == CART].mean(axis=0) + path(POINTS) + R.apply(targets[c])
        positions.append(turn.apply(place) + shift)
        rotations.append(turn * R)
    orientation = None if turns is None else Rotation.concatenate(rotations).as_quat(scalar_first=True)
    return CartMeasurements(np.repeat([1, 2, 3], 28), np.tile(POINTS, 3), np.concatenate(positions), orientation)


def commands(count: int, seed: int, reach: float = 0.6) -> Floats:
    """(N, 3) random commands, m, within the measured tracks."""
    return np.random.default_rng(seed).uniform(-reach, reach, (count, 3))
