"""Readings of instruments in the linear problem: what is left out, degrees of freedom, and errors that others can't predict."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import binomtest, chi2
from virtual_gantry import draw
from virtual_instruments import Seen, cup, level, read, wire

import gtpin
from gtpin.calibration.left_out import of_block
from gtpin.diagnosis.design import Design, Observed
from gtpin.diagnosis.evidence import Marginal
from gtpin.diagnosis.gap import blocks_of, leave_out
from gtpin.diagnosis.prepare import Prepared, prepare
from gtpin.model.measured_robot import robot_of

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")

Floats = np.ndarray


@cache
def prepared(kind: str) -> Prepared:
    rng = np.random.default_rng(11)
    machine = draw(rng).gantry
    seen: dict[str, list[Seen]] = {
        "sockets": [cup(machine, rng, 72)],
        "wire and level": [wire(machine, rng, 90), level(machine, rng, 40)],
    }
    dataset = read(Path(mkdtemp()) / "set", *seen[kind])
    return prepare(dataset, robot_of(dataset))


def design(kind: str) -> Design:
    found = prepared(kind)
    return Observed.of(found.dataset, found.baseline).design(found.baseline.model)


@pytest.mark.parametrize("kind", ["sockets", "wire and level"])
def test_a_block_of_readings_is_what_a_fit_without_it_predicts(kind: str) -> None:
    problem, c = design(kind), design(kind).components
    rng = np.random.default_rng(0)
    causes = rng.standard_normal((len(problem.y), 2))
    masks = [np.arange(len(problem.whitening)) % 9 == i for i in range(9)]
    found = leave_out(problem, causes, masks)
    J = np.hstack([problem.B, causes])
    for block in masks:
        rows = np.repeat(~block, c)
        z = np.linalg.solve(J[rows].T @ J[rows] + np.eye(J.shape[1]), J[rows].T @ problem.y[rows])
        residual = (problem.y - J @ z).reshape(-1, c)[block] * problem.counted[block]
        assert_allclose(found.errors[block], residual, rtol=1e-6, atol=1e-6 * np.abs(problem.y).max())


def test_what_others_can_not_predict_is_left_out_of_the_errors() -> None:
    """A number that only its own block determines: the rest of the block is predicted as if it were not there."""
    rng = np.random.default_rng(1)
    J, own = rng.standard_normal((40, 3)), np.zeros((40, 1))
    own[:4] = rng.standard_normal((4, 1)) * 1e6
    y = J @ rng.standard_normal(3) + rng.standard_normal(40)
    both = np.hstack([J, own])
    root = np.linalg.inv(np.linalg.cholesky(both.T @ both + np.eye(4))).T
    half = both @ root
    residual = y - half @ (half.T @ y)
    errors, kept = of_block(half[:4], residual[:4])
    assert kept.sum() == pytest.approx(3.0)
    z = np.linalg.solve(J[4:].T @ J[4:] + np.eye(3), J[4:].T @ y[4:])
    unit = own[:4, 0] / np.linalg.norm(own[:4])
    across = np.eye(4) - np.outer(unit, unit)
    # Along what can't be predicted there is no error; across it, that of the fit of the others.
    assert abs(float(unit @ errors)) < 1e-5
    assert_allclose(across @ errors, across @ (y[:4] - J[:4] @ z), rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("rows", [4, 30])
def test_a_block_is_the_same_by_rows_and_by_coefficients(rows: int) -> None:
    rng = np.random.default_rng(2)
    half = np.linalg.qr(rng.standard_normal((60, 10)))[0] * np.sqrt(rng.uniform(0.1, 0.99, 10))
    left = rng.standard_normal(rows)
    errors, _ = of_block(half[:rows], left)
    leverage = np.eye(rows) - half[:rows] @ half[:rows].T
    assert_allclose(errors, np.linalg.solve(leverage, left), rtol=1e-9)


@pytest.mark.slow
def test_sockets_that_only_one_session_has_make_no_gap_of_it(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    machine = draw(rng).gantry
    dataset = read(tmp_path / "set", cup(machine, rng, 72, sockets=18))
    socket = dataset.readings.columns["socket"].astype(str)
    day = np.array([f"day{int(name[1:]) // 6}" for name in socket], dtype=object)
    found = gtpin.diagnose(replace(dataset, covariates={"session": day}), hold_out="session")
    assert found.verdict == "none"
    assert found.gap.before < 1.3 * found.gap.floor
    (cups,) = found.gap.by_instrument
    assert cups.before < 1.3 * cups.floor
    assert cups.floor > 1e-5


@pytest.mark.parametrize("kind", ["sockets", "wire and level"])
def test_power_without_a_cause_is_chi_square_with_its_degrees_of_freedom(kind: str) -> None:
    """Over noise, geometry and unknowns drawn from their priors, those without one put where the readings have them."""
    problem = design(kind)
    readings = problem.measured
    free = ~np.isfinite(readings.sigma)
    p = len(problem.model.geometry.parameters)
    vague = np.concatenate([np.zeros(p, dtype=bool), free])
    assert problem.free_unknowns == free.sum()
    marginal, rng, values = Marginal(problem.B), np.random.default_rng(3), []
    for _ in range(300):
        drawn = np.where(vague, 0.0, rng.standard_normal(len(vague)))
        noise = np.where(problem.counted.ravel(), rng.standard_normal(len(problem.y)), 0.0)
        y = noise + problem.B @ drawn
        values.append(float(marginal.product(y[:, None], y[:, None])[0, 0]))
    shared = problem.count - int(problem.counted.sum())  # known distances, taken to be exact here
    below = chi2.cdf(values, problem.dof - shared)
    for share in (0.1, 0.5, 0.9):
        assert binomtest(int((below < share).sum()), 300, share).pvalue > 1e-3


@pytest.mark.parametrize("kind", ["sockets", "wire and level"])
def test_all_readings_at_one_pose_are_left_out_together(kind: str) -> None:
    dataset = prepared(kind).dataset
    blocks = blocks_of(dataset, "region", np.random.default_rng(0))
    of = np.argmax(np.stack(blocks), axis=0)
    assert len(blocks) > 3
    for pose in np.unique(dataset.pose.astype(str)):
        assert len(set(of[dataset.pose.astype(str) == pose])) == 1


@pytest.mark.parametrize("kind", ["sockets", "wire and level"])
def test_a_sigma_that_visits_contradict_counts_as_declared(kind: str) -> None:
    found = prepared(kind)
    noise = found.baseline.noise
    contradicted = replace(noise, sigma=2.0 * noise.sigma, estimated=np.ones_like(noise.estimated))
    again = Observed.of(found.dataset, replace(found.baseline, noise=contradicted)).noise
    assert None not in found.declared
    assert again.sigma[0] == found.declared[0]
    assert not again.estimated.any()
