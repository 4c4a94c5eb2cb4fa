"""A machine on six rods as it was really built: geometry and masses deviate from the nominal ones."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from gtpin.bench.simulator.closing import RodEnds, closed
from gtpin.bench.simulator.deviation import Deviation
from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.rods import Rods
from gtpin.bench.simulator.rotations import across, exp
from gtpin.bench.simulator.universal import Universal
from gtpin.errors import RobotError, UnreachableError
from gtpin.robot.geometry import Geometry
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

MASS_SPREAD = 0.04
"""Standard deviation of each mass, relative to the nominal mass."""
ACROSS = 0.3
"""Repeatability across a track, as a share of that along it."""
REACH = 0.8
"""Errors of drives and guideways are functions of places from -REACH to REACH, for every length of range."""


@dataclass(frozen=True)
class Machine:
    """A robot on six rods as it was really built: on carts, on arms, or on legs of variable length.

    Here everything that a drive moves is called a cart: a cart along a track, an arm about an axis, or the foot of a leg, which
    does not move when the leg's length changes.

    Parameters
    ----------
    geometry
        Its true geometry.
    plate_mass, plate_center
        Mass of the platform, kg, and its centre of mass, TCP frame, m.
    rod_masses
        (k,) masses of the rods, kg; the centre of mass of a rod of fixed length is at its middle.

    Raises
    ------
    RobotError
        If the robot does not have six rods, has a rod without a drive, or a drive without a rod.
    """

    geometry: Geometry
    plate_mass: float
    plate_center: Floats
    rod_masses: Floats

    def __post_init__(self) -> None:
        robot = self.robot
        if len(robot.rods) != 6 or set(self.driver.tolist()) != set(range(robot.n_actuators)):
            raise RobotError(
                f"{robot.name} has not six rods that its actuators move",
                hint="the plant simulates machines of that kind",
            )

    @staticmethod
    def draw(robot: Robot, rng: np.random.Generator) -> Machine:
        """A machine whose parameters deviate from nominal by normal draws from the tolerances, its masses by some per cent."""
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
    def kinematics(self) -> Rods:
        """The kinematics of the true geometry, without any effect."""
        return Rods(self.geometry)

    @property
    def n_carts(self) -> int:
        """Number of carts."""
        return self.robot.n_actuators

    @property
    def per_metre(self) -> float:
        """Repeatability of a cart, m or rad, over that of a cart on a track, m."""
        return 1.0

    @property
    def n_rods(self) -> int:
        """Number of rods."""
        return len(self.robot.rods)

    @cached_property
    def driver(self) -> npt.NDArray[np.int_]:
        """(k,) the cart of each rod; -1 where nothing moves it."""
        return self.kinematics.driver

    @cached_property
    def is_leg(self) -> npt.NDArray[np.bool_]:
        """(n,) whether the drive changes a leg's length."""
        return np.array([any(rod.extension == c for rod in self.robot.rods) for c in range(self.n_carts)])

    @cached_property
    def slides(self) -> npt.NDArray[np.bool_]:
        """(n,) whether the drive moves a cart along a track."""
        return np.asarray(~self.is_leg & ~self.robot.revolute)

    @cached_property
    def tracks(self) -> Floats:
        """(n, 3) unit directions of the tracks, of the arms' axes, and of the legs at the URDF's zero, base frame."""
        along = [self.kinematics.v[self.driver == c][0] for c in range(self.n_carts)]
        legs = [actuator.axis for actuator in self.robot.actuators]
        return np.where(self.is_leg[:, None], legs, along)

    @cached_property
    def across(self) -> Floats:
        """(n, 2, 3) two unit vectors across each track, base frame."""
        return np.array([across(v) for v in self.tracks])

    @cached_property
    def levers(self) -> Floats:
        """(k, 3) vectors from the mean of a cart's joints to each of them, with all commands zero, base frame, m."""
        C0 = self.kinematics.C0
        means = np.array([C0[self.driver == c].mean(axis=0) for c in range(self.n_carts)])
        return np.asarray(C0 - means[self.driver])

    @cached_property
    def zoom(self) -> Floats:
        """(n,) change of the place by a unit command, 1/m or 1/rad: the largest power of two with which places stay within
        REACH.

        A power of two has no rounding error.
        """
        half = (self.robot.upper - self.robot.lower) / 2.0
        return np.asarray(2.0 ** np.floor(np.log2(REACH / np.where(np.isfinite(half), half, REACH))))

    def places(self, q: Floats) -> Floats:
        """(N, n) places of commands (N, n) in their ranges: no unit, from about -REACH to REACH; the middle is rounded to
        0.1."""
        middle = (self.robot.upper + self.robot.lower) / 2.0
        return np.asarray((q - np.round(np.where(np.isfinite(middle), middle, 0.0), 1)) * self.zoom)

    @cached_property
    def leg_masses(self) -> Floats:
        """(k, 2) for each rod: distance of its centre of mass from its platform joint at command zero, m, and the share of its
        mass that a leg's drive moves."""
        return np.array([_centre_and_sliding(self.robot, i) for i in range(self.n_rods)])

    def unbent(self, visits: int) -> Deviation:
        """Deviations of zero at a number of visits."""
        return Deviation.none(visits, self.n_carts, self.n_rods)

    def jitter(self, sigmas: Floats, visits: int, rng: np.random.Generator) -> Deviation:
        """Random deviations at every visit, of carts with the repeatabilities ``sigmas`` (n,), m or rad."""
        deviation = self.unbent(visits)
        deviation.travel[:] = sigmas * rng.standard_normal((visits, self.n_carts))
        sideways = ACROSS * sigmas[:, None] * rng.standard_normal((visits, self.n_carts, 2))
        deviation.shift[:] = np.einsum("nca,cai->nci", sideways, self.across)
        return deviation

    @cached_property
    def universal(self) -> Universal:
        """The universal joint of the first rod, at which an encoder can be."""
        return Universal.of(self.robot, 0)

    def command_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6 + k, n) derivative by the commands of the poses, and of the k joints whose coordinates the poses have."""
        J = self.kinematics.command_jacobian(q, poses)
        return self._with_joint(J, q, poses, self.kinematics.commanded(q)) if poses.joints else J

    def by_tolerance(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6 + k, p) derivative of the poses by the geometry's parameters, in units of their tolerances.

        The k joints are those whose coordinates the poses have.
        """
        J = self.kinematics.geometry_jacobian(q, poses)
        J = self._with_joint(J, q, poses, self.kinematics.changed(q)) if poses.joints else J
        return np.asarray(J * self.geometry.tolerance)

    def _with_joint(self, J: Floats, q: Floats, poses: Poses, moved: list[tuple[RodEnds, RodEnds]]) -> Floats:
        own = self.universal.by_motion(poses, self.kinematics.ends(q), J, moved)
        return np.concatenate([J, own], axis=1)

    def ends(self, q: Floats, deviation: Deviation) -> RodEnds:
        """Ends and lengths of the rods at commands q (N, n), with a deviation."""
        arms = ~self.is_leg & ~self.slides
        straight = self.kinematics.ends(q + deviation.travel * arms if arms.any() else q)
        moved = deviation.shift + (deviation.travel * self.slides)[..., None] * self.tracks
        swung = np.einsum("ncij,nj->nci", _minus_one(deviation.turn)[:, self.driver].transpose(1, 0, 2, 3), self.levers)
        C = straight.C + moved[:, self.driver] + swung.transpose(1, 0, 2)
        L = straight.L + deviation.length
        if self.is_leg.any():
            L = L + (deviation.travel * self.is_leg)[:, self.driver]
        return RodEnds(straight.P + deviation.joint, C, L)

    def close(self, start: Poses, ends: RodEnds) -> Poses:
        """(N) closed poses, base frame, from poses at a distance of less than some millimetres.

        Raises
        ------
        UnreachableError
            If some rods can't be closed.
        """
        poses, done = closed(start, ends, self.robot.size)
        if not done.all():
            raise UnreachableError("the deviations open the rods", hint="make the effects smaller")
        return poses


