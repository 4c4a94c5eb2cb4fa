"""A Gantry-Tau of the tests' own closures: its manufacturing errors, and its tracker, whose noise is written down here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from closures import Closures, nominal
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.data import InstrumentSection

Floats = np.ndarray

RODS = ("1", "2a", "2b", "3a", "3b", "3c")
TOLERANCE = {"length": 1e-3, "platform_joint": 1e-3, "cart_joint": 2e-3, "track_direction": 1e-3, "scale": 5e-4}
POSITION_SIGMA, ORIENTATION_SIGMA = 1.5e-5, 5e-5
ROBOT = gtpin.load_robot("gantry_tau")
GANTRY = nominal("gantry_tau")


def names(directions: str = "actuator", scale: str | None = None) -> list[str]:
    """Names of the parameters: 48, or more where directions or drive scales are the rods' own."""
    owners = {"actuator": [f"cart{i + 1}" for i in range(3)], "rod": list(RODS), None: []}
    joints = [f"{kind}[{rod}].{axis}" for kind in ("platform_joint", "cart_joint") for rod in RODS for axis in "xyz"]
    turns = [f"track_direction[{owner}].{axis}" for owner in owners[directions] for axis in "ab"]
    return [f"length[{rod}]" for rod in RODS] + joints + turns + [f"scale[{owner}]" for owner in owners[scale]]


def tolerance(name: str) -> float:
    return TOLERANCE[name.split("[")[0]]


@dataclass(frozen=True)
class Machine:
    """A machine whose truth is known, and the tracker's view of it."""

    gantry: Closures
    deviations: dict[str, float]
    view: tuple[Rotation, Floats] | None = None

    def seen(self, q: Floats) -> tuple[Floats, Rotation]:
        """True positions and rotations in the instrument's frame."""
        T, R = self.gantry.poses(q)
        turn = Rotation.from_matrix(R)
        return (T, turn) if self.view is None else (self.view[0].apply(T) + self.view[1], self.view[0] * turn)


def draw(rng: np.random.Generator, parameters: list[str] | None = None, free: bool = False) -> Machine:
    """A machine off by normal draws from its tolerances; with ``free``, watched from anywhere."""
    deviations = {name: tolerance(name) * rng.standard_normal() for name in parameters or names()}
    view = (Rotation.from_quat(rng.standard_normal(4)), rng.uniform(-10.0, 10.0, 3)) if free else None
    return Machine(GANTRY.off(deviations), deviations, view)


def commands(rng: np.random.Generator, count: int) -> Floats:
    """Commands in the part of the range where the platform stays well held."""
    return rng.uniform(-0.35, 0.35, (count, 1)) + rng.uniform(-0.25, 0.25, (count, 3))


def measured(
    machine: Machine,
    q: Floats,
    rng: np.random.Generator,
    *,
    noise: Floats | None = None,
    pose: Sequence[object] | None = None,
    orientation: bool = True,
    instrument: InstrumentSection | None = None,
) -> gtpin.Dataset:
    """What a tracker reads: truth and noise (N, 6), m and rad; by default Gaussian of the usual size, and declared."""
    if noise is None:
        noise = rng.standard_normal((len(q), 6)) * np.repeat([POSITION_SIGMA, ORIENTATION_SIGMA], 3)
    T, turn = machine.seen(q)
    if instrument is None:
        instrument = InstrumentSection(
            position_sigma=POSITION_SIGMA,
            orientation_sigma=ORIENTATION_SIGMA if orientation else None,
            frame="robot" if machine.view is None else "free",
        )
    return gtpin.Dataset(
        robot="gantry_tau",
        pose=np.arange(len(q)) if pose is None else pose,
        q=q,
        position=T + noise[:, :3],
        orientation=(Rotation.from_rotvec(noise[:, 3:]) * turn).as_quat(scalar_first=True) if orientation else None,
        instrument=instrument,
    )


def case(
    rng: np.random.Generator, count: int, drawn: list[str] | None = None, *, free: bool = False, **options: Any
) -> tuple[Machine, gtpin.Dataset]:
    """A machine as :func:`draw` makes it, and what a tracker reads of it at so many commands."""
    machine = draw(rng, drawn, free=free)
    return machine, measured(machine, commands(rng, count), rng, **options)


def indices(s: Floats, rows: int) -> dict[str, float]:
    """Observability indices O1 to O5 of singular values, the largest first, of a derivative of so many rows."""
    return {
        "O1": np.exp(np.log(s).mean()) / np.sqrt(rows),
        "O2": s[-1] / s[0],
        "O3": s[-1],
        "O4": s[-1] ** 2 / s[0],
        "O5": 1.0 / (1.0 / s).sum(),
    }


def undeclared(dataset: gtpin.Dataset) -> gtpin.Dataset:
    """The same data from an instrument that does not say how noisy it is."""
    blank = dataset.instrument.model_copy(update={"position_sigma": None, "orientation_sigma": None})
    return replace(dataset, instrument=blank)
