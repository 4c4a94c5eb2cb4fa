"""Colours of shares and errors, in light and in space."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

GREY, BLUE, RED = np.array([0.60, 0.64, 0.69]), np.array([0.48, 0.64, 0.82]), np.array([0.71, 0.14, 0.09])
"""Nothing, some, much."""


def of_share(share: float) -> Floats:
    """(3,) from grey to red, which half of the gap reaches."""
    part = min(2.0 * max(share, 0.0), 1.0)
    return np.asarray((1.0 - part) * GREY + part * RED)


def of_errors(lengths: Floats) -> Floats:
    """(N, 3) from grey over blue to red, which the largest twentieth reaches."""
    part = np.clip(lengths / max(float(np.quantile(lengths, 0.95)), 1e-300), 0.0, 1.0)[:, None]
    low = np.minimum(2.0 * part, 1.0)
    high = np.maximum(2.0 * part - 1.0, 0.0)
    return np.asarray((1.0 - high) * ((1.0 - low) * GREY + low * BLUE) + high * RED)
