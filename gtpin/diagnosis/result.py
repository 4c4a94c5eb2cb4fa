"""The results of a diagnosis, and of a check against an earlier model, with their parts as plain values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.effects.catalogue import catalogue, effect_of
from gtpin.effects.effect import Effect, Nature
from gtpin.effects.operating_points import Column
from gtpin.effects.untestable import Untestable
from gtpin.errors import renamed
from gtpin.estimate import Estimate
from gtpin.model.fit_conditions import ModelDiscrepancy
from gtpin.model.model import Model
from gtpin.output.shown import FitResult, SavedResult, present
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


Verdict = Literal["none", "explained", "ambiguous", "unknown"]


@dataclass(frozen=True)
class Member:
    """An effect at a site that could be the cause, with its probability.

    ``recorded`` is False where its covariate is missing and only a proxy of it supports the effect. ``beside`` is the effect
    and site of another member, where two or more could be in the place of the cause only together, each beside the next; their
    probability is divided equally between them. ``parameters``: its parameters in the place of the cause; empty where a proxy
    or a pair is meant.
    """

    effect: str
    site: str
    probability: float
    recorded: bool = True
    beside: tuple[str, str] | None = None
    parameters: Mapping[str, Estimate] = field(default_factory=dict, hash=False)


@dataclass(frozen=True)
class Cause:
    """A cause, and everything that could be the cause in its place.

    Parameters
    ----------
    effect, site, probability
        The leader of the class, and its probability.
    members
        The class: the leader and every hypothesis with at least 5 % of its probability. An effect with a missing covariate is
        one of them where a proxy supports it.
    parameters
        The parameters of the leader, by name.
    explained_fraction
        Explained fraction of the gap's power, given the other causes.
    nature
        The nature of the leader's effect: :attr:`gtpin.effects.effect.Effect.nature`.
    share
        Its share of the squares of all causes' displacements beyond what the geometry absorbs.
    """

    effect: str
    site: str
    probability: float
    members: tuple[Member, ...]
    parameters: dict[str, Estimate]
    explained_fraction: float
    nature: Nature = "mechanism"
    share: float = 1.0
    shrinkage = renamed("shrinkage", "explained_fraction")


@dataclass(frozen=True)
class Undecided:
    """What is weak and undecided: the site of the leader of its class, the size at the TCP (root mean square, m), the class."""

    site: str
    rms: float
    members: tuple[Member, ...]


@dataclass(frozen=True)
class FlexibleFamily:
    """A flexible family that fits, but is no cause: it says where the error is and over what, not why.

    ``rms`` is its root mean square at the TCP, m, and ``probability`` that of the family among all hypotheses.
    """

    effect: str
    site: str
    over: tuple[str, ...]
    rms: float
    probability: float


@dataclass(frozen=True)
class Considered:
    """A hypothesis that was considered.

    Parameters
    ----------
    effect, site
        The hypothesis.
    log_evidence
        Its gain in log evidence, nats.
    probability
        Its probability as a member of the class of a cause; 0 where it is in none. An untestable effect has one where a proxy
        supports it.
    testable
        Whether these data can test it.
    reason
        Of an untestable effect: why it is untestable. Of a testable one: why it could be the cause although its test did not
        show it (a payload that was not recorded); else None.
    """

    effect: str
    site: str
    log_evidence: float
    probability: float
    testable: bool
    reason: Untestable | None


@dataclass(frozen=True)
class Question:
    """A parameter of a cause whose value is outside the range that its effect states as plausible or usual.

    ``effect``, ``site``, ``parameter``: the parameter. ``value``, ``sigma``, ``unit``: its estimate. ``low``, ``high``: the
    range, in ``unit``. ``why``: the reason for this range. ``believed``: whether the cause is named in spite of it.
    """

    effect: str
    site: str
    parameter: str
    value: float
    sigma: float
    unit: str
    low: float
    high: float
    why: str
    believed: bool


class Correlate(NamedTuple):
    """A smooth term that correlates with what the causes leave.

    ``site`` and ``coordinates`` of the term; its p-value under noise alone; its kind of motion, as in `SmoothTerm`; its
    probability relative to that of the best one.
    """

    site: str
    coordinates: str
    p_value: float
    motion: str
    odds: float


class Leader(NamedTuple):
    """A mechanism that comes near to what is unknown.

    Its effect and site; its gain in log evidence beside the named causes, nats; the error on left-out poses, as in
    :class:`Gap`, of the geometry with the named causes and it.
    """

    effect: str
    site: str
    log_evidence: float
    left: float


class BestKnown(NamedTuple):
    """The mechanisms that together explain most of the gap, the named causes first, and the error on left-out poses, as in
    :class:`Gap`, that they leave."""

    effects: tuple[tuple[str, str], ...]
    left: float


@dataclass(frozen=True)
class Unexplained:
    """What is left after the causes.

    ``share``: Chi-square beyond its expected value, divided by the same quantity with the geometry alone; 0 to 1. ``p_value``:
    probability that noise alone gives a larger chi-square. ``correlates``: the smooth terms that correlate with the residuals,
    the largest gain in log evidence first, one of each site over the same coordinates; five at most. ``could_be``: effect and
    site of effects that could be the unknown: likely causes that these data do not tell from it, then the first leader, then
    untestable effects whose proxies explain the residuals about as well as the best smooth term, then those at its site that
    have no proxy; each with the root mean square position error on left-out poses, m, beside the named causes: None where no
    instrument reads positions, and for untestable effects, which can't be fitted. ``descriptions``: flexible families that
    explain a part of them and are no causes. ``leaders``: where something unknown is assumed, the mechanisms of the catalogue
    by evidence, five at most. ``best_known``: the best set of mechanisms; None where no set explains a tenth of the gap's
    squares. ``jumps``: times, s, at which what is unknown jumps, where it is a function of the time.
    """

    share: float
    p_value: float
    correlates: tuple[Correlate, ...]
    could_be: Mapping[tuple[str, str], float | None] = field(default_factory=dict, hash=False)
    descriptions: tuple[FlexibleFamily, ...] = ()
    leaders: tuple[Leader, ...] = ()
    best_known: BestKnown | None = None
    jumps: tuple[float, ...] = ()


Standing = Literal[
    "named",
    "also",
    "untestable",
    "impossible",
    "description",
    "weak",
    "class",
    "taken",
    "beside",
    "chance",
    "smooth",
    "left_out",
    "part",
    "rival",
]
"""Where an effect at a site stands in a diagnosis; the first that applies:

