"""Diagnose the gap between a model and measurements: where it lies, what causes it, how far it shrinks."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.calibration.calibrate import FIXED, PER_POSE, calibrate
from gtpin.calibration.checks.declared_noise import Sigma
from gtpin.calibration.checks.prepared import prepared
from gtpin.calibration.result import Calibration
from gtpin.calibration.rounds import Progress
from gtpin.data import Dataset, Instrument, by_region
from gtpin.data.sane import sane_rows
from gtpin.diagnosis.hypotheses.hypothesis_set import Pool
from gtpin.diagnosis.hypotheses.propose import check_excluded, make_pool
from gtpin.diagnosis.inference.causes import cause
from gtpin.diagnosis.inference.decide import Decision, decide, rough_guess, split, with_fine
from gtpin.diagnosis.inference.digits import with_full_digits
from gtpin.diagnosis.inference.held_out import held_out, scatter_may_hide
from gtpin.diagnosis.inference.joint_fit import Observed, fit_together
from gtpin.diagnosis.inference.noise import asked_again, gross_errors
from gtpin.diagnosis.inference.predictive import without_idle
from gtpin.diagnosis.inference.questions import questions, without_impossible
from gtpin.diagnosis.inference.readmit_outliers import MOST_POSES, believed
from gtpin.diagnosis.inference.understated_noise import understated
from gtpin.diagnosis.inference.unexplained import unexplained
from gtpin.diagnosis.inference.where import where
from gtpin.diagnosis.linear.cross_validation import Gap, gap
from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.planning.discrimination import Standing
from gtpin.diagnosis.planning.next_experiment import plan
from gtpin.diagnosis.preparation.contradictions import without_contradictions
from gtpin.diagnosis.preparation.filled_in import without_filled_in
from gtpin.diagnosis.result import Cause, Considered, Diagnosis
from gtpin.errors import ModelError, warn
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.memory import require
from gtpin.model.model import Model
from gtpin.robot.geometry import Geometry
from gtpin.robot.library import load_robot
from gtpin.robot.robot import Robot

Floats = npt.NDArray[np.float64]

FALSE_ALARM = 0.01
"""Chance of naming a cause where there is none."""
REGIONS = 12
"""Boxes that the workspace is cut into."""
SEARCHED, SEARCHED_A_COVARIATE = 130e3, 45e3
"""Bytes of memory for each pose that a search is made on, and for each of its covariates in addition: displacements by every
candidate. Measured: docs/speed.md.
"""
TOGETHER = 4
"""Neighbouring poses that are left out together."""
ROUNDS = 2
"""Times that the noise is asked again: a first guess beside too little noise explains some of it away."""


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

    Examples
    --------
    >>> import gtpin
    >>> diagnosis = gtpin.diagnose(gtpin.Dataset.read("measured"), exclude=["backlash@cart1"])
    >>> any((cause.effect, cause.site) == ("backlash", "cart1") for cause in diagnosis.causes)
    False
    """
    given = dataset
    nominal = robot.robot if isinstance(robot, Model) else robot or load_robot(dataset.robot_reference)
    excluded = check_excluded(exclude, nominal)
    searching = min(len(dataset), MOST_POSES) * (SEARCHED + SEARCHED_A_COVARIATE * len(dataset.covariates))
    require(f"diagnosing {len(dataset):,} poses", FIXED + searching + PER_POSE * len(dataset))
    recorded = prepared(dataset, Model(Geometry.nominal(nominal)))
    dataset = without_contradictions(without_filled_in(recorded.take(sane_rows(recorded))))
    baseline = calibrate(dataset, nominal, progress=progress)
    # What is drawn from rows must not depend on the order that they came in.
    dataset = replace(dataset, instrument=baseline.instrument).in_order()
    if not isinstance(baseline.model.kinematics, RodKinematics):
        raise ModelError(f"{baseline.model.robot.name} has no rods", hint="effects are for robots with rods")
    report = progress or _silent
    report("searching for causes", 0, float(np.sqrt(baseline.chi2_per_dof)))
    rng = np.random.default_rng(seed)
    believable, sure = believed(dataset, baseline, excluded, false_alarm)
    kept, rows, everything, evidence = _sought(
        dataset.take(believable), ~sure[believable], baseline, excluded, false_alarm, rng
    )
    if not evidence.found.named.names and (believable != sure).any():
        none = np.zeros(np.count_nonzero(sure), dtype=bool)
        kept, rows, everything, evidence = _sought(dataset.take(sure), none, baseline, excluded, false_alarm, rng)
    small = understated(
        Observed.of(dataset.take(sure), baseline).take(_at_most(sure)),
        baseline,
        lambda design: make_pool(design, excluded, false_alarm)[0],
    )
    if small:
        _warn_of_noise(small)
        undeclared = dataset.instrument.model_copy(update=dict.fromkeys(small))
        again = diagnose(
            replace(recorded, instrument=undeclared),
            robot,
            exclude=exclude,
            false_alarm=false_alarm,
            seed=seed,
            progress=progress,
        )
        return replace(again, dataset=given)
    design, pool = evidence.design, evidence.pool
    told = evidence.observed.noise
    noise = replace(
        everything.noise,
        position_sigma=told.position_sigma,
        orientation_sigma=told.orientation_sigma,
        repeatability=told.repeatability,
    )
    searched = kept.take(rows[evidence.used])
    if len(kept) <= MOST_POSES:
        kept, everything = searched, evidence.observed
    else:
        good = ~np.isin(np.arange(len(kept)), rows[~evidence.used])
        kept, everything = kept.take(good), replace(everything, noise=noise).take(good)
    report("fitting causes and geometry together", 0, float("nan"))
    found = with_full_digits(without_idle(pool, evidence.found, _blocks(searched)), pool, searched)
    model, found_causes = _fitted(everything, baseline.model, evidence, found)
    asked = questions(pool, found_causes)
    if asked.impossible:
        found = without_impossible(pool, found, asked.impossible)
        model, found_causes = _fitted(everything, baseline.model, evidence, found)
    names = found.named.names
    columns = {n: pool.groups.columns[n] * s for n, s in zip(names, found.named.scale, strict=True)}
    report("how far the gap shrinks", 0, float("nan"))
    whole, shares = _gaps(searched, evidence, columns, rng)
    found = held_out(found, pool, whole, searched)
    sigma, at = baseline.noise.position_sigma, design.situation
    scattered = scatter_may_hide(found, baseline.noise.repeatability, sigma, evidence.untestable, at)
    if scattered:
        found = replace(found, verdict="unknown", unknown=1.0)
    left = design.y - design.B @ pool.groups.marginal.deviation(design.y)
    remaining = unexplained(pool, found.named, found.verdict == "unknown")
    remaining = replace(remaining, could_be=tuple(dict.fromkeys((*scattered, *remaining.could_be))))
    takes = {n: (whole.shrinkage or 0.0) - (shares[n].shrinkage or 0.0) for n in names}
    shrunk = [replace(c, shrinkage=takes[f"{c.effect}@{c.site}"]) for c in found_causes]
    causes = sorted(shrunk, key=lambda c: -c.shrinkage)
    regions = by_region(searched, max(2, min(REGIONS, int(searched.visits.max()) + 1)))
    aside = ~np.isin(recorded.row, kept.row)
    report("what to measure next", 0, float("nan"))
    return Diagnosis(
        verdict=found.verdict,
        causes=tuple(causes),
        candidates=tuple(_considered(pool, found, evidence.untestable, remaining.could_be)),
        where=where(design, left, pool, found.gains, regions),
        gap=whole,
        unexplained=remaining,
        baseline=baseline,
        model=model,
        set_aside=tuple(dict.fromkeys(str(pose) for pose in recorded.pose[aside])),
        set_aside_rows=tuple(int(line) for line in recorded.row[aside]),
        next_experiment=plan(
            evidence.observed,
            baseline.model,
            design.situation.references,
            standings=_standings(pool, found, causes),
            untestable=evidence.untestable,
            unknown=next(((free.site, free.words) for free in found.strangers), None),
            rng=rng,
        ),
        questions=(*asked.impossible, *asked.unusual),
        dataset=given,
        seed=seed,
    )


