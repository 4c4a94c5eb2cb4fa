"""Robots without rods, with masses: an arm, and loops (planar upright, planar level, spatial, a parallelogram); their plants,
and that of the Gantry-Tau."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from urdfs import joint, loop, own, urdf

import gtpin
from gtpin.bench.simulator.arm import Arm
from gtpin.bench.simulator.build import drawn_machine, known_robot
from gtpin.bench.simulator.causes.kinds import PlantedCause
from gtpin.bench.simulator.causes.kinds import kind as kind_of
from gtpin.bench.simulator.noncentrality import Response
from gtpin.bench.simulator.recipe import SimulatedConditions
from gtpin.bench.simulator.visits import plan
from gtpin.robot.chain import Chain
from gtpin.robot.description import RobotDescription

FIVE_BAR = Path(__file__).parents[3] / "examples" / "loops" / "five_bar.urdf"
INERTIA = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'


def hinge(name: str, parent: str, child: str, xyz: str, axis: str, mass: float, centre: str, **more: Any) -> str:
    """A joint and its link, with a mass."""
    turn = more.pop("turn", "0 0 0")
    body = f'<inertial><origin xyz="{centre}" rpy="{turn}"/><mass value="{mass}"/>{INERTIA}</inertial>'
    return joint(name, parent, child, xyz, axis, body=body, **{"limit": 0.6, **more})


def level() -> str:
    """The five-bar laid down: gravity acts across its plane."""
    return FIVE_BAR.read_text(encoding="utf-8").replace("<gtpin>", '<gtpin><gravity xyz="0 9.81 0"/>')


def spatial() -> str:
    """A crank, a coupler that hangs on it by a universal joint, and a rocker to which a ball joint leads: one command."""
    return urdf(
        "rusr",
        hinge("crank_joint", "base", "crank", "0 0 0", "0 0 1", 1.0, "0.1 0 0"),
        hinge("cross_joint", "crank", "cross", "0.2 0 0", "0 0 1", 0.2, "0 0 0", rpy="0 0 1.0"),
        hinge("coupler_joint", "cross", "coupler", "0 0 0", "0 1 0", 0.8, "0.25 0.01 0"),
        hinge("rocker_joint", "base", "rocker", "0.6 0 0", "0 0 1", 1.1, "0.2 0 0.02", rpy="0.3 0 1.9"),
        joint("flange", "rocker", "tool0", "0.5 0.1 0", kind="fixed"),
        loop("coupler", "0.5 0 0", "rocker", "0.45 0 0", "ball"),
        own(["crank_joint"], "tool0"),
    )


def parallelogram() -> str:
    """A column that turns; on it a parallelogram that keeps its plate level; on the plate an elbow."""
    return urdf(
        "parallelogram",
        hinge("waist", "base", "column", "0 0 0", "0 0 1", 4.0, "0 0.05 0.2"),
        hinge("shoulder", "column", "crank", "0.1 0 0.3", "0 1 0", 2.0, "0 0.02 0.25"),
        hinge("follow", "column", "rocker", "-0.1 0 0.3", "0 1 0", 0.8, "0 0 0.25"),
        hinge("top", "crank", "plate", "0 0 0.5", "0 1 0", 1.5, "0 0 0.05"),
        hinge("elbow", "plate", "wrist", "0.1 0 0.1", "0 1 0", 1.0, "0.2 0.03 0"),
        joint("flange", "wrist", "tool0", "0.4 0 0", kind="fixed"),
        loop("plate", "-0.2 0 0", "rocker", "0 0 0.5"),
        own(["waist", "shoulder", "elbow"]),
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
    parts, parent = [], "base"
    for name, kind, xyz, rpy, axis, mass, centre, limit in JOINTS:
        more = {"kind": kind, "rpy": rpy, "limit": limit, "turn": "0.3 0 0"}
        parts.append(hinge(name, parent, f"{name}_link", xyz, axis, mass, centre, **more))
        parent = f"{name}_link"
    parts.append(hinge("f", parent, "bracket", "0 0.05 0", "", 0.5, "0 0.01 0", kind="fixed", rpy="0 0 1"))
    parts.append(joint("t", "bracket", "tool0", "0 0 0.1", kind="fixed"))
    return urdf("seven", *parts, own([row[0] for row in JOINTS], "tool0"))


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


def cause(robot: str, effect: str, site: str, seed: int = 0) -> PlantedCause:
    """An error of a machine of a robot."""
    parts = plant_robot(robot)
    return kind_of(effect, parts).at(parts, site, np.random.default_rng(seed))
