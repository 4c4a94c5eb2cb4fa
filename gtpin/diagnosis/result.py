"""What a diagnosis says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from gtpin.calibration.result import Calibration
from gtpin.diagnosis.inference.where import Where
from gtpin.diagnosis.linear.cross_validation import Gap
from gtpin.diagnosis.planning.experiment import Experiment
from gtpin.estimate import Estimate
from gtpin.model.model import Model

Verdict = Literal["none", "explained", "ambiguous", "unknown"]


@dataclass(frozen=True)
class Member:
    """An effect at a site that could be the cause; ``recorded`` is false where it goes with what was not recorded."""

    effect: str
    site: str
    probability: float
    recorded: bool = True


@dataclass(frozen=True)
class Cause:
    """A cause, and everything that could stand in for it.

    Parameters
    ----------
    effect, site, probability
        The leader of its class.
    members
        Its class: itself and what has at least 5 % of its probability; also what can't be tested for lack of a covariate, as
        far as other columns tell that it could stand in.
    parameters
        By name.
    shrinkage
        Share of the gap's power that goes away with it, beside the other causes.
    """

    effect: str
    site: str
    probability: float
    members: tuple[Member, ...]
    parameters: dict[str, Estimate]
    shrinkage: float


@dataclass(frozen=True)
class Considered:
    """A candidate, and what came of it; what can't be tested has a probability where it could stand in for a cause.

    ``reason`` says why it can't be tested or, of what can be, why it could be the cause all the same.
    """

    effect: str
    site: str
    log_evidence: float
    probability: float
    testable: bool
    reason: str


@dataclass(frozen=True)
class Question:
    """A parameter outside what its effect calls plausible or usual.

    Parameters
    ----------
    effect, site, parameter, value, sigma, unit
        What it is, and what was found.
    low, high, why
        What was expected.
    believed
        Whether the cause is named all the same.
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


@dataclass(frozen=True)
class Unexplained:
    """What is left after the causes.

    Parameters
    ----------
    share
        Of the excess of chi-square that geometry alone leaves.
    p_value
        Chance of a larger chi-square from noise alone.
    correlates
        Site, coordinates and p-value of free motions that go with it.
    could_be
        Effect and site of what can't be tested for lack of a covariate, and would account for what is unknown all the same.
    """

    share: float
    p_value: float
    correlates: tuple[tuple[str, str, float], ...]
    could_be: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Diagnosis:
    """Verdict, causes, where the gap lies and how far it shrinks; see ``docs/diagnosis.md``.

    Parameters
    ----------
    model
        Predicts with the causes in; ``baseline.model`` without.
    set_aside
        Ids of the poses of which rows were taken for gross errors, beside the causes.
    set_aside_rows
        Lines of these rows in their file.
    next_experiment
        What to measure to tell more.
    questions
        Parameters that are outside what physics allows or machines have.
    """

    verdict: Verdict
    causes: tuple[Cause, ...]
    candidates: tuple[Considered, ...]
    where: Where
    gap: Gap
    unexplained: Unexplained
    baseline: Calibration
    model: Model
    set_aside: tuple[str, ...]
    set_aside_rows: tuple[int, ...]
    next_experiment: tuple[Experiment, ...] = ()
    questions: tuple[Question, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``."""
        none = self.verdict == "none"
        return {
            "schema": "gtpin-diagnosis/1",
            "verdict": self.verdict,
            "causes": [
                {
                    "effect": c.effect,
                    "site": c.site,
                    "probability": c.probability,
                    "class": [{"effect": m.effect, "site": m.site, "probability": m.probability} for m in c.members],
                    "parameters": {
                        n: {"value": e.value, "sigma": e.sigma, "unit": e.unit} for n, e in c.parameters.items()
                    },
                    "shrinkage": c.shrinkage,
                }
                for c in self.causes
            ],
            "candidates": [
                {
                    "effect": c.effect,
                    "site": c.site,
                    "log_evidence": c.log_evidence,
                    "probability": c.probability,
                    "testable": c.testable,
                    "reason": c.reason,
                }
                for c in self.candidates
            ],
            "where": {
                "rod": self.where.rod,
                "site": self.where.site,
                "axis": self.where.axis,
                "covariate": self.where.covariate,
                "region": [{"box": np.asarray(box).tolist(), "share": share} for box, share in self.where.region],
            },
            "gap": {
                "position_rms_before": self.gap.before,
                "position_rms_after": self.gap.after,
                "noise_floor": self.gap.floor,
                "shrinkage": None if none else self.gap.shrinkage,
                "interval": None if none or self.gap.interval is None else list(self.gap.interval),
                "method": "four neighbouring poses left out in turn; "
                "interval: what 120 other poses may show, by the uncertainty of what was fitted",
            },
            "unexplained": {
                "share": self.unexplained.share,
                "p_value": self.unexplained.p_value,
                "correlates": [
                    {"site": site, "covariate": coordinates, "p_value": p}
                    for site, coordinates, p in self.unexplained.correlates
                ],
                "could_be": [{"effect": effect, "site": site} for effect, site in self.unexplained.could_be],
                "questions": [
                    {
                        "effect": q.effect,
                        "site": q.site,
                        "parameter": q.parameter,
                        "value": q.value,
                        "sigma": q.sigma,
                        "unit": q.unit,
                        "expected": [q.low if np.isfinite(q.low) else None, q.high if np.isfinite(q.high) else None],
                        "why": q.why,
                        "believed": q.believed,
                    }
                    for q in self.questions
                ],
            },
            "next_experiment": [e.to_json() for e in self.next_experiment],
        }
