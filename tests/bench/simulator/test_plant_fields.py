"""Random functions are Gaussian-process draws of the lengths asked for, and play lags."""

import numpy as np
import pytest

from gtpin.bench.simulator.fields import Field, curve, play, uneven_curve


@pytest.mark.parametrize("smoothness", ["rough", "once", "twice", "smooth"])
def test_curves_have_mean_0_and_rms_1_and_stay_so_beyond_their_ends(smoothness: str) -> None:
    drawn = curve(np.random.default_rng(0), -1.0, 1.0, 0.2, smoothness)
    assert drawn.values.mean() == pytest.approx(0.0, abs=1e-12)
    assert np.sqrt((drawn.values**2).mean()) == pytest.approx(1.0)
    assert drawn(np.array([5.0]))[0] == drawn.values[-1]


def test_shorter_lengths_wiggle_more() -> None:
    def steepness(length: float) -> float:
        return float(
            np.mean([np.abs(np.diff(curve(np.random.default_rng(s), 0, 1, length).values)).mean() for s in range(20)])
        )

    assert steepness(0.05) > 3.0 * steepness(0.3)


def test_uneven_curves_are_of_rms_1() -> None:
    for seed in range(10):
        assert np.sqrt((uneven_curve(np.random.default_rng(seed), -0.8, 0.8).values ** 2).mean()) == pytest.approx(1.0)


@pytest.mark.slow
def test_fields_have_unit_variance_and_correlate_over_their_length() -> None:
    points = np.random.default_rng(0).uniform(-1, 1, (300, 2))
    fields = [Field.draw(np.random.default_rng(seed), [0.4, 0.4]) for seed in range(200)]
    values = np.array([f(points) for f in fields])
    assert values.var() == pytest.approx(1.0, abs=0.1)
    near = np.array([f(points + 0.05) for f in fields])
    far = np.array([f(points + 2.0) for f in fields])
    assert (values * near).mean() > 0.9
    assert abs((values * far).mean()) < 0.2


def test_play_lags_behind_its_pin_by_its_width() -> None:
    pin = np.concatenate([np.linspace(0.0, 1.0, 50), np.linspace(1.0, 0.0, 50)])
    dragged = play(pin, 0.1)
    assert dragged[49] == pytest.approx(0.9)
    assert dragged[-1] == pytest.approx(0.1)
    assert np.abs(dragged - pin).max() <= 0.1 + 1e-15
