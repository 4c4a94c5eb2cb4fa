"""Data of the plant's machines with usual mistakes of units, axes, signs and frames are refused by the mistake's name."""

import re
from dataclasses import replace
from functools import cache
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from quick_first import quick_first
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.bench.simulator import simulate
from gtpin.calibration.checks.readings import order_looks
from gtpin.calibration.checks.recognise import recognised
from gtpin.calibration.problem import measured_poses
from gtpin.errors import DatasetError, GtpinWarning
from gtpin.model.model import Model
from gtpin.robot.geometry import Geometry

pytestmark = pytest.mark.filterwarnings(
    "ignore:commands a little outside",
    "ignore:parameters more than",
    "ignore:off by more than",
    "ignore:the nominal model is not",
)

FIVE_BAR = str(Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf")
ROBOTS = ("gantry_tau", "tau", "gantry_tau_6dof", "stewart", "linear_delta", "stewart_jugglebot")


@cache
def nominal(robot):
    return Model(Geometry.nominal(gtpin.load_robot(robot)))


@cache
def machine(robot, seed):
    return simulate(gtpin.load_robot(robot), robot, poses=60, seed=seed, held_out=1).dataset


def rotations(data):
    return Rotation.from_quat(data.orientation.copy(), scalar_first=True)


def turned(data, rotation):
    return replace(data, orientation=rotation.as_quat(scalar_first=True))


def elsewhere(data, seed, frame):
    """The data as an instrument sees them that stands somewhere else."""
    rng = np.random.default_rng(seed)
    stand = Rotation.random(random_state=rng)
    seen = replace(data, position=stand.apply(data.position.copy()) + rng.normal(0, 3, 3))
    instrument = data.instrument.model_copy(update={"frame": frame})
    return replace(turned(seen, stand * rotations(data)), instrument=instrument)


def in_units(metres, axes=(0, 1, 2)):
    def spoil(data):
        position = data.position.copy()
        position[:, list(axes)] /= metres
        return replace(data, position=position)

    return spoil


def along(*signed):
    """Positions along other axes: 1, 2, 3 for x, y, z, negative where reversed."""

    def spoil(data):
        return replace(data, position=data.position[:, np.abs(signed) - 1] * np.sign(signed))

    return spoil


def left_handed(data):
    S = np.diag([1.0, 1.0, -1.0])
    mirrored = Rotation.from_matrix(S @ rotations(data).as_matrix() @ S)
    return turned(replace(data, position=data.position @ S), mirrored)


def conjugated(data):
    return turned(data, rotations(data).inv())


def inverted(data):
    inverse = rotations(data).inv()
    return turned(replace(data, position=-inverse.apply(data.position.copy())), inverse)


def commands(change):
    def spoil(data):
        return replace(data, q=change(data.q.copy()))

    return spoil


MISTAKES = {
    "centimetres": (in_units(0.01), "x y z look like centimetres; multiply x, y and z by 0.01"),
    "inches": (in_units(0.0254), "x y z look like inches; multiply x, y and z by 0.0254"),
    "feet": (in_units(0.3048), "x y z look like feet; multiply x, y and z by 0.3048"),
    "yards": (in_units(0.9144), "x y z look like yards"),
    "millimetres": (in_units(0.001), "x y z look like millimetres; multiply x, y and z by 0.001"),
    "z in millimetres": (in_units(0.001, axes=(2,)), "z looks like millimetres beside metres; multiply z by 0.001"),
    "x reversed": (along(-1, 2, 3), "x looks reversed; change the sign of x"),
    "y reversed": (along(1, -2, 3), "y looks reversed"),
    "z reversed": (along(1, 2, -3), "z looks reversed"),
    "x and y swapped": (along(2, 1, 3), "x and y look swapped"),
    "y and z swapped": (along(1, 3, 2), "y and z look swapped"),
    "left-handed": (left_handed, "z looks reversed"),
    "poses inverted": (inverted, "the poses look inverted"),
    "q1 reversed": (commands(lambda q: q * np.where(np.arange(q.shape[1]) == 0, -1.0, 1.0)), "q1 looks reversed"),
    "q1 in millimetres": (
        commands(lambda q: q * np.where(np.arange(q.shape[1]) == 0, 1e3, 1.0)),
        "q1 looks like millimetres; multiply q1 by 0.001",
    ),
    "q in inches": (commands(lambda q: q / 0.0254), "look like inches"),
}


def found(robot, data):
    model = nominal(robot)
    poses = model.kinematics.forward(data.q)
    looks = recognised(model, poses, measured_poses(data), data.instrument)
    return looks and f"{looks.looks}; {looks.hint}"


def refusal(data):
    with pytest.raises(DatasetError) as caught:
        gtpin.calibrate(data)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["gantry_tau", "stewart"])
