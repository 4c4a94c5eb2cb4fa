"""How much a planned round of measurements tells beside a random one: the table of docs/next_experiment.md.

Machines of the plant with one effect each are measured, calibrated, and measured again at planned rows and at random ones. Run
``python examples/next_experiment/compare.py [MACHINES]`` (8 for each pair of effects by default, some minutes).
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

import gtpin
from gtpin.calibration.calibrate import measured_poses
from gtpin.data import Commands, Dataset
from gtpin.data.table import Column
from gtpin.diagnosis.candidates import Candidate
from gtpin.diagnosis.circumstances import INTERVAL, LATER, NIGHT
from gtpin.diagnosis.evidence import NOTHING, Groups, Marginal, gain
from gtpin.diagnosis.fit import Observed
from gtpin.diagnosis.splitting import Standing, chosen, concerns, split
from gtpin.diagnosis.trials import Known, possible
from gtpin.effects.catalogue import catalogue
from gtpin.plant import Case, make_case, measure_at

Floats = npt.NDArray[np.float64]

PAIRS = (
    ("linearity@cart2", "straightness@cart2"),
    ("straightness@cart3", "linearity@cart3"),
    ("cross_coupling@cart2", "linearity@cart2"),
    ("backlash@cart1", "servo_lag@cart1"),
    ("servo_lag@cart1", "backlash@cart1"),
    ("link_compliance@link2a", "joint_runout@link2a"),
    ("encoder_scale@cart1", "thermal_track@cart1"),
    ("thermal_links@arm", "tracker_drift@frame"),
    ("zero_shift@cart2", "frame_shift@frame"),
)
"""The effect that a machine has, and the one that it shall be told from."""
ENERGY, POSES, ROUND = 80.0, 140, 20
OPEN = 5.9
"""Log Bayes factor, nats, below which a diagnosis leaves two effects in one class: it halves what it is told."""


@dataclass(frozen=True)
class Told:
    """Log Bayes factors for the truth: before, and what planned and random rows add; with what was expected of them."""

    before: float
    planned: float
    random: float
    expected: float
    expected_random: float


def compare(truth: Candidate, rival: Candidate, seed: int) -> Told | None:
    """One machine; None where nothing parts the two."""
    case = make_case(seed, effects=[(truth.effect.id, truth.site)], energy=ENERGY, poses=POSES)
    baseline = gtpin.calibrate(case.dataset)
    known = known_from(case.dataset, baseline)
    rng = np.random.default_rng(seed)
    planned = split(known, [Standing(truth, 1.0, ((truth, 0.5), (rival, 0.5)))], 0, ROUND, rng)
    if not len(planned.poses):
        return None
    words = {*concerns(truth, known.robot), *concerns(rival, known.robot)}
    trials = possible(known, words, 4 * ROUND, rng)
    rows = rng.choice(len(trials), ROUND, replace=False)
    before = factor(known, case.dataset, truth, rival)
    planned_rows = again(case, planned.poses, planned.covariates, seed)
    random_rows = again(case, trials.q[rows], chosen(trials, rows, words), seed)
    return Told(
        before,
        factor(known, planned_rows, truth, rival) - before,
        factor(known, random_rows, truth, rival) - before,
        planned.expected_gain or 0.0,
        planned.random_gain or 0.0,
    )


def known_from(dataset: Dataset, baseline: gtpin.Calibration) -> Known:
    """What a plan starts from."""
    observed = Observed(
        measured_poses(dataset),
        dataset.covariates,
        baseline.noise,
        np.ones(len(dataset)),
        dataset.conditions.reference_temperature,
        dataset.instrument.frame == "free",
    )
    return Known(observed, baseline.model, observed.situation(baseline.model).references)


def again(case: Case, q: Floats, covariates: Mapping[str, Column], seed: int) -> Dataset:
    """The case's dataset with further rows, those on a cold machine after a night."""
    cold = np.zeros(len(q), dtype=bool)
    for name in [n for n in covariates if n.startswith("temp_")]:
        cold = np.asarray(covariates[name], dtype=float) == case.dataset.conditions.reference_temperature
    order = np.argsort(cold, kind="stable")
    first = float(np.asarray(case.dataset.covariates["time"], dtype=float).max()) + LATER
    told = {name: values[order] for name, values in covariates.items()}
    told["time"] = first + INTERVAL * np.arange(len(q)) + NIGHT * cold[order]
    pose = np.array([f"later{i}" for i in range(len(q))], dtype=object)
    later = measure_at(case, Commands(pose, q[order], told), seed)
    both, old = {}, case.dataset
    for name, values in old.covariates.items():
        both[name] = np.concatenate([values, later.covariates[name]])
    assert old.orientation is not None
    assert later.orientation is not None
    return replace(
        old,
        pose=np.concatenate([old.pose, later.pose]),
        q=np.vstack([old.q, later.q]),
        position=np.vstack([old.position, later.position]),
        orientation=np.vstack([old.orientation, later.orientation]),
        covariates=both,
        row=np.arange(2, 2 + len(old) + len(later)),
    )


def factor(known: Known, dataset: Dataset, truth: Candidate, rival: Candidate) -> float:
    """Log Bayes factor, nats, of two effects, each at its best scale."""
    observed = replace(
        known.observed,
        measured=measured_poses(dataset),
        covariates=dataset.covariates,
        weight=np.ones(len(dataset)),
    )
    design = observed.design(known.model)
    groups = Groups(Marginal(design.B), design.y)
    for candidate in (truth, rival):
        groups.set(candidate.name, design.columns(candidate.effect.basis(design.situation, candidate.site)))
    return gain(groups, NOTHING, truth.name)[0] - gain(groups, NOTHING, rival.name)[0]


def main(machines: int) -> None:
    """Print the table."""
    effects = catalogue()
    print(
        "| truth | rival | expected: planned | random | told: planned | random | planned tells more | settled of those open |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for pair in PAIRS:
        truth, rival = (Candidate(effects[name.split("@")[0]], name.split("@")[1]) for name in pair)
        told = [t for t in (compare(truth, rival, seed) for seed in range(machines)) if t is not None]
        if not told:
            print(f"| {pair[0]} | {pair[1]} | - | - | - | - | 0 of 0 | |", flush=True)
            continue
        means = [
            np.mean([getattr(t, name) for t in told]) for name in ("expected", "expected_random", "planned", "random")
        ]
        more = sum(t.planned > t.random for t in told)
        left = [t for t in told if t.before < OPEN]
        settled = [sum(t.before + gained(t) >= OPEN for t in left) for gained in (_planned, _random)]
        cells = [
            *pair,
            *(f"{m:.1f}" for m in means),
            f"{more} of {len(told)}",
            f"{settled[0]} and {settled[1]} of {len(left)}",
        ]
        print(f"| {' | '.join(cells)} |", flush=True)


def _planned(told: Told) -> float:
    return told.planned


def _random(told: Told) -> float:
    return told.random


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 8)
