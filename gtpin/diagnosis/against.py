"""What has changed since an earlier model was identified, by cause, from a few poses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gtpin.calibration.robust_fit import Progress
from gtpin.data import Dataset, by_region
from gtpin.data.plausible import copies
from gtpin.diagnosis.changed_geometry import in_geometry
from gtpin.diagnosis.design import Design, Observed
from gtpin.diagnosis.doubts import out_of_range
from gtpin.diagnosis.earlier import (
    Earlier,
    Usable,
    expectation,
    places,
    pose_chi2,
    share_unexplained,
    updated,
    usable,
    with_unexplained,
)
from gtpin.diagnosis.evidence import SCALES, marginal_power
from gtpin.diagnosis.gap import gaps, lost, unexplained, where
from gtpin.diagnosis.hypothesis import Hypothesis, Scope
from gtpin.diagnosis.hypothesis_set import HypothesisSet
from gtpin.diagnosis.joint_fit import cause
from gtpin.diagnosis.noise import floor_of
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.diagnosis.propose import propose
from gtpin.diagnosis.result import Cause, Doubt, HealthCheck, Smallest
from gtpin.diagnosis.verdict import Conclusion, considered, decide
from gtpin.distributions import chi2
from gtpin.effects.active import ActiveEffect
from gtpin.model.model import Model
from gtpin.typing import Floats


def gains_of_draws(
    values: Floats, vectors: Floats, along: Floats, core: Sequence[int] = (), priors: Priors = PRIORS
) -> Floats:
    """(S,) largest gain in log evidence of one group over the scales, as :func:`best_scales`, for S residuals.

    ``values``, ``vectors``: (c,) eigenvalues and (c, c) eigenvectors of the group's inner products. ``along``: (S, c) inner
    products of the group with each residual, along the eigenvectors.
    """
    s2 = (SCALES**2)[:, None]
    shrunk = s2 / (1.0 + s2 * values)
    gain = 0.5 * (shrunk @ (along**2).T - np.log1p(s2 * values).sum(axis=1)[:, None])
    gain -= 0.5 * (np.log(SCALES)[:, None] / priors.scale_spread) ** 2
    if len(core):
        part = vectors[list(core)]
        mean = (shrunk[:, None] * part).reshape(-1, len(values)) @ along.T
        variance = (shrunk @ (part**2).T).mean(axis=1)
        mean = mean.reshape(len(SCALES), len(part), -1)
        square = ((mean**2).mean(axis=1) + variance[:, None]) / s2
        inner = (part * values) @ part.T
        energy = np.einsum("kfs,fg,kgs->ks", mean, inner, mean, optimize=True)
        unsuited = square < priors.least_core**2
        if np.trace(inner) > len(part):
            unsuited |= energy + len(part) < priors.least_core**2 * ((shrunk**2 * values) @ (along**2).T)
        unsuited[0] = False  # as in `best_scales`
        gain = np.where(unsuited, -np.inf, gain)
    return np.asarray(gain.max(axis=0))


MOST_NUMBERS = 4_000_000
"""Number of simulated residuals that are in memory at the same time."""
ALARM_DRAWS, POWER_DRAWS = 10_000, 800
"""Numbers of draws: for the alarm's threshold, with which a probability of 1 % has a standard error of 0.1 %; and for each
smallest change, with which 95 % have a standard error of 0.8 %."""
LARGEST_CHANGE = 1e3
"""Size of a change, over its typical size, at which the search for the smallest one ends. Assumed."""
SIZE_STEPS = 12
"""Number of bisections of the logarithm of the size, from 1e-3 to `LARGEST_CHANGE`: they determine the size to 0.4 %."""
DRAWN_SHAPES = 60
"""Number of random shapes for the median of a parameter."""


@dataclass(frozen=True)
class Axes:
    """A hypothesis, and the axes along which its coefficients are independent.

    ``values``, ``vectors``: eigenvalues (c,) and eigenvectors of its c columns' inner products, with the earlier model
    marginalised. ``core``: indices of the core's columns; empty where all are. ``weights``: (N c, c) by which a residual is
    multiplied for its inner products along the axes.
    """

    hypothesis: Hypothesis
    values: Floats
    vectors: Floats
    core: tuple[int, ...]
    weights: Floats


class GainSampler:
    """Gains in log evidence, nats, of every hypothesis of a check alone, for residuals of simulated checks.

    ``unexplained``: share of the earlier model's unexplained errors in the variance of the whitened residuals.
    """

    def __init__(self, hypotheses: HypothesisSet, unexplained: float = 0.0) -> None:
        self.hypotheses, self.share = hypotheses, unexplained
        groups, self.axes = hypotheses.groups, list[Axes]()
        for hypothesis in hypotheses.linear:
            values, vectors = np.linalg.eigh(groups.block(hypothesis, hypothesis))
            weights = groups.marginal.past(groups.columns(hypothesis)) @ vectors
            self.axes.append(Axes(hypothesis, np.maximum(values, 0.0), vectors, groups.core[hypothesis], weights))

    def unchanged(self, draws: int, rng: np.random.Generator) -> Floats:
        """(N c, draws) whitened residuals of a machine that has not changed: noise, and the error of the earlier model.

        That error is the one of the model's unknowns, and what the model left unexplained of its own data. The latter could
        be anything; most easily taken for a change is an effect that can be named as one, and was there before: in each draw it
        is one of these, with random coefficients. The pose of a free instrument is left out: no gain depends on it.
        """
        design = self.hypotheses.design
        noise = rng.standard_normal((len(design.y), draws))
        B = design.B[:, : design.n_prior]
        y = noise * np.sqrt(1.0 - self.share) + B @ rng.standard_normal((B.shape[1], draws))
        if self.share == 0.0 or not self.axes:
            return np.asarray(y)
        which = rng.integers(0, len(self.axes), draws)
        for i, axes in enumerate(self.axes):
            own = np.flatnonzero(which == i)
            X = self.hypotheses.groups.columns(axes.hypothesis)
            power = (X**2).sum(axis=1).reshape(len(design.whitening), -1).mean(axis=1)
            # An effect that acts at a few poses is not larger there for it: the mean is over the poses at which it acts.
            size = np.sqrt(self.share * power.sum() / max(float((power**2).sum()), 1e-300))
            drawn = rng.standard_normal((X.shape[1], len(own)))
            y[:, own] += size * (X @ (drawn * np.sqrt(X.shape[1] / (drawn**2).sum(axis=0))))
        return np.asarray(y)

    def gains(self, axes: Axes, moments: Floats) -> Floats:
        """(draws,) gains of a hypothesis, for its inner products (draws, c) with residuals, along its axes."""
        return gains_of_draws(axes.values, axes.vectors, moments, axes.core, self.hypotheses.priors)

    def largest(self, y: Floats) -> Floats:
        """(draws,) largest gain of any hypothesis, for residuals y (N c, draws)."""
        best = np.full(y.shape[1], -np.inf)
        for axes in self.axes:
            best = np.maximum(best, self.gains(axes, y.T @ axes.weights))
        return best

    def batches(self, draws: int, rng: np.random.Generator) -> Iterator[Floats]:
        """The residuals of ``draws`` simulated checks of an unchanged machine, as many at a time as fit in memory."""
        most = max(MOST_NUMBERS // len(self.hypotheses.design.y), 1)
        for start in range(0, draws, most):
            yield self.unchanged(min(most, draws - start), rng)


def threshold(sampler: GainSampler, false_alarm: float, draws: int, rng: np.random.Generator) -> float:
    """The gain in log evidence, nats, that the best hypothesis exceeds by chance with the probability ``false_alarm``."""
    if not sampler.axes:
        return np.inf
    found = np.concatenate([sampler.largest(y) for y in sampler.batches(draws, rng)])
    return float(np.quantile(found, 1.0 - false_alarm, method="higher"))


def chance(sampler: GainSampler, power: float, draws: int, rng: np.random.Generator) -> float:
    """Probability that chi-square of an unchanged machine's residuals, the earlier model marginalised, exceeds ``power``.

    It is found from ``draws`` simulated checks where there are unexplained errors: these are not independent.
    """
    if sampler.share == 0.0:
        return float(chi2.sf(power, sampler.hypotheses.design.dof))
    above, marginal = 0, sampler.hypotheses.groups.marginal
    for y in sampler.batches(draws, rng):
        above += int(((y**2).sum(axis=0) - (marginal.half(y) ** 2).sum(axis=0) >= power).sum())
    return above / draws


def smallest_changes(
    sampler: GainSampler, threshold: float, power: float, rng: np.random.Generator
) -> tuple[Smallest, ...]:
    """For each hypothesis, the smallest change whose own gain in log evidence exceeds ``threshold`` with probability ``power``.

    The probability of an alarm is at least this: another hypothesis, or chi-square, may raise the alarm too.
    """
    at, found = sampler.hypotheses.design.operating_points, list[Smallest]()
    y = sampler.unchanged(POWER_DRAWS, rng)
    for axes in sampler.axes:
        hypothesis, shape = axes.hypothesis, _shapes(axes, POWER_DRAWS, rng)
        null, along = y.T @ axes.weights, (shape @ axes.vectors) * axes.values

        def seen(size: float, axes: Axes = axes, null: Floats = null, along: Floats = along) -> bool:
            """Whether enough of the drawn changes, multiplied by ``size``, exceed the threshold."""
            return float((sampler.gains(axes, null + size * along) >= threshold).mean()) >= power

        low, high = np.log(1e-3), np.log(LARGEST_CHANGE)
        for _ in range(SIZE_STEPS if (ever := seen(LARGEST_CHANGE)) else 0):
            middle = (low + high) / 2.0
            low, high = (low, middle) if seen(float(np.exp(middle))) else (middle, high)
        sigma = hypothesis.basis(at).sigma
        named = [
            hypothesis.effect.parameters_of(at.robot, hypothesis.site, u * sigma, ()) for u in shape[:DRAWN_SHAPES]
        ]
        name, (_, unit) = next(iter(named[0].items()))
        typical = float(np.median([abs(one[name][0]) for one in named]))
        found.append(Smallest(*hypothesis.place, name, float(np.exp(high)) * typical if ever else None, unit))
    return tuple(found)


def _shapes(axes: Axes, draws: int, rng: np.random.Generator) -> Floats:
    """(draws, c) coefficients of random changes of typical size: of the core where there is one, none in the modulation."""
    c = len(axes.values)
    own = list(axes.core) or list(range(c))
    drawn = rng.standard_normal((draws, len(own)))
    found = np.zeros((draws, c))
    found[:, own] = drawn * np.sqrt(len(own) / (drawn**2).sum(axis=1, keepdims=True))
    return found


POWER = 0.95
"""Probability of an alarm by each smallest change that is reported. Assumed."""
CHECK_REGIONS, REGION_POSES = 4, 3
"""Largest number of regions of the workspace that ``where`` distinguishes, and fewest poses in each (but there are two regions
at least). Assumed."""


def changes(earlier: Earlier, observed: Observed, scope: Scope) -> tuple[GainSampler, tuple[str, ...]]:
    """The changes of some poses or readings since an earlier model, with their gains on a machine that has not changed.

    And the names of the temperatures whose change is not known and therefore assumed.
    """
    since, assumed = earlier.since(observed.covariates, observed.temperature, len(observed.weight), scope.priors.warmer)
    design = expectation(earlier, observed, since)
    share = share_unexplained(design, observed.noise, earlier.unexplained)
    return GainSampler(propose(design, scope, changes=True), share), assumed


def check(dataset: Dataset, model: Model, scope: Scope, seed: int, progress: Progress) -> HealthCheck:
    """Find what has changed since a model was identified: :func:`gtpin.diagnose` with ``against=model``."""
    earlier, rng = Earlier(model), np.random.default_rng(seed)
    data = usable(dataset, model, scope.priors)
    progress("simulating machines that have not changed", 0, float("nan"))
    tried = _without_gross(_Tried.of(earlier, data, scope, rng), earlier, scope, rng)
    progress("the smallest changes that these poses show", 0, float("nan"))
    return _result(tried, earlier, scope, dataset, rng)


@dataclass(frozen=True)
class _Tried:
    """Rows of a check, with the hypotheses that are tested, and the conclusion."""

    data: Usable
    sampler: GainSampler
    assumed: tuple[str, ...]
    hypotheses: HypothesisSet
    conclusion: Conclusion

    @staticmethod
    def of(earlier: Earlier, data: Usable, scope: Scope, rng: np.random.Generator) -> _Tried:
        """Decide which changes are named, and whether the poses show something that they do not explain."""
        sampler, assumed = changes(earlier, data.observed, scope)
        priors = scope.priors
        level = threshold(sampler, priors.named_alarms * scope.false_alarm, ALARM_DRAWS, rng)
        hypotheses = sampler.hypotheses.at_threshold(level)
        found = decide(hypotheses)
        while impossible := _impossible(earlier, hypotheses, found, assumed):
            hypotheses = hypotheses.barring(impossible)
            found = decide(hypotheses)
        by_chance = chance(sampler, marginal_power(hypotheses.groups, found.model), ALARM_DRAWS, rng)
        if by_chance < (1.0 - priors.named_alarms) * scope.false_alarm:
            found = found.only(hypotheses, found.sure()).doubted(Doubt("chi_square"))
        return _Tried(data, sampler, assumed, hypotheses, found)


def _changed(
    earlier: Earlier, hypotheses: HypothesisSet, found: Conclusion
) -> tuple[Model, list[tuple[Hypothesis, ActiveEffect, Cause]]]:
    """The earlier model with the named changes, and each of these with its coefficients and its class."""
    named, columns = list(found.classes), hypotheses.columns(found.model)
    model, active = updated(earlier, hypotheses.design, named, [found.scale[c] for c in named], columns)
    # The earlier model may have another effect of the same name.
    return model, [
        (one, own, cause(replace(model, effects=(own,)), one, found, one, hypotheses))
        for own, one in zip(active, named, strict=True)
    ]


def _impossible(
    earlier: Earlier, hypotheses: HypothesisSet, found: Conclusion, assumed: Sequence[str]
) -> set[tuple[str, str]]:
    """Members of classes with a parameter that physics does not allow, as in a diagnosis; effects and sites.

    Where a change of temperature is ``assumed``, it may have either sign, and so may the parameter.
    """
    robot, effects = earlier.model.robot, {h.effect.id: h.effect for h in hypotheses.linear}
    places = set()
    for _, _, one in _changed(earlier, hypotheses, found)[1]:
        for member in one.members:
            effect, own = effects[member.effect], dict(member.parameters)
            either = [own]
            if set(effect.covariates(robot, member.site)) & set(assumed):
                either.append({name: replace(e, value=-e.value) for name, e in own.items()})
            asked = [out_of_range(effect, member.site, one_sign, hypotheses.priors) for one_sign in either]
            if all(any(not question.believed for question in each) for each in asked):
                places.add((member.effect, member.site))
    return places


def _without_gross(tried: _Tried, earlier: Earlier, scope: Scope, rng: np.random.Generator) -> _Tried:
    """The check without gross errors: poses far from the prediction of the other poses, given the named changes.

    A pose is also a gross error if it is far from the prediction without changes, and no change is named without it.
    """
    for _ in range(int(scope.priors.gross_share * len(tried.data.dataset))):
        columns = tried.hypotheses.columns(tried.conclusion.model)
        for some, alone in ((columns, False), (columns[:, :0], True)):
            worst = _gross(tried.hypotheses.design, some, scope.priors)
            if worst is None:
                continue
            trial = _Tried.of(earlier, tried.data.without(worst), scope, rng)
            if not alone or (trial.conclusion.verdict == "none" and tried.conclusion.verdict != "none"):
                break
        else:
            return tried
        tried = trial
    return tried


def _gross(design: Design, columns: Floats, priors: Priors) -> int | None:
    """The row of a gross error, given whitened displacements (N c, m) of changes; None where there is none."""
    chi = pose_chi2(design, columns)
    worst = int(chi.argmax())
    by_chance = float(chi2.sf(chi[worst], design.components)) * len(chi)
    return None if by_chance >= priors.gross or chi[worst] < priors.gross_alone * float(np.median(chi)) else worst


def _result(tried: _Tried, earlier: Earlier, scope: Scope, dataset: Dataset, rng: np.random.Generator) -> HealthCheck:
    """The result, with everything that reports show."""
    found, hypotheses, data = tried.conclusion, tried.hypotheses, tried.data
    design, used = hypotheses.design, tried.data.dataset
    model, changed = _changed(earlier, hypotheses, found)
    # Every pose is left out in turn; of readings, all of one stop of the machine.
    together = np.arange(len(used)) if design.measured.tracked else used.visits
    floor, blocks = _floor(tried, earlier), [together == one for one in np.unique(together)]
    whole, less = gaps(hypotheses, found, floor, blocks, rng)
    causes, unpredicted = [], []
    for hypothesis, own, one in changed:
        causes.append(replace(one, explained_fraction=lost(whole, less[hypothesis.place])))
        if set(hypothesis.covariates(model.robot)) & set(tried.assumed):
            unpredicted.append(own.name)
    regions = by_region(used, int(np.clip(len(used) // REGION_POSES, 2, CHECK_REGIONS)))
    kept = {tuple(place) for place in places(used)}
    aside = np.array([tuple(place) not in kept for place in places(dataset)]) & ~copies(dataset)
    return HealthCheck(
        verdict=found.verdict,
        causes=tuple(sorted(causes, key=lambda c: -c.explained_fraction)),
        candidates=considered(hypotheses, found),
        where=where(hypotheses, regions),
        gap=whole,
        unexplained=unexplained(hypotheses, found.model, False),
        doubts=found.doubts,
        baseline=replace(earlier.model, frame=design.model.frame),
        model=in_geometry(model.without(unpredicted) if unpredicted else model),
        poses=len(blocks),
        set_aside=tuple(dict.fromkeys(str(pose) for pose in dataset.pose[aside])),
        set_aside_rows=tuple(int(line) for line in dataset.row[aside]),
        false_alarm=scope.false_alarm,
        threshold=hypotheses.threshold,
        power=POWER,
        smallest=smallest_changes(tried.sampler, hypotheses.threshold, POWER, rng),
        assumed=tried.assumed,
        unexplained_before=earlier.unexplained,
        noise_known=data.noise_known,
        free_frame=data.observed.free_frame,
        effects=scope.effects,
        dataset=dataset,
    )


def _floor(tried: _Tried, earlier: Earlier) -> Floats:
    """(N, k) expected square of the noise of each compared number, m^2, without unexplained errors of the earlier model where
    the noise is known; ones for readings: their errors are in units of noise."""
    design, data = tried.hypotheses.design, tried.data
    if not design.measured.tracked:
        return np.ones((len(data.dataset), design.components))
    noise = data.observed.noise
    if not data.noise_known:
        noise = with_unexplained(noise, design.measured, earlier.unexplained)
    if earlier.model.fit is not None:  # what the drives are assumed to scatter at least is no noise
        noise = replace(noise, repeatability=min(noise.repeatability, earlier.model.fit.drives))
    return floor_of(noise, design)
