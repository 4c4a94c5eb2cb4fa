"""Where effects can act on a robot."""

from __future__ import annotations

from gtpin.robot.robot import Robot


def carts(robot: Robot) -> tuple[str, ...]:
    """Sites of the actuators."""
    return robot.sites


def sliding_carts(robot: Robot) -> tuple[str, ...]:
    """Sites of the actuators that slide a carrier along a track."""
    carried = {rod.carrier for rod in robot.rods if rod.carrier is not None}
    return tuple(s for i, s in enumerate(robot.sites) if i in carried and not robot.actuators[i].revolute)


def links(robot: Robot) -> tuple[str, ...]:
    """Sites of the rods."""
    return robot.rod_sites


def arm_and_links(robot: Robot) -> tuple[str, ...]:
    """All rods together, and each."""
    return ("arm", *robot.rod_sites)


def number(robot: Robot, site: str) -> int:
    """Number of an actuator, as covariates count them: 1, 2, ..."""
    return robot.sites.index(site) + 1
