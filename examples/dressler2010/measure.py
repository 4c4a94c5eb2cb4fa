"""The paper's three sets of measurements, taken on the twin: writes a dataset folder that gtpin reads.

python examples/dressler2010/measure.py twin
gtpin compare twin -o compared
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
from machine import TARGET, Twin
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.data import CartMeasurements, Instrument
from gtpin.kinematics.inverse import commands_for

Floats = npt.NDArray[np.float64]

CENTER, HALF_WIDTH = (
    np.array([0.0, 0.15, -0.13]),
    np.array([0.67, 0.51, 0.50]),
)  # m, from the home TCP; see docs/paper.md
NOISE = Instrument(position_sigma=2.0e-5, orientation_sigma=1.0e-4)  # assumed, of a T-Mac's size
POINTS, RANDOM = 28, 150


def grid(twin: Twin) -> Floats:
    """(N, 3) commands of the paper's grid: six layers across the tracks, each path walked back in the next layer."""
    along, y, z = (np.linspace(-1, 1, n) for n in (6, 6, 5))
    path = np.array([[b, c] for j, b in enumerate(y) for c in (z if j % 2 == 0 else z[::-1])])
    layers = [np.column_stack([np.full(30, a), path if i % 2 == 0 else path[::-1]]) for i, a in enumerate(along)]
    T = twin.rods.home.T[0] + CENTER + HALF_WIDTH * np.concatenate(layers)
    q = np.round(commands_for(twin.rods, T)[0], 6)
    return np.asarray(q[np.isfinite(q).all(axis=1)][:176])


def measure(folder: Path, seed: int = 2010) -> None:
    """Write the dataset, and set 3 beside it as a table of its own."""
    twin, rng = Twin(seed), np.random.default_rng(seed + 1)
    q = grid(twin)
    true = twin.poses(q)
    turned = Rotation.from_rotvec(NOISE.orientation_sigma * rng.standard_normal(true.T.shape)) * Rotation.from_matrix(
        true.R
    )
    placed = (
        Rotation.from_rotvec([0.02, -0.01, 2.4]),
        np.array([4.1, -2.2, 0.6]),
    )  # where the tracker stood for sets 2, 3

    together = np.repeat(np.linspace(-0.65, 0.70, POINTS)[:, None], 3, axis=1)
    span = np.ptp(q, axis=0).max()
    anywhere = np.clip(q[rng.integers(0, len(q), RANDOM)] + rng.normal(0, 0.05 * span, (RANDOM, 3)), -0.65, 0.70)
    gtpin.Dataset(
        robot="gantry_tau",
        pose=np.arange(len(q)).astype(str).astype(object),
        q=q,
        position=true.T + NOISE.position_sigma * rng.standard_normal(true.T.shape),
        orientation=turned.as_quat(scalar_first=True),
        instrument=NOISE,
        carts=_carts(twin, together, placed, rng),
    ).write(folder)
    _carts(twin, anywhere, placed, rng).write(folder.with_name(f"{folder.name}-set3.csv"))


def _carts(twin: Twin, q: Floats, placed: tuple[Rotation, Floats], rng: np.random.Generator) -> CartMeasurements:
    rows = []
    for cart in range(3):
        seen = placed[0].apply(twin.on_cart(cart, q, twin.middle[cart] + TARGET[cart])) + placed[1]
        rows.append(seen + NOISE.position_sigma * rng.standard_normal(seen.shape))
    return CartMeasurements(np.repeat([1, 2, 3], len(q)), q.T.ravel(), np.concatenate(rows))


if __name__ == "__main__":
    measure(Path(sys.argv[1] if len(sys.argv) > 1 else "twin"))