def _minus_one(turn: Floats) -> Floats:
    """Rotation matrices of rotation vectors, less the identity."""
    return np.asarray(exp(turn) - np.eye(3))


def _bodies(robot: Robot, rod: int) -> list[int]:
    """The Pinocchio joints of a rod, from the platform to its end."""
    constraint = robot.constraints[robot.rods[rod].loop]
    tip = constraint.joint1_id if robot.rods[rod].rod_end == 0 else constraint.joint2_id
    chain = list(robot.model.supports[tip])
    return chain[chain.index(robot.rods[rod].joint_id) :]


def _rod_mass(robot: Robot, rod: int) -> float:
    return float(sum(robot.model.inertias[joint].mass for joint in _bodies(robot, rod)))


def _centre_and_sliding(robot: Robot, rod: int) -> tuple[float, float]:
    extension = robot.rods[rod].extension
    if extension is None:
        return robot.rods[rod].L / 2.0, 0.0
    moment = sliding = 0.0
    placement = pin.SE3.Identity()
    for joint in _bodies(robot, rod):
        if joint != robot.rods[rod].joint_id:
            placement = placement * robot.model.jointPlacements[joint]
        inertia = robot.model.inertias[joint]
        moment += inertia.mass * float(np.linalg.norm(placement.act(inertia.lever)))
        if joint >= robot.actuators[extension].joint_id:
            sliding += inertia.mass
    mass = _rod_mass(robot, rod)
    return moment / mass, sliding / mass
