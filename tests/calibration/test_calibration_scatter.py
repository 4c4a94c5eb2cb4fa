"""Scatter of the drives is what is new at every pose; what neighbouring poses share is a lack of the model, and no scatter."""

from dataclasses import replace

import numpy as np
import pytest
from monte_carlo import ONCE
from scipy.stats import binom
from virtual_gantry import commands, draw, measured, undeclared

import gtpin

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")]

MACHINES = 30
SCATTER = 20e-6


def visited(seed, offset, count=80):
    """Undeclared measurements of a machine whose carts stand off by offset(q, rng), m; no pose is visited twice."""
    rng = np.random.default_rng([seed, 31])
    machine, asked = draw(rng), commands(rng, count)
    return undeclared(replace(measured(machine, asked + offset(asked, rng), rng), q=asked))


def test_what_is_new_at_every_pose_is_scatter():
    datasets = [visited(seed, lambda q, rng: SCATTER * rng.standard_normal(q.shape)) for seed in range(MACHINES)]
    found = [gtpin.calibrate(dataset) for dataset in datasets]
    believed = [c.noise.repeatability for c in found if c.noise.repeatability > 0.0]
    # Documented: independent scatter is taken for a lack of the model with a chance of 2.5 %.
    assert MACHINES - len(believed) <= binom.isf(ONCE, MACHINES, 0.025)
    assert np.mean(believed) == pytest.approx(SCATTER, rel=0.1)


def bent(q, rng):
    """A track that is bent, in its own command alone."""
    off = np.zeros_like(q)
    off[:, 1] = 40e-6 * np.sin(2.0 * np.pi * q[:, 1] / 0.35 + rng.uniform(0.0, 2.0 * np.pi))
    return off


def yielding(q, rng):
    """A cart that gives way with where the others are."""
    off = np.zeros_like(q)
    away = q[:, [0, 2]] - q[:, [1]]
    off[:, 1] = 60e-6 * np.sin(2.0 * np.pi * away / 0.6 + rng.uniform(0.0, 2.0 * np.pi, 2)).sum(axis=1)
    return off


@pytest.mark.parametrize("lack", [bent, yielding])
def test_what_neighbouring_poses_share_is_no_scatter(lack):
    found = [gtpin.calibrate(visited(seed, lack, count=120)) for seed in range(10)]
    assert [c.noise.repeatability for c in found] == [0.0] * 10
    # Of 1,200 good poses. What is left is no Gaussian, but sums of waves have no tails either.
    assert sum(len(c.rejected) for c in found) <= 2


@pytest.mark.parametrize("lack", [bent, yielding])
def test_repeated_visits_show_scatter_whatever_the_model_lacks(lack):
    rng = np.random.default_rng(7)
    machine, visits = draw(rng), np.repeat(np.arange(60), 2)
    asked = commands(rng, 60)[visits]
    off = lack(asked[::2], rng)[visits] + SCATTER * rng.standard_normal(asked.shape)
    found = gtpin.calibrate(undeclared(replace(measured(machine, asked + off, rng), q=asked, pose=visits)))
    # A sigma from 180 numbers is known to 5 %.
    assert found.noise.repeatability == pytest.approx(SCATTER, rel=0.25)
