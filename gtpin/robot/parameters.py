"""Which parameters a robot's geometry has: their names, units, nominal values, tolerances, and what they move."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from gtpin.errors import ModelError
from gtpin.robot.chain import Chain
from gtpin.robot.constrained_model import Actuator, joint_axis
from gtpin.robot.placement_frames import frame_of_anchor, frame_of_joint, frame_of_tcp, shift, turned
from gtpin.robot.rods import Rod
from gtpin.typing import Floats

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
    "zero": 0.1,
}
"""1-sigma tolerances (m, rad, m/m) by kind, where neither the URDF nor the dataset gives one. Assumed; that of a joint's zero,
0.1 m or 6 degrees, is wide because a zero is set when the machine is assembled or mastered, and no manufacturing tolerance
bounds it."""
FREE = 1.0
"""Tolerance, m, rad or m/m, of a parameter that is freed: a prior that says nothing. No machine is so far from its drawing."""
JOINTS = ("platform_joint", "cart_joint", "arm_joint", "base_joint")
KINDS = (*TOLERANCE, *(f"{kind}_{axis}" for kind in JOINTS for axis in "xyz"))
"""Kinds for which a tolerance may be given; for positions of joints also for a single axis, as ``base_joint_z``."""


DIRECTIONS = ("track_direction", "arm_axis")
"""Kinds of parameters that turn the track or axis of an actuator."""
Column = Mapping[str, float]
"""What one number changes: parameters of the geometry, each with the factor of its change."""
COMPONENTS = {"x": 0, "y": 1, "z": 2, "rx": 3, "ry": 4, "rz": 5, "a": 0, "b": 1, "c": 2, "": 0}
"""Index of a vector's component by the end of a parameter's name."""


@dataclass(frozen=True)
class Parameter:
    """One number of the geometry, and what it moves.

    - ``name``: ``length[2a]``, ``track_direction[cart1].a``, ...
    - ``unit``: ``m``, ``rad`` or ``m/m``.
    - ``nominal``, ``tolerance``: the URDF's value, and the 1-sigma manufacturing tolerance around it: the prior of a
      calibration.
    - ``moves``: frames (:mod:`~gtpin.robot.placement_frames`) and their twists (6,) per unit of the parameter, in their own
      axes. The twists of one frame by several parameters are added. A placement is then multiplied from the right by the
      exponential of the sum; an anchor is displaced, then turned about the origin of the joint that carries it.
    - ``drive``: index of the actuator whose travel it multiplies; None: it is no drive's scale.
    - ``widened``: the factor by which a calibration multiplied the declared tolerance, which the data contradict.
    """

    name: str
    unit: str
    nominal: float
    tolerance: float
    moves: tuple[tuple[int, Floats], ...] = field(default=(), compare=False)
    drive: int | None = None
    widened: float = 1.0

    @property
    def kind(self) -> str:
        """The kind of quantity: the name's beginning, as ``length``, ``cart_joint``, ``placement`` or ``platform``."""
        return self.name.partition("[")[0].partition(".")[0]

    @property
    def part(self) -> str:
        """The part that has it: what stands in the name's brackets; empty for the platform."""
        return self.name.rpartition("]")[0].partition("[")[2]

    @property
    def is_free(self) -> bool:
        """Whether its tolerance is no statement on the machine, and the data alone determine it."""
        return self.tolerance >= FREE or self.kind == "zero"

    @property
    def component(self) -> int:
        """Index of the component of a vector or twist; 0 where it is a single number."""
        return COMPONENTS[self.name[self.name.rfind("]") + 1 :].rpartition(".")[2]]


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
            what = f"{source} gives a tolerance of unknown kind {unknown[0]!r}"
            raise ModelError(what, hint=f"kinds are {', '.join(TOLERANCE)}")
    found = {**TOLERANCE, **robot.tolerance, **override}
    for kind in JOINTS:
        for axis in (f"{kind}_{axis}" for axis in "xyz"):
            own = robot.tolerance.get(axis, found[kind]) if kind not in override else override[kind]
            found[axis] = override.get(axis, own)
    return found


def zero_of(robot: Chain, actuator: Actuator, tolerances: Mapping[str, float]) -> Parameter:
    """The zero of an actuator's joint: its coordinate, and those of joints that follow it, at command 0."""
    joints = {int(v): j for j, v in enumerate(robot.model.idx_vs) if j}
    followers = ((joints[f.index_v], f.multiplier) for f in robot.followers if f.master_v == actuator.index_v)
    ratios = ((actuator.joint_id, 1.0), *followers)
    moves = ((frame_of_joint(j), ratio * joint_axis(robot.model, j)) for j, ratio in ratios)
    unit = "rad" if actuator.revolute else "m"
    return Parameter(f"zero[{actuator.site}]", unit, 0.0, tolerances["zero"], tuple(moves))


