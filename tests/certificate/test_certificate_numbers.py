"""The numbers of ISO 9283 and ISO 230-2 against scatter and deviations that are known."""

from __future__ import annotations

import numpy as np
import pytest

from gtpin.certificate.pose_accuracy import VisitScatter, accuracy, standard_accuracy
from gtpin.certificate.positioning import mean_reversal, positioning
from gtpin.certificate.repeatability import Scatter, pooled_repeatability, standard_repeatability

TRIALS = 200
COVARIANCE = np.array([[9.0, 2.0, 0.0], [2.0, 4.0, 1.0], [0.0, 1.0, 16.0]]) * 1e-12
"""Of a visit, m^2."""


def lengths(rng: np.random.Generator) -> np.ndarray:
    return np.linalg.norm(rng.multivariate_normal(np.zeros(3), COVARIANCE, 400_000), axis=1)


def inside(values: list[float], sigmas: list[float], truth: float) -> float:
    """Share of estimates that agree with the truth within two of their standard uncertainties."""
    return float((np.abs(np.array(values) - truth) <= 2.0 * np.array(sigmas)).mean())


def test_repeatability_from_few_visits_of_many_poses_agrees_with_that_of_very_many_visits():
    rng = np.random.default_rng(0)
    far = lengths(rng)
    truth = far.mean() + 3.0 * far.std()
    visits = np.repeat(np.arange(20), 2)
    found = []
    for _ in range(TRIALS):
        where = rng.uniform(-1.0, 1.0, (20, 3))[visits]
        position = where + rng.multivariate_normal(np.zeros(3), COVARIANCE, len(visits))
        found.append(pooled_repeatability(Scatter.of(visits, position), 1e-9)[0])
    assert 0.88 <= inside([q.value for q in found], [q.sigma for q in found], truth) <= 1.0
    assert np.mean([q.value for q in found]) == pytest.approx(truth, rel=0.05)


def test_the_machine_s_repeatability_is_what_remains_without_the_instrument_s_noise():
    rng = np.random.default_rng(1)
    far = lengths(rng)
    truth = far.mean() + 3.0 * far.std()
    sigma, visits = 3e-6, np.repeat(np.arange(40), 6)
    found = []
    for _ in range(TRIALS):
        position = rng.multivariate_normal(np.zeros(3), COVARIANCE + sigma**2 * np.eye(3), len(visits))
        found.append(pooled_repeatability(Scatter.of(visits, position), sigma)[1])
    assert inside([q.value for q in found], [q.sigma for q in found], truth) >= 0.88


def test_scatter_no_larger_than_the_noise_leaves_the_machine_s_repeatability_blank():
    rng = np.random.default_rng(2)
    visits, blank = np.repeat(np.arange(20), 2), 0
    for _ in range(TRIALS):
        found = pooled_repeatability(Scatter.of(visits, 1e-5 * rng.standard_normal((40, 3))), 1e-5)
        blank += found[1].missing == "within_noise"
    assert blank >= 0.95 * TRIALS


def test_the_standard_s_numbers_need_thirty_visits_and_agree_with_the_truth():
    rng = np.random.default_rng(3)
    far = lengths(rng)
    visits = np.repeat(np.arange(2), [30, 29])
    offset, repeat = [], []
    for _ in range(TRIALS):
        errors = rng.multivariate_normal(np.zeros(3), COVARIANCE, 59)
        errors[:30] += (3e-5, 0.0, 4e-5)
        offset.append(standard_accuracy(visits, errors))
        repeat.append(standard_repeatability(visits, errors))
    assert {q.poses for q in offset} == {q.poses for q in repeat} == {1}
    assert inside([q.value for q in offset], [q.sigma for q in offset], 5e-5) >= 0.9
    assert inside([q.value for q in repeat], [q.sigma for q in repeat], far.mean() + 3.0 * far.std()) >= 0.88
    few = visits[visits == 1]
    assert standard_repeatability(few - 1, np.zeros((29, 3))).missing == "few_cycles"
    assert standard_accuracy(few - 1, np.zeros((29, 3))).have == 29


