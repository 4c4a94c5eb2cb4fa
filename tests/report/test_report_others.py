"""Pages of compare and sensitivity: what they say follows from their numbers."""

from __future__ import annotations

import numpy as np
import pytest
from browsers import DRAWN, Opened, launched
from report_findings import text

from gtpin import Geometry, Model, load_robot
from gtpin.accuracy import workspace
from gtpin.accuracy.analysis import Accuracy, analyse
from gtpin.comparison.result import Comparison, Held
from gtpin.data import CartMeasurements, Dataset
from gtpin.report.accuracy import sensitivity_page
from gtpin.report.comparison import comparison_page

ROBOT = load_robot("gantry_tau")


def comparison(means: dict[int, float], spread: float = 0.1) -> Comparison:
    """Models with such mean errors, m, on 60 poses."""
    rng = np.random.default_rng(3)
    pose = np.array([str(i) for i in range(60)], dtype=object)
    held = []
    for model, mean in means.items():
        position = mean * (1.0 + spread * rng.uniform(-1.0, 1.0, 60))
        angles = 1e-4 * rng.standard_normal((60, 3))
        held.append(
            Held(model, np.arange(60), pose, position, np.linalg.norm(angles, axis=1), angles, None, (False,) * 6)
        )
    return Comparison(tuple(held), 0, "pose")


def dataset(carts: CartMeasurements | None = None) -> Dataset:
    return Dataset(robot="gantry_tau", pose=["0"], q=np.zeros((1, 3)), position=np.zeros((1, 3)), carts=carts)


def measured_carts() -> CartMeasurements:
    q = np.tile(np.linspace(-0.5, 0.5, 9), 3)
    position = np.stack([q, 1e-4 * np.sin(9.0 * q), 0.0 * q], axis=1)
    return CartMeasurements(np.repeat([1, 2, 3], 9), q, position)


@pytest.mark.slow
def test_the_model_with_the_smallest_mean_error_is_said_to_predict_best_and_carts_tracks_are_shown():
    models = comparison({1: 3e-4, 3: 1e-4, 4: 2e-5})
    told = text(comparison_page(models, dataset(), ROBOT))
    assert "Model 4 (full arm, measured tracks) predicts best" in told
    assert "of model 3" in told
    assert "don't settle" not in told
    assert "The carts' tracks" not in told
    assert "The carts' tracks" in text(comparison_page(models, dataset(measured_carts()), ROBOT))


@pytest.mark.slow
def test_models_whose_intervals_overlap_are_not_told_apart():
    told = text(comparison_page(comparison({1: 1.00e-4, 3: 1.001e-4}, spread=0.9), dataset(), ROBOT))
    assert "their intervals overlap" in told.lower()


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
    told = text(sensitivity_page(accuracy, seed=5))
    expected = accuracy.expected.position
    assert f"{1e3 * expected.mean:.2f} mm on average" in told
    table = accuracy.sensitivity.to_table()
    worst = table.loc[table["position_mm"].idxmax()]
    assert f"{worst['parameter']} of link {worst['link']} moves the TCP most" in told
    assert "from manufacturing tolerances" in told
    assert "seed 5" in told


def test_every_parameter_and_link_has_a_cell(accuracy):
    told = text(sensitivity_page(accuracy))
    for _, row in accuracy.sensitivity.to_table().iterrows():
        cell = 1e3 * row["position_mm"] / (2 * accuracy.sensitivity.poses)
        assert f"{cell:.2f}" in told


def test_pages_of_compare_and_sensitivity_load_and_draw(accuracy, tmp_path):
    with launched() as browser:
        pages = {
            "comparison": comparison_page(comparison({1: 3e-4, 3: 1e-4, 4: 2e-5}), dataset(measured_carts()), ROBOT),
            "sensitivity": sensitivity_page(accuracy),
        }
        for name, page in pages.items():
            opened = Opened(browser, tmp_path / f"{name}.html", page)
            assert len(opened.run(DRAWN)) == 3
            opened.is_whole()
