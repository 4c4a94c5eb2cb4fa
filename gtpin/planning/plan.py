"""Which poses to measure: for a calibration, to distinguish effects, or to see whether a machine has changed."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np

from gtpin.accuracy.planning import plan_poses
from gtpin.data import Commands
from gtpin.diagnosis.against import ALARM_DRAWS, POWER, GainSampler, changes, smallest_changes, threshold
from gtpin.diagnosis.design import Design, Observed
from gtpin.diagnosis.diagnose import FALSE_ALARM
from gtpin.diagnosis.earlier import FEWEST_POSES, Earlier, noise_of_fit
from gtpin.diagnosis.hypothesis import Hypothesis, Scope
from gtpin.diagnosis.priors import PRIORS
from gtpin.diagnosis.result import Smallest
from gtpin.effects.catalogue import catalogue
from gtpin.errors import ModelError, check_kind
from gtpin.instruments.readings import Readings
from gtpin.model.model import Model
from gtpin.noise.noise import Noise
from gtpin.noise.reading_noise import SMALLEST
from gtpin.output.shown import Shown, present
from gtpin.planning.choice import Candidates, PoseChoice, Rows, candidates
from gtpin.real import generator
from gtpin.threads import in_one_thread
from gtpin.typing import Floats

Purpose = Literal["calibration", "discrimination", "health"]
Place = Literal["robot", "free"]

RANDOM = 20
"""Number of random plans, each with the same number of poses, with which a plan is compared."""
VAGUE = 100.0
"""Prior variance of the effects that a check is to find, in units of the squared typical size: a sigma of ten typical sizes.
For effects that are to be distinguished it is 1: the others are not larger than usual."""


@dataclass(frozen=True)
class Separability:
    """How well an effect is distinguished from all others.

    ``effect``, ``site``, ``parameter``: the effect's first parameter; where the effect has several coefficients, the first core
    coefficient. ``sigma``, ``sigma_random``: its standard deviation, in ``unit``, after the planned poses, and after as many
    random poses. All other effects of the plan and the geometry are unknown too.
    """

    effect: str
    site: str
    parameter: str
    sigma: float
    sigma_random: float
    unit: str


@dataclass(frozen=True)
class Information:
    """The result to expect of a calibration with the planned poses and, in ``..._random``, with as many random poses.

    ``nats``, ``nats_random``: information about the geometry, nats. ``error``, ``error_random``: position error of the
    calibrated model, m, root mean square.
    """

    nats: float
    nats_random: float
    error: float
    error_random: float


@dataclass(frozen=True, repr=False)
class PosePlan(Shown):
    """Poses to measure.

    Parameters
    ----------
    purpose
        ``calibration``, ``health`` or ``discrimination``: see :func:`gtpin.plan`.
    commands
        The commands and measurement conditions of the poses, in the order of measurement.
    model, noise, frame
        The model, the noise of the measurement, and ``robot`` or ``free``, for which the poses were chosen.
    smallest, false_alarm, power, threshold
        For ``health``: the smallest changes that a check of these poses finds with the probability ``power``, if the
        probability of a false alarm is ``false_alarm``; ``threshold``, nats, is the gain in log evidence from which a change
        is named.
    told
        For ``discrimination``: how well each effect is distinguished from all others.
    information
        For ``calibration``: the information of the poses about the geometry; None for the other purposes.

    Examples
    --------
    >>> import gtpin
    >>> model = gtpin.calibrate(gtpin.Dataset.read("measured")).model
    >>> found = gtpin.plan(model, "health", 10)
    >>> found.to_dataframe().columns.tolist()
    ['q1', 'q2', 'q3', 'approach1', 'approach2', 'approach3']
    """

    purpose: Purpose
    commands: Commands
    model: Model
    noise: Noise
    frame: Place
    smallest: tuple[Smallest, ...] = ()
    false_alarm: float = FALSE_ALARM
    power: float = POWER
    threshold: float | None = None
    told: tuple[Separability, ...] = ()
    information: Information | None = None

    def to_json(self) -> dict[str, Any]:
        """The content of ``plan.json``."""
        content: dict[str, Any] = present(self).json()
        return content


@in_one_thread
def plan(
    model: Model,
    purpose: Purpose,
    poses: int,
    *,
    noise: Noise | None = None,
    q: Floats | None = None,
    frame: Place | None = None,
    orientation: bool = True,
    between: Collection[str] = (),
    false_alarm: float = FALSE_ALARM,
    seed: int = 0,
) -> PosePlan:
    """Choose poses to measure.

    Parameters
    ----------
    model
        A model of the machine. Its covariance says how well the geometry is known; for a nominal model, the tolerances do.
    purpose
        ``calibration``: the poses that give most information about the geometry (D-optimal). ``health``: the poses that
        determine shifted zeros and backlash of every actuator best, for ``gtpin.diagnose(data, against=model)``.
        ``discrimination``: the poses that best distinguish effects from each other and from the geometry.
    poses
        Number of poses.
    noise
        Noise of the measurement; by default that of the model's fit.
    q
        (N, n) commands to choose from, m or rad; by default about 300 that fill the workspace. Obstacles are not known: where
        there are any, give commands that are free of them.
    frame
        ``robot``: the instrument measures in the base frame. ``free``: its pose is unknown. By default as for the model.
    orientation
        Whether orientations are measured.
    between
        For ``discrimination``: the effects to distinguish, each ``effect`` or ``effect@site``; by default the catalogue.
    false_alarm
        For ``health``: probability of an alarm where nothing has changed.
    seed
        Seed of the random numbers. The same seed gives the same plan.

    Raises
    ------
    ModelError
        If the noise is not known, there are fewer candidates than poses, or an effect is not known.

    Examples
    --------
    >>> import gtpin
    >>> from gtpin.noise.noise import Noise
    >>> found = gtpin.plan(gtpin.read_model("gantry_tau"), "calibration", 12, noise=Noise(1.5e-5, 5e-5))
    >>> len(found.commands)
    12
    """
    check_kind(model, Model)
    if purpose not in get_args(Purpose):
        raise ModelError(f"no plan is called {purpose!r}", hint=f"use {', '.join(get_args(Purpose))}")
    earlier, given, fit = Earlier(model), noise is not None, model.fit
    if noise is None:
        if fit is None:
            hint = "give it: Noise(1.5e-5, 5e-5), m and rad"
            raise ModelError("the noise of the measurement is not known", hint=hint)
        noise = noise_of_fit(model, fit)
    where: Place = frame or ("robot" if model.frame.is_base else "free")
    rng, free = generator(seed), where == "free"
    some = candidates(model, q, rng, moving=purpose == "discrimination", seed=seed)
    if not FEWEST_POSES <= poses <= len(some):
        hint = f"ask for {FEWEST_POSES} at least, and no more than there are candidates"
        raise ModelError(f"{poses} poses out of {len(some)}", hint=hint)
    if purpose == "calibration":
        best = plan_poses(
            model, some.q, poses, noise, some.q, orientation=orientation, free_frame=free, draws=RANDOM, seed=seed
        )
        nats, error = float(best.random_nats.mean()), float(best.random_error.mean())
        information = Information(best.nats, nats, best.error, error)
        return PosePlan(purpose, _commands(some, best.rows, purpose), model, noise, where, information=information)
    known = given or earlier.unexplained.noise_known
    # Otherwise the noise of the fit is what it left.
    used = noise if known else replace(noise, position_sigma=SMALLEST, orientation_sigma=SMALLEST)
    scope = Scope.of(catalogue(), (), false_alarm, model.robot)

    def possible(some: Candidates) -> GainSampler:
        """The changes that measuring candidates could test."""
        seen = model.in_instrument_frame(earlier.predicted(some.q, some.covariates, model.kinematics.forward(some.q)))
        measured = Readings.of_poses(some.q, seen.T, seen.R if orientation else None, model.robot)
        rows = used.rows(len(some), measured.components)
        observed = Observed(measured, some.covariates, rows, np.ones(len(some)), temperature=20.0, free_frame=free)
        return changes(earlier, observed, scope)[0]

    hypotheses = possible(some).hypotheses
    words = checked_first() if purpose == "health" else tuple(between)
    wanted = [h for h in hypotheses.linear if not words or h.effect.id in words or str(h) in words]
    for word in words:
        if not any(word in (h.effect.id, str(h)) for h in wanted):
            able = ", ".join(dict.fromkeys(h.effect.id for h in hypotheses.linear))
            raise ModelError(f"no poses of {model.robot.name} tell {word}", hint=f"what they can tell: {able}")
    choice = _choice(hypotheses.design, wanted, VAGUE if purpose == "health" else 1.0)
    rows = choice.best(poses)
    commands = _commands(some, rows, purpose)
    if purpose == "discrimination":
        random = [rng.choice(len(some), poses, replace=False) for _ in range(RANDOM)]
        told = tuple(_told(hypotheses.design, choice, wanted, rows, random))
        return PosePlan(purpose, commands, model, noise, where, told=told)
    sampler = possible(some.take(rows))
    level = threshold(sampler, PRIORS.named_alarms * false_alarm, ALARM_DRAWS, rng)
    smallest = smallest_changes(sampler, level, POWER, rng)
    return PosePlan(purpose, commands, model, noise, where, smallest, false_alarm, POWER, level)


def checked_first() -> tuple[str, ...]:
    """Ids of the effects for which the poses of a check are chosen."""
    return tuple(effect.id for effect in catalogue() if effect.first_checked)


def _choice(design: Design, wanted: Sequence[Hypothesis], variance: float) -> PoseChoice:
    """The choice of poses that determines the cores of some effects; everything else is unknown too.

    ``variance``: prior variance of the cores' coefficients, in units of the squared typical size.
    """
    place = design.B.shape[1]
    columns, prior, groups = [design.B], [np.ones(place)], []
    for hypothesis in wanted:
        own = design.columns(hypothesis.basis(design.operating_points))
        core = hypothesis.effect.core or tuple(range(own.shape[1]))
        columns.append(own)
        prior.append(np.where(np.isin(np.arange(own.shape[1]), core), variance, 1.0))
        groups.append([place + i for i in core if i < own.shape[1]])
        place += own.shape[1]
    J = np.hstack(columns).reshape(len(design.whitening), design.components, -1)
    return PoseChoice(J, np.concatenate(prior), groups)


def _told(
    design: Design,
    choice: PoseChoice,
    wanted: Sequence[Hypothesis],
    rows: Rows,
    random: Sequence[Rows],
) -> list[Separability]:
    planned = np.sqrt(np.diag(choice.covariance(rows)))
    others = np.mean([np.sqrt(np.diag(choice.covariance(drawn))) for drawn in random], axis=0)
    robot, found = design.operating_points.robot, []
    for hypothesis, group in zip(wanted, choice.groups, strict=True):
        sigma = hypothesis.basis(design.operating_points).sigma
        first = hypothesis.effect.core[0] if hypothesis.effect.core else 0
        one = np.where(np.arange(len(sigma)) == first, sigma, 0.0)
        name, (value, unit) = next(iter(hypothesis.effect.parameters_of(robot, hypothesis.site, one, ()).items()))
        own, random_ = (float(some[group[0]]) * abs(float(value)) for some in (planned, others))
        found.append(Separability(*hypothesis.place, name, own, random_, unit))
    return found


def _commands(some: Candidates, rows: Rows, purpose: str) -> Commands:
    """The chosen poses as a table, in an order in which the next is always the nearest of those that are left."""
    q = some.q[rows]
    span, left, order = np.maximum(np.ptp(q, axis=0), 1e-12), list(range(1, len(q))), [0]
    while left:
        off = np.linalg.norm((q[left] - q[order[-1]]) / span, axis=1)
        order.append(left.pop(int(off.argmin())))
    rows = rows[order]
    ids = np.array([f"{purpose}{k + 1}" for k in range(len(rows))], dtype=object)
    known = {} if purpose == "calibration" else {name: some.covariates[name][rows] for name in some.set_by_plan}
    return Commands(ids, some.q[rows], known)
