"""Calibration, and a Gaussian process over commands and covariates for what it leaves: predicts, and names no cause.

For a tracker's positions. For readings of other instruments it predicts as the geometry alone does.
"""

from __future__ import annotations

from pathlib import Path

from problem import Problem, predictions

from gtpin.bench.benchmark.answer import Answer
from gtpin.bench.blind.baselines import gaussian_process_positions
from gtpin.data import Commands


def answer(folder: Path) -> Answer:
    """The answer to one case."""
    problem = Problem.of(folder)
    plain = predictions(problem.baseline, folder)
    dataset = problem.prepared.dataset
    if plain.readings or dataset.instrument.frame == "free":
        return plain
    used = dataset.take(problem.prepared.baseline.used(dataset))
    commands = Commands.read(folder / "commands.csv", dataset.n_actuators)
    return Answer(positions=gaussian_process_positions(used, problem.baseline, commands).tolist())
