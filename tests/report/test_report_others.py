"""Pages of compare and sensitivity: what they say follows from their numbers."""

from __future__ import annotations

import json
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from browsers import DRAWN, Opened, launched
from report_findings import text

from gtpin import Geometry, Model, load_robot
from gtpin.accuracy import workspace
from gtpin.accuracy.analysis import Accuracy, analyse
from gtpin.comparison.compare import Comparison, Held
from gtpin.data import CartMeasurements, Dataset
from gtpin.errors import DatasetError, GtpinError, GtpinWarning
from gtpin.report.accuracy import AccuracyPresentation
from gtpin.report.comparison import ComparisonPresentation, angles_drawing, position_errors

ROBOT = load_robot("gantry_tau")


def comparison(means: dict[int, float], spread: float = 0.1, carts: CartMeasurements | None = None) -> Comparison:
    """Models with such mean errors, m, on 60 poses."""
    rng = np.random.default_rng(3)
    pose = np.array([str(i) for i in range(60)], dtype=object)
    held = []
    for model, mean in means.items():
        position = mean * (1.0 + spread * rng.uniform(-1.0, 1.0, 60))
        angles = 1e-4 * rng.standard_normal((60, 3))
        held.append(Held(model, pose, position, np.linalg.norm(angles, axis=1), angles))
    one = {"pose": ["0"], "q": np.zeros((1, 3)), "position": np.zeros((1, 3))}
    return Comparison(tuple(held), 0, Dataset(robot="gantry_tau", **one, carts=carts))


def measured_carts() -> CartMeasurements:
    q = np.tile(np.linspace(-0.5, 0.5, 9), 3)
    position = np.stack([q, 1e-4 * np.sin(9.0 * q), 0.0 * q], axis=1)
    return CartMeasurements(np.repeat([1, 2, 3], 9), q, position)


@pytest.mark.slow
def test_the_model_with_the_smallest_mean_error_is_said_to_predict_best_and_carts_tracks_are_shown():
    means = {1: 3e-4, 3: 1e-4, 4: 2e-5}
    told = text(ComparisonPresentation(comparison(means)).page())
    assert "Model 4 (full arm, measured tracks) predicts best" in told
    assert "of model 3" in told
    assert "don't settle" not in told
    assert "The carts' tracks" not in told
    assert "The carts' tracks" in text(ComparisonPresentation(comparison(means, carts=measured_carts())).page())


@pytest.mark.slow
def test_models_whose_intervals_overlap_are_not_told_apart():
    told = text(ComparisonPresentation(comparison({1: 1.00e-4, 3: 1.001e-4}, spread=0.9)).page())
    assert "their intervals overlap" in told.lower()


def test_a_picture_of_a_comparison_has_a_bar_for_each_figure_and_model():
    pytest.importorskip("matplotlib")
    made = comparison({1: 3e-4, 3: 1e-4})
    heights = [bar.get_height() for bar in position_errors(made).axes[0].patches]
    np.testing.assert_allclose(heights, made.table()[["mean_um", "rms_um", "max_um"]].to_numpy().ravel())


@pytest.mark.slow
def test_a_comparison_on_disk_is_tables_a_page_and_a_picture_which_needs_matplotlib(tmp_path, monkeypatch):
    made = comparison({1: 3e-4, 3: 1e-4})
    made.save(tmp_path / "all")
    assert {file.name for file in (tmp_path / "all").iterdir()} >= {*ComparisonPresentation.files}
    table = pd.read_csv(tmp_path / "all" / "compare.csv")
    told = json.loads((tmp_path / "all" / "compare.json").read_text(encoding="utf-8"))
    assert told["schema"] == "gtpin-compare/1"
    for row, model in zip(table.itertuples(), told["models"], strict=True):
        low, high = model["interval"]["mean_um"]
        assert low < row.mean_um == model["mean_um"] < high
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(GtpinError, match="matplotlib"):
        position_errors(made)
    with pytest.warns(GtpinWarning, match="matplotlib"):
        made.save(tmp_path / "bare")
    names = {file.name for file in (tmp_path / "bare").iterdir()}
    assert {"compare.csv", "compare.json", "report.html"} <= names
    assert "position_errors.png" not in names


def test_warnings_of_a_comparison_and_of_an_accuracy_analysis_are_on_page_and_in_json(accuracy):
    for made, shown in ((comparison({1: 3e-4, 3: 1e-4}), ComparisonPresentation), (accuracy, AccuracyPresentation)):
        warned = replace(made, warnings=("the first", "the second"))
        assert "Warnings (2) the first the second" in text(shown(warned).page().partition("<nav")[0])
        assert warned.to_json()["warnings"] == ["the first", "the second"]


@pytest.fixture(scope="module")
def accuracy() -> Accuracy:
    q = np.random.default_rng(0).uniform(-0.4, 0.4, (15, 3))
    found = analyse(Model(Geometry.nominal(ROBOT)), q)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workspace, "COUNTS", (3, 6, 6))
        assert found.space.q.size
    return found


@pytest.mark.slow
def test_an_accuracy_page_tells_the_errors_to_expect_and_the_parameter_that_makes_most(accuracy):
    told = text(AccuracyPresentation(replace(accuracy, seed=5)).page())
    expected = accuracy.expected.position
    assert f"{1e3 * expected.mean:.2f} mm on average" in told
    table = accuracy.sensitivity.to_table()
    worst = table.loc[table["position_mm"].idxmax()]
    assert f"{worst['parameter']} of link {worst['link']} moves the TCP most" in told
    assert "from manufacturing tolerances (1 sigma) of 1 to 2 mm and 1 mrad" in told
    assert "seed 5" in told


def test_every_parameter_and_link_has_a_cell(accuracy):
    told = text(AccuracyPresentation(accuracy).page())
    for _, row in accuracy.sensitivity.to_table().iterrows():
        cell = 1e3 * row["position_mm"] / (2 * accuracy.sensitivity.poses)
        assert f"{cell:.2f}" in told


def test_pages_of_compare_and_sensitivity_load_and_draw(accuracy, tmp_path):
    with launched() as browser:
        pages = {
            "comparison": ComparisonPresentation(
                comparison({1: 3e-4, 3: 1e-4, 4: 2e-5}, carts=measured_carts())
            ).page(),
            "sensitivity": AccuracyPresentation(accuracy).page(),
        }
        for name, page in pages.items():
            opened = Opened(browser, tmp_path / f"{name}.html", page)
            assert len(opened.run(DRAWN)) == 3
            opened.is_whole()


def test_angles_need_orientations_and_one_of_the_three_names():
    made = comparison({1: 3e-4, 3: 1e-4})
    bare = Comparison(tuple(replace(held, orientation=None, angles=None) for held in made.held), 0, made.dataset)
    with pytest.raises(DatasetError, match="orientation was not measured"):
        angles_drawing(bare)
    with pytest.raises(DatasetError, match="no angle 'delta'"):
        angles_drawing(made, "delta")
    drawn = angles_drawing(made, "beta").traces
    np.testing.assert_allclose([trace["y"] for trace in drawn], [1e3 * held.angles[:, 1] for held in made.held])


def test_the_same_comparison_gives_the_same_bytes(tmp_path):
    for name in ("one", "two"):
        comparison({1: 3e-4, 3: 1e-4}).save(tmp_path / name)
    for file in ("compare.csv", "compare.json"):
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()
