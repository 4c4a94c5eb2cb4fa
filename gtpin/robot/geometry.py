"""The named parameters of a robot's geometry that can be identified: units, tolerances, values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from gtpin.errors import ModelError, RobotError
from gtpin.robot.robot import Robot
from gtpin.robot.rods import Rod
from gtpin.robot.tracks import MeasuredTrack

Floats = npt.NDArray[np.float64]
Kind = Literal["length", "platform_joint", "carrier_joint", "direction", "scale", "placement"]
Per = Literal["actuator", "rod"]

TOLERANCE: Mapping[str, float] = {
    "link_length": 1e-3,
    "platform_joint": 1e-3,
    "cart_joint": 2e-3,
    "arm_joint": 2e-3,
    "base_joint": 2e-3,
    "track_direction": 1e-3,
    "arm_axis": 1e-3,
    "scale": 5e-4,
    "placement_position": 1e-3,
    "placement_rotation": 1e-3,
}
"""1-sigma tolerances (m, rad, m/m) by kind, where neither the URDF nor the dataset gives one."""


@dataclass(frozen=True)
class Parameter:
    """One number of the geometry.

    Parameters
    ----------
    name
        ``length[2a]``, ``track_direction[cart1].a``, ...
    kind, owner, component
        What it is, whose (index of a rod, an actuator or a Pinocchio joint, see ``per``), and which component.
    per
        What ``owner`` counts.
    unit
        ``m``, ``rad`` or ``m/m``.
    nominal, tolerance
        The URDF's value, and the 1-sigma manufacturing tolerance around it: the prior of a calibration.
    """

    name: str
    kind: Kind
    owner: int
    component: int
    per: Literal["actuator", "rod", "joint"]
    unit: str
    nominal: float
    tolerance: float

    def with_tolerance(self, tolerance: float) -> Parameter:
        """The same parameter with another tolerance."""
        return replace(self, tolerance=tolerance)


@dataclass(frozen=True)
class Geometry:
    """Values of a robot's geometric parameters.

    Parameters
    ----------
    robot
        Whose geometry it is; its URDF gives the nominal values.
    parameters
        What can be identified; everything else stays nominal.
    values
        (p,) their values, m, rad or m/m, in the order of ``parameters``.
    tracks
        By rod, the measured track of its cart, or None where the track is straight; empty where all are.
    """

    robot: Robot
    parameters: tuple[Parameter, ...]
    values: Floats
    tracks: tuple[MeasuredTrack | None, ...] = ()

    @staticmethod
    def nominal(
        robot: Robot,
        *,
        directions: Per = "actuator",
        scale: Per | None = None,
        tolerance: Mapping[str, float] | None = None,
        without: Iterable[str] = (),
    ) -> Geometry:
        """The nominal geometry, with the parameters that a calibration shall identify.

        Parameters
        ----------
        directions
            One direction per actuator, or one per rod as in models 3 to 5 of Dressler et al. 2010.
        scale
            Whether drive scales are parameters: one per actuator, one per rod, or (None) not at all.
        tolerance
            1-sigma tolerances by kind that override the robot's.
        without
            Names, or beginnings of names (``track_direction``, ``length[2a]``), of parameters to leave at nominal.

        Raises
        ------
        ModelError
            If a kind of tolerance or a name in ``without`` is not known.
        """
        tolerances = _tolerances(robot, tolerance or {})
        if robot.rods:
            parameters = _rod_parameters(robot, tolerances, directions, scale)
        else:
            parameters = _placement_parameters(robot, tolerances)
        for start in without:
            kept = [p for p in parameters if not p.name.startswith(start)]
            if len(kept) == len(parameters):
                raise ModelError(f"no parameter is called {start!r}", hint=f"names look like {parameters[0].name}")
            parameters = kept
        return Geometry(robot, tuple(parameters), np.array([p.nominal for p in parameters]))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(p.name for p in self.parameters)

    @property
    def tolerance(self) -> Floats:
        """(p,) 1-sigma tolerances."""
        return np.array([p.tolerance for p in self.parameters])

    @property
    def deviation(self) -> Floats:
        """(p,) values less nominal."""
        return np.asarray(self.values - np.array([p.nominal for p in self.parameters]))

    def track(self, rod: int) -> MeasuredTrack | None:
        """The measured track that carries a rod, or None where its track is straight."""
        return self.tracks[rod] if self.tracks else None

    def with_values(self, values: Floats) -> Geometry:
        """The same parameters at other values (p,)."""
        frozen = np.array(values, dtype=float)
        frozen.flags.writeable = False
        return replace(self, values=frozen)

    def deviations(self, kind: Kind, per: Literal["actuator", "rod", "joint"], shape: tuple[int, int]) -> Floats:
        """Deviations of one kind, by owner and component; zero where there is no such parameter."""
        table = np.zeros(shape)
        for parameter, deviation in zip(self.parameters, self.deviation, strict=True):
            if parameter.kind == kind and parameter.per == per:
                table[parameter.owner, parameter.component] = deviation
        return table

    def __getitem__(self, name: str) -> float:
        if name not in self.names:
            raise ModelError(f"no parameter is called {name!r}", hint=f"names look like {self.names[0]}")
        return float(self.values[self.names.index(name)])


def rotation_axes(direction: Floats) -> Floats:
    """(3, 3) the unit vectors about which small rotations of a direction (3,) turn: a, b and the direction itself.

    a turns about the base axis that is least aligned with the direction, less its part along it; b about direction x a.
    """
    least = np.eye(3)[int(np.argmin(np.abs(direction)))]
    a = least - (least @ direction) * direction
    a /= np.linalg.norm(a)
    return np.array([a, np.cross(direction, a), direction])


def _tolerances(robot: Robot, override: Mapping[str, float]) -> dict[str, float]:
    for source, given in (("the robot's URDF", robot.tolerance), ("the dataset", override)):
        unknown = sorted(set(given) - set(TOLERANCE))
        if unknown:
            raise ModelError(
                f"{source} gives a tolerance of unknown kind {unknown[0]!r}", hint=f"kinds are {', '.join(TOLERANCE)}"
            )
    return {**TOLERANCE, **robot.tolerance, **override}


def _carrier_kind(robot: Robot, rod: Rod) -> str:
    if rod.carrier is None:
        return "base_joint"
    return "arm_joint" if robot.actuators[rod.carrier].revolute else "cart_joint"


def _rod_parameters(
    robot: Robot, tolerances: Mapping[str, float], directions: Per, scale: Per | None
) -> list[Parameter]:
    found = []
    for i, rod in enumerate(robot.rods):
        found.append(Parameter(f"length[{rod.name}]", "length", i, 0, "rod", "m", rod.L, tolerances["link_length"]))
    for kind, points in (("platform_joint", "P"), ("carrier_joint", "C")):
        for i, rod in enumerate(robot.rods):
            word = kind if kind == "platform_joint" else _carrier_kind(robot, rod)
            for c, axis in enumerate("xyz"):
                value = float(getattr(rod, points)[c])
                name = f"{word}[{rod.name}].{axis}"
                found.append(Parameter(name, kind, i, c, "rod", "m", value, tolerances[word]))  # type: ignore[arg-type]
    carriers = [(i, rod.carrier) for i, rod in enumerate(robot.rods) if rod.carrier is not None]
    for owner, label, actuator in _owners(robot, directions, carriers):
        word = "arm_axis" if robot.actuators[actuator].revolute else "track_direction"
        for c, axis in enumerate("ab"):
            name = f"{word}[{label}].{axis}"
            found.append(Parameter(name, "direction", owner, c, directions, "rad", 0.0, tolerances[word]))
    if scale is not None:
        driven = carriers + [(i, rod.extension) for i, rod in enumerate(robot.rods) if rod.extension is not None]
        for owner, label, _ in _owners(robot, scale, driven):
            found.append(Parameter(f"scale[{label}]", "scale", owner, 0, scale, "m/m", 1.0, tolerances["scale"]))
    return found


def _owners(robot: Robot, per: Per, driven: list[tuple[int, int]]) -> list[tuple[int, str, int]]:
    """Index, label and actuator of whatever owns a parameter of the drives."""
    if per == "rod":
        return [(i, robot.rods[i].name, actuator) for i, actuator in sorted(driven)]
    return [(a, robot.sites[a], a) for a in sorted({actuator for _, actuator in driven})]


def _placement_parameters(robot: Robot, tolerances: Mapping[str, float]) -> list[Parameter]:
    found = []
    for joint_id in range(1, robot.model.njoints):
        if robot.model.nvs[joint_id] != 1:
            raise RobotError(f"{robot.name} has loops that are no rods", hint="name its rods in the <gtpin> element")
        for c, axis in enumerate(("x", "y", "z", "rx", "ry", "rz")):
            name = f"placement[{robot.model.names[joint_id]}].{axis}"
            unit, word = ("m", "placement_position") if c < 3 else ("rad", "placement_rotation")
            found.append(Parameter(name, "placement", joint_id, c, "joint", unit, 0.0, tolerances[word]))
    return found
