"""Robots without rods, with masses: an arm, and loops (planar upright, planar level, spatial, a parallelogram); their plants,
and that of the Gantry-Tau."""

from functools import cache
from pathlib import Path

import numpy as np

import gtpin
from gtpin.bench.simulator.arm import Arm
from gtpin.bench.simulator.build import drawn_machine, known_robot
from gtpin.bench.simulator.causes.cause import Cause
from gtpin.bench.simulator.causes.kinds import kind
from gtpin.bench.simulator.noncentrality import Response
from gtpin.bench.simulator.recipe import SimulatedConditions
from gtpin.bench.simulator.visits import plan
from gtpin.robot.chain import Chain
from gtpin.robot.description import RobotDescription

FIVE_BAR = Path(__file__).parents[3] / "examples" / "loops" / "five_bar.urdf"
INERTIA = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'


def _link(name: str, mass: float, centre: str, rpy: str = "0 0 0") -> str:
    at = f'<origin xyz="{centre}" rpy="{rpy}"/>'
    return f'<link name="{name}"><inertial>{at}<mass value="{mass}"/>{INERTIA}</inertial></link>'


def _fixed(name: str, parent: str, child: str, xyz: str, rpy: str = "0 0 0") -> str:
    return (
        f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/></joint>'
    )


def _hinge(
    name: str, parent: str, child: str, xyz: str, rpy: str, axis: str, kind: str = "revolute", limit: float = 0.6
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
        f'<limit lower="{-limit}" upper="{limit}" effort="1" velocity="1"/></joint>'
    )


def level() -> str:
    """The five-bar laid down: gravity acts across its plane."""
    return FIVE_BAR.read_text(encoding="utf-8").replace("<gtpin>", '<gtpin><gravity xyz="0 9.81 0"/>')


def spatial() -> str:
    """A crank, a coupler that hangs on it by a universal joint, and a rocker to which a ball joint leads: one command."""
    return (
        '<robot name="rusr"><link name="base"/>'
        + _link("crank", 1.0, "0.1 0 0")
        + _link("cross", 0.2, "0 0 0")
        + _link("coupler", 0.8, "0.25 0.01 0")
        + _link("rocker", 1.1, "0.2 0 0.02")
        + _hinge("crank_joint", "base", "crank", "0 0 0", "0 0 0", "0 0 1")
        + _hinge("cross_joint", "crank", "cross", "0.2 0 0", "0 0 1.0", "0 0 1")
        + _hinge("coupler_joint", "cross", "coupler", "0 0 0", "0 0 0", "0 1 0")
        + _hinge("rocker_joint", "base", "rocker", "0.6 0 0", "0.3 0 1.9", "0 0 1")
        + '<loop_joint name="ball" type="spherical"><link1 link="coupler" xyz="0.5 0 0"/>'
        '<link2 link="rocker" xyz="0.45 0 0"/></loop_joint><link name="tool0"/>'
        + _fixed("flange", "rocker", "tool0", "0.5 0.1 0")
        + '<gtpin><actuator joint="crank_joint"/><platform link="tool0"/></gtpin></robot>'
    )


def parallelogram() -> str:
    """A column that turns; on it a parallelogram that keeps its plate level; on the plate an elbow."""
    return (
        '<robot name="parallelogram"><link name="base"/>'
        + _link("column", 4.0, "0 0.05 0.2")
        + _link("crank", 2.0, "0 0.02 0.25")
        + _link("rocker", 0.8, "0 0 0.25")
        + _link("plate", 1.5, "0 0 0.05")
        + _link("wrist", 1.0, "0.2 0.03 0")
        + _hinge("waist", "base", "column", "0 0 0", "0 0 0", "0 0 1")
        + _hinge("shoulder", "column", "crank", "0.1 0 0.3", "0 0 0", "0 1 0")
        + _hinge("follow", "column", "rocker", "-0.1 0 0.3", "0 0 0", "0 1 0")
        + _hinge("top", "crank", "plate", "0 0 0.5", "0 0 0", "0 1 0")
        + _hinge("elbow", "plate", "wrist", "0.1 0 0.1", "0 0 0", "0 1 0")
        + '<link name="tool0"/>'
        + _fixed("flange", "wrist", "tool0", "0.4 0 0")
        + '<loop_joint name="pin" type="spherical"><link1 link="plate" xyz="-0.2 0 0"/><link2 link="rocker" xyz="0 0 0.5"/>'
        '</loop_joint><gtpin><actuator joint="waist"/><actuator joint="shoulder"/><actuator joint="elbow"/></gtpin></robot>'
    )