``named``, ``also``
    It is a cause, or stands apart as weak and undecided.
``untestable``, ``impossible``, ``description``
    These data can't test it; a parameter would be impossible; it is a flexible family, which is no cause.
``weak``
    Alone, it gains less than the prior odds against it.
``class``
    Another member of its class is the cause.
``taken``, ``beside``
    Beside the named causes it gains too little: one of them takes its place, or it is no more than what they leave.
``chance``, ``smooth``
    Its periods are not significant against the scatter of the drive; smooth terms take its place.
``left_out``
    The errors on left-out poses are no smaller with it.
``part``, ``rival``
    It could be a part of something unknown; another hypothesis is more probable.
"""


class Rival(NamedTuple):
    """What could be in the place of an effect: an effect at a site, or a smooth term over coordinates.

    ``effect``: empty for a smooth term. ``over``: coordinates of a smooth term. ``log_evidence``: its gain there, nats.
    ``probability``: in that place.
    """

    effect: str
    site: str
    over: tuple[str, ...]
    log_evidence: float
    probability: float


class LeftOutErrors(NamedTuple):
    """Root mean square errors on left-out poses: positions, m, or all readings in units of their noise (``unit`` empty).

    Of the geometry; of the geometry with the effect alone; with the other named causes without it; and with it.
    """

    unit: str
    geometry: float
    alone: float
    without: float
    with_it: float


@dataclass(frozen=True)
class Why:
    """What stands for and against one effect at a site.

    Of an untestable effect, only the reason, an experiment, and the probability by a proxy are given.

    Parameters
    ----------
    effect, site, standing
        The effect, and where it stands.
    reason
        Why it can't be tested.
    probability
        In its class; of what is in no class, in the place of the named cause that takes its place.
    log_evidence, odds
        Its gain in log evidence alone over the geometry, and the log prior odds against it, nats.
    beside, needed
        Its gain beside the other named causes, and what it must be there: prior odds, and a share of stronger evidence.
    smooth, beside_smooth
        Sites and coordinates of the smooth terms of the diagnosis, else those of the best one; its gain beside these too.
    in_place
        Its gain in the place of the first rival; without named causes, beside nothing.
    rivals
        What could be in its place: first the named cause, then others by probability, then the best smooth term.
    parameters, questions
        Its parameters if it were alone, by a linear fit, and those that are not plausible, or unusual.
    left_out
        Errors on left-out poses.
    experiment
        Poses that tell it from the first rival, both taken for equally probable, or make it testable.
    """

    effect: str
    site: str
    standing: Standing
    reason: Untestable | None = None
    probability: float = 0.0
    log_evidence: float = 0.0
    odds: float = 0.0
    beside: float = 0.0
    needed: float = 0.0
    smooth: tuple[tuple[str, tuple[str, ...]], ...] = ()
    beside_smooth: float = 0.0
    in_place: float = 0.0
    rivals: tuple[Rival, ...] = ()
    parameters: Mapping[str, Estimate] = field(default_factory=dict, hash=False)
    questions: tuple[Question, ...] = ()
    left_out: LeftOutErrors | None = None
    experiment: Experiment | None = None


Reason = Literal[
    "smooth_term",
    "description",
    "restless",
    "impossible",
    "held_out",
    "part",
    "excess",
    "two_groups",
    "scatter",
    "chi_square",
]
"""Why something unknown is inferred. The rules are in ``doubts.py``; those of the first and the third are in ``verdict.py``,
and that of the last is in ``against.py``:

