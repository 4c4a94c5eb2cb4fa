"""Effects at joints and links of an arm drawn from its tolerances, and of a gantry whose joints slide."""

from pathlib import Path

import numpy as np
from effect_places import covariates

import gtpin
from gtpin.effects.operating_points import Column, OperatingPoints, References
from gtpin.kinematics.chain_kinematics import ChainKinematics
from gtpin.robot.description import RobotDescription

Floats = np.ndarray
ARM_FILE = Path(__file__).parents[2] / "examples" / "effects" / "arm.urdf"
ARM = gtpin.load_robot(ARM_FILE)
MIDDLE, HALF = np.array([0.1, 0.4, 1.2, 0.3, 0.5, 0.2]), np.array([1.5, 0.7, 0.7, 1.0, 1.0, 2.0])


def drawn(robot: gtpin.Robot = ARM, seed: int = 0) -> ChainKinematics:
    nominal = gtpin.Geometry.nominal(robot)
    rng = np.random.default_rng(seed)
    return ChainKinematics(
        nominal.with_values(nominal.values + nominal.tolerance * rng.standard_normal(len(nominal.values)))
    )


KINEMATICS = drawn()


def operating_points(
    count: int = 8,
    seed: int = 0,
    fixed: References | None = None,
    kinematics: ChainKinematics = KINEMATICS,
    without: tuple[str, ...] = (),
    **changed: Column,
) -> OperatingPoints:
    """Commands all over a large part of the range, with everything that an effect may ask for."""
    rng = np.random.default_rng(seed + 1)
    n = kinematics.geometry.robot.n_actuators
    q = MIDDLE[:n] + HALF[:n] * rng.uniform(-1.0, 1.0, (count, n))
    told = {name: v for name, v in ({**covariates(count, n, seed), **changed}).items() if name not in without}
    return OperatingPoints(kinematics, q, kinematics.forward(q), told, fixed)


FIT = operating_points(120, seed=7)
"""What the effects were fitted to, as it were."""


def robot_of(xml: str) -> gtpin.Robot:
    return gtpin.Robot(RobotDescription.parse(xml, "test"))


def beam(length: float, axis: str = "0 0 1", mass: float = 0.0) -> gtpin.Robot:
    """One turning joint at the base's origin that carries a horizontal link along x, tool at its end."""
    inertia = (
        f'<inertial><origin xyz="{length / 2.0} 0 0"/><mass value="{mass}"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    )
    return robot_of(
        '<robot name="beam"><link name="base"/><joint name="hinge" type="revolute"><parent link="base"/>'
        f'<child link="rod"/><axis xyz="{axis}"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        f'<link name="rod">{inertia if mass else ""}</link><joint name="end" type="fixed"><parent link="rod"/>'
        f'<child link="tool0"/><origin xyz="{length} 0 0"/></joint><link name="tool0"/></robot>'
    )
