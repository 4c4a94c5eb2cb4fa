"""The accuracy of a five-bar agrees with its closed form, wherever its instrument stood."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from urdfs import crossing

import gtpin
from gtpin.accuracy.expected import Uncertainty
from gtpin.accuracy.sensitivity import STEP
from gtpin.accuracy.workspace import space_of

FIVE_BAR = Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf"
NOMINAL = np.array([0.3, 0.3, 0.4, 0.4, 0.0, 0.0])
"""Lengths of the links at the drives and of the far links, and how far the elbows are beside their links, left and right, m."""
C, S = np.cos(1.3758), np.sin(1.3758)
MOVES = {
    "placement[elbow_left].x": np.array([C, 0.0, 0.0, 0.0, -S, 0.0]),
    "placement[elbow_right].x": np.array([0.0, C, 0.0, 0.0, 0.0, S]),
    "anchor[pin.left_far].x": np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
    "anchor[pin.right_far].x": np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0]),
}
"""What of the closed form a unit of a parameter changes: an elbow's own axes are turned in the plane from its link's."""


@pytest.fixture(scope="module")
def model() -> gtpin.Model:
    return gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot(str(FIVE_BAR))))


def elbow(foot: float, angle: np.ndarray, length: float, beside: float) -> np.ndarray:
    """(N, 2) x and z of an elbow."""
    along, across = (np.column_stack([np.cos(angle + turn), np.sin(angle + turn)]) for turn in (0.0, np.pi / 2.0))
    return np.array([foot, 0.0]) + length * along + beside * across


def tool(q: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """(N, 2) x and z of the tool: circles of the far links about the elbows; the tool is on the left far link, 0.45 m out."""
    left = elbow(-0.1, 2.2 + q[:, 0], lengths[0], lengths[4])
    right = elbow(0.1, 0.94159265 + q[:, 1], lengths[1], lengths[5])
    pin = crossing(left, lengths[2], right, lengths[3])
    return left + 0.45 * (pin - left) / lengths[2]


def commands(count: int) -> np.ndarray:
    return np.random.default_rng(0).uniform(-0.5, 0.5, (count, 2))


def test_the_closed_form_is_the_robot(model: gtpin.Model) -> None:
    q = commands(20)
    assert_allclose(model.predict(q).T[:, [0, 2]], tool(q, NOMINAL), atol=1e-9)


def test_a_length_moves_the_tool_as_in_the_closed_form(model: gtpin.Model) -> None:
    q = commands(10)
    table = gtpin.analyse(model, q).to_dataframe().set_index(["parameter", "link"])
    for name, move in MOVES.items():
        moved = [tool(q, NOMINAL + step * move) - tool(q, NOMINAL) for step in (STEP, -STEP)]
        link = name.split("[")[1].rpartition(".")[0].removesuffix("]")
        found = table.loc[("x", link), "position_mm"]
        assert found == pytest.approx(1e3 * sum(np.linalg.norm(m, axis=1).sum() for m in moved), rel=1e-5), name


@pytest.mark.slow
def test_the_expected_error_is_that_of_machines_of_the_closed_form(model: gtpin.Model) -> None:
    q = commands(10)
    names, sigma = list(model.geometry.names), 1e-4
    variances = np.zeros(len(names))
    variances[[names.index(name) for name in MOVES]] = sigma**2
    found = gtpin.analyse(model, q, uncertainty=Uncertainty(np.diag(variances))).expected.position
    drawn = NOMINAL + np.random.default_rng(1).normal(0.0, sigma, (4000, 4)) @ np.array([*MOVES.values()])
    lengths = np.array([np.linalg.norm(tool(q, one) - tool(q, NOMINAL), axis=1) for one in drawn])
    assert found.mean == pytest.approx(lengths.mean(), rel=0.03)
    assert found.p95 == pytest.approx(np.quantile(lengths, 0.95), rel=0.05)


@pytest.mark.slow
def test_where_a_free_instrument_saw_the_machine_is_no_error_of_it(model: gtpin.Model) -> None:
    """Both drives moved and turned alike are the machine elsewhere: an error in the base frame, none for a free instrument."""
    names, q = list(model.geometry.names), commands(30)
    drives, shift = ("drive_left", "drive_right"), np.zeros(len(names))
    for name in drives:
        # Their frames are turned about y, by the angles in the URDF: the same motion of the base in each one's axes.
        turn = {"drive_left": -2.2, "drive_right": -0.94159265}[name]
        x, z = np.cos(turn) * 3e-3, np.sin(turn) * 3e-3
        shift[names.index(f"placement[{name}].x")], shift[names.index(f"placement[{name}].z")] = x, z
    here = gtpin.Model(model.geometry, covariance=np.outer(shift, shift))
    there = gtpin.Model(model.geometry, gtpin.Frame(np.array([1.0, 2.0, 0.5])), covariance=here.covariance)
    # One standard normal number times 3 mm: the mean of its size is sqrt(2 / pi).
    assert gtpin.analyse(here, q).expected.position.mean == pytest.approx(3e-3 * np.sqrt(2.0 / np.pi), rel=1e-3)
    assert gtpin.analyse(there, q).expected.position.mean < 1e-8


@pytest.mark.slow
def test_a_calibrated_planar_machine_has_one_map(model: gtpin.Model) -> None:
    off = np.random.default_rng(0).normal(0.0, 5e-4, len(model.geometry.names))
    space = space_of(gtpin.Model(model.geometry.with_values(model.geometry.values + off)), commands(5))
    assert [len(axis) for axis in space.axes] == [17, 1, 17]
