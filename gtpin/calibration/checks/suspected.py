"""What follows from a suspected mistake of the user: an error or a warning. All checks that name a mistake decide here.

It is an error only where the data can't be fitted as they are, and can be fitted with the mistake corrected. Otherwise it is a
warning, and the data are used as they are: a large effect, or a nominal robot that is far off, can look like a mistake.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence

import numpy as np

from gtpin.calibration.checks import limits
from gtpin.calibration.fit_state import FitState
from gtpin.data import Dataset
from gtpin.data.plausible import named_poses
from gtpin.errors import ConvergenceError, DatasetError, listed, warn
from gtpin.model.departures import ParameterOrZero, with_zeros
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats, Mask

Size = tuple[float, float]
"""Robust standard deviation of what a fit leaves: of positions, m, and of rotations, rad; 0 where there are none."""
UNCERTAIN = "(not certain"
"""Beginning of what follows a suspicion in a warning."""
GROSS = "set aside as gross errors: "
"""Beginning of a warning of rows that are not used: causes that a diagnosis finds can explain some of them."""
UNEXPLAINED = "the geometry does not explain these data"
"""What a warning of a calibration says that is no longer true where causes explain the data."""
NO_FIT: Size = (np.inf, np.inf)
"""Size of the residuals of a fit that fails."""


def suspect(error: DatasetError, dataset: Dataset, before: Size, after: Size, *, exact: bool = False) -> None:
    """Raise the error of a suspected mistake, or warn of it.

    ``before``, ``after``: what a fit leaves of the data as they are, and with the mistake corrected. ``exact``: whether
    residuals that fall from above twice the declared noise to exactly this noise (at most 1.1 times) are enough: for a
    correction with few free numbers that no effect looks like. An effect has another pattern, so that more would be left.

    Raises `DatasetError` if the data can't be fitted as they are (more than 10 times the noise is left), and can with the
    mistake corrected (3 times at most, for effects that are not fitted, or a tenth, which only a mistake can; a fourth, where
    no effect leaves what is left); not for trusted data. All these factors are assumed.
    Warns: otherwise, if the correction makes the residuals smaller by a fifth.
    """
    known = (dataset.instrument.position_sigma, dataset.instrument.orientation_sigma)
    noise = [
        min(usual, max(left, least)) if sigma is None else sigma
        for sigma, usual, left, least in zip(known, limits.USUAL_NOISE, after, (1e-6, 1e-6), strict=True)
    ]
    now, then = (max(size / sigma for size, sigma in zip(sizes, noise, strict=True)) for sizes in (before, after))
    beyond = any(size > most for size, most in zip(before, limits.NO_EFFECT, strict=True))
    certain = now > 10.0 and np.isfinite(then) and then <= max(3.0, now / (4.0 if beyond else 10.0))
    if exact and not certain:
        seen = [(b / s, a / s) if s else (0.0, np.inf) for b, a, s in zip(before, after, known, strict=True) if b > 0.0]
        certain = all(left <= 1.1 for _, left in seen) and any(size > 2.0 for size, _ in seen)
    if certain and not dataset.trusted:
        raise error
    left = ""
    if np.isfinite(before).all():
        if then > 0.8 * now:
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
        if suspicions:
            error.hint = "; ".join(filter(None, (error.hint, f"suspected: {', '.join(suspicions)}")))
        raise


def refuse(error: DatasetError, dataset: Dataset, *, sure: bool = True) -> None:
    """Raise the error of data that can't be fitted as they are; only warn if that is not ``sure``, or the data are trusted."""
    if sure and not dataset.trusted:
        raise error
    warn(str(error))


def gross_errors(dataset: Dataset, aside: Mask) -> str:
    """The warning of the rows (N,) that are set aside as gross errors; empty where there is none."""
    if not aside.any():
        return ""
    counted = f"{np.count_nonzero(aside):,} of {len(dataset):,} rows, of "
    several = not dataset.readings.names and len(set(dataset.pose)) < len(dataset)
    return f"{GROSS}{counted if several else ''}{named_poses(dataset, aside)}"


