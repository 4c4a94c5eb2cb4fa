"""The amplitude at which an effect has a given energy."""

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
    """Amplitude of a cause, in typical sizes, at which it has ``energy`` at the visits ``rows``; at most ``largest``."""
    amplitude = 1.0
    for _ in range(STEPS):
        reached = past.energy(plant.displacement([(cause, amplitude)])[rows])
        if abs(reached - energy) <= CLOSE * energy:
            break
        # The energy is almost proportional to the square of the amplitude.
        wanted = amplitude * np.sqrt(energy / reached) if reached > 0.0 else largest
        if wanted >= largest and amplitude == largest:
            break
        amplitude = float(min(wanted, largest))
    return amplitude
