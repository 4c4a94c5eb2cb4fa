"""The machines, as gtpin loads them and as the tests' own closures."""

import machines
import pytest
from closures import Closures, nominal
from loaded_machines import load
from urdfs import joint, loop, own, robot_of

import gtpin
from gtpin.kinematics.kinematics import Kinematics

NAMES = ("gantry_tau", *machines.MAKERS)


@pytest.fixture(scope="session")
def gantry() -> Closures:
    """The Gantry-Tau's closures, read from the shipped URDF by the tests."""
    return nominal("gantry_tau")


@pytest.fixture(scope="session")
def robot() -> gtpin.Robot:
    """The Gantry-Tau."""
    return gtpin.load_robot("gantry_tau")


@pytest.fixture(scope="session")
def at_home(robot: gtpin.Robot) -> gtpin.ClosedPosture:
    """The Gantry-Tau at home."""
    return gtpin.home(robot)


@pytest.fixture(scope="session")
def arrays(robot: gtpin.Robot) -> Kinematics:
    """The nominal Gantry-Tau's closures in arrays."""
    return Kinematics(gtpin.Geometry.nominal(robot))


@pytest.fixture(scope="session", params=NAMES)
def machine(request: pytest.FixtureRequest, gantry: Closures) -> Closures:
    """Each of the parallel machines."""
    return gantry if request.param == "gantry_tau" else machines.MAKERS[request.param]()


@pytest.fixture(scope="session")
def loaded(machine: Closures) -> gtpin.Robot:
    """The same machine as gtpin loads it."""
    return load(machine)


@pytest.fixture(scope="session")
def closures(loaded: gtpin.Robot) -> Kinematics:
    """Its closures in arrays, with every parameter that there is."""
    return Kinematics(gtpin.Geometry.nominal(loaded, scale="actuator"))


@pytest.fixture(scope="session")
def four_bar() -> gtpin.Robot:
    """A planar crank and rocker (0.2, 0.5, 0.45 m on a base of 0.6 m); the crank turns round and round."""
    return robot_of(
        "four_bar",
        joint("turn", "base", "crank", kind="continuous"),
        joint("elbow", "crank", "coupler", "0.2 0 0", kind="continuous", rpy="0 0 1.025"),
        joint("swing", "base", "rocker", "0.6 0 0", kind="continuous", rpy="0 0 1.889"),
        loop("coupler", "0.5 0 0", "rocker", "0.45 0 0"),
        own(["turn"], "rocker"),
    )
