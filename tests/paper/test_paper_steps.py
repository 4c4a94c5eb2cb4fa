"""A step of one parameter, pose by pose, and the figures of it."""

from __future__ import annotations

import numpy as np
import pytest
from paper_figures import cost_and_position, orientation_along_grid, orientation_change
from paper_steps import drawn_measurements, step_change

import gtpin
from gtpin.accuracy.sensitivity import STEP
from gtpin.errors import ModelError

MODEL = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau")))


def commands(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-0.6, 0.6, (count, 3))


def test_a_step_to_both_sides_shifts_errors_in_opposite_senses() -> None:
    q = commands(8, seed=8)
    measured = drawn_measurements(MODEL, q, np.zeros(6))
    change = step_change(MODEL, q, measured, "L", "1")
    np.testing.assert_allclose(change.before.position, 0.0, atol=1e-12)
    np.testing.assert_allclose(change.plus.position, change.minus.position, rtol=1e-3)
    np.testing.assert_allclose(change.plus.costs[:, 0], (2.0 * MODEL.robot.rods[0].L * STEP) ** 2, rtol=1e-3)


def test_an_unknown_link_is_refused() -> None:
    q = commands(3)
    with pytest.raises(ModelError, match="links are 1, 2a"):
        step_change(MODEL, q, MODEL.predict(q), "L", "7")


def test_every_axis_of_every_figure_is_labelled() -> None:
    q = commands(12)
    measured = drawn_measurements(MODEL, q, np.full(6, 1e-4))
    links = [rod.name for rod in MODEL.robot.rods]
    made = (
        orientation_along_grid(MODEL.predict(q), 3),
        cost_and_position(step_change(MODEL, q, measured, "L", "1"), links),
        orientation_change(step_change(MODEL, q, measured, "Px", "3a")),
    )
    for figure in made:
        assert figure.get_suptitle()
        assert any(axis.get_xlabel() for axis in figure.axes)
        assert any(axis.get_ylabel() for axis in figure.axes)
