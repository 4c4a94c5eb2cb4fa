"""Where a part of the rows is in another unit, the error says which rows, not that the column is."""

from dataclasses import replace

import numpy as np
import pytest
from quick_first import quick_first
from test_recognise import elsewhere, machine, refusal

import gtpin
from gtpin.calibration.checks.before_fit import check_mixed_units
from gtpin.calibration.checks.readings import UNITS
from gtpin.model.model import Model
from gtpin.robot.geometry import Geometry


def spoilt(data, rows, metres):
    position = data.position.copy()
    position[rows] /= metres
    return replace(data, position=position)


@pytest.mark.parametrize(("robot", "frame"), [("gantry_tau", "robot"), ("stewart", "free")])
@pytest.mark.parametrize(("unit", "metres"), UNITS)
@pytest.mark.parametrize("share", quick_first(["every other", "second half", "three quarters"]))
def test_rows_in_another_unit_are_counted_and_the_first_and_last_named(robot, frame, unit, metres, share):
    data = machine(robot, 651)
    data = data if frame == "robot" else elsewhere(data, 651, "free")
    count = len(data)
    every = np.arange(count)
    rows = {"second half": every >= count // 2, "every other": every % 2 == 0, "three quarters": every % 4 != 3}[share]
    text = refusal(spoilt(data, rows, metres))
    lines = data.row[rows]
    assert f"x y z look like {unit} in {rows.sum()} of {count} rows" in text
    assert f"the first in line {lines[0]} and the last in line {lines[-1]} of the file" in text
    assert f"multiply x, y and z of these rows by {metres:g}" in text


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["gantry_tau", "stewart", "linear_delta"])
@pytest.mark.parametrize("frame", ["robot", "free"])
def test_data_in_one_unit_or_with_gross_errors_have_no_part_in_another(robot, frame):
    model = Model(Geometry.nominal(gtpin.load_robot(robot)))
    rng = np.random.default_rng(652)
    for seed in (652, 653):
        data = machine(robot, seed) if frame == "robot" else elsewhere(machine(robot, seed), seed, "free")
        poses = model.kinematics.forward(data.q)
        wrong = rng.choice(len(data), len(data) // 4, replace=False)
        off = data.position.copy()
        off[wrong] += rng.normal(0, 0.5, (len(wrong), 3))
        for part in (data, replace(data, position=off), spoilt(data, slice(None), 1e-3), spoilt(data, wrong[:3], 1e-3)):
            check_mixed_units(part, poses)


def test_commands_in_millimetres_in_half_of_the_rows_are_counted_and_the_first_and_last_named():
    data = machine("gantry_tau", 654)
    q = data.q.copy()
    rows = np.isin(data.pose, data.pose[20:40])
    q[rows] *= 1000.0
    lines = data.row[rows]
    text = refusal(replace(data, q=q))
    assert (
        f"so are {rows.sum()} of {len(data)} rows, the first in line {lines[0]} and the last in line {lines[-1]}"
        in text
    )
    assert "look like millimetres; write commands of these rows in m" in text
