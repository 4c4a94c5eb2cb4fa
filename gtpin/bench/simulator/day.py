"""Temperatures over a day: of the air, the frame and the links."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.bench.simulator.fields import curve
from gtpin.typing import Floats

STEP = 20.0
"""Time between two temperatures of a day, s."""


@dataclass(frozen=True)
class Day:
    """Temperatures over time, degC. At time 0 everything is at the reference temperature.

    Parameters
    ----------
    time
        (M,) times, s, from 0.
    frame, link
        (M,) readings of the two sensors, degC: the frame follows the air slowly; the links follow the air and are heated by
        work.
    end
        End of the day's work, s: slow changes depend on the time over ``end``.
    """

    time: Floats
    frame: Floats
    link: Floats
    end: float

    @staticmethod
    def draw(rng: np.random.Generator, duration: float, reference: float, warming: float = 1.0) -> Day:
        """A random day of ``duration``, s, from ``reference``, degC; ``warming``: a factor on the changes of temperature."""
        time = np.arange(0.0, duration + 2.0 * STEP, STEP)
        hours = time / 3600.0
        span = max(float(hours[-1]), 1e-3)
        swing = curve(rng, 0.0, span, max(0.4 * span, 0.5), "twice")(hours)
        rise = rng.uniform(1.5, 5.0) * rng.choice([1.0, 1.0, -1.0])
        air = rise * (1.0 - np.exp(-time / rng.uniform(1500.0, 5000.0))) + rng.uniform(0.3, 0.9) * (swing - swing[0])
        work = rng.uniform(0.5, 3.0) * (1.0 - np.exp(-time / rng.uniform(800.0, 2500.0)))
        frame = _lagged(air, rng.uniform(600.0, 2400.0))
        link = _lagged(rng.uniform(0.4, 1.0) * air + work, rng.uniform(300.0, 1200.0))
        return Day(time, reference + warming * frame, reference + warming * link, float(time[-1]))

    def continued(self, time: Floats, frame: Floats, link: Floats) -> Day:
        """The day, continued by readings of the sensors (N,), degC, at later times (N,), s, ascending."""
        return Day(
            np.concatenate([self.time, time]),
            np.concatenate([self.frame, frame]),
            np.concatenate([self.link, link]),
            self.end,
        )

    def frame_at(self, time: Floats, delay: float = 0.0) -> Floats:
        """Readings of the frame's sensor, degC, at times (N,) less a delay, s."""
        return np.asarray(np.interp(time - delay, self.time, self.frame))

    def link_at(self, time: Floats, delay: float = 0.0) -> Floats:
        """Readings of the links' sensor, degC, at times (N,) less a delay, s."""
        return np.asarray(np.interp(time - delay, self.time, self.link))


def _lagged(source: Floats, constant: float) -> Floats:
    """(M,) response of a first-order lag with a time constant, s, to a source (M,), from zero."""
    from scipy.signal import lfilter

    share = STEP / (constant + STEP)
    return np.asarray(lfilter([share], [1.0, share - 1.0], source))
