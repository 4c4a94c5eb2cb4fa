"""Diagnose the gap between a model and measurements: where it lies, what causes it, how much the causes explain.

Or, with an earlier model, what has changed since.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from typing import overload

import numpy as np

from gtpin.calibration.calibrate import FIXED, PER_POSE
from gtpin.calibration.checks.suspected import gross_errors, true_of_causes
from gtpin.calibration.result import Calibration
from gtpin.calibration.robust_fit import Progress
from gtpin.calibration.thinning import thinned
from gtpin.data import Dataset, by_region
from gtpin.data.plausible import sane_rows
from gtpin.diagnosis.against import check
from gtpin.diagnosis.changed_geometry import LengthChange, TrackChange
from gtpin.diagnosis.doubts import (
    OF_LEFT_OUT_POSES,
    OF_THE_FIT,
    OF_THE_SEARCH,
    Context,
    FittedContext,
    judged,
    questions,
)
from gtpin.diagnosis.gap import (
    Place,
    blocks_of,
    capped_by_left_out_errors,
    check_hold_out,
    gaps,
    lost,
    unexplained,
    where,
)
from gtpin.diagnosis.hypothesis import Hypothesis, Scope
from gtpin.diagnosis.joint_fit import between_members, cause, fit_together
from gtpin.diagnosis.jumps import jump_times
from gtpin.diagnosis.leaders import leaders, left_with
from gtpin.diagnosis.next_experiment import classes, plan
from gtpin.diagnosis.noise import (
    MOST_POSES,
    SearchState,
    ShownNoise,
    floor_of,
)
from gtpin.diagnosis.periodic_lines import strongest_first
from gtpin.diagnosis.prepare import Prepared
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.diagnosis.result import (
    Cause,
    Diagnosis,
    Doubt,
    Gap,
    HealthCheck,
    HoldOut,
    Source,
)
from gtpin.diagnosis.tolerances import begun
from gtpin.diagnosis.trials import Known
from gtpin.diagnosis.verdict import Conclusion, considered, infer, undecided, with_also
from gtpin.diagnosis.why import why_of
from gtpin.effects.catalogue import catalogue
from gtpin.effects.driver import driver_effects
from gtpin.effects.effect import Effect
from gtpin.errors import ConvergenceError, ModelError, check_kind, deferred, noted, warn
from gtpin.memory import require
from gtpin.model.measured_robot import check_same_robot, measuring, robot_of
from gtpin.model.model import Model
from gtpin.paper.geometry import nominal_geometry
from gtpin.read_only import gives_read_only
from gtpin.real import generator, probability
from gtpin.robot.chain import Chain
from gtpin.threads import in_one_thread
from gtpin.typing import Mask

FALSE_ALARM = 0.01
"""Probability of naming a cause where there is none."""
REGIONS = 12
"""Largest number of regions into which the workspace is divided; with fewer poses there are fewer regions."""
SEARCHED, SEARCHED_A_COVARIATE = 130e3, 45e3
"""Memory for the displacements by all hypotheses, bytes: for each pose of a search, and in addition for each covariate of each
pose. Measured: docs/speed.md.
"""


@overload
def diagnose(
    dataset: Dataset,
    robot: Chain | Model | None = None,
    *,
    against: None = None,
    effects: Iterable[Effect] | None = None,
    exclude: Collection[str] = (),
    false_alarm: float = FALSE_ALARM,
    priors: Priors = PRIORS,
    hold_out: HoldOut = "region",
    seed: int = 0,
    poses: int | None = None,
    trust_data: bool = False,
    progress: Progress | None = None,
    why: str | None = None,
) -> Diagnosis: ...


@overload
def diagnose(
    dataset: Dataset,
    robot: None = None,
    *,
    against: Model,
    effects: Iterable[Effect] | None = None,
    exclude: Collection[str] = (),
    false_alarm: float = FALSE_ALARM,
    priors: Priors = PRIORS,
    seed: int = 0,
    poses: int | None = None,
    trust_data: bool = False,
    progress: Progress | None = None,
    why: None = None,
) -> HealthCheck: ...


@in_one_thread
@gives_read_only
def diagnose(
    dataset: Dataset,
    robot: Chain | Model | None = None,
    *,
    against: Model | None = None,
    effects: Iterable[Effect] | None = None,
    exclude: Collection[str] = (),
    false_alarm: float = FALSE_ALARM,
    priors: Priors = PRIORS,
    hold_out: HoldOut = "region",
    seed: int = 0,
    poses: int | None = None,
    trust_data: bool = False,
    progress: Progress | None = None,
    why: str | None = None,
) -> Diagnosis | HealthCheck:
    """Find the causes of the error that remains after geometric calibration; or, with ``against``, of what has changed.

    Without ``against``, five steps: prepare the data and calibrate; propose hypotheses, and re-estimate noise and outliers;
    infer which hypotheses are causes; fit them together with the geometry; plan what to measure next. See docs/diagnosis.md.

    With ``against``, nothing is calibrated: the earlier model with its uncertainty is the prior, and the causes are changes
    since then. Ten poses are enough. See docs/health.md.

    Parameters
    ----------
    dataset
        Measured poses or readings, with all covariates that were recorded.
    robot
        The nominal robot, or a model whose ``robot`` is taken; by default the robot that the dataset names. Not allowed
        together with ``against``.
    against
        An earlier model of the machine; None: no earlier model.
    effects
        The effects to try; by default the whole catalogue. To add your own effects: ``[*gtpin.catalogue(), MyEffect()]``.
        The dataset's drivers (``[[driver]]`` in dataset.toml) are tried in addition, but not with ``against``.
    exclude
        Effects that are not tried, each as ``effect`` (at all its sites) or ``effect@site``.
    false_alarm
        Probability of naming a cause where there is none.
    priors
        The constants on which verdicts depend, each with its source: docs/statistics.md.
    hold_out
        The poses that are left out together to compute the gap: ``region`` (neighbouring poses), ``session``, ``time``
        (neighbours in time) or ``random``. Only ``gap`` and the causes' ``explained_fraction`` depend on it.
        With ``against`` it is not used: each pose is left out by itself.
    seed
        Seed of the random numbers: subsets of large datasets, and the draws from which intervals and thresholds are computed.
    poses
        Number of poses that are used of a dataset with more: see :func:`~gtpin.calibration.thinning.thinned`. None: all.
    trust_data
        Whether checks for usual mistakes (units, signs, orders of columns) only warn, and never refuse the data.
    progress
        Called at each stage with a message, the number of the iteration, and the RMS residual in units of the noise (NaN where
        there is none); None: no calls.
    why
        An effect at a site, ``EFFECT@SITE``: the result's ``why`` has what stands for and against it. Not allowed together
        with ``against``.

    Returns
    -------
    diagnosis
        A :class:`~gtpin.diagnosis.result.Diagnosis`; with ``against`` a :class:`~gtpin.diagnosis.result.HealthCheck`.

    Raises
    ------
    GtpinError
        If the dataset does not match this robot, an excluded effect is not known, or the data do not have the column or the
        number of poses that ``hold_out`` needs. If both a robot and an earlier model are given, or a check lacks what the
        model needs.

    Examples
    --------
    >>> import gtpin
    >>> diagnosis = gtpin.diagnose(gtpin.Dataset.read("measured"), exclude=["backlash@cart1"])
    >>> any((cause.effect, cause.site) == ("backlash", "cart1") for cause in diagnosis.causes)
    False
    """
    check_kind(dataset, Dataset)
    check_kind(robot, Chain, Model, type(None))
    check_kind(against, Model, type(None))
    generator(seed)
    probability(false_alarm, "false_alarm")
    if against is not None and robot is not None:
        raise ModelError("a robot and an earlier model of it", hint="give against alone: the model has its robot")
    if against is not None and why is not None:
        raise ModelError("a check has no answer to why", hint="ask a diagnosis: leave out the earlier model")
    with noted() as texts:
        trusted = replace(dataset, trusted=True) if trust_data else dataset
        report: Progress = progress or (lambda step, number, value: None)
        known = tuple(catalogue() if effects is None else effects)
        found: Diagnosis | HealthCheck
        if against is None:
            nominal = measuring(robot.robot if isinstance(robot, Model) else robot or robot_of(trusted), trusted)
            if poses is not None:
                trusted = thinned(trusted, nominal_geometry(nominal, tolerance=trusted.tolerance), poses)
            scope = Scope.of((*known, *driver_effects(trusted, nominal)), exclude, false_alarm, nominal, priors)
            place = None if why is None else scope.place(why, nominal)
            with deferred() as of_the_fits:
                found = _diagnose(trusted, nominal, known, scope, hold_out, seed, report, place)
                of_the_fits[:] = _true_warnings(of_the_fits, found)
        else:
            check_same_robot(against.robot, trusted)
            geometry = against.geometry
            earlier = replace(against, geometry=replace(geometry, robot=measuring(geometry.robot, trusted)))
            if poses is not None:
                trusted = thinned(trusted, earlier.geometry, poses)
            if effects is None:
                known = (*known, LengthChange(earlier), TrackChange(earlier))
            scope = Scope.of([one.as_change() for one in known], exclude, false_alarm, earlier.robot, priors)
            found = check(trusted, earlier, scope, seed, report)
    dataset = dataset if poses is None else replace(trusted, trusted=dataset.trusted)
    return replace(found, dataset=dataset, seed=seed, warnings=dataset.all_warnings(texts))


def _diagnose(
    dataset: Dataset,
    nominal: Chain,
    known: Sequence[Effect],
    scope: Scope,
    hold_out: HoldOut,
    seed: int,
    report: Progress,
    place: Place | None,
) -> Diagnosis:
    """As :func:`diagnose`, without an earlier model; ``known``: the effects without the dataset's drivers; ``place``: that of
    ``why``."""
    check_hold_out(dataset, hold_out)
    searching = min(len(dataset), MOST_POSES) * (SEARCHED + SEARCHED_A_COVARIATE * len(dataset.covariates))
    require(f"diagnosing {len(dataset):,} poses", FIXED + searching + PER_POSE * len(dataset))
    if not any(inertia.mass > 0.0 for inertia in nominal.model.inertias[1:]):
        what = "can be tested only by a recorded payload or force on the tool"
        warn(f"the links of {nominal.name} have no masses: effects of load {what}")
    for number, actuator in enumerate(nominal.actuators):
        led = [str(nominal.model.names[j]) for j, _ in nominal.carriers(number) if j != actuator.joint_id]
        if led and actuator.joint_id not in nominal.moving_joints:
            warn(f"{actuator.joint} does not carry the TCP itself: its effects are those of {', '.join(led)}")
    rng, priors = generator(seed), scope.priors

    # 1. Prepare. 2. Propose hypotheses, and settle the noise and which rows are gross errors.
    prepared, scope, settled = begun(dataset, nominal, known, scope, hold_out, rng, report)
    hypotheses, searched, recorded = settled.hypotheses, settled.searched, prepared.recorded

    # 3. Infer which hypotheses are causes, and apply the doubts that need no fit. The checks always leave out neighbours.
    report("comparing causes", 0, float("nan"))
    context = Context(prepared, settled, infer(settled), blocks_of(searched, "region", rng))
    report("fitting causes and geometry together", 0, float("nan"))
    found = judged(context, OF_THE_SEARCH).found

    # 4. Fit causes and geometry together with the exact kinematics, and apply the other doubts.
    try:
        model, causes = _fitted(prepared, settled, found)
    except ConvergenceError:  # the causes explain the data to first order only: no closed chain has them at such sizes
        if not found.classes:
            raise
        found = found.only(hypotheses, []).doubted(Doubt("held_out"))
        model, causes = _fitted(prepared, settled, found)
    context = replace(context, found=found, causes=causes)
    asked = questions(found, causes, priors)
    found = judged(context, OF_THE_FIT).found
    if found is not context.found:
        model, causes = _fitted(prepared, settled, found)
    fitted = found.classes
    report("predicting poses left out", 0, float("nan"))
    shown = ShownNoise.of(settled.observed, hypotheses, settled.guess, prepared.declared, priors)
    floor, inferred = shown.floor(hypotheses.design), floor_of(settled.observed.noise, hypotheses.design)
    sessions = len(set(searched.covariates.get("session", ("",))))

    def gaps_by(which: HoldOut) -> tuple[Gap, dict[tuple[str, str], Gap]]:
        blocks = blocks_of(searched, which, rng)
        whole, less = gaps(hypotheses, found, floor, blocks, rng, which == "session", inferred)
        return replace(whole, hold_out=which, blocks=len(blocks), sessions=sessions), less

    whole, less = gaps_by("region")
    found = capped_by_left_out_errors(found, whole, less, causes, bool(nominal.joint_sites), priors)
    found = with_also(hypotheses, found)
    left_out = FittedContext(prepared, settled, found, context.blocks, causes, gap=whole, shown=shown)
    found = judged(left_out, OF_LEFT_OUT_POSES).found
    sure = found.named_beside_unknown(hypotheses) if found.doubts else found
    if len(sure.classes) < len(found.classes) or found.classes is not fitted:
        # A cause that is not sure may only take up a part of the unknown. Fitted causes have the probabilities of before.
        found = sure
        model, causes = _fitted(prepared, settled, found)
        whole, less = gaps_by("region")
    if hold_out != "region":
        whole, less = gaps_by(hold_out)
    small_causes = {cause.place for cause in found.also}
    causes = [replace(c, explained_fraction=lost(whole, less[c.effect, c.site])) for c in causes]
    causes = sorted((c for c in causes if (c.effect, c.site) not in small_causes), key=lambda c: -c.explained_fraction)
    remaining = unexplained(hypotheses, found.model, found.verdict == "unknown")
    no_cause = {c.place for c in found.classes} | {(q.effect, q.site) for q in asked if not q.believed}
    nearest, best = leaders(hypotheses, found, context.blocks, no_cause, whole) if found.doubts else ((), None)
    likely = [place for place in found.likely if place not in no_cause]
    likely += [(one.effect, one.site) for one in nearest[:1]]
    could_be = left_with(hypotheses, found, context.blocks, (*likely, *remaining.could_be))

    # 5. Plan what to measure next.
    report("what to measure next", 0, float("nan"))
    places = [(one.site, one.coordinates) for one in remaining.correlates]  # the first one is in the headline
    places += [(d.site, ",".join(d.over)) for d in found.doubts if d.over]
    known_now = Known(settled.observed, prepared.baseline.model, settled.references)
    by_class = classes(found, causes, hypotheses)
    experiments = plan(
        known_now,
        classes=by_class,
        untestable=hypotheses.untested,
        unknown=places[0] if any(d.over for d in found.doubts) else None,
        unseen_noise=any(d.reason == "excess" for d in found.doubts),
        rng=rng,
    )
    why = None
    if place is not None:
        context = replace(context, found=found)
        why = why_of(place, context, asked, known_now, by_class, experiments, generator(seed))
        more = [why.experiment] if why.experiment is not None and why.experiment not in experiments else []
        experiments = (*experiments, *more)
    regions = by_region(searched, max(2, min(REGIONS, int(searched.visits.max()) + 1)))
    aside: Mask = ~np.isin(recorded.row, settled.kept.row)
    unknown = remaining.correlates[:1] if found.verdict == "unknown" else ()
    over_time = [one.site for one in unknown if one.coordinates == "time"]
    jumps = [t for site in over_time for t in jump_times(recorded, model, ~aside, site)]
    return Diagnosis(
        verdict=found.verdict,
        causes=tuple(causes),
        also=undecided(hypotheses, found),
        candidates=considered(hypotheses, found, could_be),
        where=where(hypotheses, regions),
        gap=whole,
        noise_source=shown.source,
        noise_ratio=shown.ratio,
        unexplained=replace(
            remaining,
            could_be=could_be,
            descriptions=found.descriptions,
            leaders=nearest,
            best_known=best,
            jumps=tuple(jumps),
        ),
        baseline=_with_left_out(prepared.baseline, model, whole, shown.source),
        model=replace(model, between_members=between_members(hypotheses, found)),
        set_aside=tuple(dict.fromkeys(str(pose) for pose in recorded.pose[aside])),
        set_aside_rows=tuple(int(line) for line in recorded.row[aside]),
        next_experiment=experiments,
        questions=tuple(asked),
        effects=scope.effects,
        doubts=found.doubts,
        dataset=recorded,
        why=why,
    )


def _with_left_out(baseline: Calibration, fitted: Model, gap: Gap, source: Source) -> Calibration:
    """The geometry alone, with what the search found of its errors: without causes what the fit leaves unexplained, with some
    its errors at left-out poses beyond noise, less those by repeatability.

    A calibration can't tell scatter between visits that the causes explain from noise of the instrument.
    """
    model, of, larger = baseline.model, gap.of_positions, fitted.unexplained
    if model.unexplained is None or of is None or source == "residuals":
        return baseline
    if fitted.effects:
        power = of.before**2 - of.floor**2
        if model.fit is not None:
            q = baseline.dataset.q[baseline.used(baseline.dataset)]
            moved = model.kinematics.command_jacobian(q, model.kinematics.forward(q))[:, :3] * model.fit.drives
            power -= float((moved**2).sum(axis=(1, 2)).mean())
        larger = model.unexplained.of_position(float(np.sqrt(max(power, 0.0) / 3.0)))
    return replace(baseline, model=replace(model, unexplained=larger))


def _true_warnings(texts: Sequence[str], found: Diagnosis) -> list[str]:
    """The warnings of a diagnosis and its calibrations that are true of its last fit."""
    recorded = found.dataset
    gross = np.isin(recorded.row, found.set_aside_rows) & sane_rows(recorded)  # there are other warnings of others
    gross[gross] = found.baseline.model.kinematics.forward(recorded.q[gross]).reached
    return true_of_causes(texts, gross_errors(recorded, gross), explained=found.verdict != "unknown")


def _fitted(prepared: Prepared, settled: SearchState, found: Conclusion) -> tuple[Model, list[Cause]]:
    """The model fitted with the causes, and the causes with their parameters."""
    named: Sequence[Hypothesis] = list(found.classes)
    # Not `cause` as the variable: in Python 3.12.1 the function `cause` would then be unbound below.
    scale = [found.scale[hypothesis] for hypothesis in named]
    ordered = [strongest_first(settled.hypotheses, found.model, c) for c in named]
    model = prepared.baseline.model
    try:
        model = fit_together(settled.everything, model, ordered, scale, settled.references)
    except ConvergenceError:
        if named:  # without causes, the calibration has fitted the same, with its own noise
            raise
    return model, [cause(model, own, found, c, settled.hypotheses) for c, own in zip(named, ordered, strict=True)]
