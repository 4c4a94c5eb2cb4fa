"""A scan finds the setting that trying each by itself finds, and says how sure it is of it."""

from dataclasses import replace

import numpy as np
import pytest
from linear_problems import calibrated
from numpy.testing import assert_allclose
from scipy.stats import binom, chi2

from gtpin.diagnosis import scan
from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import NOTHING, Groups, Marginal, Posterior, fixed, gain
from gtpin.diagnosis.scan import Scan
from gtpin.effects.displacement import Displacement
from gtpin.effects.effect import Effect
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.rack import RackPeriodic, RackStep

SITE = "cart2"


class FrameWave(Effect):
    """A wave of the whole frame over a cart's command: displacements that no single actuator makes."""

    id = "frame_wave"
    core = (0, 1)

    def sites(self, robot):
        return robot.sites

    def nonlinear_values(self, at, site):
        return [float(s) for s in np.geomspace(0.05, 0.4, 150)]

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        phase = 2.0 * np.pi * at.q[:, at.robot.sites.index(site)] / shape_parameter
        twist = np.zeros((len(at), 6, 3))
        twist[:, 1, :2] = np.stack([np.cos(phase), np.sin(phase)], axis=1)
        twist[:, 4, 2] = np.cos(phase)
        return Displacement(np.array([2e-5, 2e-5, 5e-6]), twist=twist)


class FewPeriods(RackPeriodic):
    """Periods about those of racks, and no more than a test has time for."""

    def nonlinear_values(self, at, site):
        return super().nonlinear_values(at, site)[300:500]


def problem(effect: Effect, setting: float, seed: int) -> Design:
    """Noise of unit size, a geometry out of its tolerances, and an effect of twice its typical size at a setting."""
    observed, baseline = calibrated()
    design = observed.design(baseline.model)
    rng = np.random.default_rng(seed)
    X = design.columns(effect.basis(design.operating_points, SITE, setting))
    coefficients = np.zeros(X.shape[1])
    angle = rng.uniform(-np.pi, np.pi)
    coefficients[list(effect.core)] = 2.0 * np.array([np.cos(angle), np.sin(angle)])[: len(effect.core)]
    y = design.B @ rng.standard_normal(design.B.shape[1]) + X @ coefficients + rng.standard_normal(len(design.y))
    return replace(design, y=y)


def beside_linearity(design: Design, groups: Groups[object]) -> Posterior[object]:
    """A model that has smooth waves along the same track already."""
    at = design.operating_points
    waves = np.stack([np.cos(k * np.pi * at.travel[:, 1]) for k in (1, 2, 3)], axis=1)
    groups.add("smooth", design.columns(Displacement(np.full(3, 3e-5), command=(1, waves))))
    return fixed(groups, ("smooth",), (1.0,))


EFFECTS = [(FewPeriods(), 0.021), (RackStep(), 0.4), (FrameWave(), 0.13)]


@pytest.mark.slow
@pytest.mark.parametrize("kept", [True, False])
@pytest.mark.parametrize("with_model", [False, True])
@pytest.mark.parametrize(("effect", "setting"), EFFECTS, ids=lambda v: getattr(v, "id", ""))
def test_a_scan_finds_what_each_setting_by_itself_gains(effect, setting, with_model, kept, monkeypatch):
    if not kept:
        monkeypatch.setattr(scan, "MOST_KEPT", 0)
        monkeypatch.setattr(scan, "BATCH", 7)
    design = problem(effect, setting, seed=1)
    groups: Groups[object] = Groups(Marginal(design.B), design.y)
    model = beside_linearity(design, groups) if with_model else NOTHING
    found = Scan(design, groups, effect, SITE).best(model)

    def by_itself(setting: float) -> float:
        if setting not in groups:
            groups.add(setting, design.columns(effect.basis(design.operating_points, SITE, setting)), effect.core)
        return gain(groups, model, setting)[0]

    settings = np.sort(effect.nonlinear_values(design.operating_points, SITE))
    gains = np.array([by_itself(s) for s in settings])
    top = int(np.argmax(gains))
    assert settings[max(top - 1, 0)] <= found.value <= settings[min(top + 1, len(settings) - 1)]
    # No less than what all settings share, no more than the best there is, less what so many trials cost.
    trials = np.log(len(settings))
    assert found.gain >= np.logaddexp.reduce(gains) - trials - 1e-6
    own = by_itself(found.value)
    # A finer grid about the best setting need not hit it, but no farther off than half a step below a sigma.
    assert own >= gains[top] - 0.5**2 / 2.0
    assert_allclose(found.gain, max(own - trials, np.logaddexp.reduce(gains) - trials), rtol=1e-6)


@pytest.mark.slow
def test_sigmas_of_periods_cover_the_true_ones():
    effect, draws = FewPeriods(), 30
    rng = np.random.default_rng(7)
    observed, baseline = calibrated()
    periods = effect.nonlinear_values(observed.operating_points(baseline.model), SITE)
    z = []
    for seed in range(draws):
        true = float(rng.uniform(min(periods[20:-20]), max(periods[20:-20])))
        design = problem(effect, true, seed)
        found = Scan(design, Groups(Marginal(design.B), design.y), effect, SITE).best(NOTHING)
        z.append((found.value - true) / found.sigma)
    inside = int((np.abs(z) < 1.96).sum())
    assert inside >= binom.ppf(1e-4, draws, 0.95), z
    # Nor are they so large that they say nothing.
    assert float(np.square(z).sum()) > chi2.ppf(1e-4, draws), z


