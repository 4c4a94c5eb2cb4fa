"""Dense scans of what is not linear in an effect: a period, a place."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
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
KEPT = 12_000_000
"""Numbers up to which all values' displacements are kept between scans, and up to which their products with groups are."""
LEAST = -1e9
"""Gain of a value that is left out."""
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
class _Products:
    """Inner products of S values, c columns each, with the geometry marginalised.

    Parameters
    ----------
    halves
        (p, S c) what the geometry absorbs of them.
    grams
        (S, c, c) with themselves.
    moments
        (S, c) with the residual.
    """

    halves: Floats
    grams: Floats
    moments: Floats


class Scan:
    """An effect at a site with every value that is worth a try, prepared once for all scans given other models.

    Whitened displacements are (R, S, c): S values, c columns each. They have a row for each measured number, or, where one
    actuator moves, a row for each pose, since rows of a pose then differ by a factor only.
    """

    def __init__(self, design: Design, marginal: Marginal, effect: Effect, site: str, priors: Priors = PRIORS) -> None:
        """Prepare the inner products with the geometry marginalised."""
        self.design, self.marginal, self.priors = design, marginal, priors
        self.effect, self.site = effect, site
        self.values = np.array(effect.nonlinear_values(design.situation, site))
        self._half_y = marginal.half(design.y[:, None])
        moved = effect.basis(design.situation, site, float(self.values[0])).command
        self._factor = None if moved is None else design.by_command[:, :, moved[0]]
        self._with_groups: dict[Hashable, Floats] = {}

    def _displacements(self, values: Sequence[float] | Floats) -> Floats:
        bases = [self.effect.basis(self.design.situation, self.site, float(value)) for value in values]
        if self._factor is None:
            return np.stack([self.design.columns(basis) for basis in bases], axis=1)
        return np.stack([basis.command[1] * basis.sigma for basis in bases if basis.command], axis=1)

    def _seen(self, Z: Floats) -> Floats:
        """(R, m) of columns Z (N c, m), by which products with displacements are taken."""
        if self._factor is None:
            return Z
        return np.asarray(np.einsum("nc,ncm->nm", self._factor, Z.reshape(*self._factor.shape, -1), optimize=True))

    def _products(self, displacements: Floats) -> _Products:
        count, width = displacements.shape[1:]
        flat = displacements.reshape(len(displacements), -1)
        halves = self.marginal.lower_solve((flat.T @ self._seen_geometry).T)
        sized = displacements
        if self._factor is not None:
            sized = displacements * np.sqrt((self._factor**2).sum(axis=1))[:, None, None]
        by_value, absorbed = sized.transpose(1, 2, 0), halves.reshape(-1, count, width).transpose(1, 2, 0)
        grams = by_value @ by_value.transpose(0, 2, 1) - absorbed @ absorbed.transpose(0, 2, 1)
        moments = flat.T @ self._seen(self.design.y[:, None]) - halves.T @ self._half_y
        return _Products(halves, grams, moments.reshape(count, width))

    @cached_property
    def _seen_geometry(self) -> Floats:
        return self._seen(self.marginal.B)

    @cached_property
    def _batches(self) -> list[Floats]:
        return [self.values[i : i + BATCH] for i in range(0, len(self.values), BATCH)]

    @cached_property
    def _prepared(self) -> tuple[list[Floats] | None, _Products]:
        """Displacements of every batch where they are kept, and the products of all values."""
        kept, found = [], []
        for batch in self._batches:
            displacements = self._displacements(batch)
            found.append(self._products(displacements))
            if displacements.size * len(self.values) <= KEPT * len(batch):
                kept.append(displacements)
        halves = np.hstack([part.halves for part in found])
        grams, moments = (np.concatenate([getattr(part, name) for part in found]) for name in ("grams", "moments"))
        return kept or None, _Products(halves, grams, moments)

    def _across(self, model: Posterior[Any], columns: Floats) -> Floats:
        """(S c, m) products of all values with a model's groups, the geometry marginalised; computed once for each group."""
        ends = np.cumsum(model.widths)
        places = {t: slice(end - w, end) for t, w, end in zip(model.terms, model.widths, ends, strict=True)}
        if new := [term for term in places if term not in self._with_groups]:
            Z = np.hstack([columns[:, places[term]] for term in new])
            kept, products = self._prepared
            seen = self._seen(Z)
            batches = kept or map(self._displacements, self._batches)
            found = np.vstack([part.reshape(len(part), -1).T @ seen for part in batches])
            found -= products.halves.T @ self.marginal.half(Z)
            parts = np.split(found, np.cumsum([model.widths[model.terms.index(term)] for term in new])[:-1], axis=1)
            self._with_groups |= {term: part.copy() for term, part in zip(new, parts, strict=True)}
        used = {term: self._with_groups.pop(term) for term in model.terms}
        self._with_groups |= used  # the latest last
        while sum(part.size for part in self._with_groups.values()) > KEPT and len(self._with_groups) > len(used):
            del self._with_groups[next(iter(self._with_groups))]
        return np.hstack(list(used.values()))

    def best(self, model: Posterior[Any], columns: Floats, others: Sequence[float] = ()) -> Found:
        """Best value given a model.

        Parameters
        ----------
        model, columns
            Groups that are in already, and their (m, k) whitened displacements for coefficients of typical size. A group's
            displacements must be the same in every call.
        others
            Values of the same cause that are in already: those that can't be told from them are left out.
        """
        products = self._prepared[1]
        gains, scales = self._gains(products, model, self._across(model, columns) if model.terms else None)
        gains = np.where(self._resolved(self.values, others), gains, LEAST)
        top = int(np.argmax(gains))
        # Settings that explain as well as the best one share its evidence: the prior is spread over all that were tried.
        trials = float(np.log(len(self.values)))
        together = float(np.logaddexp.reduce(gains)) - trials
        near = self.values[[max(top - 1, 0), min(top + 1, len(self.values) - 1)]]
        if gains[top] < trials or near[0] == near[1]:
            return Found(float(self.values[top]), float(np.ptp(near)), together, float(scales[top]))
        seen, half = self._seen(columns), self.marginal.half(columns)
        for _ in range(REFINEMENTS):
            finer = np.linspace(near.min(), near.max(), REFINED)
            displacements = self._displacements(finer)
            products = self._products(displacements)
            across = displacements.reshape(len(displacements), -1).T @ seen - products.halves.T @ half
            fine, fine_scales = self._gains(products, model, across if model.terms else None)
            fine = np.where(self._resolved(finer, others), fine, LEAST)
            best = int(np.argmax(fine))
            likely = np.exp(fine - fine[best])
            sigma = float(np.sqrt((likely * (finer - finer[best]) ** 2).sum() / likely.sum()))
            step = float(finer[1] - finer[0])
            if sigma > step:
                break
            near = finer[[max(best - 2, 0), min(best + 2, REFINED - 1)]]
        gain = max(together, float(fine[best]) - trials)
        return Found(float(finer[best]), max(sigma, step / np.sqrt(12.0)), gain, float(fine_scales[best]))

    def _resolved(self, values: Floats, others: Sequence[float]) -> npt.NDArray[np.bool_]:
        return self.effect.resolved(self.design.situation, self.site, values, others)

    def _gains(self, products: _Products, model: Posterior[Any], across: Floats | None) -> tuple[Floats, Floats]:
        """(S,) gains in log evidence given a model, and the scales that give them."""
        grams, moments = products.grams, products.moments
        if across is not None:
            moments = moments - (across @ model.mean).reshape(moments.shape)
            by_value = across.reshape(*moments.shape, -1)
            grams = grams - by_value @ model.covariance @ by_value.transpose(0, 2, 1)
        return best_scales(grams, moments, self.effect.core, self.priors)
