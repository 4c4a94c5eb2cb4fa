"""How large an effect must be to be as hard to see as it shall be."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gtpin.plant.causes.cause import Cause
from gtpin.plant.energy import Past
from gtpin.plant.response import Plant

CLOSE = 1e-3
STEPS = 6


def amplitude_for(
    plant: Plant, cause: Cause, rows: npt.NDArray[np.int_], past: Past, energy: float, largest: float
) -> float:
    """Amplitude, in typical sizes, at which a cause has the energy at some of the visits; the largest if it never has."""
    amplitude = 1.0
    for _ in range(STEPS):
        reached = past.energy(plant.displacement([(cause, amplitude)])[rows])
        if abs(reached - energy) <= CLOSE * energy:
            break
        # Energy goes all but exactly with the square.
        wanted = amplitude * np.sqrt(energy / reached) if reached > 0.0 else largest
        if wanted >= largest and amplitude == largest:
            break
        amplitude = float(min(wanted, largest))
    return amplitude