@pytest.mark.parametrize("mistake", MISTAKES)
@pytest.mark.study
def test_a_mistake_is_refused_by_its_name(robot, mistake):
    spoil, words = MISTAKES[mistake]
    assert words in refusal(spoil(machine(robot, 611)))


@pytest.mark.slow
@pytest.mark.parametrize("mistake", ["inches", "z in millimetres", "q1 reversed"])
@pytest.mark.parametrize("frame", ["robot", "free"])
@pytest.mark.study
def test_it_is_recognised_in_positions_of_an_instrument_elsewhere_too(mistake, frame):
    spoil, words = MISTAKES[mistake]
    data = spoil(replace(elsewhere(machine("gantry_tau", 612), 612, frame), orientation=None))
    text = refusal(data)
    assert words.split(";")[0] in text
    assert ('set frame = "free"' in text) == (frame == "robot")


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["gantry_tau", "tau", "gantry_tau_6dof", "stewart", "linear_delta"])
@pytest.mark.study
def test_an_instrument_elsewhere_is_recognised(robot):
    data = elsewhere(machine(robot, 613), 613, "robot")
    assert 'set frame = "free" under [instrument]' in (found(robot, data) or "")
    assert found(robot, replace(data, instrument=data.instrument.model_copy(update={"frame": "free"}))) is None


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["gantry_tau", "gantry_tau_6dof", "stewart", "linear_delta"])
@pytest.mark.parametrize("orientations", [True, False])
@pytest.mark.study
def test_a_metre_along_x_may_always_be_another_frame(robot, orientations):
    data = machine(robot, 616)
    data = replace(data, position=data.position + np.array([1.0, 0.0, 0.0]))
    text = refusal(data if orientations else replace(data, orientation=None))
    assert "the instrument looks to stand elsewhere than in the base frame" in text
    assert 'set frame = "free" under [instrument]' in text


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["gantry_tau", "gantry_tau_6dof", "stewart"])
def test_conjugated_quaternions_are_recognised(robot):
    for seed in (614, 702):
        assert "the orientations look inverted (conjugated)" in (found(robot, conjugated(machine(robot, seed))) or "")


USUAL_ORDERS = ("xyzw", "zxyw", "wyxz")
RARE_ORDERS = [order for order in map("".join, permutations("wxyz")) if order not in ("wxyz", *USUAL_ORDERS)]


@pytest.mark.parametrize("frame", ["robot", "free"])
@pytest.mark.parametrize("order", quick_first([*USUAL_ORDERS, *RARE_ORDERS], len(USUAL_ORDERS)))
def test_quaternions_in_any_other_order_are_recognised(frame, order):
    data = machine("gantry_tau", 611)
    data = elsewhere(data, 611, "free") if frame == "free" else data
    told = found("gantry_tau", replace(data, orientation=data.orientation[:, ["wxyz".index(p) for p in order]]))
    if order[0] == "w":
        if frame == "robot":  # a free frame takes up a part of such small turns: they are named after the fit
            assert "qx qy qz look to be along other axes" in told
            there = [f"q{part} = q{'wxyz'[order.index(part)]}" for part in "xyz"]
            assert f"write ({', '.join(there)})" in told
    else:
        assert f"looks like {order} quaternions" in told
        assert "give qw qx qy qz in that order of meaning, scalar first" in told


@pytest.mark.parametrize(
    ("order", "told"), [("xyzw", "w were under qz"), ("xwyz", "w were under qx"), ("zxyw", "w were under qz")]
)
def test_where_the_scalar_stands_is_told(order, told):
    assert order_looks(order).endswith(f"as if {told}")


@pytest.mark.slow
def test_orientations_that_are_all_turned_by_some_angle_are_no_order():
    data = machine("gantry_tau", 611)
    for angle in (0.03, 0.15, 0.4):
        words = found("gantry_tau", turned(data, Rotation.from_rotvec([0.0, angle, 0.0]) * rotations(data)))
        assert words is None or "quaternions" not in words


def test_scalar_last_quaternions_of_a_platform_that_hardly_turns_are_recognised():
    data = machine("linear_delta", 611)
    assert "looks like xyzw" in found("linear_delta", replace(data, orientation=np.roll(data.orientation, -1, axis=1)))


