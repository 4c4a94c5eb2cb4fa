"""The machines, as gtpin loads them and as the tests' own closures."""

import closures as own
import machines
import pytest
from closures import Closures
from loaded_machines import load

import gtpin
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.robot.description import RobotDescription

NAMES = ("gantry_tau", *machines.MAKERS)


@pytest.fixture(scope="session")
def gantry() -> Closures:
    """The Gantry-Tau's closures, read from the shipped URDF by the tests."""
    return own.nominal("gantry_tau")


@pytest.fixture(scope="session")
def robot() -> gtpin.Robot:
    """The Gantry-Tau."""
    return gtpin.load_robot("gantry_tau")


@pytest.fixture(scope="session")
def at_home(robot: gtpin.Robot) -> gtpin.ClosedPosture:
    """The Gantry-Tau at home."""
    return gtpin.home(robot)


@pytest.fixture(scope="session")
def arrays(robot: gtpin.Robot) -> RodKinematics:
    """The nominal Gantry-Tau's closures in arrays."""
    return RodKinematics(gtpin.Geometry.nominal(robot))


@pytest.fixture(scope="session", params=NAMES)
def machine(request: pytest.FixtureRequest, gantry: Closures) -> Closures:
    """Each of the parallel machines."""
    return gantry if request.param == "gantry_tau" else machines.MAKERS[request.param]()


@pytest.fixture(scope="session")
def loaded(machine: Closures) -> gtpin.Robot:
    """The same machine as gtpin loads it."""
    return load(machine)


@pytest.fixture(scope="session")
def closures(loaded: gtpin.Robot) -> RodKinematics:
    """Its closures in arrays, with every parameter that there is."""
    return RodKinematics(gtpin.Geometry.nominal(loaded, scale="actuator"))


FOUR_BAR = """<robot name="four_bar">
  <link name="base"/><link name="crank"/><link name="coupler"/><link name="rocker"/>
  <joint name="turn" type="continuous"><parent link="base"/><child link="crank"/><axis xyz="0 0 1"/></joint>
  <joint name="elbow" type="continuous"><parent link="crank"/><child link="coupler"/>
    <origin xyz="0.2 0 0" rpy="0 0 1.025"/><axis xyz="0 0 1"/></joint>
  <joint name="swing" type="continuous"><parent link="base"/><child link="rocker"/>
    <origin xyz="0.6 0 0" rpy="0 0 1.889"/><axis xyz="0 0 1"/></joint>
  <loop_joint name="pin" type="spherical"><link1 link="coupler" xyz="0.5 0 0"/>
    <link2 link="rocker" xyz="0.45 0 0"/></loop_joint>
  <gtpin><actuator joint="turn" site="crank"/><platform link="rocker"/></gtpin>
</robot>"""


@pytest.fixture(scope="session")
def four_bar() -> gtpin.Robot:
    """A planar crank and rocker (0.2, 0.5, 0.45 m on a base of 0.6 m); the crank turns round and round."""
    return gtpin.Robot(RobotDescription.parse(FOUR_BAR))
