"""The search for the noise of largest likelihood ends for any data, at a maximum."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from quick_first import quick_first
from scipy.stats import multivariate_normal
from urdfs import crossing

import gtpin
from gtpin.noise.estimate import LEAST_CONTRASTS, contrasts, from_repeats, likeliest, within_residuals
from gtpin.noise.reading_noise import SMALLEST, ReadingNoise

Floats = np.ndarray
STEP = 1e-7


def five_bar(q: Floats) -> Floats:
    """(N, 6, 2) derivative of the pose of a planar five-bar's left far link by its two drives, by differences; its plane is
    x, y. Beside it are rounding errors, as a chain that is solved in space has them."""

    def pose(q: Floats) -> Floats:
        elbow = 0.3 * np.stack([np.cos(q), np.sin(q)], axis=2) + np.array([[-0.1, 0.0], [0.1, 0.0]])
        at = crossing(elbow[:, 0], 0.4, elbow[:, 1], 0.4)
        far = at - elbow[:, 0]
        return np.column_stack([at, np.unwrap(np.arctan2(far[:, 1], far[:, 0]))])

    J = 1e-17 * np.random.default_rng(len(q)).standard_normal((len(q), 6, 2))
    for drive in range(2):
        step = STEP * np.eye(2)[drive]
        J[:, [0, 1, 5], drive] = (pose(q + step) - pose(q - step)) / (2.0 * STEP)
    return np.nan_to_num(J)


@cache
def _arm(name: str) -> pin.Model:
    return gtpin.load_robot(name).model


def arm(name: str, q: Floats) -> Floats:
    """(N, 6, 6) Jacobian of an arm's sixth joint."""
    model = _arm(name)
    data, found = model.createData(), []
    for one in np.hstack([q, np.zeros((len(q), model.nq - q.shape[1]))]):
        pin.computeJointJacobians(model, data, one)
        found.append(pin.getJointJacobian(model, data, 6, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)[:, :6])
    return np.array(found)


