"""Dense scans of what is not linear in an effect: a period, a place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import Marginal, best_scale
from gtpin.effects.effect import Effect

Floats = npt.NDArray[np.float64]

BATCH = 64
"""Settings whose displacements are held in memory at once."""
REFINED = 21
"""Settings tried around the best of the scan."""


@dataclass(frozen=True)
class Found:
    """The best setting of an effect at a site: its gain in log evidence, the trials paid for, and its scale."""

    setting: float
    gain: float
    scale: float


def scan(design: Design, marginal: Marginal, y: Floats, effect: Effect, site: str) -> Found | None:
    """Best setting beside what a marginal holds (geometry, and a model's groups); None where there is none to try.

    Parameters
    ----------
    marginal
        Of the geometry and of the model so far.
    y
        (m,) whitened residual.
    """
    settings = np.array(effect.settings(design.situation, site))
    if not settings.size:
        return None
    half_y = marginal.half(y[:, None])[:, 0]
    gains, scales = _gains(design, marginal, y, half_y, effect, site, settings)
    best = int(np.argmax(gains))
    near = settings[[max(best - 1, 0), min(best + 1, len(settings) - 1)]]
    fine = np.linspace(near.min(), near.max(), REFINED)
    fine_gains, fine_scales = _gains(design, marginal, y, half_y, effect, site, fine)
    # Settings that explain as well as the best one share its evidence: the prior is spread over all that were tried.
    top = int(np.argmax(fine_gains))
    together = float(np.logaddexp.reduce(gains)) - np.log(len(settings))
    alone = float(fine_gains[top]) - np.log(len(settings))
    if fine_gains[top] >= gains[best]:
        return Found(float(fine[top]), max(together, alone), float(fine_scales[top]))
    return Found(float(settings[best]), together, float(scales[best]))


def _gains(
    design: Design, marginal: Marginal, y: Floats, half_y: Floats, effect: Effect, site: str, settings: Floats
) -> tuple[Floats, Floats]:
    gains, scales = np.empty(len(settings)), np.empty(len(settings))
    for start in range(0, len(settings), BATCH):
        batch = settings[start : start + BATCH]
        grams, moments = _products(design, marginal, y, half_y, effect, site, batch)
        values, vectors = np.linalg.eigh(grams)
        along = np.einsum("sij,si->sj", vectors, moments)
        for i in range(len(batch)):
            gains[start + i], scales[start + i] = best_scale(np.maximum(values[i], 0.0), along[i] ** 2)
    return gains, scales


def _products(
    design: Design, marginal: Marginal, y: Floats, half_y: Floats, effect: Effect, site: str, settings: Floats
) -> tuple[Floats, Floats]:
    """(S, c, c) Gram matrices and (S, c) moments of an effect's displacements at each setting."""
    bases = [effect.basis(design.situation, site, float(setting)) for setting in settings]
    width = len(bases[0])
    if bases[0].command is None:
        X = np.hstack([design.columns(basis) for basis in bases])
        half = marginal.half(X)
        whole = X.reshape(len(X), len(bases), width)
        grams = np.einsum("nsi,nsj->sij", whole, whole, optimize=True)
        moments = X.T @ y - half.T @ half_y
    else:
        # Displacements of one actuator differ by a factor for each pose: inner products of N numbers, not of 6 N.
        f = np.stack([basis.command[1] * basis.sigma for basis in bases if basis.command], axis=1)
        a = design.by_command[:, :, bases[0].command[0]]
        flat = f.reshape(len(f), -1)
        by_pose = np.einsum("nci,nc->ni", marginal.B.reshape(*a.shape, -1), a, optimize=True)
        half = marginal.lower_solve(by_pose.T @ flat)
        grams = np.einsum("nsi,n,nsj->sij", f, (a**2).sum(axis=1), f, optimize=True)
        moments = flat.T @ np.einsum("nc,nc->n", a, y.reshape(a.shape)) - half.T @ half_y
    halves = half.reshape(len(half), len(bases), width)
    grams = grams - np.einsum("psi,psj->sij", halves, halves, optimize=True)
    return grams, moments.reshape(len(bases), width)