@pytest.mark.parametrize("size", [3e-6, 1e-4])
def test_pose_accuracy_of_single_visits_is_free_of_their_noise(size):
    rng = np.random.default_rng(4)
    true = size * rng.standard_normal((150, 3))
    truth = float(np.sqrt((true**2).sum(axis=1).mean()))
    visits = np.arange(150)
    found = []
    for _ in range(TRIALS):
        errors = true + rng.multivariate_normal(np.zeros(3), COVARIANCE, 150)
        found.append(accuracy("AP_p", "m", visits, errors, VisitScatter(COVARIANCE, np.inf))[0])
    assert 0.9 <= inside([q.value for q in found], [q.sigma for q in found], truth) <= 0.99
    assert np.mean([q.value for q in found]) == pytest.approx(truth, rel=0.02)


def line(rng: np.random.Generator, approaches: int, noise: float = 0.0):
    """Seven targets of the first of two actuators: reversal 8 um, deviation rising by 12 um over the targets."""
    targets = np.repeat(np.arange(7), 2 * approaches)
    side = np.tile([1.0, -1.0], 7 * approaches)
    q = np.column_stack([0.1 * targets, np.full(len(targets), 0.3)])
    deviations = np.column_stack([2e-6 * targets + 4e-6 * side, np.zeros(len(targets))])
    deviations[:, 0] += noise * rng.standard_normal(len(targets))
    return q, deviations, np.column_stack([side, side])


def test_a_line_of_targets_shows_reversal_repeatability_and_accuracy_of_its_actuator_alone():
    rng = np.random.default_rng(5)
    found = {(q.symbol, q.site): q for q in positioning(*line(rng, 5), ("cart1", "cart2"), ("m", "m"))}
    assert found["B", "cart1"].value == pytest.approx(8e-6)
    assert found["E", "cart1"].value == pytest.approx(12e-6 + 8e-6)
    assert found["R", "cart1"].value == pytest.approx(8e-6)
    assert found["A", "cart1"].value == pytest.approx(20e-6)
    assert found["B", "cart1"].poses == 7
    assert found["B", "cart1"].rows == 70
    assert found["A", "cart2"].missing == "few_targets"
    noisy = {(q.symbol, q.site): q for q in positioning(*line(rng, 50, 1e-6), ("cart1", "cart2"), ("m", "m"))}
    assert noisy["R", "cart1"].value == pytest.approx(2e-6 + 2e-6 + 8e-6, rel=0.15)
    assert noisy["A", "cart1"].value == pytest.approx(20e-6 + 4e-6, rel=0.1)


def test_four_approaches_or_unknown_directions_leave_positioning_blank():
    q, deviations, approach = line(np.random.default_rng(6), 4)
    few = positioning(q, deviations, approach, ("a", "b"), ("m", "m"))
    assert {one.missing for one in few} == {"few_targets"}
    assert few[0].have == 7
    assert {one.missing for one in positioning(q, deviations, None, ("a", "b"), ("m", "m"))} == {"no_approach"}
    assert {one.missing for one in positioning(q, None, approach, ("a", "b"), ("m", "m"))} == {"too_many_drives"}


def test_mean_reversal_from_poses_anywhere_agrees_with_the_truth():
    rng = np.random.default_rng(7)
    found = []
    for _ in range(TRIALS):
        approach = rng.choice([-1.0, 1.0], (80, 2))
        deviations = np.array([1e-5, -2e-5]) / 2.0 * approach + 1e-5 * rng.standard_normal((80, 2))
        found.append(mean_reversal(deviations, approach, ("a", "b"), ("m", "m")))
    for i, truth in enumerate((1e-5, -2e-5)):
        assert 0.9 <= inside([q[i].value for q in found], [q[i].sigma for q in found], truth) <= 0.99