``smooth_term``
    Smooth nonparametric terms are likelier than the named causes alone.
``description``
    Only a flexible family explains an error.
``restless``
    Errors of an actuator differ from pose to pose by more than repeated visits scatter.
``impossible``
    A cause would need a parameter that physics does not allow.
``held_out``
    Residuals or errors on left-out poses are larger than the noise that repeated visits show, or the
    errors are no smaller with the causes than without.
``part``
    Residuals of one part of an instrument (a station, a plane, a socket, a component) are larger than the noise.
``excess``
    The residuals are larger than the declared noise, and no visits tell whether the difference repeats.
``two_groups``
    What looks like noise comes from two groups of rows.
``scatter``
    Visits scatter, and columns that could show the reason contradict each other.
``chi_square``
    Poses of a check are farther from the earlier model than noise and its uncertainty allow.
"""


@dataclass(frozen=True)
class Doubt:
    """A reason for which something unknown is assumed.

    ``site`` and ``over``: the site at which it acts, or the part of an instrument that shows it, and the coordinates that it
    depends on; empty where not known.
    """

    reason: Reason
    site: str = ""
    over: tuple[str, ...] = ()


@dataclass(frozen=True)
class Smallest:
    """The smallest change of an effect at a site that a check finds with a given power.

    Parameters
    ----------
    effect, site
        The effect that changes, and its site.
    parameter, value, unit
        The size of the change, as the effect's first parameter. Where the effect has several coefficients: the median over
        changes of random shape. ``value`` is None where not even 1,000 times the typical size is found.
    """

    effect: str
    site: str
    parameter: str
    value: float | None
    unit: str


@dataclass(frozen=True)
class Turns:
    """Root mean square orientation errors on left-out poses, rad: before and after causes were added, and the noise floor."""

    before: float
    after: float
    floor: float


@dataclass(frozen=True)
class InstrumentGap:
    """Root mean square errors of an instrument's left-out readings, in ``unit``: without causes, with causes, and noise floor.

    ``name`` and ``kind``: of the instrument. ``inferred``: the noise that the search for causes assumed.
    """

    name: str
    kind: str
    before: float
    after: float
    floor: float
    unit: str
    inferred: float = np.nan


@dataclass(frozen=True)
class Gap:
    """Position errors on left-out poses before and after causes were added.

    For readings of several instruments, errors are in units of the noise; ``by_instrument`` has them in each instrument's unit.

    - ``before``, ``after``: root mean square length of the position error, m: with the geometry alone, and with the causes.
    - ``floor``: noise floor, m: what a perfect model would leave by the noise that was declared or that repeated visits
      show; by the inferred one where neither exists.
    - ``explained_fraction``: 1 - (after^2 - floor^2) / (before^2 - floor^2); None where there are no causes.
    - ``interval``: 95 % interval of it that other poses of the same kind would show, or, with ``hold_out``
      ``session``, another session.
    - ``hold_out``, ``blocks``: which poses were left out together, and the number of these blocks.
    - ``sessions``: number of sessions in the data; 1 where no column tells them apart.
    - ``turns``: errors of the orientation; None where it was not measured.
    """

    before: float
    after: float
    floor: float
    explained_fraction: float | None
    interval: tuple[float, float] | None
    hold_out: HoldOut = "region"
    blocks: int = 0
    sessions: int = 1
    turns: Turns | None = None
    by_instrument: tuple[InstrumentGap, ...] = ()
    inferred: float = np.nan
    """The same by the noise that the search for causes assumed, m: it is estimated from residuals, where no cause is found."""
    shrinkage = renamed("shrinkage", "explained_fraction")

    @property
    def of_positions(self) -> Gap | InstrumentGap | None:
        """The errors of positions at left-out poses, m; None where no tracker measured them."""
        return next((one for one in self.by_instrument if one.kind == "tracker"), None) if self.by_instrument else self


HoldOut = Literal["region", "session", "time", "random"]


@dataclass(frozen=True)
class Where:
    """Where the gap lies, after the geometry alone was fitted.

    Shares sum to 1, or are all zero where there is no gap.

    ``rod``, ``axis``: by name: shares of the gap's mean square beyond noise. ``rod``: in the closure residuals of the rods.
    ``axis``: in the whitened components of the pose or the readings. ``site``: by name: shares of the largest gain in log
    evidence at each site, by an effect or a smooth term alone. Common motions and proxies are left out. ``covariate``: by name:
    the largest gain in log evidence of a smooth term over it, relative to the best covariate; not shares. ``region``: boxes (2,
    3), m, base frame, and the share of the gap's mean square beyond noise in each.
    """

    rod: dict[str, float]
    site: dict[str, float]
    axis: dict[str, float]
    covariate: dict[str, float]
    region: tuple[tuple[Floats, float], ...]


Source = Literal["declared", "repeats", "residuals"]


@dataclass(frozen=True)
class Lacking:
    """Why effects can't be tested so far.

    ``covariates``: the covariates that are missing or do not vary; empty where the reason is another one. ``missing``: True:
    these covariates are missing. False: they do not vary. ``reason``: why the first of the effects can't be tested.
    """

    covariates: tuple[str, ...]
    missing: bool
    reason: Untestable | None


@dataclass(frozen=True, eq=False)
class Visits:
    """Visits along the coordinates that an unknown effect depends on, all else unchanged.

    ``site``, ``coordinates``: site and coordinates of the smooth nonparametric term that explains the unknown effect best.
    ``pattern``: ``line``: one actuator alone, there and back. ``net``: two actuators alone. ``spread``: poses all over the
    workspace. ``repeated``: the same few poses at each level of some covariates. ``again``: measured poses, each twice more.
    ``actuators``: for ``line`` and ``net``: sites of the actuators that move. ``stations``: for ``repeated``: number of poses
    that are visited at each level; for ``again``: number of poses. ``varied``, ``levels``: for ``repeated``: names of the
    covariates, all of one kind, and (R,) the value to which all of them are set in each round of visits.
    """

    site: str
    coordinates: str
    pattern: Literal["line", "net", "spread", "repeated", "again"]
    actuators: tuple[str, ...] = ()
    stations: int = 0
    varied: tuple[str, ...] = ()
    levels: Column = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, eq=False)
class Experiment:
    """What to measure next.

    Parameters
    ----------
    kind
        ``discriminate``: it distinguishes effects that the present data can't distinguish, or an effect from none.
        ``map_unknown``: it shows how an unknown effect depends on its coordinates. ``make_testable``: it makes effects
        testable.
    robot
        The machine to measure.
    effects
        Effect and site of each hypothesis that it distinguishes or makes testable, the leader first; empty for ``map_unknown``.
    poses
        (K, n) commands, m or rad, in the order of measurement; K = 0 where no poses help.
    covariates
        Measurement conditions to set at these commands: (K,) values of each covariate, by name.
    expected_gain
        Expected log Bayes factor, nats, between the effects that it distinguishes, or between an effect that it makes
        testable and no effect; None where not known.
    random_gain
        The same for as many poses and measurement conditions drawn at random.
    reference_temperature
        Temperature at which the geometry holds, degC: that of a cold machine.
    settles
        For ``discriminate``: probability that one of its effects is sure after this experiment; None where not known.
    rounds
        For ``discriminate``: number of such experiments after which the question is settled with a probability of 80 %; None
        where more than ten are needed.
    watch
        Sites whose motion should be measured directly, because poses show too little of it.
    lacking
        For ``make_testable``: why its effects can't be tested so far.
    visits
        For ``map_unknown``: what is visited.
    """

    kind: Literal["discriminate", "map_unknown", "make_testable"]
    robot: Chain
    effects: tuple[tuple[str, str], ...]
    poses: Floats
    covariates: Mapping[str, Column] = field(default_factory=dict)
    expected_gain: float | None = None
    random_gain: float | None = None
    reference_temperature: float = 20.0
    settles: float | None = None
    rounds: int | None = None
    watch: tuple[str, ...] = ()
    lacking: Lacking | None = None
    visits: Visits | None = None

    @property
    def separates(self) -> tuple[str, ...]:
        """Its effects as ``effect@site``; ``unknown`` where it maps an unknown one."""
        return ("unknown",) if self.kind == "map_unknown" else tuple(f"{e}@{site}" for e, site in self.effects)

    @property
    def measure(self) -> str:
        """What to do, in a sentence or two."""
        return str(present(self).short())

    def to_json(self) -> dict[str, Any]:
        """One entry of ``next_experiment`` in ``diagnosis.json``."""
        return {
            "measure": self.measure,
            "separates": list(self.separates),
            "poses": self.poses.tolist(),
            "covariates": {name: values.tolist() for name, values in self.covariates.items()},
            "expected_gain": self.expected_gain,
            "random_gain": self.random_gain,
            "settles": self.settles,
        }


@dataclass(frozen=True, repr=False, kw_only=True)
class Findings:
    """What a diagnosis and a check have in common: the parameters are those of :class:`Diagnosis`."""

    verdict: Verdict
    causes: tuple[Cause, ...]
    candidates: tuple[Considered, ...]
    where: Where
    gap: Gap
    unexplained: Unexplained
    model: Model
    set_aside: tuple[str, ...]
    set_aside_rows: tuple[int, ...]
    dataset: Dataset
    next_experiment: tuple[Experiment, ...] = ()
    questions: tuple[Question, ...] = ()
    effects: tuple[Effect, ...] = field(default_factory=catalogue)
    seed: int = 0
    doubts: tuple[Doubt, ...] = ()
    warnings: tuple[str, ...] = ()
    also: tuple[Undecided, ...] = ()

    def effect(self, name: str) -> Effect:
        """The effect with the id ``name``, of those that were tried; raises `ModelError` where there is none."""
        return effect_of(self.effects, name)

    def to_json(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``."""
        content: dict[str, Any] = present(self).json()
        return content


