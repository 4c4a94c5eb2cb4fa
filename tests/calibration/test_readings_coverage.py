"""What a calibration by any instruments says of its own errors is true: Monte Carlo over machines and instruments."""

from __future__ import annotations

import functools
import itertools
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from monte_carlo import ONCE, Study
from scipy.stats import binom, chi2
from virtual_gantry import Gantry, draw
from virtual_instruments import LASER, LEVEL, SEAT, TOUCH, WIRE, Seen, bed, camera, cup, laser, level, read, spare, wire

import gtpin
from gtpin.calibration.robust_fit import RobustFit
from gtpin.noise.weights import Tails

pytestmark = pytest.mark.slow

Floats = np.ndarray
Reads = Callable[[Gantry, np.random.Generator], list[Seen]]

MACHINES = 50
KINDS: dict[str, Reads] = {
    "range": lambda machine, rng: [wire(machine, rng, 150)],
    "plane": lambda machine, rng: [bed(machine, rng, 150, heights=True)],
    "socket": lambda machine, rng: [cup(machine, rng, 72)],
    "tilt": lambda machine, rng: [level(machine, rng, 100)],
    "tracker": lambda machine, rng: [laser(machine, rng, 80)],
    "camera": lambda machine, rng: [camera(machine, rng, 80)],
    "range and tilt": lambda machine, rng: [wire(machine, rng, 120, offset=1e-3), level(machine, rng, 60)],
    "encoder": lambda machine, rng: [spare(machine, rng, 60, j) for j in ("link1_yaw", "link2b_pitch", "link3a_yaw")],
}


@dataclass(frozen=True)
class ReadingsStudy(Study):
    """Calibrations by instruments whose unknowns are known as well."""

    truths: list[dict[str, float]]

    @property
    def z_unknown(self) -> Floats:
        """(n, k) errors of the instruments' unknowns in units of the sigmas that were told."""
        found = []
        for c, truth in zip(self.calibrations, self.truths, strict=True):
            told = [(c.unknown(one.name), truth[one.name]) for one in c.unknowns]
            found.append([(estimate.value - value) / estimate.sigma for estimate, value in told])
        return np.array(found)

    @property
    def spread_unknown(self) -> float:
        """Standard error of the share of unknowns inside their 95 % intervals, as correlated as they are told to be."""
        covariance = self.calibrations[0].u_covariance
        sigma = np.sqrt(np.diagonal(covariance))
        rng = np.random.default_rng(0)
        drawn = rng.multivariate_normal(
            np.zeros(len(sigma)), covariance / np.outer(sigma, sigma), 4000, check_valid="ignore"
        )
        return float((np.abs(drawn) < 1.959964).mean(axis=1).std() / np.sqrt(len(self.calibrations)))


def studied(reads: Reads, n: int, seed: int) -> ReadingsStudy:
    """Calibrate n machines, each of its own stream of random numbers."""
    calibrations, machines, truths = [], [], []
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)  # of rows set aside: counted, where it matters
        for number in range(n):
            rng = np.random.default_rng([seed, number])
            machine = draw(rng)
            seen = reads(machine.gantry, rng)
            calibrations.append(gtpin.calibrate(read(Path(folder) / "set", *seen)))
            machines.append(machine)
            truths.append({name: value for one in seen for name, value in one.truth.items()})
    return ReadingsStudy(calibrations, machines, truths)


@functools.cache
def of_kind(kind: str) -> ReadingsStudy:
    return studied(KINDS[kind], MACHINES, list(KINDS).index(kind))


@pytest.mark.parametrize("kind", KINDS)
def test_intervals_of_95_percent_cover_93_to_97_percent(kind):
    # The pooled share has a spread of 0.005 or less over 50 machines, so that 0.02 is 4 of it.
    of_kind(kind).assert_covers(pooled=0.02)


@pytest.mark.parametrize("kind", KINDS)
def test_values_are_unbiased(kind):
    of_kind(kind).assert_unbiased()


@pytest.mark.parametrize("kind", KINDS)
def test_unknowns_of_the_instruments_are_covered_and_unbiased(kind):
    found = of_kind(kind)
    z = found.z_unknown
    n, k = z.shape
    assert abs((np.abs(z) < 1.959964).mean() - 0.95) < 4.0 * found.spread_unknown
    assert (np.abs(z) < 1.959964).sum(axis=0).min() >= binom.ppf(ONCE / k, n, 0.95)
    assert np.abs(z.mean(axis=0)).max() < np.sqrt(chi2.isf(ONCE / k, 1) / n)


def test_unknowns_of_all_kinds_together_are_covered_by_93_to_97_percent():
    inside = np.concatenate([(np.abs(of_kind(kind).z_unknown) < 1.959964).ravel() for kind in KINDS])
    spreads = [of_kind(kind).spread_unknown * of_kind(kind).z_unknown.size / len(inside) for kind in KINDS]
    assert 3.1 * np.sqrt(np.square(spreads).sum()) < 0.02  # exceeded by chance with 1 of 500 choices of machines
    assert abs(inside.mean() - 0.95) < 0.02


