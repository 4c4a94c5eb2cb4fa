"""Calibrations from passive encoders alone: what they say of their own errors is true, by Monte Carlo over five-bars."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path

import numpy as np
import pytest
from monte_carlo import ONCE, Study, assert_chi2, study
from scipy.stats import chi2
from virtual_five_bar import (
    SIGMA,
    TOLERANCE,
    ZERO,
    FiveBar,
    Measured,
    commands,
    drawn,
    encoder,
    measured,
    table,
    written,
)

import gtpin

pytestmark = pytest.mark.slow

MACHINES = 40


@functools.cache
def studied() -> Study:
    with tempfile.TemporaryDirectory() as folder:

        def make(rng: np.random.Generator) -> tuple[Measured, gtpin.Dataset]:
            machine = measured(Path(tempfile.mkdtemp(dir=folder)), rng)
            return machine, machine.dataset

        return study(make, MACHINES, 15)


@pytest.mark.study
def test_intervals_of_95_percent_cover_93_to_97_percent_and_what_is_learned_and_the_zeros_are_covered_too() -> None:
    found = studied()  # the tool's placement moves no encoder: it has no true deviation
    # Most of the 24 placements keep their priors and are independent draws: of 40 machines the share has a spread near
    # sqrt(0.05 0.95 / 960) = 0.007, so that 0.02 is 2.8 of it.
    found.assert_covers(pooled=0.02)
    learned = found.calibrations[0].variance_reduction[found.known] > 0.75
    assert learned.any()
    found.assert_inside(found.z[:, learned], 1.0)  # each alone: errors of a machine are correlated
    found.assert_covers_unknowns()


def test_all_errors_together_follow_the_covariance_that_is_told_and_chi_square_is_one() -> None:
    studied().assert_covariance()
    studied().assert_fits()


def test_encoders_beside_a_tracker_s_positions_are_fitted_with_them(tmp_path: Path) -> None:
    """A row is a number then: three of a position, one of an angle."""
    squares, total, freedoms, count, n, laser = 0.0, 0.0, 0.0, 0, 8, 1.5e-5
    for number in range(n):
        rng = np.random.default_rng([18, number])
        deviations, q = drawn(rng), commands(rng, 50)
        bar, zero = FiveBar.off(deviations), rng.normal(0.0, ZERO)
        at = bar.tip(q) + rng.normal(0.0, laser, (50, 3))
        angle = bar.elbows(q[:30])[:, 1] + zero + rng.normal(0.0, SIGMA, 30)
        said = [{"name": "laser", "kind": "tracker", "position_sigma": laser}, encoder("elbow2")]
        tables = {"laser": table(q, x=at[:, 0], y=at[:, 1], z=at[:, 2]), "elbow2": table(q[:30], reading=angle)}
        found = gtpin.calibrate(gtpin.Dataset.read(written(tmp_path / str(number), said, tables)))
        truth = np.array([deviations.get(name, 0.0) for name in found.names])
        total, freedoms = total + found.chi2, freedoms + found.dof
        error = found.model.geometry.deviation - truth
        squares += float(error @ np.linalg.solve(found.covariance, error))
        count += len(truth)
        assert abs(found.unknown("elbow2.zero").value - zero) < 4.0 * found.unknown("elbow2.zero").sigma
    assert_chi2(total, freedoms)
    # The tool of these machines is not off, so that six of thirty-six deviations are no draws: the squares are at most those
    # of all, and at least those of the others.
    assert chi2.ppf(ONCE / 2, count - 6 * n) < squares < chi2.isf(ONCE / 2, count), squares / count


def test_no_reading_is_set_aside_where_none_is_wrong() -> None:
    # A good row out of all is set aside in one dataset of a thousand, for each encoder; so is a lack of fit, and tails.
    studied().assert_clean(2e-3)


def test_an_undeclared_sigma_is_estimated_without_bias(tmp_path: Path) -> None:
    n, shares = 10, []
    for number in range(n):
        machine = measured(tmp_path / str(number), np.random.default_rng([16, number]), sigma=None)
        shares.append(gtpin.calibrate(machine.dataset).noise.sigma / SIGMA)
    # The mean square over all machines has the variance 2 / (n dof); a half of 60 readings at least are left to each.
    assert np.abs((np.array(shares) ** 2).mean(axis=0) - 1.0).max() < 4.0 * np.sqrt(2.0 / (n * 30.0))


def test_what_encoders_in_the_plane_can_t_see_keeps_its_prior_and_is_said() -> None:
    found = studied().calibrations[0]
    unseen = found.to_json()["unobservable"]
    for name in ("placement[drive1].z", "placement[drive2].rx", "platform.x"):
        assert found[name].sigma == pytest.approx(TOLERANCE, rel=1e-3)
        assert any(abs(one["direction"].get(name, 0.0)) > 0.05 for one in unseen), name
    # A turn of the whole machine about its own axis moves no encoder: both drives' turns together.
    assert found["placement[drive1].rz"].sigma > 0.9 * TOLERANCE / np.sqrt(2.0)
