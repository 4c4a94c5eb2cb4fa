"""Which parameters a robot's geometry has: their names, units, nominal values and tolerances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from gtpin.errors import ModelError
from gtpin.robot.chain import Chain
from gtpin.robot.rods import Rod
from gtpin.typing import Floats

Kind = Literal["length", "platform_joint", "carrier_joint", "direction", "scale", "placement", "platform", "anchor"]
Per = Literal["actuator", "rod"]

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


def rod_parameters(
    robot: Chain,
    tolerances: Mapping[str, float],
    directions: Per,
    scale: Per | None,
    measured: Sequence[bool],
    reduced: bool = False,
) -> list[Parameter]:
    """Parameters of a robot with rods: lengths, joints, directions and, if asked for or declared unknown, scales.

    Rods whose track was measured (``measured``) have no scale. Their measured track is rotated as a whole by three angles: a,
    b, and c about its own direction. Of a ``reduced`` arm the rods of a cart share one length, and their joints on the cart
    move together.
    """
    found = _lengths_and_joints(robot, tolerances, reduced)
    carriers = [(i, rod.carrier) for i, rod in enumerate(robot.rods) if rod.carrier is not None]
    straight = [(i, carrier) for i, carrier in carriers if not measured[i]]
    found += _directions(robot, tolerances, "actuator" if reduced else directions, straight, "ab")
    found += _directions(robot, tolerances, "actuator", [pair for pair in carriers if measured[pair[0]]], "abc")
    if reduced:
        return found + _scales(robot, tolerances, scale and "actuator", straight)
    driven = straight + [(i, rod.extension) for i, rod in enumerate(robot.rods) if rod.extension is not None]
    return found + _scales(robot, tolerances, scale, driven)


def _lengths_and_joints(robot: Chain, tolerances: Mapping[str, float], clusters: bool) -> list[Parameter]:
    if clusters:
        firsts = {rod.carrier: rod for rod in reversed(robot.rods) if rod.carrier is not None}
        owners = [(a, robot.sites[a], firsts[a]) for a in sorted(firsts)]
    else:
        owners = [(i, rod.name, rod) for i, rod in enumerate(robot.rods)]
    per: Per = "actuator" if clusters else "rod"
    found = [
        Parameter(f"length[{n}]", "length", o, 0, per, "m", rod.L, tolerances["link_length"]) for o, n, rod in owners
    ]
    joints: list[tuple[Kind, str]] = (
        [("carrier_joint", "C")] if clusters else [("platform_joint", "P"), ("carrier_joint", "C")]
    )
    for kind, point in joints:
        for owner, label, rod in owners:
            word = kind if kind == "platform_joint" else _carrier_kind(robot, rod)
            for c, axis in enumerate("xyz"):
                value = float(getattr(rod, point)[c])
                tolerance = tolerances[f"{word}_{axis}"]
                found.append(Parameter(f"{word}[{label}].{axis}", kind, owner, c, per, "m", value, tolerance))
    return found


def _directions(
    robot: Chain, tolerances: Mapping[str, float], per: Per, carriers: list[tuple[int, int]], components: str
) -> list[Parameter]:
    found = []
    for owner, label, actuator in _owners(robot, per, carriers):
        word = "arm_axis" if robot.actuators[actuator].revolute else "track_direction"
        for c, axis in enumerate(components):
            tolerance = tolerances["track_roll" if axis == "c" else word]
            found.append(Parameter(f"{word}[{label}].{axis}", "direction", owner, c, per, "rad", 0.0, tolerance))
    return found


def _scales(
    robot: Chain, tolerances: Mapping[str, float], per: Per | None, driven: list[tuple[int, int]]
) -> list[Parameter]:
    if per is None:  # not asked for: only scales that the URDF declares unknown
        per, driven = "actuator", [(i, a) for i, a in driven if robot.actuators[a].scale_unknown]
    return [
        Parameter(f"scale[{label}]", "scale", owner, 0, per, "m/m", 1.0, tolerances["scale"])
        for owner, label, _ in _owners(robot, per, driven)
    ]


def _owners(robot: Chain, per: Per, driven: list[tuple[int, int]]) -> list[tuple[int, str, int]]:
    """Index and label of each owner of a parameter of the drives, an actuator or a rod, and the index of its actuator."""
    if per == "rod":
        return [(i, robot.rods[i].name, actuator) for i, actuator in sorted(driven)]
    return [(a, robot.sites[a], a) for a in sorted({actuator for _, actuator in driven})]


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
        for c, axis in enumerate("xyz"):
            name = f"anchor[{loop}.{link}].{axis}"
            found.append(Parameter(name, "anchor", owner, c, "anchor", "m", 0.0, tolerances["placement_position"]))
    return found
