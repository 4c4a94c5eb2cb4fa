"""Blocks left out by leverage are blocks left out; noise and explained fraction are what a linear world has."""

from functools import cache

import numpy as np
import pytest
from linear_problems import bare_design
from numpy.testing import assert_allclose

from gtpin.diagnosis.design import Design
from gtpin.diagnosis.gap import gap, leave_out
from gtpin.diagnosis.result import Gap

pytestmark = pytest.mark.slow

Floats = np.ndarray
SIGMA = 2e-5


def whitening_of(n: int, c: int, rng: np.random.Generator) -> Floats:
    """(n, c, c) of noise that differs from pose to pose and from axis to axis."""
    A = rng.standard_normal((n, c, c)) * 0.2 + np.eye(c)
    return np.linalg.inv(np.linalg.cholesky(SIGMA**2 * A @ A.transpose(0, 2, 1)))


def partition(n: int, blocks: int) -> list[Floats]:
    return [np.arange(n) * blocks // n == k for k in range(blocks)]


@pytest.mark.parametrize(("c", "free", "parts"), [(3, 0, 7), (6, 0, 7), (3, 6, 7), (6, 6, 7), (3, 0, 2), (3, 0, 3)])
def test_a_block_left_out_is_what_a_fit_without_it_predicts(c, free, parts):
    """Blocks may be larger than the fit, and their columns others than those of the fit."""
    rng = np.random.default_rng(1)
    n, p, k = 30, 9, 4
    W = whitening_of(n, c, rng)
    B, E, other = (rng.standard_normal((n * c, m)) for m in (p + free, k, k))
    y = rng.standard_normal(n * c) + 3.0 * B[:, 0] + E @ rng.standard_normal(k)
    design, blocks = bare_design(y, B, W, p), partition(n, parts)
    found, elsewhere = leave_out(design, E, blocks), leave_out(design, E, blocks, other)
    J = np.hstack([B, E])
    prior = np.diag([1.0] * p + [0.0] * free + [1.0] * k)
    for block in blocks:
        rows = np.repeat(~block, c)
        z = np.linalg.solve(J[rows].T @ J[rows] + prior, J[rows].T @ y[rows])
        for columns, left_out in ((E, found), (other, elsewhere)):
            left = (y - np.hstack([B, columns]) @ z).reshape(n, c)[block]
            metres = np.linalg.solve(W[block], left[..., None])[..., 0][:, :3]
            assert_allclose(left_out.errors[block], metres, rtol=1e-9, atol=1e-9 * SIGMA)
    z = np.linalg.solve(J.T @ J + prior, J.T @ y)
    assert_allclose(found.z, z, atol=1e-9)
    assert_allclose(found.root @ found.root.T, np.linalg.inv(J.T @ J + prior), atol=1e-9)
    moved = np.linalg.solve(W, J.reshape(n, c, -1))[:, :3]
    assert_allclose(found.columns, moved, rtol=1e-9, atol=1e-9 * SIGMA)


def test_the_noise_that_a_fit_shows_is_without_bias():
    rng = np.random.default_rng(2)
    n, c, p, draws = 40, 6, 12, 300
    W, B = whitening_of(n, c, rng), rng.standard_normal((n * c, p))
    true = np.trace(np.linalg.inv(W.transpose(0, 2, 1) @ W)[:, :3, :3], axis1=1, axis2=2).mean()
    shown = []
    for _ in range(draws):
        y = B @ rng.standard_normal(p) + rng.standard_normal(n * c)
        shown.append(leave_out(bare_design(y, B, W, p), np.zeros((n * c, 0)), partition(n, 10)).noise.mean())
    error = np.std(shown) / np.sqrt(draws)
    assert abs(np.mean(shown) - true) < 4.0 * error, (np.mean(shown) / true, error / true)


class World:
    """Poses with a geometry and a cause, both linear: what is measured, and what the same machine does elsewhere.

    ``unknown``: size of an error that is in neither, over that of the cause.
    """

    def __init__(self, seed: int, strength: float, unknown: float = 0.0) -> None:
        self.rng = np.random.default_rng(seed)
        self.n, self.c, self.p, self.k = 80, 3, 10, 4
        self.W = np.broadcast_to(np.eye(3) / SIGMA, (self.n, 3, 3))
        self.modes = self.rng.standard_normal((self.p + self.k, 3, 6))
        self.geometry = self.rng.standard_normal(self.p)
        self.cause = strength * self.rng.standard_normal(self.k)
        self.strength = strength
        self.at = self.rng.uniform(-1.0, 1.0, (self.n, 3))
        self.unknown = unknown * strength * np.random.default_rng([seed, 1]).standard_normal((2, 3))

    def beside(self, x: Floats) -> Floats:
        """(N 3,) whitened displacements of the unknown error at places (N, 3)."""
        return (np.stack([np.sin(9.0 * x[:, 2]), np.cos(8.0 * x[:, 1] + 1.0)], axis=1) @ self.unknown).ravel()

    def columns(self, x: Floats) -> tuple[Floats, Floats]:
        """(N 3, p) and (N 3, k) whitened displacements at places (N, 3): smooth functions of the place."""
        waves = np.stack([np.ones(len(x)), *x.T, x[:, 0] * x[:, 1], x[:, 1] * x[:, 2]], axis=1)
        fast = np.stack([np.cos(7.0 * x[:, 0]), np.sin(5.0 * x[:, 1]), *x.T, x[:, 0] * x[:, 2]], axis=1)
        B = np.einsum("nm,jim->nij", waves, self.modes[: self.p]) * 3.0
        E = np.einsum("nm,jim->nij", fast, self.modes[self.p :])
        return B.reshape(len(x) * 3, -1), E.reshape(len(x) * 3, -1)

    def measured(self) -> tuple[Design, Floats]:
        B, E = self.columns(self.at)
        y = B @ self.geometry + E @ self.cause + self.beside(self.at) + self.rng.standard_normal(len(B))
        return bare_design(y, B, self.W, self.p), E * self.strength

    def realised(self, design: Design, E: Floats, poses: int = 120) -> float:
        """Shrinkage on other poses without noise, by fits that have nothing to do with the package's."""
        at = self.rng.uniform(-1.0, 1.0, (poses, 3))
        B_new, E_new = self.columns(at)
        truth = B_new @ self.geometry + E_new @ self.cause + self.beside(at)
        alone = np.linalg.solve(design.B.T @ design.B + np.eye(self.p), design.B.T @ design.y)
        J = np.hstack([design.B, E])
        both = np.linalg.solve(J.T @ J + np.eye(J.shape[1]), J.T @ design.y)
        after = truth - np.hstack([B_new, E_new * self.strength]) @ both
        before = truth - B_new @ alone
        return float(1.0 - (after**2).sum() / (before**2).sum())


@cache
def compared(strength: float, unknown: float = 0.0) -> list[tuple[Gap, float]]:
    """What was said of worlds 1, 2, ..., and what they did."""
    found = []
    for seed in range(60):
        world = World(seed, strength, unknown)
        design, E = world.measured()
        floor = np.full((world.n, 3), SIGMA**2)
        said = gap(design, E, floor, partition(world.n, 20), np.random.default_rng(0))
        found.append((said, world.realised(design, E)))
    return found


@pytest.mark.parametrize("strength", [0.3, 1.0])
@pytest.mark.parametrize("unknown", [0.0, 1.0])
def test_intervals_cover_the_shrinkage_on_other_poses(strength, unknown):
    found = compared(strength, unknown)
    inside = [said.interval[0] <= true <= said.interval[1] for said, true in found]
    assert all(said.interval[0] <= said.explained_fraction <= said.interval[1] for said, _ in found)
    assert np.mean(inside) >= 0.85, np.mean(inside)
    if unknown:  # what is left is no noise: the value is within the interval, not at its end
        assert np.mean([said.interval[0] < said.explained_fraction - 0.01 for said, _ in found]) >= 0.85


@pytest.mark.parametrize("strength", [0.3, 1.0])
def test_shrinkage_is_the_realised_one_in_the_mean(strength):
    errors = [said.explained_fraction - true for said, true in compared(strength)]
    chance = np.std(errors) / np.sqrt(len(errors))
    assert abs(np.mean(errors)) < 4.0 * chance + 0.01, (np.mean(errors), chance)


def test_without_causes_nothing_shrinks_and_the_floor_is_no_higher_than_the_gap():
    world = World(1, 0.0)
    design, E = world.measured()
    none = np.zeros((len(E), 0))
    for scale in (1.0, 100.0):
        found = gap(design, none, np.full((80, 3), scale * SIGMA**2), partition(80, 20), np.random.default_rng(0))
        assert found.before == found.after
        assert found.floor <= found.before
        assert found.explained_fraction is None
        assert found.interval is None


def test_a_perfect_model_shows_the_noise_floor():
    ratios = []
    for seed in range(20):
        world = World(seed, 3.0)
        design, E = world.measured()
        found = gap(design, E, np.full((80, 3), SIGMA**2), partition(80, 20), np.random.default_rng(0))
        ratios.append(found.floor**2 / (3.0 * SIGMA**2))
        assert found.before > found.after >= 0.9 * found.floor
    # The floor is these poses' own noise: 240 numbers of a sample's variance, less what the cap takes away.
    assert abs(np.mean(ratios) - 1.0) < 0.06, np.mean(ratios)