def rod_parameters(
    robot: Chain, tolerances: Mapping[str, float], *, scale: bool, zeros: bool = False
) -> list[Parameter]:
    """Parameters of a robot with rods: lengths, joints, directions and scales; only declared unknown ones without ``scale``.

    ``zeros``: also those of its joints. A zero moves all joints of rods on a carrier, each of which has a tolerance of its own.

    A rod's joint on its carrier is where it is with all commands zero, base frame, and stays there when the direction of the
    track or axis turns.
    """
    found, turns = list[Parameter](), robot.revolute
    for rod, longer in zip(robot.rods, robot.longer_rods, strict=True):
        found.append(Parameter(f"length[{rod.name}]", "m", rod.L, tolerances["link_length"], (longer,)))
    for rod in robot.rods:
        R = np.asarray(robot.model.jointPlacements[rod.joint_id].rotation.T @ robot.tcp_placement.rotation)
        found += _position("platform_joint", rod, rod.P, tolerances, frame_of_joint(rod.joint_id), R)
    for rod in robot.rods:
        R = robot.anchor_axes[rod.seat].T @ _at_zero(robot, rod.carrier).T
        kind = "base_joint" if rod.carrier is None else "arm_joint" if turns[rod.carrier] else "cart_joint"
        found += _position(kind, rod, rod.C, tolerances, frame_of_anchor(robot, rod.seat), R)
    for a in sorted({rod.carrier for rod in robot.rods if rod.carrier is not None}):
        kind, joint = "arm_axis" if turns[a] else "track_direction", robot.actuators[a].joint_id
        seats = [rod.seat for rod in robot.rods if rod.carrier == a]
        for axis, turn in zip("ab", rotation_axes(robot.actuators[a].axis) @ _at_zero(robot, a), strict=False):
            back = ((frame_of_anchor(robot, s), turned(-robot.anchor_axes[s].T @ turn)) for s in seats)
            moves = ((frame_of_joint(joint), turned(turn)), *back)
            found.append(Parameter(f"{kind}[{robot.sites[a]}].{axis}", "rad", 0.0, tolerances[kind], moves))
    for a in sorted({rod.driver for rod in robot.rods if rod.driver is not None}):
        if scale or robot.actuators[a].scale_unknown:
            found.append(Parameter(f"scale[{robot.sites[a]}]", "m/m", 1.0, tolerances["scale"], drive=a))
    return [*found, *(zero_of(robot, actuator, tolerances) for actuator in robot.actuators if zeros)]


def _at_zero(robot: Chain, carrier: int | None) -> Floats:
    """(3, 3) rotation, all commands zero, of the joint of an actuator, or of the base, to the base frame."""
    joint = 0 if carrier is None else robot.actuators[carrier].joint_id
    return np.array(robot.model.jointPlacements[joint].rotation)


def _position(
    kind: str, rod: Rod, at: Floats, tolerances: Mapping[str, float], frame: int, R: Floats
) -> Iterator[Parameter]:
    """The three coordinates ``at`` of a rod's joint, whose axes R (3, 3) turns into those of the frame that they move."""
    for c, axis in enumerate("xyz"):
        moves = ((frame, shift(R[:, c])),)
        yield Parameter(f"{kind}[{rod.name}].{axis}", "m", float(at[c]), tolerances[f"{kind}_{axis}"], moves)


def placement_parameters(robot: Chain, tolerances: Mapping[str, float], *, zeros: bool = False) -> list[Parameter]:
    """Parameters of a robot without rods: placements of the joints that move its TCP, of the TCP, and of its loops' anchors.

    Each joint and the TCP have six, each anchor has the three of its position on its link. They are redundant: a deviation that
    the data do not assign to one parameter is divided among several in proportion to their prior variances. The name of an
    anchor has the names of its loop and of its link. With ``zeros``, that of a commanded joint is in the place of the component
    of its placement that is nearest to its axis: both together would be one quantity with two names.
    """
    places = [(f"placement[{robot.model.names[j]}]", [frame_of_joint(j)], 6) for j in robot.moving_joints]
    places.append(("platform", [frame_of_tcp(robot)], 6))
    ends = [(loop.name, anchor.link) for loop in robot.description.loops for anchor in (loop.anchor1, loop.anchor2)]
    follow: dict[int, list[int]] = {}
    for a, leading in enumerate(robot.leading_anchors):  # the anchors of two frames move together
        follow.setdefault(leading, []).append(frame_of_anchor(robot, a))
    places += [(f"anchor[{loop}.{link}]", follow[a], 3) for a, (loop, link) in enumerate(ends) if a in follow]
    found = []
    for name, frames, count in places:
        for axis, twist in zip(("x", "y", "z", "rx", "ry", "rz")[:count], np.eye(6), strict=False):
            unit, size = ("m", "placement_position") if twist[:3].any() else ("rad", "placement_rotation")
            moves = tuple((frame, twist) for frame in frames)
            found.append(Parameter(f"{name}.{axis}", unit, 0.0, tolerances[size], moves))
    for actuator in robot.actuators if zeros else ():
        along = int(np.argmax(np.abs(joint_axis(robot.model, actuator.joint_id))))
        own = [i for i, p in enumerate(found) if (p.kind, p.part) == ("placement", actuator.joint)]
        if own:
            found[own[along]] = zero_of(robot, actuator, tolerances)
    return found


def tracks_by_parameters(robot: Chain) -> dict[str, list[Column]]:
    """What moves a track that carries rods, and its cart, by the track's site: parameters, each with the factor of its change.

    The track turns about its axes a and b (rad); the cart moves along a and b (m), and, where it has several joints, turns
    about a, b and the track at the mean of its joints at command 0 (rad).
    """
    found: dict[str, list[Column]] = {}
    for number in sorted({rod.carrier for rod in robot.rods if rod.carrier is not None}):
        if robot.actuators[number].revolute:
            continue
        own, site = [rod for rod in robot.rods if rod.carrier == number], robot.sites[number]
        lever = np.array([rod.C for rod in own]) - np.mean([rod.C for rod in own], axis=0)
        axes = rotation_axes(robot.actuators[number].axis)
        shifts = [np.tile(axis, (len(own), 1)) for axis in axes[:2]]
        shifts += [np.cross(axis, lever) for axis in axes if len(own) > 1]
        columns: list[Column] = [{f"track_direction[{site}].{axis}": 1.0} for axis in "ab"]
        for way in shifts:
            moved = zip(own, way, strict=True)
            each = ((rod.name, x, d) for rod, by in moved for x, d in zip("xyz", by, strict=True))
            columns.append({f"cart_joint[{rod}].{x}": d for rod, x, d in each})
        found[site] = columns
    return found
