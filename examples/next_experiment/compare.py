"""How much a planned round of measurements tells beside a random one: the table of docs/diagnosis.md.

Machines of the plant with one effect each are measured, calibrated, and measured again at planned rows and at random ones.
``python examples/pages/refresh.py --measure next_experiment`` measures the table of the page again.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

import numpy as np
import pandas as pd
from again import again

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.calibration.noise_estimator import noise_at
from gtpin.data import Dataset
from gtpin.diagnosis.design import Observed
from gtpin.diagnosis.discrimination import CauseClass, chosen, concerns, discriminate
from gtpin.diagnosis.evidence import NOTHING, Groups, Marginal, gain
from gtpin.diagnosis.hypothesis import Hypothesis
from gtpin.diagnosis.priors import PRIORS, SURE
from gtpin.diagnosis.trials import Known, possible
from gtpin.effects.catalogue import effects_by_id
from gtpin.instruments.readings import Readings

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
OPEN = PRIORS.temperature * float(np.log(SURE / (1.0 - SURE)))
"""Log Bayes factor, nats, below which neither of two effects is sure: the temperature divides it."""


@dataclass(frozen=True)
class Told:
    """Log Bayes factors for the truth: before, and what planned and random rows add; with what was expected of them."""

    before: float
    planned: float
    random: float
    expected: float
    expected_random: float


def compare(truth: Hypothesis, rival: Hypothesis, seed: int) -> Told | None:
    """One machine; None where nothing parts the two."""
    case = make_case(seed, effects=[(truth.effect.id, truth.site)], noncentrality=ENERGY, poses=POSES)
    baseline = gtpin.calibrate(case.dataset)
    known = known_from(case.dataset, baseline)
    rng = np.random.default_rng(seed)
    planned = discriminate(known, [CauseClass(truth, 1.0, ((truth, 0.5), (rival, 0.5)))], 0, ROUND, rng)
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
    measured = Readings.of(dataset, baseline.model.robot)
    observed = Observed(
        measured,
        dataset.covariates,
        noise_at(baseline.noise, measured),
        np.ones(len(dataset)),
        dataset.conditions.reference_temperature,
        dataset.instrument.frame == "free",
    )
    return Known(observed, baseline.model, observed.operating_points(baseline.model).references)


def factor(known: Known, dataset: Dataset, truth: Hypothesis, rival: Hypothesis) -> float:
    """Log Bayes factor, nats, of two effects, each at its best scale."""
    measured = Readings.of(dataset, known.model.robot)
    observed = replace(
        known.observed,
        measured=measured,
        noise=noise_at(known.observed.noise, measured),
        covariates=dataset.covariates,
        weight=np.ones(len(dataset)),
    )
    design = observed.design(known.model)
    groups: Groups[Hypothesis] = Groups(Marginal(design.B), design.y)
    for hypothesis in (truth, rival):
        groups.add(hypothesis, design.columns(hypothesis.basis(design.operating_points)))
    return gain(groups, NOTHING, truth)[0] - gain(groups, NOTHING, rival)[0]


def jobs(machines: int) -> list[dict[str, object]]:
    """Which machines are measured again."""
    return [{"truth": truth, "rival": rival, "machine": seed} for truth, rival in PAIRS for seed in range(machines)]


def measured(truth: str, rival: str, machine: int) -> list[dict[str, float]]:
    """One machine; nothing where no poses part the two."""
    effects = effects_by_id()
    pair = [Hypothesis(effects[name.split("@")[0]], name.split("@")[1]) for name in (truth, rival)]
    found = compare(*pair, machine)
    return [] if found is None else [asdict(found)]


def table(records: pd.DataFrame) -> str:
    """Means by pair of effects."""
    lines = ["| true effect | alternative | planned (expected) | random (expected) |", "|---|---|---|---|"]
    total, ahead = np.zeros(3, dtype=int), 0
    for (truth, rival), rows in records.groupby(["truth", "rival"], sort=False):
        mean = rows[["planned", "expected", "random", "expected_random"]].mean()
        left = rows[rows["before"] < OPEN]
        settled = [int((left["before"] + left[name] >= OPEN).sum()) for name in ("planned", "random")]
        gains = [
            f"{mean[name]:.1f} ({mean[e]:.1f})" for name, e in (("planned", "expected"), ("random", "expected_random"))
        ]
        lines.append(f"| {' | '.join([truth.replace('@', ' '), rival.replace('@', ' '), *gains])} |")
        total += [len(left), *settled]
        ahead += int((rows["planned"] > rows["random"]).sum())
    return "\n".join(
        [
            *lines,
            "",
            f"Planned poses added more than random ones on {ahead} of {len(records)} machines. Of {total[0]} cases open "
            f"before, {total[1]} were settled by planned poses and {total[2]} by random ones.",
        ]
    )


if __name__ == "__main__":
    print(table(pd.DataFrame([{**job, **row} for job in jobs(2) for row in measured(**job)])))
