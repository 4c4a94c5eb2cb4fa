"""A day in the hall: how the air, the frame and the links warm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.plant.fields import curve

Floats = npt.NDArray[np.float64]

STEP = 20.0  # s


@dataclass(frozen=True)
class Day:
    """Temperatures over time, degC, from the time when everything was at the reference temperature.

    Parameters
    ----------
    time
        (M,) s, from 0.
    frame, link
        (M,) what the two sensors read: the frame follows the air slowly, the links follow it and the work.
    end
        When the day's work ends, s: slow changes go by the share of it that has passed.
    """

    time: Floats
    frame: Floats
    link: Floats
    end: float

    @staticmethod
    def draw(rng: np.random.Generator, duration: float, reference: float, warming: float = 1.0) -> Day:
        """A day of so many seconds; ``warming`` is a factor on the drawn changes of temperature."""
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
        """The day and what the sensors read at later times (N,), ascending."""
        return Day(
            np.concatenate([self.time, time]),
            np.concatenate([self.frame, frame]),
            np.concatenate([self.link, link]),
            self.end,
        )

    def frame_at(self, time: Floats, delay: float = 0.0) -> Floats:
        """What the frame's sensor read at times (N,) less a delay, s."""
        return np.asarray(np.interp(time - delay, self.time, self.frame))

    def link_at(self, time: Floats, delay: float = 0.0) -> Floats:
        """What the links' sensor read at times (N,) less a delay, s."""
        return np.asarray(np.interp(time - delay, self.time, self.link))


def _lagged(source: Floats, constant: float) -> Floats:
    """What follows a source (M,) with a time constant, s, from zero."""
    from scipy.signal import lfilter

    share = STEP / (constant + STEP)
    return np.asarray(lfilter([share], [1.0, share - 1.0], source))
