"""``gtpin robots``: the robots that can be given by name."""

from __future__ import annotations

import warnings
from typing import Annotated, Any

import typer
from rich.table import Table

from gtpin.commands.terminal import AsJson, rendered, tell
from gtpin.errors import GtpinWarning, RobotError
from gtpin.robot.library import ARMS, PACKAGE, example_names, load_robot, robot_names


def robots(
    every: Annotated[bool, typer.Option("--all", help="All of example-robot-data, not only its arms.")] = False,
    as_json: AsJson = False,
) -> None:
    """List the robots that can be given by name: those that gtpin ships, and the arms of example-robot-data."""
    shipped = robot_names()
    others = [name for name in example_names() if name not in shipped]
    listed = [name for name in others if every or as_json or name in ARMS]
    found = [_described(name, "gtpin" if name in shipped else PACKAGE) for name in (*shipped, *listed)]
    table = Table("name", "joints", "TCP", "source", box=None, pad_edge=False)
    for robot in found:
        if robot["loads"]:
            table.add_row(robot["name"], str(len(robot["joints"])), robot["tcp"], robot["source"])
    notes = [f"{robot['name']} can't be loaded: {robot['reason']}" for robot in found if not robot["loads"]]
    if rest := [name for name in others if name not in listed]:
        notes.append(f"\nAlso by name (gtpin robots --all shows them): {', '.join(rest)}")
    tell(found, rendered(table, *notes), as_json)


def _described(name: str, source: str) -> dict[str, Any]:
    """The row of the list for a robot; ``joints`` are those that its commands q1, q2, ... move."""
    try:
        with warnings.catch_warnings():  # the list has the TCP that would be taken
            warnings.simplefilter("ignore", GtpinWarning)
            robot = load_robot(name)
    except RobotError as error:
        return {"name": name, "source": source, "loads": False, "joints": [], "tcp": None, "reason": error.what}
    joints = [actuator.joint for actuator in robot.actuators]
    return {"name": name, "source": source, "loads": True, "joints": joints, "tcp": robot.tcp_frame, "reason": None}
