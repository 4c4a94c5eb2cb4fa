"""Sites: the parts of a robot at which effects can act."""

from __future__ import annotations

from gtpin.robot.chain import Chain, MovingLink, moving_links


def actuators(robot: Chain) -> tuple[str, ...]:
    """Sites of all actuators, of robots with and without rods."""
    return robot.sites


def sliding_actuators(robot: Chain) -> tuple[str, ...]:
    """Sites of the actuators that slide a carrier along a track."""
    return tuple(a.site for i, a in enumerate(robot.actuators) if robot.attachments(i) and not a.revolute)


def tracks(robot: Chain) -> tuple[str, ...]:
    """Sites of the actuators of a robot with rods."""
    return () if robot.joint_sites else robot.sites


def joints(robot: Chain) -> tuple[str, ...]:
    """Sites of the joints with an actuator of a robot without rods."""
    return robot.joint_sites


def guided(robot: Chain) -> tuple[str, ...]:
    """Sites of the actuators whose guide or bearing has error motions: joints, and carriers that slide along a track."""
    return joints(robot) or sliding_actuators(robot)


def slides(robot: Chain) -> tuple[str, ...]:
    """Sites of the actuators that slide: of carriers along a track, and of joints of a robot without rods."""
    return (*sliding_actuators(robot), *(site for site in joints(robot) if not turns(robot, site)))


def links(robot: Chain) -> tuple[str, ...]:
    """Sites of the rods."""
    return robot.rod_sites


def loaded_along(robot: Chain) -> tuple[str, ...]:
    """Sites with one load, along a rod or along or about a joint's axis: each rod, or each joint with an actuator."""
    return links(robot) or joints(robot)


def arm_and_links(robot: Chain) -> tuple[str, ...]:
    """``arm`` and each rod. ``arm`` means all rods together. For a robot without rods, its moving links replace the rods."""
    return ("arm", *(robot.rod_sites or (link.name for link in moving_links(robot))))


def links_at(robot: Chain, site: str) -> list[MovingLink]:
    """The moving links at a site of a robot without rods: one link, or all links for ``arm``."""
    return [link for link in moving_links(robot) if site in ("arm", link.name)]


def turns(robot: Chain, site: str) -> bool:
    """Whether a site is an actuator that turns (revolute). False for one that slides (prismatic), and for other sites."""
    return site in robot.sites and robot.actuators[robot.sites.index(site)].revolute


def turning_joint(robot: Chain, site: str) -> bool:
    """Whether a site is a turning joint with an actuator of a robot without rods."""
    return turns(robot, site) and site in joints(robot)


def number(robot: Chain, site: str) -> int:
    """Number of an actuator, 1, 2, ..., as in the names of commands and covariates (``q1``, ``approach1``)."""
    return robot.sites.index(site) + 1