@pytest.mark.parametrize("seed", range(6))
def test_a_period_and_its_sigma_are_mean_and_standard_deviation_of_its_posterior(seed):
    design = problem(FrameWave(), 0.13, seed)
    groups: Groups[object] = Groups(Marginal(design.B), design.y)
    found = Scan(design, groups, FrameWave(), SITE).best(NOTHING)
    periods = found.value + found.sigma * np.linspace(-6.0, 6.0, 121)
    for period in periods:
        groups.add(period, design.columns(FrameWave().basis(design.operating_points, SITE, period)), (0, 1))
    gains = np.array([gain(groups, NOTHING, period)[0] for period in periods])
    weight = np.exp(gains - gains.max()) / np.exp(gains - gains.max()).sum()
    mean = float(weight @ periods)
    assert abs(found.value - mean) < 0.05 * found.sigma
    assert_allclose(found.sigma, np.sqrt(weight @ (periods - mean) ** 2), rtol=0.05)


@pytest.mark.parametrize("seed", range(16))
def test_a_place_between_two_maxima_is_not_taken_for_the_best(seed):
    design = problem(RackStep(), 0.4, seed)
    groups: Groups[object] = Groups(Marginal(design.B), design.y)
    found = Scan(design, groups, RackStep(), SITE).best(NOTHING)
    places = found.value + found.sigma * np.linspace(-1.0, 1.0, 41)
    for place in places:
        groups.add(place, design.columns(RackStep().basis(design.operating_points, SITE, place)), RackStep.core)
    assert gain(groups, NOTHING, places[20])[0] >= max(gain(groups, NOTHING, place)[0] for place in places) - 0.6


def test_noise_gains_nothing_by_a_scan():
    effect, gains = FewPeriods(), []
    observed, baseline = calibrated()
    design = observed.design(baseline.model)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        y = design.B @ rng.standard_normal(design.B.shape[1]) + rng.standard_normal(len(design.y))
        drawn = replace(design, y=y)
        gains.append(Scan(drawn, Groups(Marginal(design.B), y), effect, SITE).best(NOTHING).gain)
    # The mean of exp(gain) over noise is 1 at most for a Bayes factor; the best of some scales may double it some times.
    assert max(gains) < np.log(20.0 / 1e-3)
    assert np.median(gains) < 1.0


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(("effect", "setting"), EFFECTS, ids=lambda v: getattr(v, "id", ""))
@pytest.mark.parametrize("alone", [True, False], ids=["alone", "beside linearity"])
def test_a_scan_finds_what_all_values_with_their_modulations_show(effect, setting, seed, alone, monkeypatch):
    design = problem(effect, setting, seed)
    groups: Groups[object] = Groups(Marginal(design.B), design.y)
    model = NOTHING if alone else beside_linearity(design, groups)
    screened = Scan(design, groups, effect, SITE).best(model)
    monkeypatch.setattr(scan, "LIKELY", -np.inf)
    whole = Scan(design, groups, effect, SITE).best(model)
    if whole.gain < 3.0:  # where nothing is found, values that are left out share less
        assert screened.gain < 3.0
        return
    assert screened.value == whole.value
    assert_allclose(screened.gain, whole.gain, atol=0.01)
    assert {value for value, _, _ in screened.others} == {value for value, _, _ in whole.others}


def test_a_scan_that_gains_nothing_anywhere_says_so():
    observed, baseline = calibrated()
    design = observed.design(baseline.model)
    design = replace(design, y=np.zeros_like(design.y))
    groups: Groups[object] = Groups(Marginal(design.B), design.y)
    model = beside_linearity(design, groups)
    assert Scan(design, groups, RackStep(), SITE).best(model).gain < 0.0


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_how_far_a_value_is_from_the_best_one_is_known_without_a_scan(seed):
    """Beside another value and smooth waves, as the evidence of models with values near it says."""
    effect, setting = FewPeriods(), 0.021
    design = problem(effect, setting, seed)
    groups: Groups[object] = Groups(Marginal(design.B), design.y)
    start, at = beside_linearity(design, groups), design.operating_points

    def model(period: float) -> Posterior[object]:
        for value in (period, 0.0262):
            if value not in groups:
                groups.add(value, design.columns(effect.basis(at, SITE, value)))
        return fixed(groups, (*start.terms, period, 0.0262), (1.0, 1.0, 1.0))

    periods = setting * (1.0 + 3e-3 * np.linspace(-1.0, 1.0, 201))
    evidence = np.array([model(period).log_evidence for period in periods])
    best = int(np.argmax(evidence))
    assert 0 < best < 200
    curve = np.polyfit(periods[best - 5 : best + 6] - periods[best], evidence[best - 5 : best + 6], 2)
    sigma = 1.0 / np.sqrt(-2.0 * curve[0])
    tried = periods[best] - curve[1] / (2.0 * curve[0]) + sigma * np.array([-0.5, 0.0, 0.5])
    scan_ = Scan(design, groups, effect, SITE)
    found = [scan_.improved(model(period), (period, 0.0262), start.mean.size) for period in tried]
    assert_allclose([value for (value, _), _ in found], np.full(3, tried[1]), atol=0.1 * sigma)
    assert_allclose([own for _, (own, _) in found], sigma, rtol=0.2)
