"""Recorded columns that a dataset lets act: named where they do, and not where they don't; kept in a model's file."""

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
import seats

import gtpin
from gtpin.bench.simulator import make_case, simulate
from gtpin.data import Driver
from gtpin.effects import OperatingPoints
from gtpin.effects.driver import DriverColumn, DriverEffect
from gtpin.errors import DatasetError, ModelError
from gtpin.kinematics.rotations import exp

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")

SIZE = 3e-4


@cache
def measured(robot: str) -> gtpin.Dataset:
    """A machine without a fault, and a column that says nothing of it."""
    if robot == "gantry_tau":
        data = make_case(7, effects=[], poses=100).dataset
    else:
        data = simulate(gtpin.load_robot(robot), robot, poses=100, seed=2).dataset
    tilt = 20.0 + 3.0 * np.random.default_rng(1).uniform(-1.0, 1.0, len(data))
    return replace(data, covariates={**data.covariates, "tilt_x": tilt})


def tilted(data: gtpin.Dataset, axis: int, about: tuple[float, float, float]) -> gtpin.Dataset:
    """What is measured if everything turns about a point with the column, by SIZE over its range."""
    tilt = data.covariates["tilt_x"]
    R = exp(np.eye(3)[axis] * (SIZE * (tilt - tilt.mean()) / np.ptp(tilt))[:, None])
    position = np.einsum("nij,nj->ni", R, data.position - about) + about
    q = data.orientation
    turned = [
        pin.Quaternion(r @ pin.Quaternion(*w).toRotationMatrix()).coeffs()[[3, 0, 1, 2]]
        for r, w in zip(R, q, strict=True)
    ]
    return replace(data, position=position, orientation=np.array(turned))


SITES = [("gantry_tau", "frame"), ("ur5", "base_link")]


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "site"), SITES)
def test_a_column_that_acts_is_named_and_measured(robot, site, tmp_path):
    data = replace(tilted(measured(robot), 0, (0.0, 0.0, 0.0)), drivers=(Driver("tilt_x", site, "rx", 1e-4),))
    data.write(tmp_path / "set")
    found = gtpin.diagnose(gtpin.Dataset.read(tmp_path / "set"))
    assert found.verdict == "explained"
    assert [(c.effect, c.site) for c in found.causes] == [("driver:tilt_x", site)]
    said = found.causes[0].parameters["rx"]
    assert said.unit == "rad"
    assert abs(said.value - SIZE) < 4.0 * said.sigma
    gtpin.write_model(found.model, tmp_path / "model")
    read = gtpin.read_model(tmp_path / "model")
    tilt = {"tilt_x": data.covariates["tilt_x"]}
    one, other = found.model.predict(data.q, tilt), read.predict(data.q, tilt)
    assert (one.T == other.T).all()
    assert (one.R == other.R).all()
    # A pose is predicted the same whichever poses are predicted with it.
    np.testing.assert_array_equal(read.predict(data.q[:1], {"tilt_x": tilt["tilt_x"][:1]}).T, one.T[:1])
    with pytest.raises(ModelError, match="tilt_x"):
        read.predict(data.q, {})


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "site"), SITES)
def test_the_axes_of_one_sensor_are_one_cause(robot, site, tmp_path):
    data = tilted(measured(robot), 0, (0.0, 0.0, 0.0))
    other = np.random.default_rng(4).uniform(-1.0, 1.0, len(data))
    data = replace(data, covariates={**data.covariates, "tilt_y": other})
    swapped = replace(data, covariates={**data.covariates, "tilt_x": other})
    both = replace(tilted(swapped, 1, (0.0, 0.0, 0.0)), covariates=data.covariates)
    axes = [("tilt_x", "rx"), ("tilt_y", "ry")]
    both = replace(both, drivers=tuple(Driver(name, site, way, 1e-4, "level") for name, way in axes))
    both.write(tmp_path / "set")
    found = gtpin.diagnose(gtpin.Dataset.read(tmp_path / "set"))
    assert [(c.effect, c.site) for c in found.causes] == [("driver:level", site)]
    for _, way in axes:
        said = found.causes[0].parameters[way]
        assert abs(said.value - SIZE) < 4.0 * said.sigma
    gtpin.write_model(found.model, tmp_path / "model")
    recorded = {name: data.covariates[name] for name, _ in axes}
    one, again = found.model.predict(data.q, recorded), gtpin.read_model(tmp_path / "model").predict(data.q, recorded)
    np.testing.assert_array_equal(one.T, again.T)
    with pytest.raises(ModelError, match="tilt_y"):
        found.model.predict(data.q, {"tilt_x": recorded["tilt_x"]})


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "site"), SITES)
def test_a_column_of_noise_is_not_named(robot, site):
    found = gtpin.diagnose(replace(measured(robot), drivers=(Driver("tilt_x", site, "rx", 1e-4),)))
    assert found.verdict == "none"
    assert any(c.effect == "driver:tilt_x" and c.testable for c in found.candidates)


