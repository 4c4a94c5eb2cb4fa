"""The sealed truth of readings: what the instruments read without noise, and the noise of each number."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.blind.left_out_touches import LeftOut
from gtpin.blind.repeatability import jitter
from gtpin.blind.truth import TrueNoise, TrueReadings
from gtpin.plant.instruments.case import InstrumentCase
from gtpin.plant.recipe import Recipe
from gtpin.typing import Floats


def true_readings(case: InstrumentCase, left_out: Sequence[LeftOut]) -> tuple[TrueReadings, ...]:
    """Readings without noise: at the held-out commands; for touching instruments, at the touches that were left out."""
    touches = {one.name: (one.values, one.sigma) for one in left_out}
    return tuple(
        TrueReadings(name=name, values=_rows(values), sigma=_rows(sigma))
        for name, (values, sigma) in {**case.held, **touches}.items()
    )


def true_noise(case: InstrumentCase, recipe: Recipe) -> tuple[TrueNoise, ...]:
    """The noise of every number in the instruments' tables: the instrument's own, and that of the machine's repeatability.

    E is computed with this noise.
    """
    moves, found = jitter(case, recipe), []
    for gauge in case.gauges:
        moved = gauge.by_motion(case.true[gauge.stop]) @ moves[gauge.stop]
        found.append(TrueNoise(name=gauge.name, sigma=_rows(np.sqrt(gauge.sigma**2 + (moved**2).sum(axis=2)))))
    return tuple(found)


def _rows(values: Floats) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, values.tolist()))
