"""A proposed experiment is carried out, and the machine is diagnosed again: a table of docs/diagnosis.md.

Machines of the plant with one effect each are measured and diagnosed. Where the diagnosis leaves open which effect the cause
is, the machine is measured again at the commands and conditions of the file that ``gtpin diagnose`` writes, and, separately, at
as many random ones. All measurements together are diagnosed again.
``python examples/pages/refresh.py --measure closed_loop`` measures the table of the page again.
"""

from __future__ import annotations

import tempfile
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from again import again
from compare import known_from

import gtpin
from gtpin.bench.blind.score import rate
from gtpin.bench.simulator import Case, make_case
from gtpin.data import Commands
from gtpin.data.table import Column
from gtpin.diagnosis.discrimination import PROMISED, chosen, concerns
from gtpin.diagnosis.hypothesis import Hypothesis
from gtpin.diagnosis.priors import SURE
from gtpin.diagnosis.result import Cause, Experiment
from gtpin.diagnosis.trials import possible
from gtpin.effects.catalogue import effects_by_id

EFFECTS = {
    "gantry_tau": (
        "encoder_scale",
        "linearity",
        "rack_step",
        "zero_shift",
        "backlash",
        "straightness",
        "cart_compliance",
        "link_compliance",
        "thermal_links",
        "thermal_track",
        "tracker_drift",
        "frame_shift",
    ),
    "ur5": ("encoder_scale", "linearity", "joint_compliance", "link_compliance", "tracker_drift", "frame_shift"),
}
"""Effects that others can look like, by robot."""
EVERY = {"gantry_tau": 1, "ur5": 10}
"""A robot has a machine with each effect for each of so many machines of the first robot."""
ENERGY, POSES = (63.0, 600.0), 140
SEEDS = 1796079002
"""The first machine's seed: the clock's seconds before the table was measured last, so that nothing was ever tuned on them."""
OUTCOMES = ("right", "wrong", "open", "lost")
LEAST = 1e-3
"""Weight of an alternative that is in no class."""


@dataclass(frozen=True, eq=False)
class Open:
    """A question that a diagnosis leaves open: the cause, the proposal, and the file that a user gets."""

    cause: Cause
    experiment: Experiment
    file: Commands

    @property
    def to_set(self) -> dict[str, Column]:
        """Covariates of the file. Times are those of the measurement, unless the proposal itself prescribes them."""
        return {n: v for n, v in self.file.covariates.items() if n != "time" or n in self.experiment.covariates}


def jobs(machines: int) -> list[dict[str, object]]:
    """Every effect on a few machines of each robot, at any site; fewer machines are the first ones of more."""
    found = [
        {"robot": robot, "effect": effect}
        for machine in range(machines)
        for robot, effects in EFFECTS.items()
        if machine % EVERY[robot] == 0
        for effect in effects
    ]
    return [{**job, "seed": SEEDS + number} for number, job in enumerate(found)]


def measured(robot: str, effect: str, seed: int) -> list[dict[str, object]]:
    """One machine; only its verdict where no question about its cause is open."""
    case = make_case(seed, effects=[(effect, None)], noncentrality=ENERGY, poses=POSES, robot=robot)
    truth = (case.effects[0].effect, case.effects[0].site)
    first = diagnosed(case.dataset)
    row: dict[str, object] = {
        "site": truth[1],
        "energy": round(case.effects[0].noncentrality),
        "verdict": first.verdict,
    }
    question = open_question(first, truth)
    if question is None:
        return [row]
    row |= {"asked": " ".join(question.experiment.separates), "in_class": truth in members(question.cause)}
    row |= {"settles": question.experiment.settles, "rounds": question.experiment.rounds or ""}
    row |= {"expected": question.experiment.expected_gain, "expected_random": question.experiment.random_gain}
    planned = again(case, question.file.q, question.to_set, seed)
    random = again(case, *random_rows(case, first, question, seed), seed)
    for name, dataset in (("planned", planned), ("random", random)):
        second = diagnosed(dataset)
        row[name] = outcome(second, truth, question.cause)
        row[f"{name}_nats"] = realised(first, second, truth, question)
        row[f"{name}_verdict"] = second.verdict
        row[f"{name}_named"] = " ".join(f"{c.effect}@{c.site}" for c in second.causes)
    return [row]