JOINTS = (
    ("pan", "revolute", "0 0 0.3", "0 0 0.2", "0 0 1", 7.0, "0 0.02 0.1", 2.9),
    ("slide", "prismatic", "0 0 0.1", "0.1 0 0", "0 0 -1", 2.0, "0 0 0", 0.2),
    ("shoulder", "revolute", "0 0.1 0.2", "0 1.2 0", "0 1 0", 6.0, "0 0 0.25", 2.0),
    ("elbow", "revolute", "0 -0.05 0.45", "0 0.1 -0.2", "0 1 0.1", 3.0, "0.01 0 0.2", 2.0),
    ("wrist1", "revolute", "0 0 0.4", "0 0.3 0", "0 1 0", 1.2, "0 0.05 0", 2.5),
    ("wrist2", "revolute", "0 0.1 0", "0.4 0 0", "0 0 1", 1.1, "0 0 0.04", 2.5),
    ("wrist3", "revolute", "0 0 0.1", "0 0 0", "0 -1 0", 0.4, "0 0.02 0", 2.9),
)


def seven() -> str:
    """An arm of six turning joints and a sliding one, in skew places."""
    parts, parent = ['<link name="base"/>'], "base"
    for name, moves, xyz, rpy, axis, mass, centre, limit in JOINTS:
        link = f"{name}_link"
        parts += [_link(link, mass, centre, "0.3 0 0"), _hinge(name, parent, link, xyz, rpy, axis, moves, limit)]
        parent = link
    parts += [_link("bracket", 0.5, "0 0.01 0"), _fixed("f", parent, "bracket", "0 0.05 0", "0 0 1")]
    parts += ['<link name="tool0"/>', _fixed("t", "bracket", "tool0", "0 0 0.1")]
    named = "".join(f'<actuator joint="{joint[0]}"/>' for joint in JOINTS)
    return f'<robot name="seven">{"".join(parts)}<gtpin>{named}<platform link="tool0"/></gtpin></robot>'


ROBOTS = {
    "five_bar": lambda: FIVE_BAR.read_text(encoding="utf-8"),
    "level": level,
    "spatial": spatial,
    "parallelogram": parallelogram,
    "seven": seven,
}
LOOPED = tuple(name for name in ROBOTS if name != "seven")


@cache
def nominal(name: str) -> tuple[gtpin.Robot, Arm]:
    """The robot as the package has it, and as the plant has it."""
    robot = gtpin.Robot(RobotDescription.parse(ROBOTS[name]()))
    return robot, Arm.of(robot)


def urdf_file(name: str, folder: Path) -> str:
    """The URDF in a file."""
    file = folder / f"{name}.urdf"
    file.write_text(ROBOTS[name](), encoding="utf-8")
    return str(file)


def plant_robot(name: str) -> Chain | Arm:
    """The robot as the plant has it."""
    return known_robot(name) if name == "gantry_tau" else nominal(name)[1]


@cache
def a_plant(name: str, poses: int = 50, warming: float = 1.5) -> Response:
    """A machine drawn from the tolerances on its way through a day."""
    rng = np.random.default_rng(0)
    machine = drawn_machine(plant_robot(name), rng)
    push, payload = {"gantry_tau": (150.0, 10.0), "seven": (30.0, 2.0)}.get(name, (5.0, 0.5))
    conditions = SimulatedConditions(sessions=3, push=push, payloads=(0.0, payload, 2.0 * payload), warming=warming)
    return Response(machine, plan(machine, poses, 10, conditions, rng), np.array([1.5, -7.0, 0.3]))


def cause(robot: str, effect: str, site: str, seed: int = 0) -> Cause:
    """An error of a machine of a robot."""
    parts = plant_robot(robot)
    return kind(effect, parts).at(parts, site, np.random.default_rng(seed))
