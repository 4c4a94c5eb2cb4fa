"""The noise that is re-estimated is the one that the poses have, and only that which was not declared."""

from dataclasses import replace

import numpy as np
import pytest
from linear_problems import calibrated, every_effect
from numpy.testing import assert_allclose
from scipy.stats import binom

from gtpin.diagnosis.design import Observed
from gtpin.diagnosis.evidence import NOTHING, fixed
from gtpin.diagnosis.hypothesis_set import HypothesisSet
from gtpin.diagnosis.noise import beyond_noise, left_over, reestimate_noise
from gtpin.diagnosis.priors import PRIORS
from gtpin.effects.displacement import Displacement
from gtpin.instruments.readings import Readings
from gtpin.kinematics.rotations import exp

Floats = np.ndarray
POSITION, ORIENTATION = 1.5e-5, 5e-5


def measured(
    seed: int, *, repeatability: float = 0.0, factor: float = 1.0, tails: float | None = None, fast: float = 0.0
) -> Observed:
    """Poses of a machine that lacks nothing, with noise of known size; what is supposed of it are the declared sigmas."""
    observed, baseline = calibrated(poses=120)
    rng = np.random.default_rng(seed)
    model, q = baseline.model, observed.measured.q
    q_off = q + repeatability * rng.standard_normal(q.shape)
    q_off[:, 1] += fast * np.sin(1e4 * q[:, 1])  # too fast for any model, and the same at every visit
    seen = model.predict(q_off)
    z = rng.standard_normal((len(q), 6))
    if tails is not None:
        z *= np.sqrt(tails / rng.chisquare(tails, (len(q), 1)))
    T = seen.T + factor * POSITION * z[:, :3]
    R = exp(factor * ORIENTATION * z[:, 3:]) @ seen.R
    noise = replace(observed.noise, sigma=np.array([POSITION, ORIENTATION]), repeatability=0.0)
    return replace(observed, measured=Readings.of_poses(q, T, R, model.robot), noise=noise, weight=np.ones(len(q)))


def hypotheses_of(observed: Observed) -> HypothesisSet:
    return HypothesisSet(observed.design(calibrated(poses=120)[1].model), (), (), (), every_effect())


def asked(observed: Observed, declared: tuple[bool, bool]) -> tuple[Observed, bool]:
    known = replace(observed.noise, estimated=~np.array(declared))
    found = reestimate_noise(replace(observed, noise=known), hypotheses_of(observed), NOTHING)
    return found.observed, found.matters


@pytest.mark.slow
def test_what_a_model_leaves_is_what_least_squares_leaves():
    observed = measured(1)
    hypotheses = hypotheses_of(observed)
    design = hypotheses.design
    waves = np.cos(np.pi * np.outer(design.operating_points.travel[:, 0], [3.0, 5.0, 7.0]))
    hypotheses.groups.add("waves", design.columns(Displacement(np.full(3, 2e-5), command=(0, waves))))
    residual, effective_parameters = left_over(hypotheses, fixed(hypotheses.groups, ("waves",), (2.0,)))
    # Ridge regression as ordinary least squares with a row for each prior, and its hat matrix.
    J = np.hstack([design.B, 2.0 * hypotheses.groups.columns("waves")])
    rows = np.vstack([J, np.eye(J.shape[1])])
    x = np.linalg.lstsq(rows, np.concatenate([design.y, np.zeros(J.shape[1])]), rcond=None)[0]
    assert_allclose(residual.ravel(), design.y - J @ x, atol=1e-7)
    assert_allclose(effective_parameters, np.trace(J @ np.linalg.pinv(rows)[:, : len(J)]), rtol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("factor", [0.4, 2.5])
def test_sigmas_that_are_not_declared_are_found(seed, factor):
    observed = measured(seed, factor=factor)
    found, matters = asked(observed, (False, False))
    # A sigma from k numbers is known to 1 / sqrt(2 k).
    chance = 4.0 / np.sqrt(2.0 * (3.0 * len(observed.weight) - 48.0))
    assert abs(np.log(found.noise.sigma[0] / (factor * POSITION))) < chance
    assert abs(np.log(found.noise.sigma[1] / (factor * ORIENTATION))) < chance
    assert matters


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("declared", [True, False])
@pytest.mark.parametrize("true", [1.3e-5, 2.5e-5])
def test_repeatability_is_found(seed, declared, true):
    observed = measured(seed, repeatability=true)
    found, matters = asked(observed, (declared, declared))
    assert abs(np.log(found.noise.repeatability / true)) < 4.0 / np.sqrt(2.0 * (3.0 * len(observed.weight) - 48.0))
    assert matters


@pytest.mark.slow
def test_declared_sigmas_of_gaussian_noise_are_left_alone():
    draws, shown = 16, 0
    for seed in range(draws):
        observed = measured(seed)
        found, matters = asked(observed, (True, True))
        assert found.noise.sigma[0] == POSITION
        assert found.noise.sigma[1] == ORIENTATION
        assert_allclose(found.weight, 1.0)
        shown += found.noise.repeatability > 0.0
        assert matters or found.noise.repeatability < 0.2 * POSITION
    # Repeatability that is not there is believed with a chance of 2.5 %.
    assert shown <= binom.isf(1e-3, draws, 0.025), shown


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_farther_out_in_heavy_tails_the_less_a_pose_counts(seed):
    observed = measured(seed, tails=2.5)
    found, matters = asked(observed, (True, True))
    assert matters
    hypotheses = hypotheses_of(observed)
    norms = np.linalg.norm(left_over(hypotheses, NOTHING)[0], axis=1)
    order = np.argsort(norms)
    assert (np.diff(found.weight[order]) <= 1e-12).all()
    assert found.weight[order[-5:]].max() < 0.5 * found.weight[order[: len(order) // 2]].min()


def test_only_the_sigma_that_is_not_declared_changes():
    observed = measured(1, factor=2.0)
    found, _ = asked(observed, (True, False))
    assert found.noise.sigma[0] == POSITION
    assert found.noise.sigma[1] != ORIENTATION
    found, _ = asked(observed, (False, True))
    assert found.noise.sigma[0] != POSITION
    assert found.noise.sigma[1] == ORIENTATION


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_errs_alike_at_every_visit_is_no_scatter(seed):
    observed = measured(seed, fast=5e-5)
    found = reestimate_noise(observed, hypotheses_of(observed), NOTHING)
    assert found.drive_beyond_noise == "cart2"
    assert found.observed.noise.repeatability < 2e-5


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("repeatability", [0.0, 1.3e-5, 2.5e-5])
def test_what_errs_anew_at_every_visit_is_scatter(seed, repeatability):
    observed = measured(seed, repeatability=repeatability)
    assert reestimate_noise(observed, hypotheses_of(observed), NOTHING).drive_beyond_noise is None


def test_a_drive_that_moves_nothing_that_was_measured_hides_no_other_drive_beyond_noise():
    size = np.tile([0.0, 1.0, 1.0], (200, 1))
    score = size * np.random.default_rng(1).chisquare(1.0, (200, 3)) * [1.0, 1.0, 4.0]
    assert beyond_noise(score, size, ("hidden", "good", "rough"), 0.0, PRIORS) == "rough"
