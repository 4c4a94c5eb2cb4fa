"""The shipped Gantry-Tau is the machine of Table II, model 3, of Dressler, Brogardh and Robertsson, ICRA 2010."""

import tomllib
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from single_postures import Single

import gtpin
from gtpin.robot.library import urdf_path

RODS = ("1", "2a", "2b", "3a", "3b", "3c")
CARTS = (1, 2, 2, 3, 3, 3)
PRINTED = Path(__file__).parents[2] / "examples" / "dressler2010" / "paper_tables.toml"
TABLE = tomllib.loads(PRINTED.read_text(encoding="utf-8"))["table2"]["model3"]
LENGTH, PLATFORM, CART, PER_LINK = (TABLE[key] for key in ("length", "platform_joint", "offset", "direction"))
HOME_T = [-1.30463238, -4.25858892, 0.02731677]
HOME_ROTVEC = [-1.75779449, 0.09855017, -0.04572403]


@pytest.fixture(scope="module")
def robot() -> gtpin.Robot:
    return gtpin.load_robot("gantry_tau")


@pytest.fixture(scope="module")
def root() -> ElementTree.Element:
    return ElementTree.parse(urdf_path("gantry_tau")).getroot()


def test_plain_pinocchio_loads_it_with_a_tree_of_21_freedoms() -> None:
    model = pin.buildModelFromUrdf(str(urdf_path("gantry_tau")))
    assert model.nv == 21
    assert model.nq == 22


def test_yourdfpy_loads_and_validates_it() -> None:
    other = yourdfpy.URDF.load(str(urdf_path("gantry_tau")))
    assert other.validate()
    assert "platform" in other.link_map


def test_it_has_18_constraint_rows_and_3_freedoms_left(robot: gtpin.Robot) -> None:
    posture = gtpin.home(robot).moved_to([0.1, -0.2, 0.3])
    assert robot.model.nv == 21
    assert posture.constraint_jacobian.shape == (18, 21)
    assert np.linalg.matrix_rank(posture.constraint_jacobian) == 18
    assert robot.n_actuators == 3


def test_links_and_sites_have_the_names_of_the_contract(robot: gtpin.Robot, root: ElementTree.Element) -> None:
    links = {link.get("name") for link in root.findall("link")}
    assert {"base", "cart1", "cart2", "cart3", "platform", *(f"link{rod}" for rod in RODS)} <= links
    assert robot.sites == ("cart1", "cart2", "cart3")
    assert robot.rod_sites == tuple(f"link{rod}" for rod in RODS)
    assert tuple(rod.name for rod in robot.rods) == RODS
    assert "gantry_tau" in gtpin.robot_names()


def test_the_loops_are_isaac_sims_elements(root: ElementTree.Element) -> None:
    loops = root.findall("loop_joint")
    assert len(loops) == 6
    for loop in loops:
        assert loop.get("type") == "spherical"
        for tag in ("link1", "link2"):
            end = loop.find(tag)
            assert end is not None
            assert {"link", "xyz", "rpy"} <= set(end.attrib)


def test_lengths_and_joints_are_the_papers(robot: gtpin.Robot) -> None:
    np.testing.assert_allclose([rod.L for rod in robot.rods], LENGTH, rtol=0, atol=1e-12)
    np.testing.assert_allclose([rod.P for rod in robot.rods], PLATFORM, rtol=0, atol=1e-12)
    np.testing.assert_allclose([rod.C for rod in robot.rods], CART, rtol=0, atol=1e-12)
    assert tuple(rod.carrier for rod in robot.rods) == tuple(cart - 1 for cart in CARTS)


def test_track_directions_are_unit_vectors_along_the_means_of_the_papers(robot: gtpin.Robot) -> None:
    """The mean over a cart's links, to the five digits in which the machine's numbers are given, then normalised."""
    for k, actuator in enumerate(robot.actuators):
        mean = np.mean([v for v, cart in zip(PER_LINK, CARTS, strict=True) if cart == k + 1], axis=0)
        assert np.linalg.norm(actuator.axis) == pytest.approx(1.0, abs=1e-14)
        np.testing.assert_allclose(actuator.axis, mean / np.linalg.norm(mean), rtol=0, atol=1e-5)
    table = np.array([[0.99773, -0.06636, -0.00544], [0.99752, -0.06586, -0.00553], [0.99768, -0.06601, -0.00510]])
    table /= np.linalg.norm(table, axis=1, keepdims=True)
    np.testing.assert_allclose([actuator.axis for actuator in robot.actuators], table, rtol=0, atol=1e-12)


