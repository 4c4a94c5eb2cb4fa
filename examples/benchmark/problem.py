"""What several rivals share: the linear problem of a dataset, and predictions of a model where nothing was fitted.

The problem is that of a diagnosis (docs/statistics.md, sections 1 to 4): whitened residuals y, their derivative B by geometry
and instrument, and the displacements X of every effect at every site. So rivals and diagnosis differ in how they choose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gtpin.bench.benchmark.answer import Answer, AnsweredCause, OtherEffect
from gtpin.data import Commands, Dataset
from gtpin.data.files import read_table
from gtpin.data.names import ORIENTATION
from gtpin.diagnosis.design import Observed
from gtpin.diagnosis.diagnose import FALSE_ALARM
from gtpin.diagnosis.evidence import NOTHING
from gtpin.diagnosis.hypothesis import Hypothesis, Scope
from gtpin.diagnosis.hypothesis_set import HypothesisSet
from gtpin.diagnosis.prepare import Prepared, prepare
from gtpin.diagnosis.propose import propose
from gtpin.effects.active import ActiveEffect
from gtpin.effects.catalogue import catalogue
from gtpin.instruments.predicted import predicted_readings
from gtpin.instruments.readings import Readings
from gtpin.model.measured_robot import measuring, robot_of
from gtpin.model.model import Model

Floats = npt.NDArray[np.float64]

TEXTBOOK = {"cart_compliance": (0, 1, 2)}
"""Columns of an effect's textbook form that are not its core: a carriage that gives way along and across, and does not tip."""


@dataclass(frozen=True)
class Problem:
    """The linear problem of a dataset; ``hypotheses`` are the effects that it can test, each at each of its sites."""

    prepared: Prepared
    observed: Observed
    hypotheses: HypothesisSet

    @staticmethod
    @lru_cache(maxsize=1)
    def of(folder: Path) -> Problem:
        """Read a dataset, calibrate, and leave out the rows that the calibration sets aside; kept for the next rival."""
        dataset = Dataset.read(folder)
        robot = measuring(robot_of(dataset), dataset)
        prepared = prepare(dataset, robot)
        baseline = prepared.baseline
        observed = Observed.of(prepared.dataset.take(baseline.used(prepared.dataset)), baseline)
        scope = Scope.of(catalogue(), (), FALSE_ALARM, robot)
        return Problem(prepared, observed, propose(observed.design(baseline.model), scope))

    @property
    def baseline(self) -> Model:
        """The calibrated model without effects."""
        return self.prepared.baseline.model

    @cached_property
    def gains(self) -> dict[Hypothesis, float]:
        """Log evidence of each effect at each site alone, with the best value of a period or a place."""
        found = self.hypotheses.gains(NOTHING, self.hypotheses.named)
        return {gain.term: gain.value for gain in found.values() if isinstance(gain.term, Hypothesis)}

    @cached_property
    def cores(self) -> dict[Hypothesis, Floats]:
        """(m, c) whitened displacements of each effect in its textbook form, for coefficients of typical size."""
        design, found = self.hypotheses.design, {}
        for term in self.gains:
            X = design.columns(term.basis(design.operating_points))
            core = TEXTBOOK.get(term.effect.id, term.effect.core)
            found[term] = X[:, list(core)] if core else X
        return found

    @property
    def rows_of_a_pose(self) -> int:
        """How many numbers follow each other that belong together."""
        return self.hypotheses.design.components

    def fitted(self, causes: Sequence[Hypothesis], scale: Sequence[float] | None = None) -> Model:
        """Geometry, instrument and causes fitted together, to first order about the calibrated model.

        ``scale`` are the scales of the causes, which shrink their coefficients; by default those of the largest evidence.
        """
        if not causes:
            return self.baseline
        design, terms = self.hypotheses.design, list(causes)
        at = design.operating_points
        bases = [term.basis(at) for term in terms]
        X = np.hstack([design.columns(basis) for basis in bases])
        widths = [len(basis) for basis in bases]
        sizes = np.repeat(scale or self.hypotheses.of(terms, [1.0] * len(terms)).scale, widths)
        marginal = self.hypotheses.groups.marginal
        A = marginal.product(X, X) * np.outer(sizes, sizes) + np.eye(len(sizes))
        c = sizes * np.linalg.solve(A, sizes * marginal.product(X, design.y[:, None])[:, 0])
        x = marginal.deviation(design.y - X @ c)
        geometry, p = self.baseline.geometry, len(self.baseline.geometry.values)
        nominal = geometry.values - geometry.deviation
        active = []
        for term, basis, own in zip(terms, bases, np.split(c, np.cumsum(widths)[:-1]), strict=True):
            coefficients = own * basis.sigma
            covariance = np.zeros((len(own), len(own)))
            active.append(
                ActiveEffect(
                    term.effect, term.site, term.shape_parameter, coefficients, covariance, at.references, term.further
                )
            )
        instruments = self.baseline.instruments
        if isinstance(design.measured, Readings):
            instruments = design.measured.at(x[p:] * design.measured.sigma).fitted
        return replace(
            self.baseline,
            geometry=geometry.with_values(nominal + geometry.tolerance * x[:p]),
            effects=tuple(active),
            instruments=instruments,
        )


def without_geometry(B: Floats, *columns: Floats) -> list[Floats]:
    """Columns multiplied by (I + B B')^-1/2: what is left of them where geometry and instrument are marginalised."""
    U, s, _ = np.linalg.svd(B, full_matrices=False)
    shrink = (1.0 / np.sqrt(1.0 + s**2) - 1.0)[:, None]
    found = []
    for X in columns:
        wide = X.reshape(len(X), -1)
        found.append((wide + U @ (shrink * (U.T @ wide))).reshape(X.shape))
    return found


def cause(term: Hypothesis, probability: float, others: Sequence[Hypothesis] = ()) -> AnsweredCause:
    """A cause of an answer; ``others`` is what else it could be."""
    members = tuple(OtherEffect(effect=other.effect.id, site=other.site) for other in others)
    effect, site = term.place
    return AnsweredCause.model_validate(
        {"effect": effect, "site": site, "probability": min(max(probability, 0.0), 1.0), "class": members}
    )


def predictions(model: Model, folder: Path) -> Answer:
    """An answer without causes, with what a model predicts at the commands of a case."""
    commands = Commands.read(folder / "commands.csv", model.robot.n_actuators)
    if not model.instruments:
        return Answer(positions=model.predict(commands.q, commands.covariates).T.tolist())
    readings = {}
    for one in model.instruments:
        file = folder / f"commands-{one.name}.csv"
        own = Commands.read(file, model.robot.n_actuators, ids=one.known)
        ids = {name: values for name, values in read_table(file, ids=one.known).columns.items() if name in one.known}
        read = predicted_readings(model, model.predict(own.q, own.covariates), one.name, ids)
        readings[one.name] = np.column_stack([v for name, v in read.items() if name not in ORIENTATION]).tolist()
    return Answer.model_validate({"readings": readings})


def answered(folder: Path, model: Model, causes: Sequence[AnsweredCause], unknown: bool = False) -> Answer:
    """An answer with causes, and with the predictions of a model."""
    return predictions(model, folder).model_copy(update={"causes": tuple(causes), "unknown": unknown})
