"""Which parameters a robot's geometry has: their names, units, nominal values and tolerances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gtpin.errors import ModelError
from gtpin.robot.chain import Chain
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
    along_measured = [(i, carrier) for i, carrier in carriers if measured[i]]
    ways: list[tuple[Per, list[tuple[int, int]], str]] = [
        ("actuator" if reduced else directions, straight, "ab"),
        ("actuator", along_measured, "abc"),
    ]
    for per, driven, components in ways:
        for owner, label, actuator in _owners(robot, per, driven):
            word = "arm_axis" if robot.actuators[actuator].revolute else "track_direction"
            for c, axis in enumerate(components):
                name, size = f"{word}[{label}].{axis}", tolerances["track_roll" if axis == "c" else word]
                found.append(Parameter(name, "direction", owner, c, per, "rad", 0.0, size))
    driven = straight
    if not reduced:
        driven = straight + [(i, rod.extension) for i, rod in enumerate(robot.rods) if rod.extension is not None]
    if scale is None:  # not asked for: only scales that the URDF declares unknown
        driven = [(i, a) for i, a in driven if robot.actuators[a].scale_unknown]
    per = "actuator" if reduced or scale is None else scale
    return found + [
        Parameter(f"scale[{label}]", "scale", owner, 0, per, "m/m", 1.0, tolerances["scale"])
        for owner, label, _ in _owners(robot, per, driven)
    ]


def _lengths_and_joints(robot: Chain, tolerances: Mapping[str, float], reduced: bool) -> list[Parameter]:
    """Lengths of rods, and their joints; of a reduced arm those of the first rod on each cart, for all rods on it."""
    per: Per = "actuator" if reduced else "rod"
    owners = [(i, rod.name, rod) for i, rod in enumerate(robot.rods)]
    joints: list[tuple[Kind, str]] = [("platform_joint", "P"), ("carrier_joint", "C")]
    if reduced:
        firsts = {rod.carrier: rod for rod in reversed(robot.rods) if rod.carrier is not None}
        owners, joints = [(a, robot.sites[a], firsts[a]) for a in sorted(firsts)], joints[1:]
    found = [
        Parameter(f"length[{n}]", "length", o, 0, per, "m", rod.L, tolerances["link_length"]) for o, n, rod in owners
    ]
    for kind, point in joints:
        for owner, label, rod in owners:
            word: str = kind
            if kind == "carrier_joint":
                revolute = rod.carrier is not None and robot.actuators[rod.carrier].revolute
                word = "base_joint" if rod.carrier is None else "arm_joint" if revolute else "cart_joint"
            for c, axis in enumerate("xyz"):
                value, size = float(getattr(rod, point)[c]), tolerances[f"{word}_{axis}"]
                found.append(Parameter(f"{word}[{label}].{axis}", kind, owner, c, per, "m", value, size))
    return found


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
    owners: list[tuple[Kind, int, str]] = [
        ("placement", joint, f"placement[{robot.model.names[joint]}]") for joint in robot.moving_joints
    ]
    found = []
    for kind, joint, word in [*owners, ("platform", 0, "platform")]:
        for c, axis in enumerate(("x", "y", "z", "rx", "ry", "rz")):
            unit, size = ("m", "placement_position") if c < 3 else ("rad", "placement_rotation")
            found.append(Parameter(f"{word}.{axis}", kind, joint, c, "joint", unit, 0.0, tolerances[size]))
    ends = [(loop.name, anchor.link) for loop in robot.description.loops for anchor in loop.anchors]
    for owner, (loop, link) in enumerate(ends):
        for c, axis in enumerate("xyz"):
            name = f"anchor[{loop}.{link}].{axis}"
            found.append(Parameter(name, "anchor", owner, c, "anchor", "m", 0.0, tolerances["placement_position"]))
    return found
