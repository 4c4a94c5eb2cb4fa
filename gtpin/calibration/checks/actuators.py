"""Whether the commands of a dataset are as many as the robot has actuators."""

from __future__ import annotations

from gtpin.data import Dataset
from gtpin.errors import DatasetError
from gtpin.robot.robot import Robot


def check_actuators(robot: Robot, dataset: Dataset) -> None:
    """Check that a dataset has a command for each actuator of its robot.

    Raises `DatasetError` if the number of its commands is not the number of actuators.
    """
    if dataset.n_actuators != robot.n_actuators:
        raise DatasetError(
            f"{_counted(dataset.n_actuators, 'command')} a pose, but {robot.name} has "
            + _counted(robot.n_actuators, "actuator"),
            file=dataset.file,
            hint=f"give {'q1' if robot.n_actuators == 1 else f'q1 .. q{robot.n_actuators}'} ({', '.join(robot.sites)})"
            + (
                ", or name those that were commanded: actuators = [...]"
                if dataset.n_actuators < robot.n_actuators
                else ""
            ),
        )


def _counted(count: int, thing: str) -> str:
    return f"{count} {thing}{'s' if count != 1 else ''}"
