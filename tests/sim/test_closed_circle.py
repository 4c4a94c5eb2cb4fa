"""From a machine to its model, to MuJoCo, and to a diagnosis again; machines by the plant, which shares no code with gtpin."""

import sys
from pathlib import Path

import pandas as pd
import pytest
from scipy.stats import binom

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "examples" / name) for name in ("pages", "simulator")]

import closed_circle  # noqa: E402  (the scripts of examples are no package)
import figures  # noqa: E402

(FIGURE,) = [figure for figure in figures.FIGURES if figure.name == "closed_circle"]
LARGER = 1.5
"""Largest error in MuJoCo over the printed one: the poses and loads of a dataset are not those of a loss."""
SLACK = 1.0
"""um: MuJoCo's own error, and what first order leaves."""
ONLY_IN_LAYER = ("ur5", "joint_compliance@shoulder_lift_joint")
"""Where the circle is known not to close by a file: springs of MJCF do not stiffen with the load (docs/export.md)."""
SAID = 0.05
"""Largest difference of the explained fraction in MuJoCo from the stated one: the goal of the blind check for its mean."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "cause"),
    [
        ("gantry_tau", "encoder_scale@cart1"),
        ("gantry_tau", "linearity@cart3"),
        ("linear_delta", "backlash@cart1"),
        ("ur5", "backlash@shoulder_lift_joint"),
    ],
)
@pytest.mark.study
def test_the_circle_closes(robot: str, cause: str) -> None:
    pytest.importorskip("mujoco")
    (row,) = closed_circle.measured(robot=robot, cause=cause, seed=21)
    assert row["found"] == cause
    assert row["again"] == cause
    assert row["file_um"] < LARGER * row["printed_um"] + SLACK
    assert row["file_um"] < 0.5 * row["effects_um"]
    assert row["layer_um"] < SLACK
    assert row["against_layer"] == row["against_file"] == "none"
    assert abs(row["shrank"] - row["said"]) < SAID


def test_what_the_page_says_holds_for_all_recorded_machines() -> None:
    records = FIGURE.records()
    assert len(records) == 20
    went: pd.DataFrame = records[records["again"] != ""]
    numbers = went[["printed_um", "file_um", "layer_um"]].astype(float)
    assert (numbers["layer_um"] < SLACK).all()
    assert (numbers["file_um"] < LARGER * numbers["printed_um"] + SLACK).all()
    assert (went["against_layer"] == "none").all()
    held = went[[case != ONLY_IN_LAYER for case in zip(went["robot"], went["cause"], strict=True)]]
    assert len(held) == 18
    assert (held["against_file"] == "none").all()
    assert (held["found"] == held["again"]).all()
    said, shrank = went["said"].astype(float), went["shrank"].astype(float)
    assert (said - shrank).abs().mean() < SAID
    assert closed_circle.inside(records) >= binom.ppf(0.001, len(records), 0.95)
