"""An effect's own curve with its band, and what of the measurements belongs to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gtpin.effects.active import ActiveEffect
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.rack import SHORTEST
from gtpin.report.effect_curves import WIDE, curve_notes, curves, reach
from gtpin.report.residual_plots import (
    ONE_LAYER,
    against_columns,
    column,
    columns,
    components,
    fit_along,
    residual_figure,
)
from gtpin.report.residuals import Residuals

pytestmark = pytest.mark.slow  # one diagnosis

PERIOD, AMPLITUDE, SIGMA = 0.1, 3e-5, 2e-6


@pytest.fixture(scope="module")
def residuals(single) -> Residuals:
    return Residuals.of(single.dataset, single.baseline, single.model)


def active(
    residuals: Residuals, effect: str, site: str, shape_parameter: float | None = None, first: float = 1.0
) -> ActiveEffect:
    """An effect whose first coefficient alone is known, and not zero."""
    known = effects_by_id()[effect]
    at = residuals.at(residuals.dataset.q, residuals.dataset.covariates)
    size = len(known.basis(at, site, shape_parameter))
    coefficients, covariance = np.zeros(size), np.zeros((size, size))
    coefficients[0], covariance[0, 0] = first, SIGMA**2
    return ActiveEffect(known, site, shape_parameter, coefficients, covariance, at.references)


def test_the_curve_of_a_periodic_rack_is_the_cosine_that_its_coefficient_says(residuals):
    (curve,) = curves(active(residuals, "rack_periodic", "cart2", PERIOD, AMPLITUDE), residuals)
    (line,) = curve.lines
    assert (curve.name, curve.unit, curve.x_title) == ("travel of cart2", "m", "q2 (m)")
    wave = np.cos(2.0 * np.pi * line.x / PERIOD)
    wave -= wave.mean()
    np.testing.assert_allclose(line.y, AMPLITUDE * wave, atol=1e-12)
    np.testing.assert_allclose(line.sigma, SIGMA * np.abs(wave), atol=1e-12)
    assert curve.seen
    assert "travel of cart2" in reach((curve,))


def test_points_of_a_curve_are_the_curve_and_what_is_left_along_it(residuals):
    (curve,) = curves(active(residuals, "rack_periodic", "cart2", PERIOD, AMPLITUDE), residuals)
    (line,) = curve.lines
    residual = residuals.component("cart2", residuals.after)
    np.testing.assert_array_equal(line.points_x, residuals.dataset.q[:, 1])
    np.testing.assert_allclose(line.points_y - np.interp(line.points_x, line.x, line.y), residual, atol=1e-15)


def test_backlash_has_a_curve_for_each_direction_of_approach(residuals):
    (curve,) = curves(active(residuals, "backlash", "cart1", first=1e-5), residuals)
    down, up = curve.lines
    assert (up.y > 0.0).all()
    np.testing.assert_allclose(up.y, -down.y, atol=1e-15)
    assert len(up.points_x) + len(down.points_x) == len(residuals)
    approach = residuals.dataset.covariates["approach1"]
    np.testing.assert_array_equal(np.sort(up.points_x), np.sort(residuals.dataset.q[approach > 0.0, 0]))


def test_a_straight_line_across_the_track_is_geometrys_and_not_in_the_curve(residuals):
    found = curves(active(residuals, "straightness", "cart3", first=1e-4), residuals)
    for curve in found:
        line = curve.lines[0]
        assert curve.straightened
        slope, level = np.polyfit(line.x, line.y, 1)
        assert abs(slope) < 1e-12
        assert abs(level) < 1e-12


def test_a_curve_within_its_band_is_not_said_to_be_seen(residuals):
    faint = active(residuals, "rack_periodic", "cart2", PERIOD, 0.5 * WIDE * SIGMA)
    found = curves(faint, residuals)
    assert not found[0].seen
    assert reach(found) == ""
    assert any("Not detected" in note for note in curve_notes(found))


@pytest.mark.parametrize("effect", sorted(effects_by_id()))
def test_every_effect_that_can_be_tested_has_curves_of_finite_numbers(residuals, effect):
    known = effects_by_id()[effect]
    at = residuals.at(residuals.dataset.q, residuals.dataset.covariates)
    site = next((s for s in known.sites(residuals.model.robot) if not known.untestable(at, s)), None)
    if site is None:
        pytest.skip("these data can't test it")
    values = known.nonlinear_values(at, site)
    found = curves(active(residuals, effect, site, values[0] if values else None), residuals)
    assert found
    for curve in found:
        for line in curve.lines:
            assert np.isfinite(line.y).all()
            assert np.isfinite(line.sigma).all()
            assert np.isfinite(line.points_y).all()
            assert len(line.x) == len(line.y) == len(line.sigma)


def test_residuals_along_a_cart_are_how_far_it_would_have_to_move(residuals):
    moved = 2e-5
    q = residuals.dataset.q.copy()
    q[:, 0] += moved
    kinematics = residuals.baseline.kinematics
    there, here = kinematics.forward(q), kinematics.forward(residuals.dataset.q)
    shifted = replace(residuals, model=residuals.baseline)
    # To first order: second-order terms of 20 um over metres are below a nanometre.
    np.testing.assert_allclose(shifted.component("cart1", there.minus(here)), moved, rtol=1e-4)


def test_residuals_before_are_those_of_the_calibration(single, residuals):
    np.testing.assert_allclose(residuals.before, single.baseline.residual, atol=1e-12)
    assert np.linalg.norm(residuals.after) < np.linalg.norm(residuals.before)


def test_the_causes_line_along_its_column_shows_every_turn_of_its_wave_and_goes_through_what_the_causes_make(residuals):
    (period,) = [e.shape_parameter for e in residuals.model.effects]
    line = fit_along(residuals, "q2")
    x, y = (values[:-1] for values in line["cart2"])
    crossings = np.count_nonzero(np.diff(np.sign(y - y.mean())))
    assert abs(crossings - 2.0 * np.ptp(x) / period) <= 2
    made = residuals.component("cart2", residuals.before - residuals.after)
    off = np.interp(residuals.dataset.q[:, 1], x, y) - made
    assert np.std(off) < 0.35 * np.std(made)
    for name in residuals.component_names:  # in every component, at all points
        x, y = line[name]
        np.testing.assert_array_equal(np.isfinite(y), np.isfinite(x))


def test_no_line_is_drawn_along_what_no_cause_goes_with(residuals):
    for name in ("q1", "q3", "time", "temp_link"):
        assert fit_along(residuals, name) is None


def test_the_mean_of_neighbours_does_not_hide_the_causes_line(residuals):
    found = columns(residuals, {"q1": 1.0}, causes=True)
    assert [one.name for one in found if one.line is not None] == [found[0].name] == ["q2"]
    before, after = (residual_figure(residuals, "q2", "cart2", causes=True, after=after) for after in (False, True))
    lines = {"mean of neighbouring poses", "the same along the column, all else constant"}
    drawn_before, drawn_after = ({t.name: t for t in made.data if t.name in lines} for made in (before, after))
    assert list(drawn_before) == ["the same along the column, all else constant"]
    assert list(drawn_after) == ["mean of neighbouring poses"]
    assert len(drawn_before.popitem()[1].x) > 1000


@pytest.mark.parametrize("drawn", ["curve", "line"])
def test_the_shortest_period_has_points_enough(residuals, drawn):
    shortest = active(residuals, "rack_periodic", "cart2", SHORTEST, AMPLITUDE)
    if drawn == "curve":
        x = curves(shortest, residuals)[0].lines[0].x
    else:
        x = fit_along(replace(residuals, model=replace(residuals.model, effects=(shortest,))), "q2")["x"][0][:-1]
    assert np.diff(x).max() < SHORTEST / 8.0


def test_backlash_has_a_line_for_each_direction_along_its_track(residuals):
    model = replace(residuals.model, effects=(active(residuals, "backlash", "cart1", first=1e-5),))
    x, y = fit_along(replace(residuals, model=model), "q1")["cart1"]
    ends = np.flatnonzero(np.isnan(x))
    assert len(ends) == 2
    first, second = y[: ends[0]], y[ends[0] + 1 : -1]
    np.testing.assert_allclose(np.abs(first - second), 2e-5, rtol=1e-3)


def test_few_values_of_a_column_stand_in_their_order(residuals):
    covariates = {**residuals.dataset.covariates, "fx": np.resize([10.0, 5.0, -2.5], len(residuals))}
    found = column(replace(residuals, dataset=replace(residuals.dataset, covariates=covariates)), "fx")
    assert found.order == ("−2.5", "5", "10")
    assert found.values[:3].tolist() == ["10", "5", "−2.5"]


def test_poses_of_one_value_are_never_in_two_means(residuals):
    covariates = {**residuals.dataset.covariates, "time": np.maximum(0.0, np.arange(-100.0, len(residuals) - 100.0))}
    found = column(replace(residuals, dataset=replace(residuals.dataset, covariates=covariates)), "time", causes=False)
    mean = np.array([found.values[rows].mean() for rows in found.groups(np.arange(len(residuals)))])
    assert 1 < len(mean) == len(set(mean.tolist()))
    assert (np.diff(mean) > 0.0).all()


def test_a_page_has_the_figures_that_a_user_gets(residuals):
    plain = replace(residuals, after=residuals.before)
    views, component = components(plain, "z")
    plots = {plot.name: plot for plot in against_columns(plain, {}, views, (component, ONE_LAYER))}
    drawn = plots["against-q1"].draw(component="z", layer="before").figure()
    alone = residual_figure(plain, "q1", "z")
    assert [trace.to_plotly_json().keys() for trace in drawn.data] == [t.to_plotly_json().keys() for t in alone.data]
    for one, other in zip(drawn.data, alone.data, strict=True):
        np.testing.assert_array_equal(one.y, other.y)
