"""``gtpin robots``: the robots that can be given by name."""

from __future__ import annotations

import warnings
from typing import Any

from rich.table import Table

from gtpin.commands.terminal import AsJson, rendered, tell
from gtpin.errors import GtpinWarning, RobotError
from gtpin.robot.examples import PACKAGE, example_names
from gtpin.robot.library import load_robot, robot_names


def robots(as_json: AsJson = False) -> None:
    """List the robots that can be given by name: those that gtpin ships, and those of example-robot-data."""
    shipped = robot_names()
    found = [_described(name, "gtpin") for name in shipped]
    found += [_described(name, PACKAGE) for name in example_names() if name not in shipped]
    table = Table("name", "joints", "TCP", "source", box=None, pad_edge=False)
    for robot in found:
        if robot["loads"]:
            table.add_row(robot["name"], str(len(robot["joints"])), robot["tcp"], robot["source"])
    lost = [f"{robot['name']} can't be loaded: {robot['reason']}" for robot in found if not robot["loads"]]
    tell(found, rendered(table, *lost), as_json)


def _described(name: str, source: str) -> dict[str, Any]:
    """The row of the list for a robot; ``joints`` are those that its commands q1, q2, ... move."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", GtpinWarning)  # of a list, nothing is computed
            robot = load_robot(name)
    except RobotError as error:
        return {"name": name, "source": source, "loads": False, "joints": [], "tcp": None, "reason": error.what}
    joints = [actuator.joint for actuator in robot.actuators]
    return {"name": name, "source": source, "loads": True, "joints": joints, "tcp": robot.tcp_frame, "reason": None}
