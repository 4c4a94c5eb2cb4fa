"""Which parameters a robot's geometry has: their names, units, nominal values and tolerances."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from gtpin.errors import ModelError
from gtpin.robot.chain import Chain
from gtpin.robot.rods import Rod
from gtpin.typing import Floats

Kind = Literal["length", "platform_joint", "carrier_joint", "direction", "scale", "placement", "platform", "anchor"]

TOLERANCE: Mapping[str, float] = {
    "link_length": 1e-3,
    "platform_joint": 1e-3,
    "cart_joint": 2e-3,
    "arm_joint": 2e-3,
    "base_joint": 2e-3,
    "track_direction": 1e-3,
    "arm_axis": 1e-3,
    "track_roll": 0.2,
    "scale": 5e-4,
    "placement_position": 5e-4,
    "placement_rotation": 5e-4,
}
"""1-sigma tolerances (m, rad, m/m) by kind, where neither the URDF nor the dataset gives one. Assumed."""
JOINTS = ("platform_joint", "cart_joint", "arm_joint", "base_joint")
KINDS = (*TOLERANCE, *(f"{kind}_{axis}" for kind in JOINTS for axis in "xyz"))
"""Kinds for which a tolerance may be given; for positions of joints also for a single axis, as ``base_joint_z``."""


@dataclass(frozen=True)
class Parameter:
    """One number of the geometry.

    - ``name``: ``length[2a]``, ``track_direction[cart1].a``, ...
    - ``kind``, ``owner``, ``component``: kind of quantity, index of the part that has it, and index of the vector's
      component.
    - ``per``: what ``owner`` is the index of: an actuator, a rod, a Pinocchio joint or a loop's anchor. The first anchor of
      loop i has the index 2 i, its second anchor 2 i + 1.
    - ``unit``: ``m``, ``rad`` or ``m/m``.
    - ``nominal``, ``tolerance``: the URDF's value, and the 1-sigma manufacturing tolerance around it: the prior of a
      calibration.
    """

    name: str
    kind: Kind
    owner: int
    component: int
    per: Literal["actuator", "rod", "joint", "anchor"]
    unit: str
    nominal: float
    tolerance: float


def rotation_axes(direction: Floats) -> Floats:
    """(3, 3) unit vectors, one per row, about which a direction (3,) is rotated by small angles: a, b, and the direction.

    a: the base axis that is least aligned with the direction, projected onto the plane normal to it; b: direction x a.
    """
    least = np.eye(3)[int(np.argmin(np.abs(direction)))]
    a = least - (least @ direction) * direction
    a /= np.linalg.norm(a)
    # The cross product written out: numpy's own is made for arrays, and this is called often.
    (x, y, z), (u, v, w) = direction, a
    return np.array([a, [y * w - z * v, z * u - x * w, x * v - y * u], direction])


def all_tolerances(robot: Chain, override: Mapping[str, float]) -> dict[str, float]:
    """1-sigma tolerances of every kind, m, rad or m/m: the dataset's (``override``), else the robot's, else `TOLERANCE`.

    Raises `ModelError` if a kind is not known.
    """
    for source, given in (("the robot's URDF", robot.tolerance), ("the dataset", override)):
        unknown = sorted(set(given) - set(KINDS))
        if unknown:
            raise ModelError(
                f"{source} gives a tolerance of unknown kind {unknown[0]!r}", hint=f"kinds are {', '.join(TOLERANCE)}"
            )
    found = {**TOLERANCE, **robot.tolerance, **override}
    for kind in JOINTS:
        for axis in (f"{kind}_{axis}" for axis in "xyz"):
            own = robot.tolerance.get(axis, found[kind]) if kind not in override else override[kind]
            found[axis] = override.get(axis, own)
    return found


def _carrier_kind(robot: Chain, rod: Rod) -> str:
    if rod.carrier is None:
        return "base_joint"
    return "arm_joint" if robot.actuators[rod.carrier].revolute else "cart_joint"


def rod_parameters(robot: Chain, tolerances: Mapping[str, float], *, scale: bool) -> list[Parameter]:
    """Parameters of a robot with rods: lengths, joints, directions and scales; only declared unknown ones without ``scale``."""
    found = [
        Parameter(f"length[{rod.name}]", "length", i, 0, "rod", "m", rod.L, tolerances["link_length"])
        for i, rod in enumerate(robot.rods)
    ]
    joints: tuple[tuple[Kind, str], ...] = (("platform_joint", "P"), ("carrier_joint", "C"))
    for kind, point in joints:
        for i, rod in enumerate(robot.rods):
            word = kind if kind == "platform_joint" else _carrier_kind(robot, rod)
            for c, axis in enumerate("xyz"):
                value, name = float(getattr(rod, point)[c]), f"{word}[{rod.name}].{axis}"
                found.append(Parameter(name, kind, i, c, "rod", "m", value, tolerances[f"{word}_{axis}"]))
    for a in sorted({rod.carrier for rod in robot.rods if rod.carrier is not None}):
        word = "arm_axis" if robot.actuators[a].revolute else "track_direction"
        for c, axis in enumerate("ab"):
            name = f"{word}[{robot.sites[a]}].{axis}"
            found.append(Parameter(name, "direction", a, c, "actuator", "rad", 0.0, tolerances[word]))
    for a in sorted({rod.driver for rod in robot.rods if rod.driver is not None}):
        if scale or robot.actuators[a].scale_unknown:
            name = f"scale[{robot.sites[a]}]"
            found.append(Parameter(name, "scale", a, 0, "actuator", "m/m", 1.0, tolerances["scale"]))
    return found


def placement_parameters(robot: Chain, tolerances: Mapping[str, float]) -> list[Parameter]:
    """Parameters of a robot without rods: placements of the joints that move its TCP, of the TCP, and of its loops' anchors.

    Each joint and the TCP have six, each anchor has the three of its position on its link. They are redundant: a deviation that
    the data do not assign to one parameter is divided among several in proportion to their prior variances. The name of an
    anchor has the names of its loop and of its link.
    """
    owners = [(j, f"placement[{robot.model.names[j]}]") for j in robot.moving_joints]
    found = []
    for kind, joint_id, word in [*(("placement", *owner) for owner in owners), ("platform", 0, "platform")]:
        for c, axis in enumerate(("x", "y", "z", "rx", "ry", "rz")):
            unit, size = ("m", "placement_position") if c < 3 else ("rad", "placement_rotation")
            found.append(
                Parameter(f"{word}.{axis}", cast(Kind, kind), joint_id, c, "joint", unit, 0.0, tolerances[size])
            )
    ends = [(loop.name, anchor.link) for loop in robot.description.loops for anchor in (loop.anchor1, loop.anchor2)]
    for owner, (loop, link) in enumerate(ends):
        if robot.leading_anchors[owner] != owner:
            continue
        for c, axis in enumerate("xyz"):
            name = f"anchor[{loop}.{link}].{axis}"
            found.append(Parameter(name, "anchor", owner, c, "anchor", "m", 0.0, tolerances["placement_position"]))
    return found
