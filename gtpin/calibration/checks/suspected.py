"""What follows from a suspected mistake of the user: an error or a warning. All checks that name a mistake decide here.

It is an error only where the data can't be fitted as they are, and can be fitted with the mistake corrected. Otherwise it is a
warning, and the data are used as they are: a large effect, or a nominal robot that is far off, can look like a mistake.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence

import numpy as np

from gtpin.calibration.fit_state import FitState
from gtpin.data import Dataset
from gtpin.errors import ConvergenceError, DatasetError, warn
from gtpin.model.departures import with_zeros
from gtpin.typing import Floats, Mask

Size = tuple[float, float]
"""Robust standard deviation of what a fit leaves: of positions, m, and of rotations, rad; 0 where there are none."""

UNCERTAIN = "(not certain"
"""Beginning of what follows a suspicion in a warning."""
NO_FIT: Size = (np.inf, np.inf)
"""Size of the residuals of a fit that fails."""
UNFIT = 10.0
"""Residuals, in units of the noise, from which data do not fit. Assumed."""
FITS = 3.0
"""Residuals, in units of the noise, up to which data fit. Assumed: effects that are not fitted make some of them."""
FAR_LOWER = 10.0
"""Factor by which a correction lowers residuals that only a mistake can make so much smaller. Assumed."""
BEYOND: Size = (1e-2, 2e-2)
"""Residuals of a fit, m and rad, that no effect of the catalogue leaves. Assumed. There `LOWER` is enough."""
LOWER = 4.0
"""The same factor for residuals `BEYOND` all effects. Assumed."""
EXACT, ABOVE = 1.1, 2.0
"""Residuals, in units of the declared noise, up to which a correction fits exactly, and above which data do not fit before it.
Assumed: an effect has another pattern than a convention of rotations, so that more would be left."""
MISFIT = 10.0
"""Size of a fit's residuals, in units of the noise, from which there is a warning. Assumed."""
STRAYED = 6.0
"""Deviation of a parameter from nominal, in units of its tolerance, and of an unknown from what is declared, in prior sigmas,
from which there is a warning. Assumed."""
NAMED = 5
"""Largest number of parameters that a warning names."""
NO_BETTER = 0.8
"""Share of the residuals that a correction leaves, from which it is no suspicion. Assumed."""
PLAUSIBLE: Size = (1e-4, 3e-4)
"""Noise of a usual instrument, m and rad, where none is declared. Assumed."""
SMALLEST: Size = (1e-6, 1e-6)
"""Smallest noise, m and rad."""


def suspect(error: DatasetError, dataset: Dataset, before: Size, after: Size, *, exact: bool = False) -> None:
    """Raise the error of a suspected mistake, or warn of it.

    ``before``, ``after``: what a fit leaves of the data as they are, and with the mistake corrected. ``exact``: whether
    residuals that fall from above the declared noise to exactly this noise are enough: for a correction with few free
    numbers that no effect looks like.

    Raises `DatasetError` if the data can't be fitted as they are, and can with the mistake corrected; not for trusted data.
    Warns: otherwise, if the correction makes the residuals smaller.
    """
    now, then = _ratios(dataset, before, after)
    beyond = any(size > most for size, most in zip(before, BEYOND, strict=True))
    certain = now > UNFIT and np.isfinite(then) and then <= max(FITS, now / (LOWER if beyond else FAR_LOWER))
    if not dataset.trusted and (certain or (exact and _exactly(dataset, before, after))):
        raise error
    left = ""
    if np.isfinite(before).all():
        if then > NO_BETTER * now:
            return
        left = f": a fit leaves {_sizes(before)} of the data as they are, {_sizes(after)} if it is so"
    warn(f"{error} {UNCERTAIN}, so that the data are used as they are{left})")


@contextlib.contextmanager
def recalled(texts: list[str]) -> Iterator[None]:
    """Context of a calibration: if it fails, the error also has the suspicions among the warnings ``texts``."""
    try:
        yield
    except (ConvergenceError, DatasetError) as error:
        suspicions = [text.partition(UNCERTAIN)[0].strip() for text in dict.fromkeys(texts) if UNCERTAIN in text]
        if not suspicions:
            raise
        hint = "; ".join([*([error.hint] if error.hint else []), f"suspected: {', '.join(suspicions)}"])
        raise type(error)(error.what, file=error.file, row=error.row, column=error.column, hint=hint) from None


