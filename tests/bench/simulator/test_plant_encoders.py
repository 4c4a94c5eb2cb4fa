"""Encoders at joints that follow in loops: the plant's readings have all effects in, and its energies are those of readings."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from plant_machines import FIVE_BAR
from typer.testing import CliRunner

import gtpin
from gtpin.bench.blind.draw import drafts, made, truth_of
from gtpin.bench.blind.judged import judge
from gtpin.bench.blind.truth import digest_of, seal
from gtpin.bench.blind.worker import Outcome
from gtpin.bench.simulator.case import drawn_recipe
from gtpin.bench.simulator.instruments.build import build_measured
from gtpin.bench.simulator.recipe import SimulatedConditions, SimulatedNoise
from gtpin.bench.simulator.truth import InstrumentCase
from gtpin.cli import app
from gtpin.instruments.readings import Readings, single
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.poses import Poses

pytestmark = pytest.mark.slow

Floats = np.ndarray

JOINT = "elbow_left"
"""The first joint that follows."""
EXACT = 1e-8


def built(
    effect: str,
    site: str,
    instruments: tuple[str, ...],
    repeatability: tuple[float, float],
    robot: str = str(FIVE_BAR),
) -> InstrumentCase:
    recipe = drawn_recipe(
        3,
        effects=[(effect, site)],
        poses=40,
        held_out=6,
        background=False,
        robot=robot,
        noncentrality=500.0,
        conditions=SimulatedConditions(),
        noise=SimulatedNoise(repeatability=repeatability),
    )
    return build_measured(recipe, instruments)


@cache
def five_bar() -> gtpin.Robot:
    return gtpin.load_robot(str(FIVE_BAR)).measuring([JOINT])


def true_kinematics(case: InstrumentCase, robot: gtpin.Robot | None = None):
    """The package's kinematics of the machine's true geometry, without effects."""
    nominal = gtpin.Geometry.nominal(robot or five_bar())
    return Kinematics(
        nominal.with_values(nominal.values + np.array([case.machine.parameters[name] for name in nominal.names]))
    )


def turned(difference: Floats) -> Floats:
    return np.asarray(difference - 2.0 * np.pi * np.round(difference / (2.0 * np.pi)))


def energy_of(model, robot: gtpin.Robot, dataset: gtpin.Dataset, zero: float) -> float:
    """E of what is left of noise-free readings of one encoder at the true geometry, past geometry and the zero."""
    poses = model.forward(dataset.q)
    readings = Readings.of(single(dataset, robot), robot)
    geometry = model.geometry_jacobian(dataset.q, poses)[:, 6] * gtpin.Geometry.nominal(robot).tolerance
    B = np.column_stack([geometry, np.full(len(dataset.q), 1e-2)]) / 2e-5
    d = turned(readings.residual_at(poses)[:, 0] - zero) / 2e-5
    return float(d @ np.linalg.solve(np.eye(len(d)) + B @ B.T, d))


def followed(case: InstrumentCase, q: Floats, seen: Poses) -> Floats:
    """(N,) coordinate of the joint where the TCP is seen, from commands near by: drives turned until the TCP is there."""
    model = true_kinematics(case)
    for _ in range(6):
        now = model.forward(q)
        left = seen.T - now.T
        slope = model.command_jacobian(q, now)[:, :3]
        q = q + np.einsum("nij,nj->ni", np.linalg.pinv(slope), left)
    assert np.abs(model.forward(q).T - seen.T).max() < 1e-10
    return np.asarray(model.forward(q).joints[JOINT])


@pytest.mark.parametrize("robot", ["gantry_tau", "stewart"])
def test_an_encoder_at_a_rod_reads_where_the_rod_points_with_what_the_drives_do(
    robot: str, exact: None, tmp_path: Path
) -> None:
    case = built("backlash", "cart1" if robot == "gantry_tau" else "leg1", ("encoder",), (0.0, 0.0), robot)
    (read,) = case.dataset.read
    nominal = gtpin.load_robot(robot).measuring([read.described["joint"]])
    model = true_kinematics(case, nominal)
    reading = np.asarray(read.columns["reading"], dtype=float) - case.hidden["encoder.zero"]
    q, column = case.dataset.q[read.stop], np.asarray(case.dataset.covariates["approach1"])[read.stop]
    slope = model.command_jacobian(q, model.forward(q))[:, 6, 0]
    travel = turned(reading - model.forward(q).joints[read.described["joint"]]) / slope
    sure = np.abs(slope) > 0.2 * np.abs(slope).max()
    assert sure.sum() > 20
    assert len(np.unique(np.sign(travel[sure]) * np.sign(column[sure]))) == 1
    case.write_dataset(tmp_path)
    dataset = gtpin.Dataset.read(tmp_path)
    noncentrality = energy_of(model, nominal, dataset, case.hidden["encoder.zero"])
    assert case.effects[0].noncentrality == pytest.approx(noncentrality, rel=1e-3)


@pytest.mark.parametrize("effect", ["backlash", "joint_compliance", "servo_lag"])
def test_an_encoder_and_a_tracker_see_one_posture_with_what_the_drives_do(effect: str, exact: None) -> None:
    case = built(effect, "drive_right", ("tracker", "encoder"), repeatability=(1e-5, 1e-5))
    read = {one.described["name"]: one for one in case.dataset.read}
    encoder, tracker = read["encoder"], read["tracker"]
    assert encoder.described["joint"] == JOINT
    assert np.array_equal(encoder.stop, tracker.stop)
    at = np.stack([tracker.columns[axis] for axis in "xyz"], axis=1)
    q, seen = case.dataset.q[encoder.stop], Poses(at, np.tile(np.eye(3), (len(at), 1, 1)))
    reading = np.asarray(encoder.columns["reading"], dtype=float) - case.hidden["encoder.zero"]
    assert np.abs(turned(reading - followed(case, q, seen))).max() < EXACT
    without = true_kinematics(case).forward(q).joints[JOINT]
    assert np.abs(turned(reading - without)).max() > 2e-5  # the effect shows beyond an encoder's noise
    held, (values, sigmas) = Poses(case.truth.T, case.truth.R), case.held["encoder"]
    there = values[:, 0] - case.hidden["encoder.zero"]
    assert np.abs(turned(there - followed(case, case.commands.q, held))).max() < EXACT
    assert (sigmas == 2e-5).all()


def test_what_moves_the_measurement_frame_has_no_energy_in_an_encoder_s_readings() -> None:
    case = built("frame_shift", "frame", ("encoder",), repeatability=(1e-5, 1e-5))
    assert case.effects[0].noncentrality == pytest.approx(0.0, abs=1e-12)


def test_a_blind_check_of_encoders_seals_their_true_readings() -> None:
    draft = next(d for d in drafts(12, 0, str(FIVE_BAR), ("encoder",)) if d.kind == "one")
    truth = truth_of(made(draft), draft.kind)
    assert truth.poses is None
    assert [read.name for read in truth.readings] == ["encoder"]


def test_a_scenario_s_five_bar_is_read_by_an_encoder_and_robots_without_such_joints_are_refused(tmp_path: Path) -> None:
    scenario = tmp_path / "it.toml"
    scenario.write_text("poses = 20\n[[effect]]\nid = 'backlash'\n", encoding="utf-8")
    rest = ["--instrument", "encoder", "--scenario", str(scenario), "-o", str(tmp_path / "data")]
    refused = CliRunner().invoke(app, ["simulate", "--robot", "ur5", *rest])
    assert isinstance(refused.exception, gtpin.GtpinError)
    assert "no joint of this machine can be read by an encoder" in str(refused.exception)
    assert not (tmp_path / "data").exists()
    result = CliRunner().invoke(app, ["simulate", "--robot", str(FIVE_BAR), *rest])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "data" / "encoder.csv").read_text().startswith("pose,q1,q2,reading,")


def test_predicted_readings_that_are_off_by_full_turns_are_right(tmp_path: Path) -> None:
    draft = next(d for d in drafts(12, 0, str(FIVE_BAR), ("encoder",)) if d.kind == "none")
    case, place = made(draft), tmp_path / "it"
    case.write_dataset(place)
    truth = truth_of(case, draft.kind)
    seal(truth, place, tmp_path / "it.json")
    true, turns = np.array(truth.readings[0].values), 2.0 * np.pi * np.arange(len(case.commands))[:, None]
    outcome = Outcome(
        baseline_readings={"encoder": (true + 4e-5).tolist()},
        model_readings={"encoder": (true + turns + 2e-5).tolist()},
    )
    judged = judge(place, tmp_path / "it.json", digest_of((tmp_path / "it.json").read_bytes()), outcome)
    assert judged.shrunk is not None
    assert (judged.shrunk.before, judged.shrunk.after) == pytest.approx((2.0, 1.0), rel=1e-6)


def test_the_energy_of_an_effect_in_a_loop_is_that_of_the_readings_past_geometry_and_the_zero(
    exact: None, tmp_path: Path
) -> None:
    case = built("backlash", "drive_right", ("encoder",), repeatability=(0.0, 0.0))
    case.write_dataset(tmp_path)
    dataset = gtpin.Dataset.read(tmp_path)
    noncentrality = energy_of(true_kinematics(case), five_bar(), dataset, case.hidden["encoder.zero"])
    assert case.effects[0].noncentrality == pytest.approx(noncentrality, rel=1e-3)
    assert case.effects[0].noncentrality == pytest.approx(500.0, rel=1e-2)