def test_the_zero_configuration_is_home_and_closes_to_rounding(robot: gtpin.Robot) -> None:
    neutral = pin.neutral(robot.model)
    assert np.abs(Single(robot, np.zeros(3), neutral).gaps).max() <= 1e-14 * robot.size
    posture = gtpin.home(robot)
    np.testing.assert_allclose(posture.configuration, neutral, rtol=0, atol=1e-15)
    np.testing.assert_allclose(posture.T, HOME_T, rtol=0, atol=1e-8)
    np.testing.assert_allclose(pin.log3(posture.R), HOME_ROTVEC, rtol=0, atol=1e-8)
    np.testing.assert_array_equal(robot.home_q, [0, 0, 0])


def test_ranges_gravity_and_tolerances_are_the_machines(robot: gtpin.Robot) -> None:
    np.testing.assert_array_equal(robot.lower, [-0.65] * 3)
    np.testing.assert_array_equal(robot.upper, [0.7] * 3)
    assert not robot.revolute.any()
    np.testing.assert_array_equal(robot.model.gravity.linear, [0, 0, -9.81])
    told = {"link_length": 1e-3, "platform_joint": 1e-3, "cart_joint": 2e-3, "track_direction": 1e-3}
    assert told.items() <= robot.tolerance.items()


def test_plate_and_links_have_their_masses(robot: gtpin.Robot) -> None:
    plate = robot.model.inertias[robot.tcp_joint]
    assert plate.mass == 22.0
    np.testing.assert_allclose(robot.tcp_placement.actInv(plate.lever), [-0.09, 0, 0.02], atol=1e-15)
    for rod, length in zip(RODS, LENGTH, strict=True):
        inertia = robot.model.inertias[robot.model.getJointId(f"link{rod}_yaw")]
        assert inertia.mass == 4.1
        np.testing.assert_allclose(inertia.lever, [0, 0, length / 2.0], rtol=0, atol=1e-12)
        # A thin rod about its middle.
        assert inertia.inertia[0, 0] == pytest.approx(4.1 * length**2 / 12.0, rel=1e-3)
    for k in (1, 2, 3):
        assert robot.model.inertias[robot.model.getJointId(f"track{k}")].mass > 0.0


def test_every_body_is_seen_in_a_viewer(root: ElementTree.Element) -> None:
    shapes = {"box", "cylinder", "sphere"}
    for name in ("base", "cart1", "cart2", "cart3", "platform", *(f"link{rod}" for rod in RODS)):
        link = next(link for link in root.findall("link") if link.get("name") == name)
        geometries = link.findall("visual/geometry")
        assert geometries, name
        assert all(geometry[0].tag in shapes for geometry in geometries)  # no meshes to be missed


def test_a_rods_shape_lies_between_its_joints(robot: gtpin.Robot, root: ElementTree.Element) -> None:
    for rod, length in zip(RODS, LENGTH, strict=True):
        link = next(link for link in root.findall("link") if link.get("name") == f"link{rod}")
        origin, cylinder = link.find("visual/origin"), link.find("visual/geometry/cylinder")
        assert origin is not None
        assert cylinder is not None
        middle, extent = float(origin.get("xyz", "").split()[2]), float(cylinder.get("length", "0"))
        assert middle - extent / 2.0 >= 0.0
        assert middle + extent / 2.0 <= length


def test_joint_limits_leave_room_over_the_whole_range(robot: gtpin.Robot) -> None:
    posture = gtpin.home(robot)
    for q in np.random.default_rng(1).uniform(robot.lower, robot.upper, (100, 3)):
        configuration = posture.moved_to(q).configuration
        low, high = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
        joints = [i for i in range(1, robot.model.njoints) if robot.model.nqs[i] == 1]
        index = [int(robot.model.idx_qs[i]) for i in joints]
        assert (configuration[index] >= low[index] - 1e-12).all()
        assert (configuration[index] <= high[index] + 1e-12).all()
