"""The pose error of a Stewart platform that manufacturing tolerances cause: Monte Carlo compared with the Jacobian.

After Wang and Masory, "On the accuracy of a Stewart platform. I. The effect of manufacturing tolerances", ICRA 1993: machines
are drawn whose joints and legs are off by their tolerances, and sent where the nominal geometry says. The Jacobian's
prediction is the covariance J S J', J the derivative of the pose by the parameters and S their variances.
"""

from __future__ import annotations

import numpy as np

import gtpin
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.rotations import exp

PLACES = [(height, radius, tilt) for height in (0.85, 0.92, 0.99) for radius in (0.0, 0.15) for tilt in (0.0, 0.15)]
"""Height and distance from the middle, m, and tilt about the way there, rad, of poses in eight directions."""


def workspace(robot: gtpin.Robot) -> np.ndarray:
    """(8 places, 6) commands: a leg is as long as its joints are apart."""
    P, C, L = (np.array([getattr(rod, name) for rod in robot.rods]) for name in ("P", "C", "L"))
    ways = [np.array([np.cos(a), np.sin(a), 0.0]) for a in np.radians(np.arange(0.0, 360.0, 45.0))]
    joints = [
        way * radius + [0.0, 0.0, height] + P @ exp(tilt * way).T for height, radius, tilt in PLACES for way in ways
    ]
    return np.linalg.norm(np.array(joints) - C, axis=2) - L


def accuracy(robot: gtpin.Robot, q: np.ndarray, machines: int = 1000) -> tuple[np.ndarray, np.ndarray]:
    """(N, 2) rms errors of position, m, and orientation, rad, by Monte Carlo and by the Jacobian."""
    geometry, rng = gtpin.Geometry.nominal(robot), np.random.default_rng(0)
    nominal = Kinematics(geometry)
    poses = nominal.forward(q)
    squares = np.zeros((len(q), 6))
    for _ in range(machines):
        drawn = geometry.values + geometry.tolerance * rng.standard_normal(len(geometry.values))
        squares += Kinematics(geometry.with_values(drawn)).forward(q, start=poses).minus(poses) ** 2 / machines
    J = nominal.geometry_jacobian(q, poses) * geometry.tolerance
    return _rms(squares), _rms((J**2).sum(axis=2))


def _rms(squares: np.ndarray) -> np.ndarray:
    return np.sqrt(np.column_stack([squares[:, :3].sum(axis=1), squares[:, 3:].sum(axis=1)]))


if __name__ == "__main__":
    stewart = gtpin.load_robot("stewart")
    drawn, predicted = accuracy(stewart, workspace(stewart))
    for place, (height, radius, tilt) in enumerate(PLACES):
        rows = slice(8 * place, 8 * place + 8)
        (p, o), (pj, oj) = (1e3 * np.sqrt((errors[rows] ** 2).mean(axis=0)) for errors in (drawn, predicted))
        print(
            f"height {height} m, {radius} m out, tilt {tilt} rad: {p:.2f} mm (J: {pj:.2f}), {o:.2f} mrad (J: {oj:.2f})"
        )
    print(f"Jacobian over Monte Carlo: {(predicted / drawn).min():.3f} to {(predicted / drawn).max():.3f}")
