"""The paper's three sets of measurements, taken on the twin: writes a dataset folder that gtpin reads, and set 3 beside it.

python examples/dressler2010/measure.py twin 2010
gtpin compare twin -o compared
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
from machine import RANGE, TARGET, Twin
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.data import CartMeasurements, InstrumentSection
from gtpin.kinematics.inverse import commands_for

Floats = npt.NDArray[np.float64]

POSES, POINTS, RANDOM = 176, 28, 150
CENTER, HALF_WIDTH = np.array([0.0, 0.15, -0.13]), np.array([0.67, 0.51, 0.50])  # m, of the grid, from the home TCP
NOISE = InstrumentSection(position_sigma=1.0e-5, orientation_sigma=5.0e-5)  # m and rad, assumed
STATIONS = (  # where the tracker stood for sets 2 and 3: turn, rad, and shift, m, assumed
    (Rotation.from_rotvec([0.02, -0.01, 2.4]), np.array([4.1, -2.2, 0.6])),
    (Rotation.from_rotvec([-0.01, 0.03, -1.1]), np.array([-1.7, 3.5, 0.4])),
)


def measure(seed: int = 2010, places: Floats | None = None) -> tuple[gtpin.Dataset, CartMeasurements]:
    """Sets 1 and 2 as a dataset, and set 3.

    Parameters
    ----------
    places
        (N, 3) TCP positions of set 1, base frame, m; the twin's own grid by default.
    """
    twin, rng = Twin(seed), np.random.default_rng(seed + 1)
    q = grid(twin) if places is None else commands(twin, places)
    true = twin.poses(q)
    read = Rotation.from_rotvec(NOISE.orientation_sigma * rng.standard_normal(q.shape)) * Rotation.from_matrix(true.R)
    together = np.repeat(np.linspace(*RANGE, POINTS)[:, None], 3, axis=1)
    dataset = gtpin.Dataset(
        robot="gantry_tau",
        pose=np.arange(len(q)).astype(str).astype(object),
        q=q,
        position=true.T + NOISE.position_sigma * rng.standard_normal(q.shape),
        orientation=read.as_quat(scalar_first=True),
        instrument=NOISE,
        carts=cart_poses(twin, together, STATIONS[0], rng, turned=True),
    )
    return dataset, cart_poses(twin, anywhere(twin, rng), STATIONS[1], rng, turned=False)


def grid(twin: Twin) -> Floats:
    """(176, 3) commands of six layers across the tracks, each walked back in the next layer."""
    along, y, z = (np.linspace(-1, 1, n) for n in (6, 6, 5))
    path = np.array([[b, c] for j, b in enumerate(y) for c in (z if j % 2 == 0 else z[::-1])])
    layers = [np.column_stack([np.full(30, a), path[:: 1 if i % 2 == 0 else -1]]) for i, a in enumerate(along)]
    return commands(twin, in_box(twin, np.concatenate(layers)[:POSES]))


def anywhere(twin: Twin, rng: np.random.Generator) -> Floats:
    """(150, 3) commands of random places in the grid's box that leave no cart's measured range."""
    q = commands(twin, in_box(twin, rng.uniform(-1, 1, (10 * RANDOM, 3))))
    return q[((q >= RANGE[0]) & (q <= RANGE[1])).all(axis=1)][:RANDOM]


def in_box(twin: Twin, places: Floats) -> Floats:
    """(N, 3) TCP positions, base frame, m, of places in the grid's box, -1 to 1."""
    return np.asarray(twin.rods.home.T[0] + CENTER + HALF_WIDTH * places)


def commands(twin: Twin, positions: Floats) -> Floats:
    """(N, 3) commands of TCP positions (N, 3), base frame, m, to a micrometre."""
    return np.asarray(np.round(commands_for(twin.rods, positions)[0], 6))


def cart_poses(
    twin: Twin, q: Floats, station: tuple[Rotation, Floats], rng: np.random.Generator, *, turned: bool
) -> CartMeasurements:
    """What the tracker reads of all carts at commands (N, 3), in its own frame."""
    positions, rotations = [], []
    for cart in range(3):
        seen = station[0].apply(twin.on_cart(cart, q, twin.middle[cart] + TARGET[cart])) + station[1]
        positions.append(seen + NOISE.position_sigma * rng.standard_normal(q.shape))
        noise = NOISE.orientation_sigma * rng.standard_normal(q.shape)
        rotations.append(Rotation.from_rotvec(noise) * station[0] * Rotation.from_rotvec(twin.turn(cart, q)))
    orientation = Rotation.concatenate(rotations).as_quat(scalar_first=True) if turned else None
    return CartMeasurements(np.repeat([1, 2, 3], len(q)), q.T.ravel(), np.concatenate(positions), orientation)


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "twin")
    dataset, random_poses = measure(int(sys.argv[2]) if len(sys.argv) > 2 else 2010)
    dataset.write(folder)
    random_poses.write(folder.with_name(f"{folder.name}-set3.csv"))
