"""Gross errors happen anywhere; outliers that are clustered over a coordinate of the machine are none."""

import numpy as np
import pytest

import gtpin
from gtpin.diagnosis.noise import clustered
from gtpin.diagnosis.priors import PRIORS
from gtpin.effects.operating_points import OperatingPoints


def operating_points(rng: np.random.Generator, count: int = 190) -> OperatingPoints:
    model = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau")))
    q = rng.uniform([-0.2, 0.1, -0.2], [0.6, 0.3, 0.5], (count, 3))
    approach = {f"approach{k}": rng.choice([-1.0, 1.0], count) for k in (1, 2, 3)}
    return OperatingPoints(model.kinematics, q, model.kinematics.forward(q), approach)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("over", ["travel", "force"])
def test_outliers_of_one_interval_are_clustered(seed: int, over: str) -> None:
    """A pit of a track, and play that the force of a rod takes up at five of 190 poses."""
    rng = np.random.default_rng(seed)
    at = operating_points(rng)
    values = at.q[:, 1] if over == "travel" else at.force[:, 4]
    pit = np.zeros(len(at), dtype=bool)
    pit[np.argsort(values)[60:65] if over == "travel" else np.argsort(values)[-5:]] = True
    wild = pit.copy()
    wild[rng.choice(np.flatnonzero(~pit), 2, replace=False)] = True  # two gross errors elsewhere
    found = clustered(at, wild, PRIORS)
    assert found[pit].all()
    assert not found[~wild].any()


def test_gross_errors_at_random_are_seldom_clustered() -> None:
    """By the bound, in at most one of 1,000 draws: more than 3 of 300 have a chance below 3e-4 (Poisson)."""
    rng = np.random.default_rng(7)
    at = operating_points(rng, 120)
    found = 0
    for _ in range(300):
        wild = np.zeros(len(at), dtype=bool)
        wild[rng.choice(len(at), rng.integers(3, 12), replace=False)] = True
        found += bool(clustered(at, wild, PRIORS).any())
    assert found <= 3


def test_visits_of_one_command_are_one() -> None:
    """Six wrong visits of one command say nothing of an interval of commands."""
    rng = np.random.default_rng(1)
    at = operating_points(rng, 60)
    rows = np.concatenate([np.arange(60), np.repeat(7, 5)])
    again = OperatingPoints(at.kinematics, at.q[rows], at.kinematics.forward(at.q[rows]), {})
    assert not clustered(again, rows == 7, PRIORS).any()
