"""The first two steps of a diagnosis: is a part farther from nominal than its tolerance, or does a cause look like it?

A calibration knows no effects. Where one acts that the geometry can follow, parameters move beyond their tolerances, and these
are widened: joints of a soft rod by 70 mm, the zero of a joint whose axis wobbles by 2.5 degrees. The effect is then a part of
the geometry, and no cause. Both explanations are compared by their log marginal likelihood, of the same rows and with the
noise of the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from gtpin.calibration.checks.limits import CONFLICT
from gtpin.calibration.robust_fit import Progress
from gtpin.data import Dataset
from gtpin.diagnosis.design import Design, Observed
from gtpin.diagnosis.evidence import Posterior
from gtpin.diagnosis.gap import blocks_of, check_hold_out, leave_out
from gtpin.diagnosis.hypothesis import Scope, Term
from gtpin.diagnosis.hypothesis_set import HypothesisSet, smooth_of
from gtpin.diagnosis.noise import SearchState, searchable_rows, settle, understated_noise, warn_of_noise
from gtpin.diagnosis.prepare import Prepared, prepare
from gtpin.diagnosis.propose import propose
from gtpin.diagnosis.result import HoldOut
from gtpin.diagnosis.search import rough_guess
from gtpin.effects.driver import InstrumentAxes, driver_effects
from gtpin.effects.effect import Effect
from gtpin.errors import ConvergenceError, GtpinError, deferred
from gtpin.robot.chain import Chain


def begun(
    dataset: Dataset,
    nominal: Chain,
    known: Sequence[Effect],
    scope: Scope,
    hold_out: HoldOut,
    rng: np.random.Generator,
    report: Progress,
) -> tuple[Prepared, Scope, SearchState]:
    """The first two steps of a diagnosis: the data prepared and calibrated, the scope with the effects of the dataset's
    drivers, and noise and hypotheses of a first search.

    Where the calibration widened tolerances, and causes with the given ones explain the data as well: with these.
    ``known``: the effects without those of drivers.
    """

    def first(widen: bool) -> tuple[Prepared, Scope, SearchState]:
        prepared = prepare(dataset, nominal, report, scope.priors, widen=widen)
        if small := understated_noise(prepared, scope):
            # Of a sigma that visits contradict, the calibration has warned, and the verdict has the visits' own.
            own = {key: sizes for key, sizes in small.items() if getattr(prepared.baseline.noise, key) == sizes[0]}
            warn_of_noise(own)
            # Where the geometry does not converge with the larger noise, the declared one is kept.
            with suppress(ConvergenceError):
                prepared = prepared.undeclared(small, nominal, report, scope.priors, widen=widen)
        check_hold_out(prepared.dataset, hold_out)  # again: the preparation may have left out the column
        effects = scope.effects
        if dataset.drivers:
            effects = (*known, *driver_effects(dataset, nominal, _instrument(prepared)))
        with_drivers = replace(scope, effects=effects)
        report("searching for causes", 0, float(np.sqrt(prepared.baseline.chi2_per_dof)))
        return prepared, with_drivers, settle(prepared, searchable_rows(prepared, scope.priors), with_drivers, rng)

    with deferred() as texts:
        prepared, with_drivers, settled = first(widen=True)
        calibrated = prepared.baseline.model
        if calibrated.geometry.is_widened and not calibrated.doubt:
            of_wider = [*texts]
            texts.clear()
            try:
                within = prepare(dataset, nominal, report, scope.priors, widen=False)
                if explained_within(within, settled, with_drivers):
                    texts.clear()
                    return first(widen=False)
            except GtpinError:  # no fit without wider tolerances
                pass
            texts[:] = of_wider
        return prepared, with_drivers, settled


def _instrument(prepared: Prepared) -> InstrumentAxes:
    """The instrument's origin and axes in the base frame."""
    frame, station = prepared.baseline.model.frame, prepared.recorded.instrument.station
    origin = np.zeros(3) if station is None else np.array(station)
    return InstrumentAxes(frame.R.T @ (origin - frame.T), frame.R.T)


def explained_within(within: Prepared, settled: SearchState, scope: Scope) -> bool:
    """Whether causes, with a geometry within the given tolerances, explain the data as well as wider tolerances do.

    They do where their log marginal likelihood is lower by `CONFLICT` at most. Where smooth terms are needed too, which are not
    in the model that users get, the geometry must also predict left-out poses as well. They do not where a pose is not reached,
    or where the two calibrations differ in what is free of the instruments.

    ``within``: the data, calibrated with the given tolerances. ``settled``: the search with the wider ones.
    """
    wide = settled.searched
    same = wide.instrument == within.dataset.instrument and wide.readings.tables == within.dataset.readings.tables
    if not (same and within.baseline.model.kinematics.forward(wide.q).reached.all()):
        return False
    seen = Observed.of(wide, within.baseline)
    seen = replace(seen, noise=settled.observed.noise, weight=settled.observed.weight)
    design = seen.design(within.baseline.model)
    hypotheses = propose(design, scope)
    found = rough_guess(hypotheses, settled.guess)
    if _log_likelihood(hypotheses, found) + CONFLICT < _log_likelihood(settled.hypotheses, settled.guess):
        return False
    return not smooth_of(found) or _left_out(design, settled) <= AS_WELL


AS_WELL = 1.05
"""Ratio of squared errors at left-out poses up to which one geometry predicts as well as another. Assumed."""


def _log_likelihood(hypotheses: HypothesisSet, model: Posterior[Term]) -> float:
    """Log marginal likelihood of the rows with the geometry and a model's terms, less the costs of these, nats."""
    volume = float(np.linalg.slogdet(hypotheses.design.whitening)[1].sum())
    return volume + hypotheses.groups.log_evidence + hypotheses.log_posterior(model)


def _left_out(design: Design, settled: SearchState) -> float:
    """Squares of the errors of a geometry alone at poses of regions that are left out, over those of the wider one; times the
    same ratio of orientations, where these are measured."""
    blocks, ratio = blocks_of(settled.searched, "region", np.random.default_rng(0)), 1.0
    own, wide = (leave_out(one, np.zeros((len(one.y), 0)), blocks) for one in (design, settled.hypotheses.design))
    for mine, other in ((own.errors, wide.errors), (own.turned, wide.turned)):
        ratio *= float((mine**2).sum() / (other**2).sum()) if other.any() else 1.0
    return ratio
