"""The robots that gtpin ships, by name; any other by the path of its URDF."""

from __future__ import annotations

from pathlib import Path

from gtpin.errors import RobotError
from gtpin.robot.robot import Robot


def _folder() -> Path:
    inside = Path(__file__).parents[1] / "urdf"  # in a wheel
    return inside if inside.is_dir() else Path(__file__).parents[2] / "urdf"  # in a checkout


def robot_names() -> tuple[str, ...]:
    """Names of the shipped robots, sorted.

    Examples
    --------
    >>> import gtpin
    >>> "gantry_tau" in gtpin.robot_names()
    True
    """
    return tuple(sorted(path.stem for path in _folder().glob("*.urdf")))


def urdf_path(name: str) -> Path:
    """Path of a shipped robot's URDF.

    Raises
    ------
    RobotError
        If no shipped robot has that name.
    """
    if name not in robot_names():
        raise RobotError(
            f"no robot is called {name!r}", hint=f"use {', '.join(robot_names())}, or the path of a URDF file"
        )
    return _folder() / f"{name}.urdf"


def load_robot(robot: str | Path, tcp: str | None = None) -> Robot:
    """Load a robot by its name or by the path of its URDF.

    Parameters
    ----------
    robot
        The name of a shipped robot, or a path (anything that ends in ``.urdf`` or contains a separator).
    tcp
        The link whose pose is the robot's pose, where it is not the one that the URDF names.

    Raises
    ------
    RobotError
        If there is no such robot, or its URDF is not a valid robot.

    Examples
    --------
    >>> import gtpin
    >>> gtpin.load_robot("gantry_tau").sites
    ('cart1', 'cart2', 'cart3')
    """
    text = str(robot)
    if isinstance(robot, Path) or text.endswith(".urdf") or "/" in text or "\\" in text:
        return Robot.from_urdf(text, tcp)
    return Robot.from_urdf(urdf_path(text), tcp)
