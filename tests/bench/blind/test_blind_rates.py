"""Rates and their bounds."""

import pytest

from gtpin.bench.blind.rates import mean, rate
from gtpin.bench.blind.score import matched_filter


@pytest.mark.parametrize(
    ("hits", "of", "low", "high"),
    # Newcombe, Statistics in Medicine 17, 1998, table I: method 3.
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_bounds_of_a_rate_are_wilsons(hits: int, of: int, low: float, high: float) -> None:
    found = rate([True] * hits + [False] * (of - hits))
    assert found.value == hits / of
    assert found.low == pytest.approx(low, abs=5e-5)
    assert found.high == pytest.approx(high, abs=5e-5)


def test_a_rate_of_no_case_is_not_known() -> None:
    assert rate([]).to_json() == {"value": None, "low": None, "high": None, "of": 0}
    assert mean([]).value is None


def test_a_mean_has_bounds_of_its_standard_error() -> None:
    found = mean([1.0, 2.0, 3.0])  # standard deviation 1, of three
    assert found.value == 2.0
    assert found.high == pytest.approx(2.0 + 1.96 / 3**0.5, abs=1e-4)
    assert mean([4.0]).low is None


def test_a_matched_filter_finds_95_in_100_at_the_energy_that_the_design_says() -> None:
    assert matched_filter(15.8) == pytest.approx(0.95, abs=0.001)
    assert matched_filter(0.0) == pytest.approx(0.01)
