"""Dense scans of an effect's nonlinear parameter (a period, a place), and the chance that scatter shows a line."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import betaincc

from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import Groups, Posterior, best_scales
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.effects.effect import Effect
from gtpin.typing import Floats

BATCH = 64
"""Number of values whose displacements are in memory at the same time."""
LIKELY = 0.2
"""All values are first compared by their cores alone; only values whose gain is at least this share of the largest are then
computed with their modulation. Assumed: less than ``ALIKE``, as other maxima are compared, too; at their typical sizes
modulations have at most 0.2 (periods) and 0.6 (steps) of the core's power."""
MOST_KEPT = 12_000_000
"""Most numbers in the displacements of all values that are kept between scans; and in their products with groups, likewise."""
NO_GAIN = -1e9
"""Gain of a value that is left out, and of a scan in which all are."""
REFINED, REFINEMENTS = 19, 4
"""Number of values tried around the best of the scan, and number of repetitions, each on a grid of a third of the step."""
COARSE = 0.7
"""Standard deviation over step of a grid that is fine enough for it. Derived: sums over such a grid differ from integrals of a
normal density by exp(-2 pi^2 0.7^2) = 6e-5, and the grid before it, of three times the step, left 4.3 standard deviations."""


SLOPE = 1e-5
"""Relative step of a value for slopes by differences."""
ALIKE = 0.3
"""Smallest gain of another maximum, relative to the best value's, for which both are added together. Derived: a line
explains up to 0.047 of another one's power where commands are spread evenly (the largest side lobe of a rectangular window);
0.3 leaves room for uneven ones."""


@dataclass(frozen=True)
class BestValue:
    """The best value of an effect at a site.

    - ``value``, ``sigma``: the value, and its standard deviation.
    - ``gain``: gain in log evidence.
    - ``others``: other maxima of the gain, each as (value, sigma, gain), with gains of at least ``ALIKE`` times the best
      one.
    """

    value: float
    sigma: float
    gain: float
    others: tuple[tuple[float, float, float], ...] = ()


@dataclass(frozen=True)
class _InnerProducts:
    """Inner products of S values, c columns each, with the geometry marginalised.

    ``halves``: (p, S c) their :meth:`Marginal.half`. ``grams``: (S, c, c) of each value with itself. ``moments``: (S, c)
    with the residual.
    """

    halves: Floats
    grams: Floats
    moments: Floats


