"""Declared noise that is too small: both residuals after a search and differences of repeated visits are larger."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.calibration.checks.declared_noise import SIGMAS, Sigma
from gtpin.calibration.result import Calibration
from gtpin.diagnosis.hypotheses.hypothesis_set import Model
from gtpin.diagnosis.hypotheses.propose import propose
from gtpin.diagnosis.hypotheses.scope import Scope
from gtpin.diagnosis.inference.reestimate_noise import reestimate_noise
from gtpin.diagnosis.inference.search import rough_guess
from gtpin.diagnosis.linear.observed import Observed
from gtpin.diagnosis.linear.posterior import NOTHING
from gtpin.diagnosis.preparation.prepare import Prepared
from gtpin.errors import warn
from gtpin.noise.noise import Noise
from gtpin.noise.repeats import LEAST_CONTRASTS, contrasts, from_repeats

LOOKED_AT = 1000
"""At most this many poses are used, evenly spread over the rows: 1,000 determine a sigma to 2 %."""
LOOKS = 2
"""Number of searches, each with the noise from the last one. With too small a noise, a search explains some of it by causes."""


def understated_noise(prepared: Prepared, scope: Scope) -> dict[Sigma, tuple[float, float]]:
    """Sigmas that are declared too small: by key, the declared value and the estimated one, m or rad.

    The estimate is the smaller of two: from the residuals after a search, and, where there are repeated visits, from their
    differences. An effect that depends on the pose is in the residuals, but not in these differences.

    Parameters
    ----------
    prepared
        The data, and their calibration with the declared noise.
    scope
        The effects that may explain part of the residuals.
    """
    baseline = prepared.baseline
    declared = {
        key: getattr(baseline.instrument, key) for key, kind in SIGMAS if kind.start < baseline.residual.shape[1]
    }
    declared = {key: value for key, value in declared.items() if value is not None}
    if not declared or baseline.chi2_per_dof < scope.priors.misfit:
        return {}
    sure = prepared.dataset.take(baseline.used(prepared.dataset))
    observed = Observed.of(sure, baseline).take(np.arange(len(sure))[:: 1 + len(sure) // LOOKED_AT])
    repeats = _of_repeats(observed, baseline)
    most = scope.priors.understated_once if repeats is None else scope.priors.understated
    if repeats is not None and all(getattr(repeats, key) <= most * value for key, value in declared.items()):
        return {}  # the smaller of the two estimates is no larger: no search is needed
    noise = replace(observed.noise.scaled(float(np.sqrt(baseline.chi2_per_dof))), repeatability=0.0)
    noise = replace(noise, estimated=np.ones_like(noise.estimated))
    guess: Model = NOTHING
    for _ in range(LOOKS):
        now = replace(observed, noise=noise)
        hypotheses = propose(now.design(baseline.model), scope).hypotheses
        guess = rough_guess(hypotheses, guess)
        noise = reestimate_noise(now, hypotheses, guess).observed.noise
    found = {}
    for key, value in declared.items():
        seen = [getattr(n, key) for n in (Noise.of(noise), repeats) if n is not None]
        if min(seen) > most * value:
            found[key] = (value, float(min(seen)))
    return found


def warn_of_noise(small: dict[Sigma, tuple[float, float]]) -> None:
    """Warn which declared sigmas are replaced."""
    for key, (declared, seen) in small.items():
        ratio = seen / declared
        warn(
            f"{key} is {declared:.2g}, but these data scatter by {seen:.2g}, {ratio:.2g} times more: the search for causes "
            "assumes this scatter, the verdict does not"
        )


def _of_repeats(observed: Observed, baseline: Calibration) -> Noise | None:
    """The instrument's noise, estimated from repeated visits together with the drives' repeatability; None where there are
    few visits."""
    visits = np.unique(observed.measured.q, axis=0, return_inverse=True)[1].ravel()
    model = baseline.model
    left = observed.measured.minus(model.predict(observed.measured.q))
    scatter, rows = contrasts(visits, left)
    if len(scatter) < LEAST_CONTRASTS:
        return None
    design = observed.design(model)
    noise = replace(observed.noise, estimated=np.ones_like(observed.noise.estimated))
    return Noise.of(from_repeats(noise.take(rows), scatter, design.by_command_seen[rows]))
