"""What has changed since an earlier model was identified, by cause, from a few poses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gtpin.calibration.robust_fit import Progress
from gtpin.data import Dataset, by_region
from gtpin.data.duplicates import copies
from gtpin.diagnosis.against.alarm import DRAWS, GainSampler, chance, smallest_changes, threshold
from gtpin.diagnosis.against.earlier import Earlier, pose_chi2, updated
from gtpin.diagnosis.against.expectation import Usable, expectation, places, share_unexplained, usable, with_unexplained
from gtpin.diagnosis.hypotheses.hypothesis import Scope
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.hypotheses.propose import propose
from gtpin.diagnosis.inference.findings import Conclusion, Doubt, considered
from gtpin.diagnosis.inference.fit import cause
from gtpin.diagnosis.inference.infer import decide
from gtpin.diagnosis.inference.predictive import gaps, lost
from gtpin.diagnosis.inference.shown_noise import floor_of
from gtpin.diagnosis.inference.where import marginal_power, unexplained, where
from gtpin.diagnosis.linear.design import Design, Observed
from gtpin.diagnosis.priors import Priors
from gtpin.diagnosis.result import HealthCheck
from gtpin.distributions import chi2
from gtpin.model.model import Model
from gtpin.typing import Floats

POWER = 0.95
"""Probability of an alarm by each smallest change that is reported. Assumed."""
REGIONS, TOGETHER = 4, 3
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
    data = usable(dataset, model)
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
        level = threshold(sampler, priors.named_alarms * scope.false_alarm, DRAWS, rng)
        hypotheses = sampler.hypotheses.at_threshold(level)
        found = decide(hypotheses)
        by_chance = chance(sampler, marginal_power(hypotheses, found.model), DRAWS, rng)
        if by_chance < (1.0 - priors.named_alarms) * scope.false_alarm:
            found = found.only(hypotheses, found.sure()).doubted(Doubt("chi_square"))
        return _Tried(data, sampler, assumed, hypotheses, found)


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
    design, named, used = hypotheses.design, list(found.classes), tried.data.dataset
    columns = hypotheses.columns(found.model)
    model, active = updated(earlier, design, named, [found.scale[c] for c in named], columns)
    # Every pose is left out in turn; of readings, all of one stop of the machine.
    together = np.arange(len(used)) if design.measured.tracked else used.visits
    floor, blocks = _floor(tried, earlier), [together == one for one in np.unique(together)]
    whole, less = gaps(hypotheses, found, floor, blocks, rng)
    causes, unpredicted = [], []
    for own, hypothesis in zip(active, named, strict=True):
        # The earlier model may have another effect of the same name.
        one = cause(replace(model, effects=(own,)), hypothesis, found, hypothesis, hypotheses)
        causes.append(replace(one, explained_fraction=lost(whole, less[hypothesis.place])))
        if set(hypothesis.covariates(model.robot)) & set(tried.assumed):
            unpredicted.append(own.name)
    regions = by_region(used, int(np.clip(len(used) // TOGETHER, 2, REGIONS)))
    kept = {tuple(place) for place in places(used)}
    aside = np.array([tuple(place) not in kept for place in places(dataset)]) & ~copies(dataset)
    return HealthCheck(
        verdict=found.verdict,
        causes=tuple(sorted(causes, key=lambda c: -c.explained_fraction)),
        candidates=considered(hypotheses, found),
        where=where(hypotheses, found.alone, regions),
        gap=whole,
        unexplained=unexplained(hypotheses, found.model, False),
        doubts=found.doubts,
        baseline=replace(earlier.model, frame=design.model.frame),
        model=model.without(unpredicted) if unpredicted else model,
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
