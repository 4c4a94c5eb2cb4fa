"""Circular tests: which readings are circles, and the quantities of ISO 230-4."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from known_readings import RADIUS, read_ranges

from gtpin.errors import DatasetError
from gtpin.report.ball_bar import ball_bar_figure, circles, circular_tests, runs

Floats = np.ndarray
UP = np.linspace(0.0, 2.0 * np.pi, 36, endpoint=False)
DOWN = UP[::-1]


def exact(angle: Floats) -> Floats:
    return np.zeros_like(angle)


def oval(angle: Floats) -> Floats:
    """20 µm out along one diagonal, and in along the other."""
    return 2e-5 * np.sin(2.0 * angle)


def round_path(angle: Floats, tilt: float = 0.0) -> Floats:
    flat = np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    turn = np.array([[1.0, 0.0, 0.0], [0.0, np.cos(tilt), -np.sin(tilt)], [0.0, np.sin(tilt), np.cos(tilt)]])
    return 0.15 * flat @ turn.T


@pytest.mark.parametrize("count", [12, 36, 2000])
def test_both_directions_of_a_circle_are_found_whatever_the_readings_distance(count: int) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    one, two = runs(np.vstack([round_path(angle), round_path(angle[::-1])]))
    np.testing.assert_allclose(one.normal, [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(two.normal, [0.0, 0.0, -1.0], atol=1e-12)
    assert 0 <= count - len(one.rows) + count - len(two.rows) <= 2
    assert one.swept == pytest.approx(2.0 * np.pi * (count - 1) / count, abs=0.06)


@pytest.mark.parametrize("tilt", [0.0, 0.4, np.pi / 2.0])
def test_a_circle_is_found_in_any_plane(tilt: float) -> None:
    (found,) = runs(round_path(UP, tilt))
    np.testing.assert_allclose(found.normal, [0.0, -np.sin(tilt), np.cos(tilt)], atol=1e-12)
    np.testing.assert_array_equal(found.rows, np.arange(36))


def test_circles_in_two_planes_after_each_other_are_two() -> None:
    found = runs(np.vstack([round_path(UP), round_path(UP, np.pi / 2.0)]))
    np.testing.assert_allclose([abs(run.normal[2]) for run in found], [1.0, 0.0], atol=1e-12)


def test_readings_at_rest_and_jitter_do_not_part_a_circle() -> None:
    angle = np.repeat(UP, 5) + 1e-4 * np.random.default_rng(1).standard_normal(180)
    (found,) = runs(round_path(angle))
    assert len(found.rows) == 180


def test_less_than_half_a_turn_is_no_circle() -> None:
    assert not runs(round_path(np.linspace(0.0, 0.9 * np.pi, 40)))
    assert len(runs(round_path(np.linspace(0.0, 1.01 * np.pi, 40)))) == 1


def test_places_at_random_a_line_and_a_spiral_are_no_circles() -> None:
    rng = np.random.default_rng(2)
    assert not runs(rng.uniform(-1.0, 1.0, (500, 3)))
    line = np.column_stack([np.linspace(-1.0, 1.0, 200), np.full(200, 0.2), np.zeros(200)])
    assert not runs(line)
    assert not runs(round_path(np.linspace(0.0, 4.0 * np.pi, 200)) * np.linspace(0.5, 1.5, 200)[:, None])


def test_deviations_of_known_circles_are_measured_and_centring_takes_no_part_of_them(tmp_path: Path) -> None:
    """The station stands 2 mm beside the centre: without an exact centring that were an oval of 17 µm."""
    residuals = read_ranges(tmp_path, [("XY", UP, oval), ("XY", DOWN, oval)], off=(2e-3, 0.0, 0.0), offset=3e-4)
    (circle,) = circles(residuals)
    assert circle.plane == "XY"
    assert circle.axes == ("X", "Y")
    assert circle.radius == pytest.approx(RADIUS, abs=1e-9)
    assert circle.directions == ("counterclockwise", "clockwise")
    for trace in circle.traces:
        np.testing.assert_allclose(trace.deviation["measured"], oval(trace.angle), atol=1e-6)
    for direction in circle.directions:
        assert circle.radial("measured", direction) == pytest.approx((-2e-5, 2e-5), abs=1e-6)
        assert circle.circular("measured", direction) == pytest.approx(4e-5, abs=2e-6)


def test_a_difference_of_the_directions_is_in_the_bidirectional_deviation_alone(tmp_path: Path) -> None:
    def larger(angle: Floats) -> Floats:
        return np.full_like(angle, 1e-5)

    residuals = read_ranges(tmp_path, [("YZ", UP, exact), ("YZ", DOWN, larger)])
    (circle,) = circles(residuals)
    assert circle.plane == "YZ"
    for direction in circle.directions:
        assert circle.circular("measured", direction) == pytest.approx(0.0, abs=1e-7)
    assert circle.circular("measured") == pytest.approx(1e-5, abs=1e-7)
    assert circle.radial("measured", "clockwise")[0] > circle.radial("measured", "counterclockwise")[1]


@pytest.mark.parametrize("plane", ["XY", "YZ", "ZX"])
def test_counterclockwise_goes_from_the_first_axis_of_a_plane_to_its_second(tmp_path: Path, plane: str) -> None:
    (circle,) = circles(read_ranges(tmp_path, [(plane, UP, exact)]))
    assert (circle.plane, "".join(circle.axes)) == (plane, plane)
    assert circle.directions == ("counterclockwise",)
    np.testing.assert_allclose(np.unwrap(circle.traces[0].angle), UP, atol=1e-9)


def test_time_and_not_the_order_of_the_rows_says_how_a_circle_was_travelled(tmp_path: Path) -> None:
    order = np.random.default_rng(3).permutation(72)
    (circle,) = circles(read_ranges(tmp_path, [("XY", UP, oval), ("XY", DOWN, oval)], order=order))
    assert [len(trace.rows) for trace in circle.traces] == pytest.approx([36, 36], abs=1)
    for trace in circle.traces:
        np.testing.assert_allclose(trace.deviation["measured"], oval(trace.angle), atol=1e-6)


def test_the_layers_before_and_after_are_the_residuals(tmp_path: Path) -> None:
    residuals = read_ranges(tmp_path, [("XY", UP, oval)])
    object.__setattr__(residuals, "after", 0.5 * residuals.before)
    (trace,) = circles(residuals)[0].traces
    np.testing.assert_array_equal(trace.deviation["before"], residuals.before[trace.rows, 0])
    np.testing.assert_array_equal(trace.deviation["after"], 0.5 * residuals.before[trace.rows, 0])


def test_the_figure_draws_what_was_measured_and_names_the_quantities(tmp_path: Path) -> None:
    pytest.importorskip("plotly")
    residuals = read_ranges(tmp_path, [("XY", UP, oval), ("XY", DOWN, oval)])
    made = ball_bar_figure(residuals, 0, True)
    lines = [trace for trace in made.data if trace.name == "counterclockwise"]
    assert [line.subplot for line in lines] == ["polar", "polar2", "polar3"]
    np.testing.assert_allclose(lines[0].r, 1e6 * oval(np.deg2rad(lines[0].theta)), atol=1.0)
    low, high = made.layout.polar.radialaxis.range
    assert low < -20.0 < 20.0 < high
    words = " ".join(note.text for note in made.layout.annotations)
    assert all(word in words for word in ("As measured", "geometry alone", "causes", "G(b) ", "Clockwise: G ", "F −"))
    ((_, plots),) = circular_tests(residuals, False)
    assert [plot.caption.split(",")[0] for plot in plots] == ["As measured", "Left by geometry alone"]
    for plot in plots:
        assert plot.drawings()


def test_where_nothing_lies_on_circles_there_is_no_plot_and_the_figure_says_so(tmp_path: Path) -> None:
    residuals = read_ranges(tmp_path, [("XY", UP[:10], exact)])
    assert circular_tests(residuals, True) == []
    with pytest.raises(DatasetError, match="no readings lie on circles"):
        ball_bar_figure(residuals, 0, True)


def test_a_circle_that_is_not_there_is_refused(tmp_path: Path) -> None:
    residuals = read_ranges(tmp_path, [("XY", UP, exact)])
    with pytest.raises(DatasetError, match="there are 1, counted from 0"):
        ball_bar_figure(residuals, 1, True)