def _fitted(everything: Observed, model: Model, evidence: _Evidence, found: Decision) -> tuple[Model, list[Cause]]:
    """The model with the causes in, and the causes with their parameters."""
    names = found.named.names
    candidates = [evidence.pool.candidates[name] for name in names]
    whole = fit_together(everything, model, candidates, found.named.scale, evidence.design.situation.references)
    return whole, [cause(whole, c, found.classes[n], 0.0) for n, c in zip(names, candidates, strict=True)]


def _at_most(rows: npt.NDArray[np.bool_]) -> npt.NDArray[np.intp]:
    """Indices of as many rows as a search is made on, evenly spread."""
    count = int(rows.sum())
    return np.arange(count)[:: 1 + count // MOST_POSES]


def _warn_of_noise(small: dict[Sigma, tuple[float, float]]) -> None:
    for key, (declared, seen) in small.items():
        ratio = seen / declared
        warn(
            f"{key} is {declared:.2g}, but these data show a noise of {seen:.2g}, {ratio:.2g} times more, which is used"
        )


def _blocks(dataset: Dataset) -> list[npt.NDArray[np.bool_]]:
    """Neighbouring poses that are left out together."""
    return by_region(dataset, max(2, (int(dataset.visits.max()) + 1) // TOGETHER))


def _silent(step: str, number: int, value: float) -> None:
    """Tell nobody of progress."""


def _standings(pool: Pool, found: Decision, causes: list[Cause]) -> list[Standing]:
    """Causes with their classes, the largest first, as the planning of experiments takes them."""
    scale = dict(zip(found.named.names, found.named.scale, strict=True))
    names = [f"{c.effect}@{c.site}" for c in causes]
    return [
        Standing(
            pool.candidates[name],
            scale[name],
            tuple((pool.settled(f"{m.effect}@{m.site}"), m.probability) for m in found.classes[name]),
        )
        for name in names
    ]


@dataclass(frozen=True)
class _Evidence:
    """A search's result, with what it was found on: ``used`` (N,) are the poses that were not set aside."""

    observed: Observed
    used: npt.NDArray[np.bool_]
    design: Design
    pool: Pool
    found: Decision
    untestable: tuple[Considered, ...]


def _sought(
    kept: Dataset,
    readmitted: npt.NDArray[np.bool_],
    baseline: Calibration,
    exclude: Collection[str],
    false_alarm: float,
    rng: np.random.Generator,
) -> tuple[Dataset, npt.NDArray[np.intp], Observed, _Evidence]:
    """The same poses, which of them (k,) the search was made on, all as they were observed, and what was found.

    Of more than ``MOST_POSES`` a random part; of poses that the calibration had set aside (``readmitted``) as many as half
    of it has room for, so that their cause is there to be found and they to be judged again.
    """
    drawn = rng.permutation(len(kept))
    first = drawn[readmitted[drawn]][: MOST_POSES // 2]
    rows = np.sort(np.concatenate([first, drawn[~readmitted[drawn]]])[:MOST_POSES])
    everything = Observed.of(kept, baseline)
    found = _searched(everything.take(rows), baseline.model, kept.instrument, exclude, false_alarm)
    return kept, rows, everything, found


def _searched(
    observed: Observed, model: Model, instrument: Instrument, exclude: Collection[str], false_alarm: float
) -> _Evidence:
    """Search, with gross errors and the noise asked again once a first look has told what is none."""
    declared = (instrument.position_sigma is not None, instrument.orientation_sigma is not None)
    design = observed.design(model)
    pool, untestable = make_pool(design, exclude, false_alarm)
    guess = rough_guess(pool)
    # Beside a large cause a calibration can't see them.
    used = ~gross_errors(pool, guess)
    if not used.all() and guess.names:
        observed = observed.take(used)
        design = observed.design(model)
        pool, untestable = make_pool(design, exclude, false_alarm)
        guess = rough_guess(pool)
    else:
        used[:] = True
    for _ in range(ROUNDS):
        asked = asked_again(observed, pool, guess, declared)
        if not asked.matters:
            break
        observed, design = asked.observed, asked.observed.design(model)
        pool, untestable = make_pool(design, exclude, false_alarm)
        guess = rough_guess(pool)
    found = decide(pool)
    if not found.strangers:
        fine = asked_again(observed, pool, found.named, declared).fine
        found = found if fine is None else with_fine(pool, found, fine)
    return _Evidence(observed, used, design, pool, found, untestable)


def _gaps(
    dataset: Dataset, evidence: _Evidence, columns: dict[str, Floats], rng: np.random.Generator
) -> tuple[Gap, dict[str, Gap]]:
    """How far the gap shrinks with all causes, and with all but each."""
    design, noise = evidence.design, evidence.observed.noise
    blocks = _blocks(dataset)
    covariance = noise.covariance(design.command_jacobian, design.components)
    floor = np.trace(covariance[:, :3, :3], axis1=1, axis2=2)
    none = np.zeros((len(design.y), 0))
    whole = gap(design, np.hstack([none, *columns.values()]), floor, blocks, rng)
    if len(columns) == 1:
        return whole, {name: gap(design, none, floor, blocks, rng) for name in columns}
    less = {name: np.hstack([none, *(v for n, v in columns.items() if n != name)]) for name in columns}
    return whole, {name: gap(design, others, floor, blocks, rng) for name, others in less.items()}


def _considered(
    pool: Pool, found: Decision, untestable: tuple[Considered, ...], could_be: Collection[tuple[str, str]]
) -> list[Considered]:
    """Everything that was tested, the likeliest first, then what could not be."""
    probability = {f"{m.effect}@{m.site}": m.probability for members in found.classes.values() for m in members}
    lifted = {f"{m.effect}@{m.site}" for members in found.classes.values() for m in members if not m.recorded}
    asked = lifted | {f"{effect}@{site}" for effect, site in could_be}
    reason = {h.candidate.name: h.reason for h in pool.hidden.values() if h.candidate.name in asked}
    rows = [
        Considered(*split(name), found.gains[name], probability.get(name, 0.0), True, reason.get(name, ""))
        for name in pool.named
        if name in found.gains
    ]
    others = [replace(row, probability=probability.get(f"{row.effect}@{row.site}", 0.0)) for row in untestable]
    return [*sorted(rows, key=lambda row: -row.log_evidence), *others]
