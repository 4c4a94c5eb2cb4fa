"""What has changed since an earlier model was identified, by cause, from a few poses."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gtpin.calibration.robust_fit import Progress
from gtpin.data import Dataset, by_region
from gtpin.data.duplicates import copies
from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.scope import Scope
from gtpin.diagnosis.inference.candidates import considered
from gtpin.diagnosis.inference.causes import cause
from gtpin.diagnosis.inference.findings import Cause, Doubt
from gtpin.diagnosis.inference.named_causes import decide
from gtpin.diagnosis.inference.unexplained import marginal_power, unexplained
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.inference.where import where
from gtpin.diagnosis.linear.cross_validation import Gap, gap
from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.distributions import chi2
from gtpin.effects.active import ActiveEffect
from gtpin.effects.catalogue import catalogue
from gtpin.effects.effect import Effect
from gtpin.errors import noted
from gtpin.health.alarm import Bench, chance, threshold
from gtpin.health.changes import Changes, Since, Tested, changes
from gtpin.health.earlier import Earlier
from gtpin.health.expectation import expectation, share_unexplained
from gtpin.health.measured import Usable, places, usable
from gtpin.health.power import smallest_changes
from gtpin.health.readings import reading_model
from gtpin.health.result import HealthCheck
from gtpin.health.update import pose_chi2, updated
from gtpin.model.measured_robot import check_same_robot
from gtpin.model.model import Model
from gtpin.noise.noise import Noise
from gtpin.threads import in_one_thread
from gtpin.typing import Floats

FALSE_ALARM, POWER = 0.01, 0.95
"""Probability of an alarm where nothing has changed; and of an alarm by each smallest change that is reported. Assumed."""
DRAWS, POWER_DRAWS = 10_000, 800
"""Numbers of draws: for the alarm's threshold, with which a probability of 1 % has a standard error of 0.1 %; and for each
smallest change, with which 95 % have a standard error of 0.8 %."""
REGIONS, TOGETHER = 4, 3
"""Largest number of regions of the workspace that ``where`` distinguishes, and fewest poses in each (but there are two regions
at least). Assumed."""


@in_one_thread
def check(
    dataset: Dataset,
    model: Model,
    *,
    effects: Iterable[Effect] | None = None,
    exclude: Collection[str] = (),
    false_alarm: float = FALSE_ALARM,
    priors: Priors = PRIORS,
    seed: int = 0,
    trust_data: bool = False,
    progress: Progress | None = None,
) -> HealthCheck:
    """Find what has changed since ``model`` was identified: :func:`gtpin.diagnose` with ``against=model``.

    The parameters are those of :func:`gtpin.diagnose`.

    Raises
    ------
    GtpinError
        If the dataset does not match the model's robot, or an excluded effect is not known.
    """
    check_same_robot(model.robot, dataset)
    with noted() as texts:
        trusted = replace(dataset, trusted=True) if trust_data else dataset
        model = reading_model(model, dataset)
        scope = Scope.of(catalogue() if effects is None else effects, exclude, false_alarm, model.robot, priors)
        found = _checked(trusted, model, scope, seed, progress)
    return replace(found, dataset=dataset, warnings=dataset.told(texts))


def _checked(dataset: Dataset, model: Model, scope: Scope, seed: int, progress: Progress | None) -> HealthCheck:
    """As :func:`check`."""
    earlier, rng = Earlier(model), np.random.default_rng(seed)
    data = usable(dataset, model)
    if progress is not None:
        progress("simulating machines that have not changed", 0, float("nan"))
    tried = _Tried.of(earlier, data, scope, rng)
    tried = _without_gross(tried, earlier, scope, rng)
    found = tried.conclusion
    if progress is not None:
        progress("the smallest changes that these poses show", 0, float("nan"))
    return _result(tried, found, earlier, scope, dataset, seed, rng)


@dataclass(frozen=True)
class _Tried:
    """Rows of a check, with the hypotheses that are tested, the conclusion, and the drives' scatter in the earlier fit."""

    data: Usable
    changes: Changes
    bench: Bench
    hypotheses: Tested
    conclusion: Conclusion
    drives: float | None

    @staticmethod
    def of(earlier: Earlier, data: Usable, scope: Scope, rng: np.random.Generator) -> _Tried:
        known, how, priors = data.dataset.covariates, data.how, scope.priors
        since = Since.of(known, earlier, how.temperature, len(data.dataset), priors.warmer)
        design = expectation(earlier, data.measured, known, how, since.covariates)
        possible = changes(design, scope, since.assumed)
        bench = Bench(possible.hypotheses, share_unexplained(design, how))
        level = threshold(bench, priors.named_alarms * scope.false_alarm, DRAWS, rng)
        hypotheses = possible.hypotheses.at_threshold(level, scope)
        fit = earlier.model.fit
        found = concluded(hypotheses, bench, scope, rng)
        return _Tried(data, possible, bench, hypotheses, found, None if fit is None else fit.drives)

    @property
    def design(self) -> Design:
        return self.hypotheses.design

    def columns(self, places: Collection[tuple[str, str]] | None = None) -> Floats:
        """(N c, m) whitened displacements of the named changes, or of some, at their scales."""
        found, none = self.conclusion, np.zeros((len(self.design.y), 0))
        some = [c for c in found.classes if places is None or c.place in places]
        return np.hstack([none, *(self.hypotheses.groups.columns(c) * found.scale[c] for c in some)])


