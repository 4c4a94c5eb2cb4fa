"""Robots whose motions and forces are checked: those that gtpin ships, and small ones with followers, planes and redundancy."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from urdfs import joint, loop, own, robot_of

from gtpin.kinematics.robot import Robot, load_robot

Floats = np.ndarray
FIVE_BAR = Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf"
SHIPPED = ("gantry_tau", "gantry_tau_6dof", "linear_delta", "stewart", "stewart_jugglebot", "tau")
INERTIA = '<inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="-0.002" izz="0.04"/>'
MASS = f'<inertial><origin xyz="0.1 0.02 -0.03"/><mass value="2"/>{INERTIA}</inertial>'


def hinge(name: str, parent: str, child: str, xyz: str, axis: str, yaw: float = 0.0, **more: str) -> str:
    return joint(name, parent, child, xyz, axis, rpy=f"0 0 {yaw}", limit=3.0, body=MASS, **more)


def series() -> Robot:
    """z follows y, which follows a; s slides with a, skew."""
    return robot_of(
        "series",
        hinge(
            "z",
            "base",
            "1",
            "0.4 0.1 0.2",
            "0 0 1",
            inside='<mimic joint="y" multiplier="-2" offset="0.1"/>',
            kind="continuous",
        ),
        hinge("y", "1", "2", "0.4 0.1 0.2", "1 0 0", inside='<mimic joint="a" multiplier="0.5" offset="0.2"/>'),
        hinge("a", "2", "3", "0.4 0.1 0.2", "0 1 0"),
        hinge("s", "3", "4", "0.4 0.1 0.2", "1 1 0", inside='<mimic joint="a"/>', kind="prismatic"),
        hinge("b", "4", "5", "0.4 0.1 0.2", "0 0 1"),
    )


def gripper() -> Robot:
    """A four-bar that leans; a finger on its coupler follows a passive joint, and turns against it."""
    return robot_of(
        "gripper",
        hinge("lean", "base", "hand", "0 0 0.2", "1 0 0"),
        hinge("a", "hand", "crank", "0 0 0", "0 0 1", 1.4),
        hinge("b", "crank", "coupler", "0.2 0 0", "0 0 1", -1.2),
        hinge("c", "hand", "rocker", "0.3 0 0", "0 0 1", 1.9),
        hinge("e", "coupler", "finger", "0.1 0.1 0", "0 1 1", inside='<mimic joint="b" multiplier="-1.5"/>'),
        loop("coupler", "0.3 0 0", "rocker", "0.25 0 0"),
        own(["lean", "a"], "finger"),
    )


def geared() -> Robot:
    """A five-bar whose second drive is geared to the first."""
    return robot_of(
        "geared",
        hinge("d1", "base", "left", "-0.1 0 0", "0 0 1", 2.2),
        hinge("e1", "left", "left_far", "0.2 0 0", "0 0 1", -1.44),
        hinge("d2", "base", "right", "0.1 0 0", "0 0 1", 0.94, inside='<mimic joint="d1" multiplier="-0.8"/>'),
        hinge("e2", "right", "right_far", "0.2 0 0", "0 0 1", 1.44),
        loop("left_far", "0.3 0 0", "right_far", "0.3 0 0"),
        own(["d1"], "left_far", '<gravity xyz="0 -9.81 0"/>'),
    )


def parallelogram(pins: int = 1) -> Robot:
    """A column that turns; on it a planar parallelogram, whose pin is beside its plane; on its plate an elbow.

    With a second pin, which holds what the first one holds already.
    """
    ends = [(f"-0.2 {0.01 * k} 0", f"0 {0.01 * k} 0.5") for k in range(pins)]
    return robot_of(
        "parallelogram",
        hinge("waist", "base", "column", "0 0 0", "0 0 1"),
        hinge("shoulder", "column", "crank", "0.1 0 0.3", "0 1 0"),
        hinge("follow", "column", "rocker", "-0.1 0 0.3", "0 1 0"),
        hinge("top", "crank", "plate", "0 0 0.5", "0 1 0"),
        hinge("elbow", "plate", "wrist", "0.1 0 0.1", "0 1 0"),
        joint("flange", "wrist", "tool0", "0.4 0 0", kind="fixed"),
        *(loop("plate", one, "rocker", other, f"pin{k}") for k, (one, other) in enumerate(ends)),
        own(["waist", "shoulder", "elbow"]),
    )


def spinning() -> Robot:
    """A four-bar whose last link, d, ends at its pin, and turns as it likes."""
    return robot_of(
        "spinning",
        hinge("a", "base", "crank", "0 0 0", "0 0 1"),
        hinge("b", "crank", "coupler", "0 0.2 0", "0 0 1"),
        hinge("c", "base", "rocker", "0.3 0 0", "0 0 1"),
        hinge("d", "rocker", "end", "0 0.2 0", "0 0 1"),
        loop("coupler", "0.3 0 0", "end", "0 0 0"),
        own(["a"], "coupler"),
    )


MAKERS: dict[str, Callable[[], Robot]] = {
    **{name: lambda name=name: load_robot(name) for name in (*SHIPPED, "ur5")},
    "five_bar": lambda: load_robot(FIVE_BAR),
    "series": series,
    "gripper": gripper,
    "geared": geared,
    "parallelogram": parallelogram,
    "two_pins": lambda: parallelogram(2),
}


@cache
def made(name: str) -> Robot:
    return spinning() if name == "spinning" else MAKERS[name]()


def motion(robot: Robot, seed: int = 1) -> tuple[Floats, Floats, Floats]:
    """Commands near home, velocities and accelerations."""
    rng, (lower, upper) = np.random.default_rng(seed), robot.ends
    size, n = np.minimum(upper - lower, 2.0), robot.n_actuators
    return (
        robot.home_q + 0.05 * size * rng.uniform(-1, 1, n),
        size * rng.uniform(-1, 1, n),
        size * rng.uniform(-1, 1, n),
    )


POINTS = np.arange(-4, 5)
FIRST = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
SECOND = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])
"""Weights of central differences of eighth order."""
