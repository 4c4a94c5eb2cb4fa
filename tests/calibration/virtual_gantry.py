"""A Gantry-Tau of the tests' own: its closures, its manufacturing errors, its tracker.

Only the nominal numbers come from gtpin. What a parameter means, how the closures are solved and how noise enters is written
down here a second time.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.data import InstrumentSection

Floats = np.ndarray

RODS = ("1", "2a", "2b", "3a", "3b", "3c")
CART = np.array([0, 1, 1, 2, 2, 2])
"""The cart of each rod."""
TOLERANCE = {"length": 1e-3, "platform_joint": 1e-3, "cart_joint": 2e-3, "track_direction": 1e-3, "scale": 5e-4}
POSITION_SIGMA, ORIENTATION_SIGMA = 1.5e-5, 5e-5
ROBOT = gtpin.load_robot("gantry_tau")


def names(directions: str = "actuator", scale: str | None = None) -> list[str]:
    """Names of the parameters: 48, or more where directions or drive scales are the rods' own."""
    owners = {"actuator": [f"cart{i + 1}" for i in range(3)], "rod": list(RODS), None: []}
    joints = [f"{kind}[{rod}].{axis}" for kind in ("platform_joint", "cart_joint") for rod in RODS for axis in "xyz"]
    turns = [f"track_direction[{owner}].{axis}" for owner in owners[directions] for axis in "ab"]
    return [f"length[{rod}]" for rod in RODS] + joints + turns + [f"scale[{owner}]" for owner in owners[scale]]


def tolerance(name: str) -> float:
    return TOLERANCE[name.split("[")[0]]


@dataclass(frozen=True)
class Gantry:
    """|T + R P - C - s q v| = L: joints P, C (6, 3), lengths L (6,), track directions v (6, 3), drive scales s (6,)."""

    P: Floats
    C: Floats
    L: Floats
    v: Floats
    s: Floats = field(default_factory=lambda: np.ones(6))

    @staticmethod
    def nominal() -> Gantry:
        return Gantry(
            np.array([rod.P for rod in ROBOT.rods]),
            np.array([rod.C for rod in ROBOT.rods]),
            np.array([rod.L for rod in ROBOT.rods]),
            np.array([ROBOT.actuators[i].axis for i in CART]),
        )

    def off(self, deviations: Mapping[str, float]) -> Gantry:
        """The machine with parameters off by so much, m and rad."""
        P, C, L, s = self.P.copy(), self.C.copy(), self.L.copy(), self.s.copy()
        turns = np.zeros((6, 2))
        for name, value in deviations.items():
            kind, owner, axis = re.fullmatch(r"(\w+)\[(\w+)\]\.?(\w?)", name).groups()
            rods = [RODS.index(owner)] if owner in RODS else list(np.flatnonzero(int(owner[-1]) - 1 == CART))
            if kind == "length":
                L[rods] += value
            elif kind == "scale":
                s[rods] += value
            elif kind == "track_direction":
                turns[rods, "ab".index(axis)] += value
            else:
                (P if kind == "platform_joint" else C)[rods, "xyz".index(axis)] += value
        return Gantry(P, C, L, np.array([_turned(v, turn) for v, turn in zip(self.v, turns, strict=True)]), s)

    def poses(self, q: Floats) -> tuple[Floats, Floats]:
        """Positions (N, 3) and rotations (N, 3, 3) at commands q (N, 3), followed from home by Newton's method."""
        home = ROBOT.description.home
        T = np.tile(np.array(home.tcp_xyz), (len(q), 1))
        R = np.tile(Rotation.from_rotvec(home.tcp_rotvec).as_matrix(), (len(q), 1, 1))
        for fraction in np.linspace(0.0, 1.0, 8):
            last = fraction == 1.0
            C = self.C + (fraction * self.s * q[:, CART])[..., None] * self.v
            for _ in range(8 if last else 2):
                RP = self.P @ np.swapaxes(R, 1, 2)
                d = T[:, None] + RP - C
                gap = (np.einsum("nki,nki->nk", d, d) - self.L**2) / 2.0
                step = np.linalg.solve(np.concatenate([d, np.cross(RP, d)], axis=2), -gap[..., None])[..., 0]
                T = T + step[:, :3]
                R = Rotation.from_rotvec(step[:, 3:]).as_matrix() @ R
                size = np.abs(step).max()
                if last and size < 1e-13:
                    break
        assert size < 1e-12
        return T, R


def _turned(v: Floats, turn: Floats) -> Floats:
    """A track turned by a about the base axis least aligned with it (less its part along it) and by b about v x a."""
    least = np.eye(3)[np.argmin(np.abs(v))]
    a = least - (least @ v) * v
    a /= np.linalg.norm(a)
    return Rotation.from_rotvec(turn[0] * a + turn[1] * np.cross(v, a)).apply(v)


@dataclass(frozen=True)
class Machine:
    """A machine whose truth is known, and the tracker's view of it."""

    gantry: Gantry
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
    return Machine(Gantry.nominal().off(deviations), deviations, view)


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
