"""The robot that a dataset names, with the dataset's actuators and TCP, and whether a model is of this robot.

The parts that the dataset names are checked.
"""

from __future__ import annotations

from pathlib import Path

from gtpin.data import Dataset
from gtpin.errors import DatasetError, ModelError, RobotError, listed
from gtpin.robot.chain import Chain
from gtpin.robot.library import load_robot

PLACES = ("platform", "frame")
"""Sites that are no joints and no links."""


def robot_of(dataset: Dataset) -> Chain:
    """Load the robot that a dataset names.

    Raises `RobotError` if the robot's file does not make a robot. `DatasetError` if no robot has the name, or it lacks a
    joint, a link or a site that dataset.toml names.
    """
    file = dataset.toml
    try:
        robot = load_robot(dataset.robot_reference, dataset.tcp, dataset.actuators, dataset.home)
    except RobotError as error:
        if error.file is not None and error.column != "tcp":
            raise
        raise DatasetError(error.what, file=file, column=error.column or "robot", hint=error.hint) from None
    joints = robot.description.tree.moving
    known = (*robot.sites, *robot.rod_sites, *joints, *robot.links, *PLACES)
    for number, driver in enumerate(dataset.drivers):
        if driver.site not in known:
            what, hint = f"{robot.name} has no site {driver.site!r}", f"sites are {listed(tuple(dict.fromkeys(known)))}"
            raise DatasetError(what, file=file, column=f"driver.{number}.site", hint=hint)
        if driver.motion == "q" and driver.site not in (*robot.sites, *joints):
            what, hint = f"{driver.site} is no joint, so it has no q", "move it along x y z or about rx ry rz"
            raise DatasetError(what, file=file, column=f"driver.{number}.motion", hint=hint)
    return robot


def check_same_robot(robot: Chain, dataset: Dataset) -> None:
    """Check that a model is of the robot that a dataset names: every use of a model with measured data begins with this.

    ``robot``: the model's robot. ``dataset``: the measured data.

    Raises `ModelError` if the robots have other names, or other driven joints. `GtpinError` if the robot that the dataset
    names can't be loaded.
    """
    check_alike(robot, robot_of(dataset), "the measured data are", dataset.file, "dataset.toml names")


def check_alike(robot: Chain, other: Chain, whose: str, file: Path | None = None, wanted: str = "is meant") -> None:
    """Raise `ModelError` where a model's robot and another one have other names, or other driven joints.

    ``whose``: what is of the other robot, with its verb, for the message; ``file``: the file of it.
    """
    hint = f"give a model of the robot that {wanted}"
    if robot.name != other.name:
        raise ModelError(f"the model is of {robot.name}, and {whose} of {other.name}", file=file, hint=hint)
    if robot.sites != other.sites:
        what = f"the model of {robot.name} drives {listed(robot.sites)}, and {whose} of one with {listed(other.sites)}"
        raise ModelError(what, file=file, hint=hint)


def measuring(robot: Chain, dataset: Dataset) -> Chain:
    """The robot with the passive joints and the links measured that the dataset's instruments read.

    Raises `DatasetError` for a joint that can't be read, and for a link that is not there; the message says which can.
    """
    tables = dataset.readings.tables
    try:
        return robot.measuring(
            (j for t in tables for j in t.measured_joints), (k for t in tables for k in t.measured_links)
        )
    except RobotError as error:
        known = {*robot.readable, *robot.links}
        read = [(*table.measured_joints, *table.measured_links) for table in tables]
        number = next(i for i, names in enumerate(read) if not known.issuperset(names))
        column = f"instrument.{number}.{error.column}"
        raise DatasetError(error.what, file=dataset.toml, column=column, hint=error.hint) from None