@dataclass(frozen=True, repr=False, kw_only=True)
class Diagnosis(Findings, FitResult):
    """Verdict, causes, where the gap lies and how much of it the causes explain; see ``docs/diagnosis.md``.

    Parameters
    ----------
    verdict
        ``none``, ``explained``, ``ambiguous`` or ``unknown``: see ``docs/glossary.md``.
    causes
        The causes that are named, each with its class, parameters and explained fraction of the gap.
    candidates
        Every hypothesis that was considered: its gain in log evidence, or why it can't be tested.
    where
        Where the gap lies: by rod, site, axis, covariate and region.
    gap
        Errors on left-out poses, of the geometry alone and with the causes, and the noise floor.
    noise_source
        Where the noise floor comes from: ``declared``, ``repeats`` (repeated visits), or ``residuals``: an assumption.
    noise_ratio
        The largest ratio of the noise that repeated visits show to a declared sigma that they contradict; 1: there is none.
    unexplained
        What the causes do not explain.
    baseline
        The calibration of the geometry alone.
    model
        The geometry and the causes, fitted together. The model without causes is ``baseline.model``.
    set_aside
        Ids of the poses with rows that are outliers even if the causes are taken into account.
    set_aside_rows
        Line numbers of these rows in their file.
    dataset
        The input data.
    next_experiment
        Proposals of what to measure next.
    questions
        Parameters of causes whose values physics does not allow, or are unusual for machines.
    effects
        The effects that were tried.
    seed
        Seed of the random numbers.
    warnings
        Texts of all warnings, also of those when the dataset was read.
    also
        What is weak and undecided beside the causes, and does not change the verdict.
    doubts
        Reasons for which something unknown is assumed. Each makes the verdict ``unknown``.
    why
        What stands for and against the effect that ``why`` asked for.

    Examples
    --------
    >>> import gtpin
    >>> diagnosis = gtpin.diagnose(gtpin.Dataset.read("measured"))
    >>> diagnosis.verdict
    'explained'
    >>> cause = diagnosis.causes[0]
    >>> cause.effect, cause.site
    ('backlash', 'cart1')
    >>> half_width = cause.parameters["half_width"]
    >>> half_width.unit, 0.0 < half_width.sigma < abs(half_width.value)
    ('m', True)
    """

    baseline: Calibration
    noise_source: Source = "declared"
    noise_ratio: float = 1.0
    why: Why | None = None

    def plot_effect(self, cause: int = 0, quantity: str | None = None) -> Figure:
        """The curve of a cause with its 95 % interval, and the measurements less everything else that the model explains.

        Parameters
        ----------
        cause
            Index of the cause in ``causes``, counted from 0.
        quantity
            One of the quantities that the cause changes, ``travel of cart2`` for example; by default the first that the report
            shows.

        Raises
        ------
        GtpinError
            If there is no such cause, or it has no curve of this quantity; the message lists those that it has.
        """
        figure: Figure = present(self).effect(cause, quantity)
        return figure


