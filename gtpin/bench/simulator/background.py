"""The background: weak further effects that every machine has, too weak to be detected."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from gtpin.bench.simulator.causes.cause import Cause
from gtpin.bench.simulator.causes.kinds import listed
from gtpin.bench.simulator.energy import Past
from gtpin.bench.simulator.response import Plant

BESIDE = (2.0, 12.0)
"""Range from which their joint energy is drawn where the machine has a wanted effect."""
ALONE = (0.5, 4.0)
"""The same range where it has none."""
MANY = (2, 5)
MOST = 2.0
"""Largest amplitude, in typical sizes: an effect with little energy is not made larger."""


def weak_others(
    plant: Plant,
    rows: npt.NDArray[np.int_],
    past: Past,
    taken: Collection[tuple[str, str]],
    beside: bool,
    rng: np.random.Generator,
) -> tuple[list[tuple[Cause, float]], float]:
    """Some effects at sites that are not ``taken``, with their amplitudes, and their joint energy.

    ``beside``: whether the machine has a wanted effect.
    """
    robot = plant.machine.robot
    causes, shares, displaced = [], [], []
    kinds = listed(robot)
    for i in rng.choice(len(kinds), size=int(rng.integers(MANY[0], MANY[1] + 1)), replace=False):
        site = str(rng.choice(kinds[i].sites(robot)))
        if (kinds[i].name, site) in taken:
            continue
        cause = kinds[i].at(robot, site, rng)
        displacement = plant.displacement([(cause, 1.0)])[rows]
        energy = past.energy(displacement)
        share = float(min(np.sqrt(rng.exponential() / max(energy, 1e-9)), MOST))
        causes.append(cause)
        shares.append(share)
        displaced.append(share * displacement)
    wanted = float(rng.uniform(*(BESIDE if beside else ALONE)))
    if not causes:
        return [], 0.0
    whole = past.energy(np.sum(displaced, axis=0))
    factor = min(np.sqrt(wanted / max(whole, 1e-9)), MOST / max(shares))
    active = [(cause, share * factor) for cause, share in zip(causes, shares, strict=True)]
    return active, past.energy(plant.displacement(active)[rows])
