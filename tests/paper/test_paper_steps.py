"""A step of one parameter, pose by pose, and the figures of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from paper_figures import (
    along_and_across,
    cost_and_position,
    linearity,
    orientation_along_grid,
    orientation_change,
    orientation_errors,
    residuals,
)
from paper_steps import drawn_measurements, step_change

import gtpin
from gtpin.accuracy.sensitivity import STEP
from gtpin.comparison.compare import Comparison, Held
from gtpin.data import CartMeasurements
from gtpin.errors import ModelError

MODEL = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau")))
POSE = {"pose": ["0"], "q": np.zeros((1, 3)), "position": np.zeros((1, 3))}


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


def test_what_a_linear_fit_leaves_is_what_was_put_in() -> None:
    rng = np.random.default_rng(0)
    q, frame, some = rng.uniform(-0.6, 0.7, 28), np.linalg.qr(rng.standard_normal((3, 3)))[0], np.ones(28, dtype=int)
    linear = np.stack([some, q], axis=1)
    bends = 1e-4 * rng.standard_normal((28, 3))
    bends -= linear @ np.linalg.lstsq(linear, bends, rcond=None)[0]
    carts = CartMeasurements(2 * some, q, (q[:, None] * [1.0, 0.0, 0.0] + bends) @ frame + 3.0)
    at, along, across = residuals(carts, 2)
    bends = bends[np.argsort(q)]
    np.testing.assert_array_equal(at, np.sort(q))
    np.testing.assert_allclose(along, bends[:, 0], atol=1e-12)
    np.testing.assert_allclose(across, np.linalg.norm(bends[:, 1:], axis=1), atol=1e-12)


def test_every_axis_of_every_figure_is_labelled() -> None:
    q = commands(12)
    measured = drawn_measurements(MODEL, q, np.full(6, 1e-4))
    links = [rod.name for rod in MODEL.robot.rods]
    bends = 1e-4 * np.random.default_rng(1).standard_normal((30, 3))
    along = np.tile(np.linspace(-0.6, 0.6, 10), 3)
    carts = CartMeasurements(np.repeat([1, 2, 3], 10), along, bends + along[:, None] * [1.0, 0.0, 0.0])
    rows, bare = np.arange(12), (None, None)
    errors = [Held(m, rows.astype(str).astype(object), rows * 1e-6, *bare) for m in (1, 3)]
    errors[1] = replace(errors[1], angles=1e-4 * np.random.default_rng(2).standard_normal((12, 3)))
    angles = orientation_errors(Comparison(tuple(errors), 0, gtpin.Dataset(robot="gantry_tau", **POSE)))
    for column, axis in enumerate(angles.axes):
        np.testing.assert_allclose(axis.lines[0].get_ydata(), 1e3 * errors[1].angles[:, column])
    assert all(
        [line.get_marker() for line in axis.lines] == ["*", "None"] for axis in along_and_across(carts, carts).axes
    )
    made = (
        angles,
        linearity(carts),
        along_and_across(carts),
        orientation_along_grid(MODEL.predict(q), 3),
        cost_and_position(step_change(MODEL, q, measured, "L", "1"), links),
        orientation_change(step_change(MODEL, q, measured, "Px", "3a")),
    )
    for figure in made:
        assert figure.get_suptitle()
        assert any(axis.get_xlabel() for axis in figure.axes)
        assert any(axis.get_ylabel() for axis in figure.axes)


def test_the_linearity_figure_shows_each_cart_s_residuals_in_micrometres() -> None:
    rng, q = np.random.default_rng(3), np.linspace(-0.6, 0.6, 12)
    bends = 1e-4 * rng.standard_normal((3, 12, 3))
    basis = np.stack([np.ones(12), q], axis=1)
    bends -= np.einsum("ij,njk->nik", basis @ np.linalg.pinv(basis), bends)
    position = np.concatenate([bend + q[:, None] * [1.0, 0.0, 0.0] for bend in bends])
    carts = CartMeasurements(np.repeat([1, 2, 3], 12), np.tile(q, 3), position)
    (axis,) = linearity(carts).axes
    for line, bend in zip(axis.lines, bends, strict=True):
        np.testing.assert_allclose(line.get_xdata(), 1e3 * q)
        np.testing.assert_allclose(line.get_ydata(), 1e6 * np.linalg.norm(bend, axis=1), atol=1e-6)
    both = along_and_across(carts).axes
    assert [len(axis.lines) for axis in both] == [1] * 6
