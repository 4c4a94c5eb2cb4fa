"""Colours of shares of the gap and of errors, as RGB, 0 to 1."""

from __future__ import annotations

import numpy as np

from gtpin.typing import Floats

GREY, BLUE, RED = np.array([0.60, 0.64, 0.69]), np.array([0.48, 0.64, 0.82]), np.array([0.71, 0.14, 0.09])
"""Colours of small, medium and large values."""


def of_share(share: float) -> Floats:
    """(3,) colour of a share of the gap, from grey at 0 to red at 0.5 and above."""
    part = min(2.0 * max(share, 0.0), 1.0)
    return np.asarray((1.0 - part) * GREY + part * RED)


def of_errors(lengths: Floats) -> Floats:
    """(N, 3) colours of error sizes (N,), from grey at 0 over blue to red at the 95 % quantile and above."""
    part = np.clip(lengths / max(float(np.quantile(lengths, 0.95)), 1e-300), 0.0, 1.0)[:, None]
    low = np.minimum(2.0 * part, 1.0)
    high = np.maximum(2.0 * part - 1.0, 0.0)
    return np.asarray((1.0 - high) * ((1.0 - low) * GREY + low * BLUE) + high * RED)
