"""Calibrations from passive encoders alone: what they say of their own errors is true, by Monte Carlo over five-bars."""

from __future__ import annotations

import functools
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom, chi2
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

Floats = np.ndarray

MACHINES = 40
ONCE = 1e-4
"""Chance that a bound fails where everything is right."""
INSIDE = 1.959964


@dataclass(frozen=True)
class Studied:
    """A machine, and its calibration."""

    machine: Measured
    found: gtpin.Calibration

    @property
    def z(self) -> Floats:
        """(p + k,) errors of the geometry and of the zeros, in units of the sigmas that were told."""
        known = self.machine.deviations
        off = {name: known.get(name, np.nan) for name in self.found.names}  # the tool's placement moves no encoder
        shown = [i for i, name in enumerate(self.found.names) if name in known]
        error = self.found.model.geometry.deviation - np.array(list(off.values()))
        zeros = [
            (one.value - self.machine.zeros[name]) / one.sigma
            for name, one in ((u.name, self.found.unknown(u.name)) for u in self.found.unknowns)
        ]
        return np.concatenate([(error / self.found.sigma)[shown], zeros])


@functools.cache
def studied() -> list[Studied]:
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(MACHINES):
            machine = measured(Path(folder) / str(number), np.random.default_rng([15, number]))
            found.append(Studied(machine, gtpin.calibrate(machine.dataset)))
    return found


def test_intervals_of_95_percent_cover_93_to_97_percent() -> None:
    inside = np.abs(np.array([one.z for one in studied()])) < INSIDE
    # Most of the 24 placements keep their priors and are independent draws: of 40 machines the share has a spread near
    # sqrt(0.05 0.95 / 960) = 0.007, so that 0.02 is 2.8 of it.
    assert 0.93 < inside.mean() < 0.97
    assert inside.sum(axis=0).min() >= binom.ppf(ONCE / inside.shape[1], MACHINES, 0.95)


def test_what_is_learned_is_covered_too() -> None:
    """Of the parameters whose variance is reduced to a quarter and less; errors of a machine are correlated."""
    variance_reduction = studied()[0].found.variance_reduction[:24] > 0.75
    assert variance_reduction.any()
    inside = np.abs(np.array([one.z[:24] for one in studied()])[:, variance_reduction]) < INSIDE
    assert inside.sum(axis=0).min() >= binom.ppf(ONCE / variance_reduction.sum(), MACHINES, 0.95)


def test_zeros_are_covered_and_unbiased() -> None:
    z = np.array([one.z[-2:] for one in studied()])
    assert (np.abs(z) < INSIDE).sum(axis=0).min() >= binom.ppf(ONCE / 2, MACHINES, 0.95)
    assert np.abs(z.mean(axis=0)).max() < np.sqrt(chi2.isf(ONCE / 2, 1) / MACHINES)


def test_all_errors_together_follow_the_covariance_that_is_told() -> None:
    total, count = 0.0, 0
    for one in studied():
        names = [name for name in one.found.names if name in one.machine.deviations]
        rows = [one.found.names.index(name) for name in names]
        error = one.found.model.geometry.deviation[rows] - np.array([one.machine.deviations[name] for name in names])
        total += float(error @ np.linalg.solve(one.found.covariance[np.ix_(rows, rows)], error))
        count += len(rows)
    assert chi2.ppf(ONCE / 2, count) < total < chi2.isf(ONCE / 2, count), total / count


def test_chi_square_per_degree_of_freedom_is_one() -> None:
    total, freedoms = sum(one.found.chi2 for one in studied()), sum(one.found.dof for one in studied())
    assert chi2.ppf(ONCE / 2, freedoms) < total < chi2.isf(ONCE / 2, freedoms), total / freedoms


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
    assert chi2.ppf(ONCE / 2, freedoms) < total < chi2.isf(ONCE / 2, freedoms), total / freedoms
    # The tool of these machines is not off, so that six of thirty-six deviations are no draws: the squares are at most those
    # of all, and at least those of the others.
    assert chi2.ppf(ONCE / 2, count - 6 * n) < squares < chi2.isf(ONCE / 2, count), squares / count


def test_no_reading_is_set_aside_where_none_is_wrong() -> None:
    # A good row out of all is set aside in one dataset of a thousand, for each encoder.
    assert sum(bool(one.found.rejected) for one in studied()) <= binom.isf(ONCE, MACHINES, 2e-3)


def test_an_undeclared_sigma_is_estimated_without_bias(tmp_path: Path) -> None:
    n, shares = 10, []
    for number in range(n):
        machine = measured(tmp_path / str(number), np.random.default_rng([16, number]), sigma=None)
        shares.append(gtpin.calibrate(machine.dataset).noise.sigma / SIGMA)
    # The mean square over all machines has the variance 2 / (n dof); a half of 60 readings at least are left to each.
    assert np.abs((np.array(shares) ** 2).mean(axis=0) - 1.0).max() < 4.0 * np.sqrt(2.0 / (n * 30.0))


def test_what_encoders_in_the_plane_can_t_see_keeps_its_prior_and_is_said() -> None:
    found = studied()[0].found
    for name in ("placement[drive1].z", "placement[drive2].rx", "platform.x"):
        assert found[name].sigma == pytest.approx(TOLERANCE, rel=1e-3)
        assert any(abs(direction.get(name, 0.0)) > 0.05 for direction in told(found)), name
    # A turn of the whole machine about its own axis moves no encoder: both drives' turns together.
    assert found["placement[drive1].rz"].sigma > 0.9 * TOLERANCE / np.sqrt(2.0)


def told(found: gtpin.Calibration) -> list[dict[str, float]]:
    """The directions of ``unobservable``."""
    return [one["direction"] for one in found.to_json()["unobservable"]]
