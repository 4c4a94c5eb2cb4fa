"""Proposed measurements as they are shown on the page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gtpin.data import Commands, Dataset
from gtpin.data.ids import normal_ids
from gtpin.diagnosis.planning.experiment import Experiment
from gtpin.diagnosis.planning.measurement_conditions import as_usual, with_nights
from gtpin.diagnosis.result import Diagnosis
from gtpin.report.page import Table
from gtpin.report.words import covariate_unit, whole, with_unit


@dataclass(frozen=True)
class Step:
    """A proposed measurement: what to do, its expected gain, the commands, and the file with these commands."""

    measure: str
    worth: str
    commands: Table
    file: str


FOLDER = "next_experiment"
NEARLY = 0.9
"""Fraction of a plan's gain from which random poses count as equally good."""


def experiments(d: Diagnosis) -> list[Step]:
    """Proposed measurements, the most informative first."""
    return [_step(e, experiment_file(i)) for i, e in enumerate(d.next_experiment)]


def experiment_file(number: int) -> str:
    """Name of the file with an experiment's commands, counted from 0, from the report's folder."""
    return f"{FOLDER}/{number + 1}.csv"


def write_experiments(d: Diagnosis, dataset: Dataset, folder: Path) -> None:
    """Write the commands of each experiment as a table, with the conditions to set and usual values of all other covariates.

    ``gtpin predict`` can read the tables. The folder is made even if it is empty, so that it replaces an older one.
    """
    (folder / FOLDER).mkdir()
    for i, experiment in enumerate(d.next_experiment):
        count = len(experiment.poses)
        if count:
            ids = normal_ids([f"next{i + 1}-{k + 1}" for k in range(count)])
            covariates = as_usual(dataset.covariates, count) | dict(experiment.covariates)
            if "time" not in experiment.covariates:
                covariates = with_nights(covariates, dataset.conditions.reference_temperature)
            Commands(ids, experiment.poses, covariates).write(folder / experiment_file(i))


def confirmation(d: Diagnosis) -> str:
    """How to confirm the causes; empty if none is certain."""
    if d.verdict != "explained":
        return ""
    return (
        "To confirm it: remove the cause on the machine, or load the corrections. Then measure as many poses of the same kind "
        "again and diagnose them: only noise should remain."
    )


def _step(e: Experiment, file: str) -> Step:
    head = [f"q{j + 1}" for j in range(e.robot.n_actuators)]
    head += [with_unit(name, covariate_unit(name)) for name in e.covariates]
    rows = [
        [*(whole(f"{value:.4f}") for value in q), *(_cell(values[i]) for values in e.covariates.values())]
        for i, q in enumerate(e.poses)
    ]
    return Step(e.measure, _worth(e), Table(head, rows), file)


def _worth(e: Experiment) -> str:
    expected, random = e.expected_gain, e.random_gain
    if expected is None:
        return ""
    words = f"Expected gain in log evidence: {expected:.1f}"
    if random is None:
        words += "."
    elif random >= NEARLY * expected:
        words += f". Other poses are as good ({random:.1f}): the conditions that are set matter, not the poses."
    else:
        words += f", compared with {random:.1f} for as many random poses."
    return words if e.settles is None else f"{words} Probability that they settle the question: {e.settles:.0%}."


def _cell(value: float | str) -> str:
    return value if isinstance(value, str) else whole(f"{value:.4g}")