@pytest.mark.parametrize("kind", KINDS)
def test_chi_square_per_degree_of_freedom_is_one(kind):
    of_kind(kind).assert_fits()


@pytest.mark.parametrize("kind", KINDS)
def test_no_row_is_set_aside_and_no_lack_of_fit_claimed_where_there_is_none(kind):
    found = of_kind(kind)
    n = len(found.calibrations)
    # A good row out of all is set aside in one dataset of a thousand, for each instrument; a lack of fit is claimed in
    # 1e-3, and so are heavy tails.
    assert sum(bool(c.rejected) for c in found.calibrations) <= binom.isf(ONCE, n, 2e-3)
    assert sum(c.enlarged > 1.0 or np.isfinite(c.freedom) for c in found.calibrations) <= binom.isf(ONCE, n, 2e-3)


UNDECLARED: dict[str, tuple[Reads, list[float]]] = {
    "touches": (lambda m, rng: [bed(m, rng, 72)], [TOUCH]),
    "range and tilt": (lambda m, rng: [wire(m, rng, 90), level(m, rng, 50)], [WIRE, LEVEL]),
    "plane and tracker": (lambda m, rng: [bed(m, rng, 90, heights=True), laser(m, rng, 40)], [TOUCH, LASER]),
    "socket": (lambda m, rng: [cup(m, rng, 72)], [SEAT]),
}


@pytest.mark.parametrize("kinds", UNDECLARED)
def test_an_undeclared_sigma_is_estimated_without_bias(kinds):
    reads, sigmas = UNDECLARED[kinds]
    n = 15

    def silent(machine, rng):
        return [one.saying(sigma=None, position_sigma=None) for one in reads(machine, rng)]

    found = studied(silent, n, 100)
    for group, sigma in enumerate(sigmas):
        shares = np.array([c.noise.sigma[group] for c in found.calibrations]) / sigma
        # The mean square over all machines has the variance 2 / (n dof); a half of the numbers at least are left to each.
        numbers = (found.calibrations[0].noise.group == group).sum()
        assert abs((shares**2).mean() - 1.0) < 4.0 * np.sqrt(2.0 / (n * numbers / 2.0)), shares.mean()
    found.assert_covers()


def test_tails_that_come_and_go_with_their_own_weights_are_heavy(tmp_path, monkeypatch):
    # Weights of heavy tails may take away the tails that were seen without them, for ever.
    tails = itertools.cycle([(Tails(15.0, 1.0),), (Tails(),)])
    monkeypatch.setattr(RobustFit, "_tails", lambda *_: next(tails))
    rng = np.random.default_rng(11)
    machine = draw(rng)
    found = gtpin.calibrate(read(tmp_path / "set", wire(machine.gantry, rng, 120)))
    assert found.freedom == 15.0


SPOILT = {
    "range": ("range", 1e-3),
    "plane": ("height", 1e-3),
    "tilt": ("tilt_x", 1e-3),
    "tracker": ("y", 1e-3),
}


@pytest.mark.parametrize("declared", [True, False], ids=["declared", "undeclared"])
@pytest.mark.parametrize("kind", SPOILT)
def test_gross_errors_of_a_millimetre_are_set_aside_and_nothing_else(tmp_path, kind, declared):
    column, size = SPOILT[kind]
    for seed in range(3):
        rng = np.random.default_rng([seed, 200])
        machine = draw(rng)
        (one,) = KINDS[kind](machine.gantry, rng)
        bad = rng.choice(len(one.q), round(0.02 * len(one.q)), replace=False)
        values = np.array(one.columns[column])
        values[bad] += size * rng.choice([-1.0, 1.0], len(bad))
        spoilt = one.reading(**{column: values})
        assert_set_aside(tmp_path, spoilt if declared else spoilt.saying(sigma=None, position_sigma=None), bad, machine)


@pytest.mark.parametrize("declared", [True, False], ids=["declared", "undeclared"])
def test_seats_missed_by_a_millimetre_are_set_aside_and_nothing_else(tmp_path, declared):
    rng = np.random.default_rng(300)
    machine = draw(rng)
    one = cup(machine.gantry, rng, 96)
    bad = rng.choice(96, 2, replace=False)
    q = one.q.copy()
    q[bad, 0] += 1e-3  # moves the platform by 1.7 mm
    spoilt = Seen(one.said, q, one.columns, one.truth, one.prefix)
    assert_set_aside(tmp_path, spoilt if declared else spoilt.saying(sigma=None), bad, machine)


def assert_set_aside(folder, seen, bad, machine):
    """The bad rows are set aside, and the errors of what is left are as small as is told."""
    with pytest.warns(gtpin.GtpinWarning, match="set aside as gross errors"):
        found = gtpin.calibrate(read(folder / "set", seen))
    assert set(found.rejected) == {f"{seen.prefix}{i}" for i in bad}
    errors = found.model.geometry.deviation - np.array([machine.deviations[name] for name in found.names])
    assert np.abs(errors / found.sigma).max() < 5.0