def true_of_causes(texts: Sequence[str], gross: str, *, explained: bool) -> list[str]:
    """The warnings of a calibration and of a diagnosis of the same data that are true of the fit with the causes.

    ``gross``: the warning of the rows that this fit sets aside; empty where there is none. ``explained``: whether it
    explains the data.
    """
    kept = [text for text in texts if not (text.startswith(GROSS) or (explained and UNEXPLAINED in text))]
    return [*kept, *([gross] if gross else [])]


def far_from_declared(values: Floats, names: Sequence[str], unit: str) -> str:
    """Names and values of the deviations, in prior sigmas, above `limits.FAR_FROM_PRIOR`, the farthest first; or nothing.

    ``unit``: what a prior sigma is called.
    """
    far = np.flatnonzero(np.abs(values) > limits.FAR_FROM_PRIOR)
    order = far[np.argsort(-np.abs(values[far]))]
    return listed([f"{names[i]} ({values[i]:+.0f} {unit})" for i in order], limits.NAMED)


def about_track(geometry: Geometry) -> Mask:
    """(p,) rotations of measured tracks about themselves: they depend on where targets were on carts, and are no errors."""
    return np.array([p.kind == "track_direction" and p.component == 2 for p in geometry.parameters], dtype=bool)


def warn_of_far_parameters(settled: FitState, tolerance: Floats, told: bool = False) -> None:
    """Warn of the geometry's parameters that are far from nominal; of joints whose zero explains it, by the zero.

    ``tolerance``: (p,) unit of the deviations, before tolerances were widened. ``told``: whether the zeros are told already.
    """
    fitted = settled.fit.point.model.geometry
    anywhere = about_track(fitted)
    far = np.where(anywhere, 0.0, fitted.deviation / tolerance)
    if not far_from_declared(far, fitted.names, "tolerances"):
        return
    zeros, values = zeros_off(settled), dict.fromkeys(fitted.names, 0.0)
    if zeros:  # what they do not explain
        size = dict(zip(fitted.names, tolerance, strict=True))
        rows = with_zeros(fitted, _covariance(settled))
        values |= {one.name: one.value / size[one.name] for one in rows if one.name in size}
        if not told:
            warn(f"off by more than the tolerances explain: {zeros}")
        far = np.where(anywhere, 0.0, list(values.values()))
    if names := far_from_declared(far, fitted.names, "tolerances"):
        farthest = names.partition(" (")[0]
        warn(
            f"parameters more than {limits.FAR_FROM_PRIOR:g} tolerances from nominal: {names}; where a part can be so far off, "
            f"let the data alone determine it (gtpin calibrate --free '{farthest}'), or write its tolerance under [tolerance] "
            "in dataset.toml"
        )


def zeros_off(settled: FitState) -> str:
    """The zeros of joints that are off by more than the tolerances explain, in words; empty where there is none."""
    found = []
    for one in zeros_beyond(settled):
        factor, unit = (180.0 / np.pi, "deg") if one.unit == "rad" else (1e3, "mm")
        digits = max(0, 1 - int(np.floor(np.log10(factor * one.sigma))))
        size = f"{factor * one.value:+.{digits}f} +- {factor * one.sigma:.{digits}f} {unit}"
        found.append(f"zero of {one.name.removeprefix('zero[')[:-1]} {size}")
    return ", ".join(found)


def zeros_beyond(settled: FitState) -> list[ParameterOrZero]:
    """The zeros of joints that are off by more than the tolerances explain."""
    return [one for one in with_zeros(settled.fit.point.model.geometry, _covariance(settled)) if one.beyond]


def _covariance(settled: FitState) -> Floats:
    """(p, p) covariance of the geometry's parameters."""
    size = settled.fit.point.model.geometry.tolerance
    return np.asarray(settled.final.covariance[: len(size), : len(size)] * np.outer(size, size))


def _sizes(sizes: Size) -> str:
    parts = [f"{1e3 * size:.2g} {unit}" for size, unit in zip(sizes, ("mm", "mrad"), strict=True) if size > 0.0]
    return " and ".join(parts) or "0 mm"
