"""Dense scans of what is not linear in an effect: a period, a place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.linear.evidence import Marginal, Posterior, best_scales
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.effects.effect import Effect

Floats = npt.NDArray[np.float64]

BATCH = 64
"""Settings whose displacements are held in memory at once."""
KEPT = 8_000_000
"""Numbers up to which all values' displacements are kept between scans."""
REFINED, REFINEMENTS = 13, 4
"""Settings tried around the best of the scan, and how often, each time nearer."""


@dataclass(frozen=True)
class Found:
    """The best value of an effect at a site, its sigma, its gain in log evidence, and its scale."""

    value: float
    sigma: float
    gain: float
    scale: float


@dataclass(frozen=True)
class _Displacements:
    """Whitened displacements of S values, c columns each; where all are one actuator's, without the factor of each pose.

    ``columns`` is (N, S, c) times ``factor`` (N, 6) by pose for an actuator, or (6 N, S, c) with no factor.
    """

    columns: Floats
    factor: Floats | None

    def across(self, Z: Floats) -> Floats:
        """(S c, m) inner products with Z (6 N, m)."""
        flat = self.columns.reshape(len(self.columns), -1)
        if self.factor is None:
            return np.asarray(flat.T @ Z)
        by_pose = np.einsum("nc,ncm->nm", self.factor, Z.reshape(*self.factor.shape, -1), optimize=True)
        return np.asarray(flat.T @ by_pose)

    def grams(self) -> Floats:
        """(S, c, c) inner products of each value's columns."""
        columns = self.columns
        if self.factor is not None:
            columns = columns * np.sqrt((self.factor**2).sum(axis=1))[:, None, None]
        by_setting = columns.transpose(1, 2, 0)
        return np.asarray(by_setting @ by_setting.transpose(0, 2, 1))


class Scan:
    """An effect at a site with every value that is worth a try, prepared once for all scans given other models."""

    def __init__(self, design: Design, marginal: Marginal, effect: Effect, site: str, priors: Priors = PRIORS) -> None:
        """Prepare the inner products with the geometry marginalised."""
        self.design, self.marginal, self.priors = design, marginal, priors
        self.effect, self.site = effect, site
        self.values = np.array(effect.nonlinear_values(design.situation, site))
        self._half_y = marginal.half(design.y[:, None])

    @cached_property
    def _prepared(self) -> list[tuple[_Displacements | None, Floats, Floats, Floats]]:
        """Of every batch: displacements where they are kept, their halves, Gram matrices and moments."""
        found = []
        size = len(self.design.y) // self.design.components * len(self.values) * 6
        for batch in self._batches():
            displacements = self._displacements(batch)
            found.append((displacements if size <= KEPT else None, *self._products(displacements)))
        return found

    def _batches(self) -> list[Floats]:
        return [self.values[i : i + BATCH] for i in range(0, len(self.values), BATCH)]

    def _displacements(self, values: Sequence[float] | Floats) -> _Displacements:
        bases = [self.effect.basis(self.design.situation, self.site, float(value)) for value in values]
        if bases[0].command is None:
            return _Displacements(np.stack([self.design.columns(basis) for basis in bases], axis=1), None)
        # Displacements of one actuator differ by a factor for each pose: inner products of N numbers, not of 6 N.
        columns = np.stack([basis.command[1] * basis.sigma for basis in bases if basis.command], axis=1)
        return _Displacements(columns, self.design.by_command[:, :, bases[0].command[0]])

    def _products(self, displacements: _Displacements) -> tuple[Floats, Floats, Floats]:
        """Halves (p, S, c), Gram matrices (S, c, c) and moments (S, c) with the geometry marginalised."""
        count, width = displacements.columns.shape[1:]
        half = self.marginal.lower_solve(displacements.across(self.marginal.B).T)
        halves = half.reshape(len(half), count, width)
        by_setting = halves.transpose(1, 2, 0)
        grams = displacements.grams() - by_setting @ by_setting.transpose(0, 2, 1)
        moments = displacements.across(self.design.y[:, None]) - half.T @ self._half_y
        return halves, grams, moments.reshape(count, width)

    def best(self, model: Posterior[Any], columns: Floats) -> Found:
        """Best value given a model.

        Parameters
        ----------
        model, columns
            Groups that are in already, and their (m, k) whitened displacements for coefficients of typical size.
        """
        half = self.marginal.half(columns)
        results = []
        for batch, (kept, *products) in zip(self._batches(), self._prepared, strict=True):
            displacements = kept if kept is not None or not columns.size else self._displacements(batch)
            results.append(self._gains(displacements, products, model, columns, half))
        gains, scales = (np.concatenate(r) for r in zip(*results, strict=True))
        top = int(np.argmax(gains))
        # Settings that explain as well as the best one share its evidence: the prior is spread over all that were tried.
        trials = float(np.log(len(self.values)))
        together = float(np.logaddexp.reduce(gains)) - trials
        near = self.values[[max(top - 1, 0), min(top + 1, len(self.values) - 1)]]
        if gains[top] < trials or near[0] == near[1]:
            return Found(float(self.values[top]), float(np.ptp(near)), together, float(scales[top]))
        for _ in range(REFINEMENTS):
            finer = np.linspace(near.min(), near.max(), REFINED)
            displacements = self._displacements(finer)
            fine, fine_scales = self._gains(displacements, self._products(displacements), model, columns, half)
            best = int(np.argmax(fine))
            likely = np.exp(fine - fine[best])
            sigma = float(np.sqrt((likely * (finer - finer[best]) ** 2).sum() / likely.sum()))
            step = float(finer[1] - finer[0])
            if sigma > step:
                break
            near = finer[[max(best - 2, 0), min(best + 2, REFINED - 1)]]
        gain = max(together, float(fine[best]) - trials)
        return Found(float(finer[best]), max(sigma, step / np.sqrt(12.0)), gain, float(fine_scales[best]))

    def _gains(
        self,
        displacements: _Displacements | None,
        products: Sequence[Floats],
        model: Posterior[Any],
        columns: Floats,
        half: Floats,
    ) -> tuple[Floats, Floats]:
        """(S,) gains in log evidence given a model, and the scales that give them."""
        halves, grams, moments = products
        count, width = moments.shape
        if columns.size and displacements is not None:
            across = displacements.across(columns) - halves.reshape(len(halves), -1).T @ half
            moments = moments - (across @ model.mean).reshape(count, width)
            by_setting = across.reshape(count, width, -1)
            grams = grams - by_setting @ model.covariance @ by_setting.transpose(0, 2, 1)
        return best_scales(grams, moments, self.effect.core, self.priors)