def small_set(rng: np.random.Generator) -> tuple[ReadingNoise, Floats, Floats, np.ndarray]:
    """Noise as first estimated, errors (N, c) and the Jacobian (N, c, n) of a few poses, some of them visited repeatedly, and
    (N,) their poses."""
    count, components = int(rng.integers(2, 15)), int(rng.choice([3, 6]))
    kind = rng.choice(["five_bar", "ur5", "panda"])
    if kind == "five_bar":
        J = five_bar(np.array([2.2, 0.94]) + rng.uniform(-0.7, 0.7, (count, 2)))
    else:
        J = arm(kind, rng.choice([0.0, 1e-9, 1.0]) * rng.uniform(-2.0, 2.0, (count, 6)))
    J[rng.random(count) < 0.1] *= 10.0 ** rng.uniform(0.0, 9.0)  # next to a singularity of a closed chain
    pose = np.repeat(np.arange(count), rng.integers(1, 5, count))
    J = J[pose, :components]
    sigma = 10.0 ** rng.uniform(-7.0, -3.0, components // 3)
    errors = np.repeat(sigma, 3) * rng.standard_normal(J.shape[:2])
    errors += rng.choice([0.0, 1e-6, 1e-4]) * np.einsum("nij,nj->ni", J, rng.standard_normal((len(J), J.shape[2])))
    errors *= rng.choice([0.0, 1.0, 1.0, 1.0, 1e3])
    group = np.broadcast_to(np.repeat([0, 1], 3)[:components], errors.shape)
    by_row = np.where(rng.random(errors.shape) < rng.choice([0.0, 0.5]), 1e-5, np.nan)
    first = sigma * 10.0 ** rng.uniform(-2.0, 2.0, len(sigma))
    return ReadingNoise(first, group, by_row, rng.random(len(sigma)) < 0.7), errors, J, pose


def test_a_search_over_noise_ends_for_any_data() -> None:
    repeated = 0
    for seed in range(60):
        noise, errors, J, pose = small_set(np.random.default_rng(seed))
        found = [likeliest(noise, errors, J, np.ones(len(errors)))]
        contrast, rows = contrasts(pose, errors)
        if len(contrast) >= LEAST_CONTRASTS:
            repeated += 1
            found.append(from_repeats(noise.take(rows), contrast, J[rows]).at_rows_of(noise))
        for one in found:
            assert (one.sigma >= SMALLEST).all()
            assert np.isfinite(one.repeatability)
            assert one.repeatability >= 0.0
            np.testing.assert_array_equal(
                one.sigma[~noise.estimated], np.maximum(noise.sigma, SMALLEST)[~noise.estimated]
            )
            assert np.isfinite(one.whitened(J, errors)).all()
    assert repeated > 20


@pytest.mark.parametrize("components", quick_first([3, 6]))
def test_the_likeliest_noise_is_a_maximum_and_near_the_true_one(components: int) -> None:
    """No other noise of a grid about it is likelier, and over many sets estimates scatter about the truth."""
    truth, ratios = np.array([20e-6, 50e-6])[: components // 3], []
    for seed in range(10):
        rng = np.random.default_rng([seed, components])
        J = arm("ur5", rng.uniform(-2.0, 2.0, (150, 6)))[:, :components]
        group = np.broadcast_to(np.repeat([0, 1], 3)[:components], (150, components))
        true = ReadingNoise(truth, group, np.full(group.shape, np.nan), np.ones(len(truth), dtype=bool), 30e-6)
        lower = np.linalg.cholesky(true.covariance(J, components))
        errors = np.einsum("nij,nj->ni", lower, rng.standard_normal(group.shape))
        start = replace(true, sigma=truth * 10.0 ** rng.uniform(-1.0, 1.0, len(truth)), repeatability=0.0)
        found = likeliest(start, errors, J, np.ones(150))

        def log_likelihood(noise: ReadingNoise, J: Floats = J, errors: Floats = errors) -> float:
            covariance = noise.covariance(J, components)
            return sum(multivariate_normal.logpdf(e, cov=V) for e, V in zip(errors, covariance, strict=True))

        best = log_likelihood(found)
        if seed < 3:
            for factor in (0.98, 1.02):
                assert log_likelihood(replace(found, repeatability=factor * found.repeatability)) < best
                for k in range(len(truth)):
                    other = np.where(np.arange(len(truth)) == k, factor, 1.0) * found.sigma
                    assert log_likelihood(replace(found, sigma=other)) < best
        assert best >= log_likelihood(true)
        ratios.append([*(found.sigma / truth), found.repeatability / 30e-6])
    mean, error = np.mean(ratios, axis=0), np.std(ratios, axis=0, ddof=1) / np.sqrt(len(ratios))
    assert (np.abs(mean - 1.0) < 4.0 * error + 0.02).all(), (mean, error)


def test_a_repeatability_that_few_visits_suggest_by_chance_does_not_hold_against_all_residuals() -> None:
    """And one that there is holds: of residuals of all poses, and of the contrasts of ten that are visited again."""
    sizes = {0.0: [], 40e-6: []}
    for seed in range(300):
        rng = np.random.default_rng([seed, 11])
        repeatability = 40e-6 if seed % 10 == 0 else 0.0
        J = arm("ur5", rng.uniform(-2.0, 2.0, (100, 6)))
        group = np.broadcast_to(np.repeat([0, 1], 3), (100, 6))
        declared = ReadingNoise(np.array([20e-6, 50e-6]), group, np.full((100, 6), np.nan), np.zeros(2, dtype=bool))
        lower = np.linalg.cholesky(replace(declared, repeatability=repeatability).covariance(J, 6))
        few = np.arange(10)
        contrast, errors = (np.einsum("nij,nj->ni", L, rng.standard_normal((len(L), 6))) for L in (lower[few], lower))
        found = from_repeats(declared.take(few), contrast, J[few])
        held = within_residuals(found.at_rows_of(declared), errors, J)
        sizes[repeatability].append((found.repeatability, held.repeatability))
    suggested, held = np.array(sizes[0.0]).T
    assert (suggested > 0.0).any()
    assert np.square(held).sum() < 0.2 * np.square(suggested).sum()
    _, held = np.array(sizes[40e-6]).T
    assert np.median(held) == pytest.approx(40e-6, rel=0.2)  # ten visits tell it to 20 %
    assert np.mean(held > 20e-6) > 0.8  # of 300 other draws 95 % are
    assert held.max() < 50e-6
