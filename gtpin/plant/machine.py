"""The machine itself: a geometry drawn from its tolerances, masses that are not quite nominal, and what moves its joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.errors import RobotError, UnreachableError
from gtpin.kinematics.closures import RodEnds, newton
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.kinematics.rotations import exp
from gtpin.plant.deviation import Deviation
from gtpin.robot.geometry import Geometry
from gtpin.robot.parameters import rotation_axes
from gtpin.robot.robot import Robot

Floats = npt.NDArray[np.float64]

MASS_SPREAD = 0.04
"""1 sigma of each mass about nominal."""


@dataclass(frozen=True)
class Machine:
    """A robot on rods and carts as it was really built.

    Parameters
    ----------
    geometry
        Its true geometry.
    plate_mass, plate_center
        Mass of the platform, kg, and its centre, TCP frame, m.
    rod_masses
        (k,) kg; a rod's centre is at the middle of its length.

    Raises
    ------
    RobotError
        If its rods do not hang on carts that slide along tracks.
    """

    geometry: Geometry
    plate_mass: float
    plate_center: Floats
    rod_masses: Floats

    def __post_init__(self) -> None:
        robot = self.robot
        carriers = [rod.carrier for rod in robot.rods]
        if len(carriers) != 6 or any(c is None or robot.actuators[c].revolute for c in carriers):
            raise RobotError(f"{robot.name} has no six rods on carts", hint="the plant simulates machines of that kind")

    @staticmethod
    def draw(robot: Robot, rng: np.random.Generator) -> Machine:
        """A machine that is off nominal by normal draws from the tolerances, and by some per cent in its masses."""
        geometry = Geometry.nominal(robot)
        built = geometry.values + geometry.tolerance * rng.standard_normal(len(geometry.values))
        plate = robot.tcp_placement.inverse() * robot.model.inertias[robot.tcp_joint]
        factors = 1.0 + MASS_SPREAD * rng.standard_normal(1 + len(robot.rods))
        center = np.array(plate.lever) + 0.005 * rng.standard_normal(3)
        nominal = np.array([_rod_mass(robot, i) for i in range(len(robot.rods))])
        return Machine(geometry.with_values(built), float(plate.mass * factors[0]), center, nominal * factors[1:])

    @property
    def robot(self) -> Robot:
        """The nominal robot."""
        return self.geometry.robot

    @cached_property
    def kinematics(self) -> RodKinematics:
        """The kinematics of the true geometry, without any effect."""
        return RodKinematics(self.geometry)

    @property
    def n_carts(self) -> int:
        """How many carts it has."""
        return self.robot.n_actuators

    @property
    def n_rods(self) -> int:
        """How many rods it has."""
        return len(self.robot.rods)

    @cached_property
    def carrier(self) -> npt.NDArray[np.int_]:
        """(k,) the cart of each rod."""
        return np.array([rod.carrier for rod in self.robot.rods])

    @cached_property
    def tracks(self) -> Floats:
        """(n, 3) unit directions of the tracks, base frame."""
        return np.array([self.kinematics.v[self.carrier == c][0] for c in range(self.n_carts)])

    @cached_property
    def across(self) -> Floats:
        """(n, 2, 3) two unit vectors across each track, base frame."""
        return np.array([rotation_axes(v)[:2] for v in self.tracks])

    @cached_property
    def levers(self) -> Floats:
        """(k, 3) from the mean of a cart's joints to each of them, base frame, m."""
        C0 = self.kinematics.C0
        means = np.array([C0[self.carrier == c].mean(axis=0) for c in range(self.n_carts)])
        return np.asarray(C0 - means[self.carrier])

    def unbent(self, visits: int) -> Deviation:
        """No deviation, at so many visits."""
        return Deviation.none(visits, self.n_carts, self.n_rods)

    def ends(self, q: Floats, deviation: Deviation) -> RodEnds:
        """Where the rods end at commands q (N, n), and how long they are."""
        straight = self.kinematics.ends(q)
        moved = deviation.shift + deviation.travel[..., None] * self.tracks
        swung = np.einsum(
            "ncij,nj->nci", _minus_one(deviation.turn)[:, self.carrier].transpose(1, 0, 2, 3), self.levers
        )
        C = straight.C + moved[:, self.carrier] + swung.transpose(1, 0, 2)
        return RodEnds(straight.P + deviation.joint, C, straight.L + deviation.length)

    def close(self, start: Poses, ends: RodEnds) -> Poses:
        """(N) closed poses, base frame, from poses that are less than some millimetres off.

        Raises
        ------
        UnreachableError
            If some rods can't be closed.
        """
        poses, closed = newton(start, ends, self.robot.size)
        if not closed.all():
            raise UnreachableError("the deviations open the rods", hint="make the effects smaller")
        return poses


def _minus_one(turn: Floats) -> Floats:
    """Rotation matrices of rotation vectors, less the identity."""
    return np.asarray(exp(turn) - np.eye(3))


def _rod_mass(robot: Robot, rod: int) -> float:
    constraint = robot.constraints[robot.rods[rod].loop]
    tip = constraint.joint1_id if robot.rods[rod].rod_end == 0 else constraint.joint2_id
    return float(robot.model.inertias[tip].mass)
