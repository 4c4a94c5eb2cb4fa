"""Diagnose the gap between a model and measurements: where it lies, what causes it, how far it shrinks."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from gtpin.calibration.calibrate import calibrate, measured_poses
from gtpin.calibration.result import Calibration
from gtpin.calibration.rounds import Progress
from gtpin.data import Dataset, by_region
from gtpin.diagnosis.candidates import Candidate
from gtpin.diagnosis.decide import Decision, decide, split
from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import Marginal
from gtpin.diagnosis.fit import Observed, fit_together
from gtpin.diagnosis.free_motions import free_motions
from gtpin.diagnosis.pool import Pool
from gtpin.diagnosis.result import Cause, Considered, Diagnosis, Member
from gtpin.diagnosis.shrinkage import gap
from gtpin.diagnosis.unexplained import unexplained
from gtpin.diagnosis.where import where
from gtpin.effects.active import ActiveEffect
from gtpin.effects.catalogue import catalogue
from gtpin.effects.effect import Effect
from gtpin.errors import ModelError
from gtpin.model import Model
from gtpin.robot.robot import Robot

Floats = npt.NDArray[np.float64]

FALSE_ALARM = 0.01
"""Chance of naming a cause where there is none."""
BLOCKS = 12


def diagnose(
    dataset: Dataset,
    robot: Robot | Model | None = None,
    *,
    exclude: Collection[str] = (),
    false_alarm: float = FALSE_ALARM,
    seed: int = 0,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find what a calibrated geometry leaves out of measurements.

    Parameters
    ----------
    dataset
        Measured poses, with whatever is known of their circumstances.
    robot
        The nominal robot, or a model of it; the one that the dataset names by default.
    exclude
        ``effect`` or ``effect@site``: what is taken out of the catalogue.
    false_alarm
        Chance of naming a cause where there is none.
    seed
        Of the resampling behind intervals.

    Raises
    ------
    GtpinError
        If the dataset can't be read as one of this robot, or an excluded effect is not known.
    """
    nominal = robot.geometry.robot if isinstance(robot, Model) else robot
    baseline = calibrate(dataset, nominal, progress=progress)
    kept = dataset.take(~np.isin(dataset.pose.astype(str), baseline.rejected))
    observed = _observed(kept, baseline)
    design = observed.design(baseline.model)
    pool, untestable = make_pool(design, exclude, false_alarm)
    if progress is not None:
        progress("searching for causes", 0, float(np.sqrt(baseline.chi2_per_dof)))
    found = decide(pool)
    names = found.named.names
    candidates = [pool.candidates[name] for name in names]
    model = fit_together(observed, baseline.model, candidates, found.named.scale, design.situation.references)
    rng = np.random.default_rng(seed)
    blocks = by_region(kept, max(2, min(BLOCKS, int(kept.visits.max()) + 1)))
    floor = np.trace(
        observed.noise.covariance(design.situation.command_jacobian, design.components)[:, :3, :3], axis1=1, axis2=2
    )
    columns = {n: pool.groups.columns[n] * s for n, s in zip(names, found.named.scale, strict=True)}
    together = np.hstack([*columns.values(), np.zeros((len(design.y), 0))])
    whole = gap(design, together, floor, blocks, rng)
    shares = {}
    for cause in columns:
        others = np.hstack([*(v for n, v in columns.items() if n != cause), np.zeros((len(design.y), 0))])
        shares[cause] = gap(design, others, floor, blocks, rng)
    causes = [
        _cause(model, i, name, found.classes[name], (whole.shrinkage or 0.0) - (shares[name].shrinkage or 0.0))
        for i, name in enumerate(names)
    ]
    left = design.y - design.B @ pool.groups.marginal.deviation(design.y)
    return Diagnosis(
        verdict=found.verdict,
        causes=tuple(sorted(causes, key=lambda c: -c.shrinkage)),
        candidates=tuple(_considered(pool, found)) + tuple(untestable),
        where=where(design, left, pool, found.gains, blocks),
        gap=whole,
        unexplained=unexplained(pool, found.named),
        baseline=baseline,
        model=model,
    )


def _observed(dataset: Dataset, baseline: Calibration) -> Observed:
    measured = measured_poses(dataset)
    return Observed(
        measured=measured,
        covariates=dataset.covariates,
        noise=baseline.noise,
        weight=np.ones(len(dataset)),
        temperature=dataset.conditions.reference_temperature,
        free_frame=dataset.instrument.frame == "free",
    )


def make_pool(design: Design, exclude: Collection[str], false_alarm: float) -> tuple[Pool, list[Considered]]:
    """Testable candidates, and what is said of the others."""
    at = design.situation
    known = catalogue()
    for word in exclude:
        named, _, place = word.partition("@")
        if named not in known or (place and place not in known[named].sites(at.robot)):
            raise ModelError(f"no effect is called {word!r}", hint=f"effects are {', '.join(known)}")
    plain, scanned, untestable = {}, [], []
    for effect in known.values():
        for site in effect.sites(at.robot):
            if effect.id in exclude or f"{effect.id}@{site}" in exclude:
                continue
            reason = effect.untestable(at, site) or _absorbed(design, effect, site)
            if reason:
                untestable.append(Considered(effect.id, site, 0.0, 0.0, False, reason))
            elif effect.settings(at, site):
                scanned.append(Candidate(effect, site))
            else:
                plain[f"{effect.id}@{site}"] = Candidate(effect, site)
    return Pool(design, plain, tuple(scanned), tuple(free_motions(at)), false_alarm), untestable


def _absorbed(design: Design, effect: Effect, site: str) -> str:
    """Whether geometry takes nearly all of an effect of ten times its usual size."""
    at = design.situation
    if effect.settings(at, site):
        return ""
    basis = effect.basis(at, site)
    X = design.columns(basis) * 10.0
    left = float(np.trace(Marginal(design.B).product(X, X)))
    return "" if left > 15.8 else "geometric calibration absorbs it"


def _cause(model: Model, place: int, name: str, members: tuple[Member, ...], shrinkage: float) -> Cause:
    effect, site = split(name)
    own = next((m for m in members if (m.effect, m.site) == (effect, site)), members[0])
    return Cause(effect, site, own.probability, members, _parameters(model.effects[place]), shrinkage)


def _parameters(active: ActiveEffect) -> dict[str, tuple[float, float, str]]:
    """Named parameters with sigmas, propagated from the coefficients' covariance by differences."""
    values = active.effect.parameters(active.coefficients, active.setting)
    found = {}
    size = np.sqrt(np.diag(active.covariance))
    for name, (value, unit) in values.items():
        slope = np.zeros(len(size))
        for i, step in enumerate(size * 1e-3):
            if step > 0.0:
                moved = active.coefficients + step * np.eye(len(size))[i]
                slope[i] = (active.effect.parameters(moved, active.setting)[name][0] - value) / step
        found[name] = (value, float(max(float(slope @ active.covariance @ slope), 0.0) ** 0.5), unit)
    return found


def _considered(pool: Pool, found: Decision) -> list[Considered]:
    probability = {f"{m.effect}@{m.site}": m.probability for members in found.classes.values() for m in members}
    rows = [
        Considered(*split(name), found.gains[name], probability.get(name, 0.0), True, "")
        for name in pool.named
        if name in found.gains
    ]
    return sorted(rows, key=lambda row: -row.log_evidence)