def refuse(error: DatasetError, dataset: Dataset) -> None:
    """Raise the error of data that can't be fitted as they are, or only warn of it for a trusted dataset."""
    if not dataset.trusted:
        raise error
    warn(str(error))


def far_from_declared(values: Floats, names: Sequence[str]) -> str:
    """Names and values of the deviations, in prior sigmas, that are larger than `STRAYED`, the farthest first; or nothing."""
    far = np.flatnonzero(np.abs(values) > STRAYED)
    order = far[np.argsort(-np.abs(values[far]))]
    more = f" and {len(order) - NAMED} more" if len(order) > NAMED else ""
    return ", ".join(f"{names[i]} ({values[i]:+.0f})" for i in order[:NAMED]) + more


def warn_of_strayed(settled: FitState, rolled: Mask | bool = False) -> bool:
    """Warn of the geometry's parameters that are far from nominal; of joints whose zero explains it, by the zero.

    ``rolled``: (p,) parameters that may have any value. Returns whether there was a warning.
    """
    fitted, far = settled.fit.point.model.geometry, np.where(rolled, 0.0, settled.deviation)
    if not far_from_declared(far, fitted.names):
        return False
    zeros, values = zeros_off(settled), dict.fromkeys(fitted.names, 0.0)
    if zeros:  # what they do not explain
        size = dict(zip(fitted.names, settled.geometry.tolerance, strict=True))
        rows = with_zeros(fitted, _covariance(settled))
        values |= {one.name: one.value / size[one.name] for one in rows if one.name in size}
        warn(f"off by more than the tolerances explain: {zeros}")
        far = np.where(rolled, 0.0, list(values.values()))
    if strayed := far_from_declared(far, fitted.names):
        warn(f"parameters more than {STRAYED:g} tolerances from nominal: {strayed}")
    return True


def zeros_off(settled: FitState) -> str:
    """The zeros of joints that are off by more than the tolerances explain, in words; empty where there is none."""
    found = []
    for one in with_zeros(settled.fit.point.model.geometry, _covariance(settled)):
        if one.beyond:
            factor, unit = (180.0 / np.pi, "deg") if one.unit == "rad" else (1e3, "mm")
            digits = max(0, 1 - int(np.floor(np.log10(factor * one.sigma))))
            size = f"{factor * one.value:+.{digits}f} +- {factor * one.sigma:.{digits}f} {unit}"
            found.append(f"zero of {one.name.removeprefix('zero[')[:-1]} {size}")
    return ", ".join(found)


def _covariance(settled: FitState) -> Floats:
    """(p, p) covariance of the geometry's parameters."""
    size = settled.fit.point.model.geometry.tolerance
    return np.asarray(settled.final.covariance[: len(size), : len(size)] * np.outer(size, size))


def _ratios(dataset: Dataset, before: Size, after: Size) -> tuple[float, float]:
    """The larger of the two residuals in units of the noise, as the data are and with the mistake corrected."""
    declared = (dataset.instrument.position_sigma, dataset.instrument.orientation_sigma)
    noise = [
        min(usual, max(left, least)) if sigma is None else sigma
        for sigma, usual, left, least in zip(declared, PLAUSIBLE, after, SMALLEST, strict=True)
    ]
    now, then = (max(size / sigma for size, sigma in zip(sizes, noise, strict=True)) for sizes in (before, after))
    return now, then


def _exactly(dataset: Dataset, before: Size, after: Size) -> bool:
    """Whether residuals have exactly the declared noise once a mistake is corrected, and more as they are."""
    known = (dataset.instrument.position_sigma, dataset.instrument.orientation_sigma)
    seen = [(now, then, sigma) for now, then, sigma in zip(before, after, known, strict=True) if now > 0.0]
    exact = all(sigma is not None and then <= EXACT * sigma for _, then, sigma in seen)
    return exact and any(sigma is not None and now > ABOVE * sigma for now, _, sigma in seen)


def _sizes(sizes: Size) -> str:
    parts = [f"{1e3 * size:.2g} {unit}" for size, unit in zip(sizes, ("mm", "mrad"), strict=True) if size > 0.0]
    return " and ".join(parts) or "0 mm"