@pytest.mark.slow
def test_a_column_can_be_excluded():
    data = replace(measured("gantry_tau"), drivers=(Driver("tilt_x", "cart1", "ry", 1e-4),))
    found = gtpin.diagnose(data, exclude=["driver:tilt_x"])
    assert not any(c.effect == "driver:tilt_x" for c in found.candidates)


MOTIONS = [
    ("shoulder_lift_joint", "x"),
    ("elbow_joint", "rz"),
    ("wrist_2_joint", "q"),
    ("tool0", "y"),
    ("base_link", "ry"),
]


@pytest.mark.parametrize(("site", "motion"), MOTIONS)
def test_motions_of_an_arm_are_those_of_its_frames(site, motion):
    """By Pinocchio's poses of a model whose placements, tool or command are displaced."""
    robot = gtpin.load_robot("ur5")
    kinematics = gtpin.Model(gtpin.Geometry.nominal(robot)).kinematics
    q = np.random.default_rng(3).uniform(-1.0, 1.0, (5, 6))
    at = OperatingPoints(kinematics, q, kinematics.forward(q), {"tilt_x": np.ones(5)})
    effect = DriverEffect([DriverColumn("tilt_x", 0.0, 1.0)], [Driver("tilt_x", site, motion, 1e-3)])
    found = effect.basis(at, site).displacement(at)[:, :, 0]

    def pose(row, step):
        model, tool, command = robot.model.copy(), robot.tcp_placement, row.copy()
        twist = np.zeros(6)
        if motion != "q":
            twist[["x", "y", "z", "rx", "ry", "rz"].index(motion)] = step
        by = pin.exp6(twist)
        if motion == "q":
            command[robot.sites.index(site)] += step
        elif site == "tool0":
            tool = tool * by
        elif site == "base_link":
            frame = model.frames[model.getFrameId(site)].placement
            model.jointPlacements[1] = frame * by * frame.inverse() * model.jointPlacements[1]
        else:
            j = model.getJointId(site)
            model.jointPlacements[j] = model.jointPlacements[j] * by
        data = model.createData()
        pin.forwardKinematics(model, data, command)
        return data.oMi[model.njoints - 1] * tool

    h = 1e-6
    for row, moved in zip(q, found, strict=True):
        one, other = pose(row, h), pose(row, -h)
        turned = pin.log3(one.rotation @ other.rotation.T)
        np.testing.assert_allclose(moved, np.append(one.translation - other.translation, turned) / (2 * h), atol=1e-8)


def test_a_cart_turns_about_the_mean_of_its_joints():
    robot = gtpin.load_robot("gantry_tau")
    kinematics = gtpin.Model(gtpin.Geometry.nominal(robot)).kinematics
    q = np.tile(robot.home_q, (2, 1))
    at = OperatingPoints(kinematics, q, kinematics.forward(q), {"a": np.ones(2)})
    both = DriverEffect([DriverColumn("a", 0.0, 1.0)], [Driver("a", "cart2", m, 1e-3) for m in ("y", "rz")])
    moved = seats.rates(at, both.basis(at, "cart2"))
    rods = [i for i, rod in enumerate(robot.rods) if rod.carrier == robot.sites.index("cart2")]
    C = at.carrier_joints[:, rods]
    up = np.cross([0.0, 0.0, 1.0], C - C.mean(axis=1, keepdims=True))
    np.testing.assert_allclose(moved[:, rods][..., 0], np.broadcast_to([0.0, 1.0, 0.0], C.shape), atol=1e-14)
    np.testing.assert_allclose(moved[:, rods][..., 2], up, atol=1e-14)
    others = np.delete(moved, rods, axis=1)
    assert not others.any()


@pytest.mark.parametrize(
    ("site", "motion", "words"),
    [
        ("link2a", "x", r"site.*sites are cart1, cart2, cart3, pl"),
        ("platform", "q", "motion"),
        ("frame", "q", "motion"),
    ],
)
def test_a_site_that_can_t_move_so_is_refused_before_the_work(site, motion, words):
    data = replace(measured("gantry_tau"), drivers=(Driver("tilt_x", site, motion, 1e-4),))
    with pytest.raises(DatasetError, match=rf"driver\.0\.{words}"):
        gtpin.diagnose(data)