class Scan:
    """An effect at a site with all values that are tried, prepared once for all scans with different models.

    Whitened displacements are (S, c, R): S values, c columns each. R is the number of measured numbers; where the effect moves
    one actuator only, it is the number of poses, since the numbers of a pose are then in fixed proportions. The numbers of one
    column are next to each other in memory, as products need them.
    """

    def __init__(self, design: Design, groups: Groups[Any], effect: Effect, site: str, priors: Priors = PRIORS) -> None:
        """Prepare the inner products with the geometry marginalised; ``groups`` has the groups of all models."""
        self.design, self.groups, self.marginal, self.priors = design, groups, groups.marginal, priors
        self.effect, self.site = effect, site
        self.values = np.array(effect.nonlinear_values(design.operating_points, site))
        self._core = list(effect.core) or slice(None)
        self._half_y = self.marginal.half(design.y[:, None])
        moved = effect.basis(design.operating_points, site, float(self.values[0])).command
        self._factor = None if moved is None else design.by_command[:, :, moved[0]]
        self._size = None if self._factor is None else np.sqrt((self._factor**2).sum(axis=1))
        self._seen_y, self._seen_geometry = self._seen(design.y[:, None]), self._seen(self.marginal.absorbed)
        self._with_groups: dict[Hashable, Floats] = {}
        self._seen_groups: dict[Hashable, Floats] = {}
        self._together: tuple[tuple[Hashable, ...], Floats, Floats] | None = None

    def _displacements(self, values: Sequence[float] | Floats, columns: list[int] | slice = slice(None)) -> Floats:
        """(S, c, R) displacements for some values; ``columns``: only these of each."""
        bases = self.effect.bases(self.design.operating_points, self.site, values)
        if self._factor is None:
            return np.stack([self.design.columns(basis).T[columns] for basis in bases])
        moved = ((basis.command[1].T[columns], basis.sigma[columns]) for basis in bases if basis.command)
        return np.stack([travel * sigma[:, None] for travel, sigma in moved])

    def _seen(self, Z: Floats) -> Floats:
        """(R, m) form of columns Z (N c, m) in which inner products with displacements are computed."""
        if self._factor is None:
            return Z
        return np.asarray(np.einsum("nc,ncm->nm", self._factor, Z.reshape(*self._factor.shape, -1), optimize=True))

    def _products(self, displacements: Floats) -> _InnerProducts:
        count, width, size = displacements.shape
        flat = displacements.reshape(-1, size)
        halves = (flat @ self._seen_geometry).T
        sized = displacements if self._size is None else displacements * self._size
        absorbed = halves.T.reshape(count, width, -1)
        grams = sized @ sized.transpose(0, 2, 1) - absorbed @ absorbed.transpose(0, 2, 1)
        moments = flat @ self._seen_y - halves.T @ self._half_y
        return _InnerProducts(halves, grams, moments.reshape(count, width))

    @cached_property
    def _batches(self) -> list[Floats]:
        return [self.values[i : i + BATCH] for i in range(0, len(self.values), BATCH)]

    @cached_property
    def _cores(self) -> tuple[Floats | None, _InnerProducts]:
        """Displacements (S, k, R) of the cores of all values where they are kept, and their products."""
        kept, found = [], []
        for batch in self._batches:
            cores = self._displacements(batch, self._core)
            found.append(self._products(cores))
            if cores.size * len(self.values) <= MOST_KEPT * len(batch):
                kept.append(cores)
        halves = np.hstack([part.halves for part in found])
        grams, moments = (np.concatenate([getattr(part, name) for part in found]) for name in ("grams", "moments"))
        return np.concatenate(kept) if kept else None, _InnerProducts(halves, grams, moments)

    def _cores_across(self, model: Posterior[Any]) -> Floats:
        """(S, k, m) inner products of the cores of all values with a model's groups, the geometry marginalised; computed once
        for each group."""
        parts = self._parts(model)
        if new := [part for part in parts if part not in self._with_groups]:
            kept, products = self._cores
            seen = np.hstack([self._seen_groups[part] for part in new])
            anew = (self._displacements(batch, self._core) for batch in self._batches)
            found = np.vstack([some.reshape(-1, len(seen)) @ seen for some in (anew if kept is None else (kept,))])
            found -= products.halves.T @ np.hstack([self.groups.half(part) for part in new])
            ends = np.cumsum([self.groups.width(part) for part in new])
            self._with_groups |= {
                part: some.copy() for part, some in zip(new, np.split(found, ends[:-1], axis=1), strict=True)
            }
        used = {part: self._with_groups.pop(part) for part in dict.fromkeys(parts)}
        self._with_groups |= used  # the latest last
        while sum(part.size for part in self._with_groups.values()) > MOST_KEPT and len(self._with_groups) > len(used):
            del self._with_groups[next(iter(self._with_groups))]
        return np.hstack([used[part] for part in parts]).reshape(*self._cores[1].moments.shape, -1)

    def _parts(self, model: Posterior[Any]) -> tuple[Hashable, ...]:
        """The groups of a model, joined groups being divided into their parts; their columns are prepared."""
        parts = tuple(part for term in model.terms for part in self.groups.parts(term))
        self._seen_groups = {
            part: self._seen_groups[part] if part in self._seen_groups else self._seen(self.groups.columns(part))
            for part in parts
        }
        return parts

    def _side_by_side(self, model: Posterior[Any]) -> tuple[Floats, Floats]:
        """(R, m) columns of a model's groups for inner products, and their (p, m) halves; kept for the next call."""
        parts = self._parts(model)
        if self._together is None or self._together[0] != parts:
            seen = np.hstack([self._seen_groups[part] for part in parts])
            self._together = parts, seen, np.hstack([self.groups.half(part) for part in parts])
        return self._together[1:]

    def best(self, model: Posterior[Any], others: Sequence[float] = ()) -> BestValue:
        """Best value given a model.

        ``model``: the model to which the effect is added. ``others``: values of the same cause that the model already has:
        values that can't be distinguished from them are left out. Where no value is left, the gain is ``NO_GAIN`` and the
        value means nothing.
        """
        gains = self._all_gains(model, self.resolved(self.values, others))
        top = int(np.argmax(gains))
        if gains[top] <= NO_GAIN:
            return BestValue(float(self.values[top]), 0.0, NO_GAIN)
        # Settings that explain as well as the best one share its evidence: the prior is spread over all that were tried.
        trials = float(np.log(len(self.values)))
        together = float(np.logaddexp.reduce(gains)) - trials
        near = self.values[[max(top - 2, 0), min(top + 2, len(self.values) - 1)]]
        if gains[top] < trials or near[0] == near[1]:
            return BestValue(float(self.values[top]), float(np.ptp(near)) / 2.0, together)
        found = self._refined(model, others, near)
        gain = max(together, found.gain - trials)
        return BestValue(found.value, found.sigma, gain, self._maxima(gains, top, others))

    def near(self, model: Posterior[Any], value: float, others: Sequence[float] = ()) -> BestValue:
        """Best value given a model, within about one step of the scan from ``value``; ln(number of values) is taken off its
        gain, which is less than ``NO_GAIN`` where no value is left.

        ``model``, ``others``: as in :meth:`best`.
        """
        ordered = np.sort(self.values)
        at = int(np.searchsorted(ordered, value))
        around = ordered[[max(at - 2, 0), min(at + 1, len(ordered) - 1)]]
        found = self._refined(model, others, around)
        return BestValue(found.value, found.sigma, found.gain - float(np.log(len(ordered))))

    def improved(self, model: Posterior[Any], values: Sequence[float], first: int) -> tuple[Floats, Floats]:
        """(L,) for each value of the effect in a model, the best value given all others, to first order, and (L,) its standard
        deviation.

        With the model's columns X, M = 1 + B B', and the mean c and the covariance C of its coefficients, the log evidence has
        the slope c' X_l,v' M^-1 (y - X c) - tr(X_l,v' M^-1 X C_l) by value v of columns X_l, and the negative second derivative
        c' X_l,v' (M^-1 - M^-1 X C X' M^-1) X_l,v c, at fixed scales.

        ``values``: of the model. ``first``: index of the first coefficient of the first one; they follow each other.
        """
        step = SLOPE * np.asarray(values)
        above, below = (self._displacements(np.asarray(values) + way * step) for way in (1.0, -1.0))
        slopes = (above - below) / (2.0 * step[:, None, None])
        products, (seen, halves) = self._products(slopes), self._side_by_side(model)
        count, width = products.moments.shape
        own = slice(first, first + count * width)
        across = slopes.reshape(-1, slopes.shape[2]) @ seen - products.halves.T @ halves
        c = model.mean[own].reshape(count, width)
        score = (c * (products.moments - (across @ model.mean).reshape(count, width))).sum(axis=1)
        score -= (across * model.covariance[own]).sum(axis=1).reshape(count, width).sum(axis=1)
        along = (c[:, :, None] * across.reshape(count, width, -1)).sum(axis=1)
        information = ((c[:, None, :] @ products.grams)[:, 0] * c).sum(axis=1)
        information -= ((along @ model.covariance) * along).sum(axis=1)
        information = np.maximum(information, 1e-300)
        return np.asarray(values) + score / information, 1.0 / np.sqrt(information)

    def step(self, value: float) -> float:
        """Step of the scan at a value."""
        ordered = np.sort(self.values)
        at = int(np.clip(np.searchsorted(ordered, value), 1, len(ordered) - 1))
        return float(ordered[at] - ordered[at - 1])

    def _refined(self, model: Posterior[Any], others: Sequence[float], near: Floats) -> BestValue:
        """The best value between two values, on successively finer grids: the posterior mean, or the best of the last."""

        def gains_at(values: Floats) -> Floats:
            return np.where(self.resolved(values, others), self._gains_at(values, model), NO_GAIN)

        for _ in range(REFINEMENTS):
            finer = np.linspace(near.min(), near.max(), REFINED)
            gains = gains_at(finer)
            best = int(np.argmax(gains))
            likely = np.exp(gains - gains[best])
            likely /= likely.sum()
            value = float(likely @ finer)
            sigma, step = float(np.sqrt(likely @ (finer - value) ** 2)), float(finer[1] - finer[0])
            if sigma > COARSE * step:
                break
            near = finer[[max(best - 3, 0), min(best + 3, REFINED - 1)]]
        (gain,) = gains_at(np.array([value]))
        if gain < gains[best] - 0.5:  # more than a sigma off: the mean of several maxima, as of places, is none of them
            value, gain = float(finer[best]), gains[best]
            sigma = float(np.sqrt(likely @ (finer - value) ** 2))
        return BestValue(value, max(sigma, step / np.sqrt(12.0)), float(gain))

    def _maxima(self, gains: Floats, top: int, others: Sequence[float]) -> tuple[tuple[float, float, float], ...]:
        """Other maxima of the gain over all values, the largest first; values that can't be distinguished from them are left
        out."""
        if self.effect.most_values < 2:
            return ()
        trials = float(np.log(len(gains)))
        least, found = max(ALIKE * float(gains[top]), trials), list(others)
        around = np.pad(gains, 1, constant_values=-np.inf)
        peaks = (gains >= around[:-2]) & (gains >= around[2:])
        left = np.where((gains >= least) & peaks, gains, NO_GAIN)
        result: list[tuple[float, float, float]] = []
        left[top] = NO_GAIN
        found.append(float(self.values[top]))
        while True:
            left = np.where(self.resolved(self.values, found), left, NO_GAIN)
            at = int(np.argmax(left))
            if left[at] < least:
                return tuple(result)
            near = self.values[[max(at - 1, 0), min(at + 1, len(gains) - 1)]]
            found.append(float(self.values[at]))
            result.append((found[-1], float(np.ptp(near)), float(left[at]) - trials))
            left[at] = NO_GAIN

    def resolved(self, values: Floats, others: Sequence[float]) -> npt.NDArray[np.bool_]:
        """(S,) which values an effect of a user's own or the catalogue distinguishes; never one that the model has already."""
        found = self.effect.resolved(self.design.operating_points, self.site, values, others)
        return np.asarray(found & ~np.isin(values, others))

    def _all_gains(self, model: Posterior[Any], wanted: npt.NDArray[np.bool_]) -> Floats:
        """(S,) gains of the values that are ``wanted``, ``NO_GAIN`` for others and where the core gains little."""
        whole = self._core == slice(None)
        gains = self._gains(self._cores[1], model, self._cores_across(model) if model.terms else None, not whole)
        if whole or not wanted.any():
            return np.where(wanted, gains, NO_GAIN)
        top = gains[wanted].max()
        likely = wanted & (gains >= min(LIKELY * top, top))
        likely[1:-1] |= likely[:-2] | likely[2:]
        some = np.flatnonzero(likely & wanted)
        gains = np.full(len(gains), NO_GAIN)
        for batch in np.array_split(some, -(-len(some) // BATCH)):
            gains[batch] = self._gains_at(self.values[batch], model)
        return gains

    def _gains_at(self, values: Floats, model: Posterior[Any]) -> Floats:
        """(S,) gains of some values with their modulations."""
        displacements = self._displacements(values)
        products = self._products(displacements)
        if not model.terms:
            return self._gains(products, model, None)
        seen, halves = self._side_by_side(model)
        across = displacements.reshape(-1, len(seen)) @ seen - products.halves.T @ halves
        return self._gains(products, model, across.reshape(*products.moments.shape, -1))

    def _gains(
        self, products: _InnerProducts, model: Posterior[Any], across: Floats | None, rough: bool = False
    ) -> Floats:
        """(S,) gains in log evidence given a model, at the best scales; ``rough``: to single precision, in half the time."""
        grams, moments = products.grams, products.moments
        if across is not None:
            moments = moments - across @ model.mean
            kind: npt.DTypeLike = np.float32 if rough else np.float64
            across, covariance = across.astype(kind, copy=False), model.covariance.astype(kind, copy=False)
            # One product of all values with the covariance: one after the other takes twice as long.
            fitted = (across.reshape(-1, len(model.mean)) @ covariance).reshape(across.shape)
            grams = grams - fitted @ across.transpose(0, 2, 1)
        return best_scales(grams, moments, self.effect.core, self.priors)[0]


FOLDS = 5
"""Number of parts of the commands that are left out in turn to see whether lines hold at commands that did not choose them."""
LEAST_SEEN = 1e-6
"""Smallest whitened motion by a drive, relative to the largest, of a row that shows the drive: it avoids a division by 0."""


@dataclass(frozen=True)
class FittedLines:
    """Errors of one drive at its different commands, and the lines that were fitted to them.

    ``errors``, ``variance``: (n,) errors that the geometry and the other causes leave, m or rad: the mean of the visits of a
    command; and their variance by the noise. ``lines``: for each line its (n, p) deviations of the travel less what the
    geometry and the other causes fit of them, m or rad. ``tried``: number of periods that were tried.
    ``effective_parameters``: effective number of the errors that the geometry and the other causes fit: this many are
    missing in what is left. ``command``: (n,) the drive's own commands, m or rad.
    """

    errors: Floats
    variance: Floats
    lines: tuple[Floats, ...]
    tried: int
    effective_parameters: float = 0.0
    command: Floats = field(default_factory=lambda: np.zeros(0))

    @staticmethod
    def of(design: Design, others: Floats, lines: Sequence[Floats], site: str, tried: int) -> FittedLines:
        """The errors of the drive at ``site`` that the geometry and other causes leave, and the lines of its periodic error.

        What the geometry and the other causes fit of the lines is subtracted. Flexible causes of the drive fit scatter, too;
        without the subtraction, less scatter would be left, and the lines would look significant.

        ``others``: (N c, m) whitened displacements of the other causes, for coefficients of one prior sigma. ``lines``: for
        each line its own (N c, p). ``tried``: number of periods that were tried.
        """
        index = design.operating_points.robot.sites.index(site)
        along, commands = design.by_command[:, :, index], design.operating_points.q[:, index]
        information = np.einsum("nc,nc->n", along, along)
        shown = information > LEAST_SEEN**2 * information.max()
        along, information = along[shown], information[shown]

        def moved(columns: Floats) -> Floats:
            return np.asarray(np.einsum("nc,ncm->nm", along, columns.reshape(len(shown), design.components, -1)[shown]))

        J, prior = design.beside(others)
        normal = J.T @ J + np.diag(prior)
        whole = np.column_stack([design.y, *lines])
        left = moved(whole - J @ np.linalg.solve(normal, J.T @ whole))
        fitted = moved(J) / np.sqrt(information)[:, None]
        # I - H of independent errors, H the fit's hat matrix, has tr (I - H)^2 degrees of freedom; this one has H's traces.
        hat = np.linalg.solve(normal, fitted.T @ fitted)
        same = np.unique(design.operating_points.q[shown], axis=0, return_inverse=True)[1].ravel()
        total = np.bincount(same, information)
        left = np.stack([np.bincount(same, column) for column in left.T], axis=1) / total[:, None]
        return FittedLines(
            errors=left[:, 0],
            variance=1.0 / total,
            lines=tuple(np.split(left[:, 1:], len(lines), axis=1)),
            tried=tried,
            effective_parameters=float(2.0 * np.trace(hat) - np.einsum("ij,ji->", hat, hat)),
            command=np.bincount(same, commands[shown]) / np.bincount(same),
        )

    def held(self, periods: Floats) -> float:
        """Share of the errors' power that lines explain at commands at which their periods were not chosen, over the share that
        they explain where they were.

        As many lines as there are in ``lines`` are chosen one after the other from the ``periods``, each the one that explains
        most of what is left, with all coefficients fitted again (orthogonal matching pursuit, Pati et al. 1993): from all
        errors, and from all but one of ``FOLDS`` random parts. Many periods follow any scatter at the commands that chose them.
        """
        weight = 1.0 / (self.variance + (self.errors**2).mean())
        waves = np.exp(2j * np.pi * self.command[:, None] / periods)
        parts = np.random.default_rng(0).permutation(len(self.errors)) % FOLDS
        predicted = np.empty_like(self.errors)
        for part in range(FOLDS):
            out = parts == part
            predicted[out] = self._predicted(waves, weight, ~out)[out]
        whole = float(weight @ self.errors**2)
        chosen = self._predicted(waves, weight, np.ones(len(parts), dtype=bool))
        held, fitted = (1.0 - float(weight @ (self.errors - some) ** 2) / whole for some in (predicted, chosen))
        return held / max(fitted, 1e-300)

    def _predicted(self, waves: npt.NDArray[np.complex128], weight: Floats, some: npt.NDArray[np.bool_]) -> Floats:
        """(n,) errors by lines that are chosen from ``waves`` (n, T) and fitted at ``some`` commands."""
        root, left, chosen = np.sqrt(weight), np.where(some, self.errors, 0.0), list[Floats]()
        found = np.zeros_like(left)
        for _ in self.lines:
            best = waves[:, int(np.argmax(np.abs((weight * left) @ waves)))]
            chosen += [best.real, best.imag]
            X = np.stack(chosen, axis=1)
            fit = np.linalg.lstsq(X[some] * root[some, None], self.errors[some] * root[some], rcond=None)[0]
            found = X @ fit
            left = np.where(some, self.errors - found, 0.0)
        return found

    def chance(self) -> float:
        """Upper bound of the probability that scatter without a period shows a line as significant as the best one.

        The lines are fitted one after the other, the strongest first; what is left without the line is noise of known variance
        and scatter of the drive, whose variance is estimated. Of n such errors, less those that other causes fit, p columns
        take a share of the power with a beta distribution, of parameters p/2 and (n - p)/2. The best of all periods that were
        tried takes a larger share than this with at most their number times the probability (Bonferroni). The k-th test of a
        line has the share 1 / (k (k + 1)) of the whole probability.
        """
        residual, open_, least = self.errors, list(self.lines), 1.0
        freedom = len(self.errors) - self.effective_parameters
        for tested in range(1, len(self.lines) + 1):
            if freedom <= 1.0:
                break
            scatter = max(float((residual**2).sum()) / freedom - float(self.variance.mean()), 0.0)
            root = 1.0 / np.sqrt(self.variance + scatter)
            whole = float(((residual * root) ** 2).sum())
            fits = [X @ np.linalg.lstsq(X * root[:, None], residual * root, rcond=None)[0] for X in open_]
            powers = [float((((residual - fit) * root) ** 2).sum()) for fit in fits]
            best = int(np.argmin(powers))
            width = open_.pop(best).shape[1]
            if freedom <= width + 1.0 or whole == 0.0:
                break
            share = min(max(1.0 - powers[best] / whole, 0.0), 1.0)
            least = min(
                least, float(betaincc(width / 2.0, (freedom - width) / 2.0, share)) * self.tried * tested * (tested + 1)
            )
            residual, freedom = residual - fits[best], freedom - width
        return least