@pytest.mark.slow
def test_two_columns_of_commands_that_are_swapped_are_recognised():
    swapped = commands(lambda q: q[:, [1, 0, 2]])(machine("gantry_tau", 615))
    assert refusal(swapped).endswith("q1 and q2 look swapped; swap them")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("frame", "home"),
    [("robot", (0.3, -0.2)), ("free", (0.3, -0.2)), ("robot", (1.2, -0.7)), ("free", (1.2, -0.7))],
)
def test_commands_of_a_five_bar_that_are_counted_from_another_home_are_named(frame, home):
    """One zero and another frame fit as well as two zeros do only where the tolerances explain what they leave."""
    right = simulate(gtpin.load_robot(FIVE_BAR), FIVE_BAR, poses=60, seed=3, held_out=1).dataset
    instrument = right.instrument.model_copy(update={"frame": frame})
    said = refusal(replace(right, q=right.q - home, instrument=instrument))
    assert "column q1 q2" in said
    told = [float(value) for value in re.findall(r"add (\S+) to q", said)]
    np.testing.assert_allclose(told, home, rtol=0, atol=0.06)  # a plain fit of the nominal robot
    followed = gtpin.calibrate(replace(right, q=right.q - home + told, instrument=instrument))
    assert followed.chi2_per_dof < 1.5


def parts(data, seed):
    """Data that are right: few poses, poses near a plane, a line or a point, a machine that is off, and gross errors."""
    rng = np.random.default_rng(seed)
    centred = data.position - np.median(data.position, axis=0)
    line = np.linalg.svd(centred, full_matrices=False)[2][0]
    off_line = np.linalg.norm(centred - np.outer(centred @ line, line), axis=1)
    yield data
    yield data.take(rng.choice(len(data), 10, replace=False))
    for axis in range(3):
        yield data.take(np.argsort(np.abs(centred[:, axis]))[:15])
    yield data.take(np.argsort(off_line)[:12])
    yield data.take(np.argsort(np.linalg.norm(centred, axis=1))[:12])
    yield replace(data, position=data.position + rng.normal(0, 0.005, 3))
    for size in (0.05, 1.0):
        position = data.position.copy()
        wrong = rng.choice(len(data), len(data) // 4, replace=False)
        position[wrong] += rng.normal(0, size, (len(wrong), 3))
        yield replace(data, position=position)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("frame", ["robot", "free"])
def test_data_that_are_right_are_never_taken_for_a_mistake(robot, frame):
    for seed in (621, 622):
        data = machine(robot, seed)
        seen = data if frame == "robot" else elsewhere(data, seed, frame)
        for part in parts(seen, seed):
            assert found(robot, part) is None
            assert found(robot, replace(part, orientation=None)) is None


def test_an_orientation_that_is_constant_is_left_out_with_a_warning():
    data = machine("gantry_tau", 631)
    constant = replace(data, orientation=np.tile(data.orientation[:1], (len(data), 1)))
    with pytest.warns(GtpinWarning, match="the orientation is the same in every row"):
        left_out = gtpin.calibrate(constant)
    alone = gtpin.calibrate(replace(data, orientation=None))
    assert np.array_equal(left_out.model.geometry.values, alone.model.geometry.values)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")  # its drawn geometry does turn a little
def test_a_constant_orientation_of_a_robot_that_keeps_it_is_a_measurement():
    data = machine("linear_delta", 632)
    constant = replace(data, orientation=np.tile([1.0, 0.0, 0.0, 0.0], (len(data), 1)))
    assert gtpin.calibrate(constant).residual.shape[1] == 6


def test_rows_with_a_logger_s_mark_are_set_aside_and_listed():
    data = machine("gantry_tau", 633)
    temperature = np.linspace(20.0, 23.0, len(data))
    temperature[[4, 9]] = -999.0
    with pytest.warns(GtpinWarning, match="temp_frame of -999 is no reading"):
        fitted = gtpin.calibrate(replace(data, covariates={"temp_frame": temperature}))
    assert set(fitted.rejected) == {str(pose) for pose in data.pose[[4, 9]]}


def test_copies_change_nothing():
    data = machine("gantry_tau", 634)
    with pytest.warns(GtpinWarning, match="counted once"):
        twice = gtpin.calibrate(data.take(np.tile(np.arange(len(data)), 2)))
    once = gtpin.calibrate(data)
    assert np.array_equal(twice.model.geometry.values, once.model.geometry.values)
    assert twice.rejected == once.rejected
