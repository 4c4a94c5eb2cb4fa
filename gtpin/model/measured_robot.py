"""The robot that a dataset names, with the dataset's actuators and TCP; the parts that the dataset names are checked."""

from __future__ import annotations

from pathlib import Path

from gtpin.data import Dataset
from gtpin.errors import DatasetError, RobotError
from gtpin.robot.library import load_robot
from gtpin.robot.measured_joints import readable
from gtpin.robot.robot import Robot

PLACES = ("platform", "frame")
"""Sites that are no joints and no links."""


def robot_of(dataset: Dataset) -> Robot:
    """Load the robot that a dataset names.

    Raises
    ------
    RobotError
        If the robot's file does not make a robot.
    DatasetError
        If no robot has the name, or it lacks a joint, a link or a site that dataset.toml names.
    """
    file = None if dataset.path is None else dataset.path / "dataset.toml"
    try:
        robot = load_robot(dataset.robot_reference, None, dataset.actuators)
    except RobotError as error:
        if error.file is not None:
            raise
        raise DatasetError(error.what, file=file, column=error.column or "robot", hint=error.hint) from None
    if dataset.tcp is not None:
        if dataset.tcp not in robot.links:
            what, hint = f"{robot.name} has no link {dataset.tcp!r}", f"links are {_some(robot.links)}"
            raise DatasetError(what, file=file, column="tcp", hint=hint)
        robot = Robot(robot.description, dataset.tcp)
    _check_drivers(dataset, robot, file)
    return robot


def measuring(robot: Robot, dataset: Dataset) -> Robot:
    """The robot with the passive joints measured that the dataset's instruments read.

    Raises
    ------
    DatasetError
        For a joint that can't be read; the message says which can.
    """
    tables = () if dataset.readings is None else dataset.readings.tables
    try:
        return robot.measuring(joint for table in tables for joint in table.measured_joints)
    except RobotError as error:
        number = next(i for i, table in enumerate(tables) if not _all_readable(robot, table.measured_joints))
        toml = None if dataset.path is None else dataset.path / "dataset.toml"
        raise DatasetError(error.what, file=toml, column=f"instrument.{number}.joint", hint=error.hint) from None


def _all_readable(robot: Robot, joints: tuple[str, ...]) -> bool:
    return set(joints) <= set(readable(robot))


def _check_drivers(dataset: Dataset, robot: Robot, file: Path | None) -> None:
    joints = robot.description.tree.moving
    for number, driver in enumerate(dataset.drivers):
        known = (*robot.sites, *robot.rod_sites, *joints, *robot.links, *PLACES)
        if driver.site not in known:
            what, hint = f"{robot.name} has no site {driver.site!r}", f"sites are {_some(tuple(dict.fromkeys(known)))}"
            raise DatasetError(what, file=file, column=f"driver.{number}.site", hint=hint)
        if driver.motion == "q" and driver.site not in (*robot.sites, *joints):
            what, hint = f"{driver.site} is no joint, so it has no q", "move it along x y z or about rx ry rz"
            raise DatasetError(what, file=file, column=f"driver.{number}.motion", hint=hint)


def _some(names: tuple[str, ...], shown: int = 20) -> str:
    return ", ".join(names[:shown]) + (" ..." if len(names) > shown else "")