@dataclass(frozen=True, repr=False, kw_only=True)
class HealthCheck(Findings, SavedResult):
    """What has changed since an earlier model was identified; see ``docs/health.md``.

    Parameters
    ----------
    verdict, causes, candidates, where, gap, unexplained, doubts
        As in a :class:`Diagnosis`, but the causes are changes since the earlier model.
    baseline
        The earlier model, with the present pose of the instrument.
    model
        The earlier model with the changes added, fitted again with the check's poses. A change whose covariate is in
        ``assumed`` is left out: the model could not predict it.
    poses, set_aside, set_aside_rows
        Number of rows that were used; ids of the poses with rows that are gross errors, and the line numbers of these rows.
    false_alarm, threshold
        Probability of an alarm where nothing has changed, and the gain in log evidence, nats, from which a change is named.
    power, smallest
        For each tested effect, the smallest change that poses like these show with the probability ``power``.
    assumed
        Names of the temperatures whose change since the earlier model is not known. A check assumes that they may have
        changed.
    unexplained_before
        What the earlier model left unexplained of the data that it was fitted to. It is a part of the uncertainty of what the
        model predicts, so that smaller changes can't be distinguished from it.
    noise_known
        Whether the noise was declared, or shown by repeated visits. Otherwise the noise floor of ``gap`` is what was left of
        the earlier model's fit.
    free_frame
        Whether the pose of the instrument is unknown and identified too.
    effects
        The effects that were tried.
    dataset, seed
        The input data, and the seed of the random draws.
    questions, next_experiment
        Empty: a check finds neither.
    warnings
        Texts of all warnings, also of those when the dataset was read.

    Examples
    --------
    >>> import gtpin
    >>> dataset = gtpin.Dataset.read("measured")
    >>> model = gtpin.calibrate(dataset).model
    >>> check = gtpin.diagnose(dataset.take(slice(0, 10)), against=model)
    >>> check.poses, check.power
    (10, 0.95)
    """

    baseline: Model
    poses: int
    false_alarm: float
    threshold: float
    power: float
    smallest: tuple[Smallest, ...]
    assumed: tuple[str, ...]
    unexplained_before: ModelDiscrepancy
    noise_known: bool
    free_frame: bool
