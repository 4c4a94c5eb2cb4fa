"""Numbers from outside: arrays of real numbers, seeds and probabilities, or an error that says what was given instead."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gtpin.errors import ModelError
from gtpin.typing import Floats

KINDS = {"c": "complex numbers", "b": "truth values", "M": "dates", "m": "durations"}
"""Kinds of NumPy arrays that NumPy would turn into floats, and that are no lengths or angles."""


def real(values: npt.ArrayLike, what: str, hint: str = "give real numbers") -> Floats:
    """Values as an array of floats.

    Raises `ModelError` where they are no numbers, complex, truth values or dates, or where some are masked; ``what`` begins
    the message.
    """
    if np.ma.is_masked(values):
        raise ModelError(f"{what} with masked values", hint="fill them, or leave out their rows")
    try:
        given = np.asarray(values)
        kind = KINDS.get(given.dtype.kind)
        found = np.zeros(0) if kind else np.asarray(given, dtype=float)
    except OverflowError:
        kind, found = "integers too large for a float", np.zeros(0)
    except (TypeError, ValueError):
        kind, found = f"{type(values).__name__} without numbers", np.zeros(0)
    if kind is not None:
        raise ModelError(f"{what} are {kind}", hint=hint)
    return found


def generator(seed: int) -> np.random.Generator:
    """The random numbers of a seed; `ModelError` where it is no integer of 0 or more."""
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise ModelError(f"seed={seed!r}", hint="give an integer of 0 or more")
    return np.random.default_rng(seed)


def probability(value: object, what: str) -> float:
    """A probability; `ModelError` where it is not above 0 and below 1."""
    if not isinstance(value, (int, float, np.floating)) or not 0.0 < value < 1.0:
        raise ModelError(f"{what}={value!r}", hint="give a probability above 0 and below 1")
    return float(value)