def diagnosed(dataset: gtpin.Dataset) -> gtpin.Diagnosis:
    """A diagnosis without its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        return gtpin.diagnose(dataset)


def open_question(found: gtpin.Diagnosis, truth: tuple[str, str]) -> Open | None:
    """The first proposal that is to tell effects apart, where one is needed for the true cause or for one in its place."""
    for number, experiment in enumerate(found.next_experiment):
        if experiment.kind != "discriminate" or not len(experiment.poses):
            continue
        cause = next(c for c in found.causes if experiment.effects[0] in members(c))
        known = {(c.effect, c.site) for c in found.causes if c is not cause}
        if truth in members(cause) or truth not in known:
            return Open(cause, experiment, written(found, number))
    return None


def members(cause: Cause) -> set[tuple[str, str]]:
    """Effects and sites of a class."""
    return {(m.effect, m.site) for m in cause.members}


def written(found: gtpin.Diagnosis, number: int) -> Commands:
    """The commands of a proposal from the file that ``gtpin diagnose`` writes."""
    with tempfile.TemporaryDirectory() as folder:
        found.save(Path(folder) / "diagnosis")
        return Commands.read(Path(folder) / "diagnosis" / "next_experiment" / f"{number + 1}.csv")


def random_rows(case: Case, found: gtpin.Diagnosis, question: Open, seed: int) -> tuple[np.ndarray, dict[str, Column]]:
    """As many random commands, with the same covariates varied at random."""
    known = known_from(case.dataset, found.baseline)
    effects = effects_by_id()
    asked = [Hypothesis(effects[effect], site) for effect, site in question.experiment.effects]
    words = {word for hypothesis in asked for word in concerns(hypothesis, known.robot)}
    rng = np.random.default_rng(seed)
    count = len(question.file)
    trials = possible(known, words, 4 * count, rng)
    rows = rng.choice(len(trials), count, replace=False)
    return trials.q[rows], {**_usual(question, count), **chosen(trials, rows, words)}


def _usual(question: Open, count: int) -> dict[str, Column]:
    """The values of the file's covariates that the proposal does not set."""
    set_by = question.experiment.covariates
    return {n: v for n, v in question.to_set.items() if n not in set_by}


def outcome(second: gtpin.Diagnosis, truth: tuple[str, str], before: Cause) -> str:
    """``right``: the true cause is sure. ``wrong``: another member of the class is, and the true cause is in no class.

    Otherwise ``open``, or ``lost`` where no class has the true cause any more.
    """
    sure = {(c.effect, c.site) for c in second.causes if c.probability >= SURE}
    if truth in sure:
        return "right"
    if any(truth in members(c) for c in second.causes):
        return "open"
    return "wrong" if sure & members(before) else "lost"


def realised(first: gtpin.Diagnosis, second: gtpin.Diagnosis, truth: tuple[str, str], question: Open) -> float | str:
    """What was added to the log Bayes factor of the true effect over its alternatives, nats; weighted as the expected gain."""
    asked = question.experiment.effects
    if truth not in asked:
        return ""
    weights = dict.fromkeys(asked, LEAST) | {(m.effect, m.site): m.probability for m in question.cause.members}
    if len(asked) == 1:
        return evidence(second, truth) - evidence(first, truth)
    rivals = asked[1:] if truth == asked[0] else asked[:1]
    added = {
        place: evidence(second, truth) - evidence(second, place) - evidence(first, truth) + evidence(first, place)
        for place in rivals
    }
    return sum(weights[p] * added[p] for p in rivals) / sum(weights[p] for p in rivals)


def evidence(found: gtpin.Diagnosis, place: tuple[str, str]) -> float:
    """Gain in log evidence of a candidate."""
    return next(c.log_evidence for c in found.candidates if (c.effect, c.site) == place)


def table(records: pd.DataFrame) -> str:
    """How often the true cause was settled, by what the proposal promised."""
    asked = records[records["planned"].astype(str).isin(OUTCOMES)].copy()
    numbers = ["settles", "expected", "expected_random", "planned_nats", "random_nats"]
    asked[numbers] = asked[numbers].apply(pd.to_numeric)
    enough = asked["settles"] >= PROMISED
    outside = int((~asked["in_class"].astype(str).eq("True")).sum())
    lines = [
        "| the proposal says | cases | mean `settles` | settled by planned poses | by random poses "
        "| wrong cause: planned, random |",
        "|---|---|---|---|---|---|",
        _line("these poses are enough", asked[enough]),
        _line("more are needed", asked[~enough]),
        _line("all", asked),
        "",
        f"Of {len(records)} machines, {len(asked)} had an open cause and a proposal of poses; in {outside} of these the true "
        f"effect was not in the class. {_gains(asked)}",
    ]
    return "\n".join(lines)


def _line(name: str, rows: pd.DataFrame) -> str:
    said = f"{rows['settles'].mean():.0%}" if len(rows) else "-"
    wrong = ", ".join(str(int((rows[way] == "wrong").sum())) for way in ("planned", "random"))
    cells = [name, str(len(rows)), said, *(_settled(rows[way]) for way in ("planned", "random")), wrong]
    return f"| {' | '.join(cells)} |"


def _settled(outcomes: pd.Series[str]) -> str:
    """The fraction that is right, with its 95 % bounds."""
    found = rate(outcomes == "right")
    if found.value is None or found.low is None or found.high is None:
        return "-"
    return f"{int((outcomes == 'right').sum())}: {found.value:.0%} ({found.low:.0%} to {found.high:.0%})"


def _gains(rows: pd.DataFrame) -> str:
    """Expected and realised log Bayes factors, where the true effect is one of those to be distinguished."""
    told = rows.dropna(subset=["planned_nats"])
    words = []
    for way, expected in (("planned", "expected"), ("random", "expected_random")):
        less = told[f"{way}_nats"] - told[expected]
        words.append(f"{less.mean():.1f} nats (median {less.median():.1f}) for {way} poses")
    return f"Realised less expected gain, means over {len(told)} cases: {' and '.join(words)}."