def concluded(hypotheses: Tested, bench: Bench, scope: Scope, rng: np.random.Generator) -> Conclusion:
    """Decide which changes are named, and whether the poses show something that they do not explain."""
    found = decide(hypotheses)
    priors = scope.priors
    by_chance = chance(bench, marginal_power(hypotheses, found.model), DRAWS, rng)
    if by_chance >= (1.0 - priors.named_alarms) * scope.false_alarm:
        return found
    return found.only(hypotheses, found.sure()).doubted(Doubt("chi_square"))


def _without_gross(tried: _Tried, earlier: Earlier, scope: Scope, rng: np.random.Generator) -> _Tried:
    """The check without gross errors: poses far from the prediction of the other poses, given the named changes.

    A pose is also a gross error if it is far from the prediction without changes, and no change is named without it.
    """
    for _ in range(int(scope.priors.gross_share * len(tried.data.dataset))):
        none = tried.columns(())
        for columns, alone in ((tried.columns(), False), (none, True)):
            worst = _gross(tried.design, columns, scope.priors)
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
    chance = float(chi2.sf(chi[worst], design.components)) * len(chi)
    return None if chance >= priors.gross or chi[worst] < priors.gross_alone * float(np.median(chi)) else worst


def _result(
    tried: _Tried,
    found: Conclusion,
    earlier: Earlier,
    scope: Scope,
    dataset: Dataset,
    seed: int,
    rng: np.random.Generator,
) -> HealthCheck:
    """The result, with everything that reports show."""
    design, hypotheses, data = tried.design, tried.hypotheses, tried.data
    named: Sequence[Hypothesis] = list(found.classes)
    model, active = updated(earlier, design, named, [found.scale[c] for c in named], tried.columns())
    whole, shares = _gaps(tried, rng)
    causes = [
        replace(_cause(model, own, c, found), shrinkage=(whole.shrinkage or 0.0) - (shares[c.place].shrinkage or 0.0))
        for own, c in zip(active, named, strict=True)
    ]
    lasting = {(a.effect.id, a.site) for a, c in zip(active, named, strict=True) if tried.changes.is_assumed(c)}
    left = design.y - design.B @ hypotheses.groups.marginal.deviation(design.y)
    regions = by_region(data.dataset, int(np.clip(len(data.dataset) // TOGETHER, 2, REGIONS)))
    used = {tuple(place) for place in data.places}
    aside = np.array([tuple(place) not in used for place in places(dataset)]) & ~copies(dataset)
    return HealthCheck(
        verdict=found.verdict,
        causes=tuple(sorted(causes, key=lambda c: -c.shrinkage)),
        candidates=considered(hypotheses, found, tried.changes.untested, ()),
        where=where(design, left, found.alone, regions),
        gap=whole,
        unexplained=unexplained(hypotheses, found.model, False),
        doubts=found.doubts,
        baseline=replace(earlier.model, frame=design.model.frame),
        model=_without(model, lasting) if lasting else model,
        poses=len(np.unique(data.dataset.visits)) if dataset.readings is not None else len(data.dataset),
        set_aside=tuple(dict.fromkeys(str(pose) for pose in dataset.pose[aside])),
        set_aside_rows=tuple(int(line) for line in dataset.row[aside]),
        false_alarm=scope.false_alarm,
        threshold=hypotheses.threshold,
        power=POWER,
        smallest=tuple(smallest_changes(tried.bench, hypotheses.threshold, POWER, POWER_DRAWS, rng)),
        assumed=tried.changes.assumed,
        unexplained_before=data.how.unexplained,
        noise_known=data.how.noise_known,
        free_frame=data.how.free_frame,
        effects=scope.effects,
        dataset=dataset,
        seed=seed,
    )


def _cause(model: Model, own: ActiveEffect, hypothesis: Hypothesis, found: Conclusion) -> Cause:
    """A change as it is reported. ``own`` is its effect: the earlier model may have another one of the same name."""
    return cause(replace(model, effects=(own,)), hypothesis, found, hypothesis)


def _without(model: Model, places: Collection[tuple[str, str]]) -> Model:
    """The model without the changes at ``places``: it can't predict changes whose covariates were not recorded."""
    p, kept, rows = len(model.geometry.parameters), [], list(range(len(model.geometry.parameters)))
    for active in model.effects:
        own = list(range(p, p + len(active.coefficients)))
        p = own[-1] + 1
        if (active.effect.id, active.site) not in places:
            kept.append(active)
            rows += own
    joint = model.joint_covariance
    smaller = None if joint is None or not kept else joint[np.ix_(rows, rows)]
    return replace(model, effects=tuple(kept), joint_covariance=smaller)


def _gaps(tried: _Tried, rng: np.random.Generator) -> tuple[Gap, dict[tuple[str, str], Gap]]:
    """The gap with all changes; and, by change, with all but this one. Every pose is left out in turn."""
    design, floor = tried.design, _floor(tried)
    blocks = list(np.eye(len(floor), dtype=bool))
    if not design.tracked:
        floor = np.ones((len(floor), design.components))  # whitened numbers
        blocks = [tried.data.dataset.visits == visit for visit in np.unique(tried.data.dataset.visits)]
    places = [c.place for c in tried.conclusion.classes]
    whole = gap(design, tried.columns(), floor, blocks, rng)
    others = {p: gap(design, tried.columns([o for o in places if o != p]), floor, blocks, rng) for p in places}
    return whole, others


def _floor(tried: _Tried) -> Floats:
    """(N,) expected squared length of each pose's position noise, m^2, without unexplained errors of the earlier model where
    the noise is known; 1 for readings: their errors are in units of noise."""
    design = tried.design
    if not design.tracked:
        return np.ones(len(tried.data.dataset))
    how = tried.data.how
    noise = how.noise if how.noise_known else how.expected(design.measured)
    if tried.drives is not None and isinstance(
        noise, Noise
    ):  # what the drives are assumed to scatter at least is no noise
        noise = replace(noise, repeatability=min(noise.repeatability, tried.drives))
    covariance = noise.covariance(design.command_jacobian, design.components)
    return np.asarray(np.trace(covariance[:, :3, :3], axis1=1, axis2=2))
