"""An arm of six turning joints and a sliding one, with a gripper that mimics, in skew places, of known masses."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

import gtpin
from gtpin.bench.simulator.arm import Arm
from gtpin.bench.simulator.arm_machine import ArmMachine
from gtpin.bench.simulator.recipe import Conditions
from gtpin.bench.simulator.response import Response
from gtpin.bench.simulator.visits import plan
from gtpin.robot.description import RobotDescription

JOINTS = (
    ("pan", "revolute", "0 0 0.3", "0 0 0.2", "0 0 1", 7.0, "0 0.02 0.1", 2.9),
    ("slide", "prismatic", "0 0 0.1", "0.1 0 0", "0 0 -1", 2.0, "0 0 0", 0.2),
    ("shoulder", "revolute", "0 0.1 0.2", "0 1.2 0", "0 1 0", 6.0, "0 0 0.25", 2.0),
    ("elbow", "revolute", "0 -0.05 0.45", "0 0.1 -0.2", "0 1 0.1", 3.0, "0.01 0 0.2", 2.0),
    ("wrist1", "revolute", "0 0 0.4", "0 0.3 0", "0 1 0", 1.2, "0 0.05 0", 2.5),
    ("wrist2", "revolute", "0 0.1 0", "0.4 0 0", "0 0 1", 1.1, "0 0 0.04", 2.5),
    ("wrist3", "revolute", "0 0 0.1", "0 0 0", "0 -1 0", 0.4, "0 0.02 0", 2.9),
)


def urdf() -> str:
    """The arm's URDF."""
    parts, parent = ['<link name="base"/>'], "base"
    for name, kind, xyz, rpy, axis, mass, centre, limit in JOINTS:
        parts.append(
            f'<link name="{name}_link"><inertial><origin xyz="{centre}" rpy="0.3 0 0"/><mass value="{mass}"/>'
            '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}_link"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
            f'<limit lower="{-limit}" upper="{limit}" effort="1" velocity="1"/></joint>'
        )
        parent = f"{name}_link"
    parts.append(
        '<link name="bracket"><inertial><mass value="0.5"/><origin xyz="0 0.01 0"/>'
        '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="f" type="fixed"><parent link="wrist3_link"/><child link="bracket"/>'
        '<origin xyz="0 0.05 0" rpy="0 0 1"/></joint>'
        '<link name="tool0"/><joint name="t" type="fixed"><parent link="bracket"/><child link="tool0"/>'
        '<origin xyz="0 0 0.1"/></joint>'
    )
    named = "".join(f'<actuator joint="{joint[0]}"/>' for joint in JOINTS)
    return f'<robot name="seven">{"".join(parts)}<gtpin>{named}<platform link="tool0"/></gtpin></robot>'


@cache
def nominal() -> tuple[gtpin.Robot, Arm]:
    """The robot as the package has it, and as the plant has it."""
    robot = gtpin.Robot(RobotDescription.parse(urdf()))
    return robot, Arm.of(robot)


def urdf_file(folder: Path) -> Path:
    """The URDF in a file."""
    file = folder / "seven.urdf"
    file.write_text(urdf(), encoding="utf-8")
    return file


def a_plant(conditions: Conditions | None = None, poses: int = 70, seed: int = 0) -> Response:
    """A machine drawn from the tolerances on its way through a day."""
    rng = np.random.default_rng(seed)
    machine = ArmMachine.draw(nominal()[1], rng)
    conditions = conditions or Conditions(sessions=3, push=30.0, payloads=(0.0, 2.0, 4.0), warming=1.5)
    return Response(machine, plan(machine, poses, 10, conditions, rng), np.array([1.5, -4.0, 0.3]))
