"""Curves that joints of an exported mechanism follow."""

from __future__ import annotations

import numpy as np
import pytest

from gtpin.extras.simulators.curves import DriveCurve, Harmonic, fitted

CURVE = DriveCurve(0.1, 0.9, (Harmonic(3.0, 0.4, 2e-3), Harmonic(7.0, -1.0, -5e-4)))
X = np.linspace(-0.6, 0.7, 40)


def test_a_curve_about_another_origin_has_the_same_values() -> None:
    np.testing.assert_allclose(CURVE.about(0.3)(X - 0.3), CURVE(X), rtol=0, atol=1e-15)


def test_the_slope_is_the_difference_quotient() -> None:
    step = 1e-5
    for x in X[::8]:
        assert CURVE.slope(x) == pytest.approx(float(CURVE(x + step) - CURVE(x - step)) / (2.0 * step), abs=1e-9)


def test_sums_and_multiples_are_those_of_the_values() -> None:
    other = DriveCurve(-0.2, 0.1, (Harmonic(3.0, 0.4, 1e-3), Harmonic(2.0, 0.0, 1e-3)))
    np.testing.assert_allclose(CURVE.plus(other.times(-2.0))(X), CURVE(X) - 2.0 * other(X), rtol=0, atol=1e-15)
    assert len(CURVE.plus(other).harmonics) == 3


def test_a_line_needs_no_harmonics() -> None:
    assert fitted(X, 2e-5 + 3e-4 * X, (-0.65, 0.7)).harmonics == ()
    assert fitted(X, np.full(40, 2e-5), (-0.65, 0.7), slope=False, count=4).harmonics == ()


def test_half_waves_of_the_range_are_found_between_the_points_too() -> None:
    lower, upper = -0.65, 0.7
    between = np.linspace(lower, upper, 333)
    for order in (1, 5, 14):
        rate = order * np.pi / (upper - lower)
        found = fitted(X, 1e-4 * np.cos(rate * (X - lower)), (lower, upper))
        np.testing.assert_allclose(found(between), 1e-4 * np.cos(rate * (between - lower)), rtol=0, atol=2e-7)
