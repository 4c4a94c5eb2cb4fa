"""Cases made by hand: truths, and diagnoses that nobody made."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import Progress, TaskID

from gtpin.bench.blind.difficulty import SCALES
from gtpin.bench.blind.judged import Judged, Statement
from gtpin.bench.blind.truth import TrueEffect
from gtpin.bench.blind.worker import Outcome
from gtpin.bench.simulator.case import Case

CANNED = "canned.json"
"""In a dataset's folder: what is to be said of it."""


def cause(name: str, probability: float = 0.99, **members: float) -> dict[str, Any]:
    """A cause of a diagnosis; members by name with ``_AT_`` for ``@``."""
    together = {name: probability} | {m.replace("_AT_", "@"): p for m, p in members.items()}
    effect, _, site = name.partition("@")
    rows = [dict(zip(("effect", "site"), m.split("@"), strict=True)) | {"probability": p} for m, p in together.items()]
    return {
        "effect": effect,
        "site": site,
        "probability": probability,
        "class": rows,
        "parameters": {"size": {"value": 2.0, "sigma": 0.5, "unit": "m"}},
        "shrinkage": 0.5,
    }


def diagnosis(
    verdict: str,
    *causes: Mapping[str, Any],
    site: str = "cart1",
    explained_fraction: float | None = None,
    interval: tuple[float, float] | None = None,
) -> dict[str, Any]:
    """The content of a ``diagnosis.json``, as the contract has it."""
    return {
        "schema": "gtpin-diagnosis/1",
        "verdict": verdict,
        "causes": list(causes),
        "candidates": [],
        "where": {"rod": {}, "site": {site: 0.7, "frame": 0.3}, "axis": {}, "covariate": {}, "region": []},
        "gap": {"shrinkage": explained_fraction, "interval": interval},
        "unexplained": {},
        "next_experiment": [],
    }


def judged(
    name: str, kind: str, truth: Sequence[tuple[str, float | None, float | None]], told: Mapping[str, Any], **more: Any
) -> Judged:
    """A judged case: effects as (name, E, D), and the diagnosis."""
    effects = []
    for full, energy, leaves in truth:
        effect, _, site = full.partition("@")
        effects.append(TrueEffect(effect=effect, site=site, energy=energy, leaves=leaves))
    return Judged(name=name, kind=kind, truth=tuple(effects), said=Statement.of(told), **more)


def write_case(
    folder: Path, name: str, case: Case, effects: Sequence[tuple[str, str]], told: Mapping[str, Any], **more: Any
) -> None:
    """A case as somebody else would hand it over; ``told`` is what the stand-in for the diagnosis will say."""
    place = folder / name
    case.dataset.write(place)
    case.commands.write(place / "commands.csv")
    (place / CANNED).write_text(json.dumps(told))
    rows = [{"effect": effect, "site": site} for effect, site in effects]
    (folder / f"{name}.truth.json").write_text(json.dumps({"effects": rows} | more))


def canned(files: Mapping[str, bytes], exclude: tuple[str, ...] = ()) -> tuple[Outcome, float]:
    """Stands in for the worker: says what lies in the dataset's folder."""
    told = json.loads(files[CANNED])
    if told == "dies":
        import os

        os._exit(1)
    if told == "fails":
        return Outcome(error="it can't be read"), 0.1
    at = told.get("at")
    say = told.get("without" if exclude else "said", told.get("said"))
    return Outcome(diagnosis=say, baseline=at and at["baseline"], model=at and at["model"]), 0.1


class Quiet(Progress):
    """Shows no progress of a check, and remembers what began."""

    def __init__(self) -> None:
        super().__init__(console=Console(quiet=True), disable=True)
        self.begun: list[tuple[str, int, int]] = []
        self.done = 0

    def add_task(self, description: str, *rest: Any, total: Any = None, completed: int = 0, **more: Any) -> TaskID:
        self.begun.append((description, total, completed))
        return super().add_task(description, *rest, total=total, completed=completed, **more)

    def advance(self, task_id: TaskID, advance: float = 1) -> None:
        super().advance(task_id, advance)
        self.done += 1


def left_by_definition(B: np.ndarray, X: np.ndarray, d: np.ndarray) -> tuple[float, float]:
    """The scale of largest evidence, and the energy of d that geometry B and an effect X leave there, by whole matrices."""
    plain = np.eye(len(d)) + B @ B.T
    trials = ((scale, plain + scale**2 * X @ X.T) for scale in SCALES)
    scale, whole = max(
        trials, key=lambda trial: -0.5 * d @ np.linalg.solve(trial[1], d) - 0.5 * np.linalg.slogdet(trial[1])[1]
    )
    return float(scale), float(d @ np.linalg.solve(whole, d))


def shifted(T: np.ndarray, by: float) -> list[list[float]]:
    """Positions that are off by so much, m."""
    return (T + np.array([0.0, by, 0.0])).tolist()
