"""Residuals of several instruments: one component of one instrument at a time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from known_readings import NOMINAL, S1, commands, mixed, read_ranges

from gtpin.errors import DatasetError
from gtpin.report.figure import has_plotly
from gtpin.report.residual_plots import components, leading, residual_figure, view, workspace_figure
from gtpin.report.residuals import Residuals


@pytest.fixture
def residuals(tmp_path: Path) -> Residuals:
    return mixed(tmp_path)


def test_each_number_that_an_instrument_reads_is_a_component(residuals: Residuals) -> None:
    cup = tuple(f"cup.{name}" for name in ("x", "y", "z", "distance"))
    assert tuple(residuals.axes) == ("wire", *cup, "level.tilt_x", "level.tilt_y")
    assert [residuals.unit(name) for name in residuals.axes] == ["m"] * 5 + ["rad"] * 2
    assert residuals.first_component == "wire"


def test_of_a_single_instrument_components_are_its_numbers(tmp_path: Path) -> None:
    found = read_ranges(tmp_path, [("XY", np.linspace(0.0, 1.0, 20), np.zeros_like)])
    assert tuple(found.axes) == ("range",)
    np.testing.assert_array_equal(found.component("range", found.before), found.before[:, 0])


def test_a_component_has_what_its_instrument_read_and_nothing_in_other_rows(residuals: Residuals) -> None:
    wire = residuals.component("wire", residuals.before)
    assert np.isfinite(wire).sum() == 20
    np.testing.assert_allclose(wire[residuals.rows_of("wire")], 1e-5, atol=1e-12)
    for name, off in (("level.tilt_x", 3e-5), ("level.tilt_y", -4e-5)):
        values = residuals.component(name, residuals.before)
        assert np.isfinite(values).sum() == 12
        np.testing.assert_allclose(values[residuals.rows_of(name)], off, atol=1e-12)
    rests = NOMINAL.kinematics.forward(commands(16, 2)).T[:8]
    for k, axis in enumerate("xyz"):
        rows = residuals.rows_of(f"cup.{axis}")
        assert len(rows) == 16
        residual = residuals.component(f"cup.{axis}", residuals.before)[rows[:8]]
        np.testing.assert_allclose(residual, (S1 - rests)[:, k], atol=1e-12)
    apart = residuals.component("cup.distance", residuals.before)[residuals.rows_of("cup.distance")]
    np.testing.assert_allclose(apart, 1e-4, atol=1e-12)


@pytest.mark.parametrize(("name", "count"), [("wire", 20), ("cup.y", 16), ("level.tilt_x", 12)])
@pytest.mark.parametrize("against", ["q1", "payload"])
def test_a_plot_of_an_instrument_leaves_out_the_rows_of_others(
    residuals: Residuals, name: str, count: int, against: str
) -> None:
    pytest.importorskip("plotly")
    first = residual_figure(residuals, against, name).data[0]
    drawn = len(np.unique(residuals.dataset.covariates["payload"])) if against == "payload" else count
    assert len(first.x) == len(first.y) == drawn  # a box for each of few values
    assert np.isfinite(np.asarray(first.y, dtype=float)).all()


def test_the_line_of_means_is_that_of_the_instrument_alone(residuals: Residuals) -> None:
    pytest.importorskip("plotly")
    made = residual_figure(residuals, "q2", "level.tilt_y")
    (means,) = [trace for trace in made.data if trace.name == "mean of neighbouring poses"]
    np.testing.assert_allclose(means.y, -40.0, atol=1e-6)
    q = commands(12, 3)[:, 1]
    assert q.min() <= means.x.min() <= means.x.max() <= q.max()


def test_the_reader_can_choose_every_component_and_sees_the_wanted_one_first(residuals: Residuals) -> None:
    views, choice = components(residuals, "cup.z")
    assert set(views) == {*residuals.model.robot.sites, *residuals.axes}
    assert choice.options[0][0] == "cup.z"
    assert choice.options[0][1].startswith("cup.z (")


def test_of_readings_the_component_is_seen_first_of_which_the_causes_explain_most(residuals: Residuals) -> None:
    after = residuals.before.copy()
    rows = residuals.rows_of("level.tilt_y")
    after[rows] += 1e-3
    assert leading(replace(residuals, after=after), ["cart2"], {}) == "level.tilt_y"


def test_a_component_that_is_not_there_is_refused_with_those_that_are(residuals: Residuals) -> None:
    with pytest.raises(DatasetError, match=r"wire.*cup\.x"):
        view(residuals, "bed")


@pytest.mark.skipif(not has_plotly(), reason="plotly is not installed")
def test_a_map_of_poses_in_one_plane_is_high_enough_for_its_labels(residuals: Residuals) -> None:
    def at(T: np.ndarray) -> Residuals:
        moved = replace(residuals)
        vars(moved)["poses"] = replace(residuals.poses, T=T)  # a cached property
        return moved

    flat = at(residuals.poses.T * [1.0, 1.0, 1e-3]).poses
    axis = workspace_figure(at(flat.T), "xz").layout.yaxis
    width = float(np.ptp(flat.T[:, 0]))
    assert axis.range[1] - axis.range[0] > 0.25 * width
    assert axis.range[0] < flat.T[:, 2].min() < flat.T[:, 2].max() < axis.range[1]
    assert axis.nticks == 3
    assert workspace_figure(at(residuals.poses.T[:, [0, 1, 0]]), "xz").layout.yaxis.range is None
