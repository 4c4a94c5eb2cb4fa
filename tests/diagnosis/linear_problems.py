"""Small linear problems whose answers are computed densely, by nothing but numpy and scipy."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.stats import multivariate_normal

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.diagnosis.design import Design, Observed
from gtpin.diagnosis.evidence import Groups, Marginal
from gtpin.diagnosis.hypothesis import Hypothesis, Scope
from gtpin.diagnosis.priors import PRIORS
from gtpin.effects.catalogue import catalogue, effects_by_id
from gtpin.instruments.readings import Readings

Floats = np.ndarray


@dataclass(frozen=True)
class Dense:
    """y ~ N(0, I + B B' + sum_g s_g^2 E_g E_g') with everything written out."""

    y: Floats
    B: Floats
    E: Mapping[str, Floats]

    @staticmethod
    def draw(seed: int, widths: Mapping[str, int], m: int = 40, p: int = 5) -> "Dense":
        rng = np.random.default_rng(seed)
        E = {name: rng.standard_normal((m, width)) for name, width in widths.items()}
        y = rng.standard_normal(m) + sum(e @ rng.standard_normal(e.shape[1]) for e in E.values())
        return Dense(y, 3.0 * rng.standard_normal((m, p)), E)

    @property
    def groups(self) -> Groups[str]:
        groups: Groups[str] = Groups(Marginal(self.B), self.y)
        for name, columns in self.E.items():
            groups.add(name, columns)
        return groups

    def covariance(self, scales: Mapping[str, float]) -> Floats:
        return np.eye(len(self.y)) + self.B @ self.B.T + sum(s**2 * self.E[n] @ self.E[n].T for n, s in scales.items())

    def log_evidence(self, scales: Mapping[str, float]) -> float:
        """Log of the density over that of no group, with the scales' log-normal priors."""
        nothing = np.zeros(len(self.y))
        both = [multivariate_normal(nothing, self.covariance(s)).logpdf(self.y) for s in (scales, {})]
        return float(both[0] - both[1] - 0.5 * sum((np.log(s) / PRIORS.scale_spread) ** 2 for s in scales.values()))


def every_effect(false_alarm: float = 0.01) -> Scope:
    """All effects of the catalogue, as a diagnosis takes them."""
    return Scope(catalogue(), frozenset(), false_alarm)


def hypothesis(name: str) -> Hypothesis:
    """The hypothesis ``effect@site``."""
    effect, _, site = name.partition("@")
    return Hypothesis(effects_by_id()[effect], site)


def bare_design(y: Floats, B: Floats, whitening: Floats, n_geometry: int) -> Design:
    """A linear problem that belongs to no machine."""
    model: Any = SimpleNamespace(geometry=SimpleNamespace(parameters=range(n_geometry)))
    operating_points: Any = None
    rows = len(whitening)
    robot: Any = None
    R = np.broadcast_to(np.eye(3), (rows, 3, 3)) if whitening.shape[1] == 6 else None
    nowhere = Readings.of_poses(np.zeros((rows, 1)), np.zeros((rows, 3)), R, robot)
    return Design(operating_points, whitening, model, y, B, n_geometry, 0, nowhere)


@cache
def calibrated(poses: int = 60, seed: int = 1) -> tuple[Observed, gtpin.Calibration]:
    """A machine without a fault that was measured and calibrated: commands and covariates as they come in practice."""
    dataset = make_case(seed, effects=[], poses=poses).dataset
    baseline = gtpin.calibrate(dataset)
    return Observed.of(dataset, baseline), baseline
