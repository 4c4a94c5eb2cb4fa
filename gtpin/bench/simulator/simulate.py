"""A robot drawn from its tolerances, without effects, measured by a noisy instrument."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from gtpin.bench.simulator.arm import Arm
from gtpin.bench.simulator.arm_machine import ArmMachine
from gtpin.bench.simulator.machine import well_conditioned
from gtpin.bench.simulator.poses import AXES, VirtualPoses
from gtpin.bench.simulator.rod_machine import Universal
from gtpin.bench.simulator.rods import Rods
from gtpin.bench.simulator.truth import Simulation
from gtpin.bench.simulator.visits import REPEATED, ids
from gtpin.data import Commands, Dataset, InstrumentSection
from gtpin.errors import GtpinError, ModelError
from gtpin.robot.chain import Chain
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats


@dataclass(frozen=True)
class TrueRobot:
    """A robot with deviations of its geometry and no effects, as :class:`~gtpin.bench.simulator.machine.Moved`.

    Its poses have the coordinates of passive joints of loops, and with ``read`` the angle of the first rod's universal joint.
    """

    geometry: Geometry
    read: bool = False

    @cached_property
    def chain(self) -> Rods | ArmMachine:
        """Its kinematics. Raises ModelError if the robot has rods, but not six."""
        robot = self.geometry.robot
        if robot.rods:
            if len(robot.rods) != 6:
                raise ModelError(f"{robot.name} has {len(robot.rods)} rods", hint="six hold a platform")
            return Rods(self.geometry)
        off: dict[str, Floats] = {}
        for name, value in zip(self.geometry.names, self.geometry.deviation, strict=True):
            place, _, axis = name.rpartition(".")
            if axis in AXES:
                off.setdefault(place, np.zeros(6))[AXES.index(axis)] = value
        return ArmMachine.of(Arm.of(robot), off)

    @property
    def parameters(self) -> dict[str, float]:
        """Deviations of the geometry's parameters from nominal, by name, m and rad."""
        return dict(zip(self.geometry.names, self.geometry.deviation.tolist(), strict=True))

    def predict(self, q: Floats) -> VirtualPoses:
        """Poses at commands q (N, n), base frame; NaN out of reach."""
        chain = self.chain
        if isinstance(chain, ArmMachine):
            return chain.predict(q, read=tuple(chain.robot.joints[j].name for j in chain.robot.passive))
        poses = chain.predict(q)
        if not self.read:
            return poses
        joint, angle, there = Universal.of(self.geometry.robot), np.full(len(q), np.nan), poses.reached
        angle[there] = joint.coordinate(poses[there], chain.ends(q[there]))
        return poses.with_joints({joint.name: angle})

    def command_jacobian(self, q: Floats, poses: VirtualPoses) -> Floats:
        """(N, 6, n) derivative of the poses by the commands: position and rotation vector, base frame."""
        return self.chain.command_jacobian(q, poses)[:, :6]


def draw_machine(robot: Chain, rng: np.random.Generator) -> TrueRobot:
    """A machine whose geometric parameters deviate from nominal by normal draws from their tolerances."""
    geometry = Geometry.nominal(robot)
    drawn = geometry.values + geometry.tolerance * rng.standard_normal(len(geometry.values))
    return TrueRobot(geometry.with_values(drawn))


def draw_commands(machine: TrueRobot, count: int, rng: np.random.Generator) -> Floats:
    """(count, n) commands, uniform over the part of the ranges where the machine is as well conditioned as around home.

    Raises UnreachableError if hardly any commands can be reached.
    """
    if isinstance(machine.chain, ArmMachine) and not machine.chain.robot.pairs:
        return machine.chain.reachable(count, rng)
    robot = machine.geometry.robot
    lower, upper = robot.ends
    equations, passive = 3 * len(robot.constraints), robot.n_passive
    hint = "give a home inside the workspace, or smaller tolerances"
    if equations > passive:
        exact = f"{equations} closure equations for {passive} passive coordinates hold for an exact geometry alone"
        hint = f"{exact}: give the loops spherical or universal joints"

    def draw() -> Floats:
        return np.asarray(rng.uniform(lower, upper, (count, robot.n_actuators)))

    return well_conditioned(machine, robot.name, robot.home_q, draw, count, hint)


def simulate(
    robot: Chain,
    reference: str,
    *,
    poses: int = 200,
    seed: int = 0,
    instrument: InstrumentSection | None = None,
    held_out: int = 120,
) -> Simulation:
    """Draw a machine from the robot's tolerances, move it to random commands, and measure it.

    Parameters
    ----------
    robot
        The nominal robot.
    reference
        The robot's name or path that the dataset gets.
    poses
        Number of different commands that are measured; a tenth of them is visited twice.
    seed
        Seed of the random numbers. The same seed gives the same bytes.
    instrument
        The instrument's section of the dataset; None: a laser tracker with 15 um and 50 urad per axis, one sigma.
    held_out
        Number of further commands, which are not measured and whose truth is given.

    Raises
    ------
    GtpinError
        If there is nothing to measure, or the robot reaches hardly any commands.
    """
    if poses < 1 or held_out < 1:
        raise GtpinError(f"{min(poses, held_out)} poses", hint="ask for at least one")
    instrument = instrument or InstrumentSection(position_sigma=1.5e-5, orientation_sigma=5e-5)
    if instrument.position_sigma is None or instrument.orientation_sigma is None:
        raise GtpinError("the instrument has no sigmas", hint="give position_sigma and orientation_sigma")
    rng = np.random.default_rng(seed)
    machine = draw_machine(robot, rng)
    q = draw_commands(machine, poses, rng)
    again = rng.choice(poses, size=int(REPEATED * poses), replace=False)
    visited = rng.permutation(np.concatenate([np.arange(poses), again]))
    true = machine.predict(q[visited])
    position = true.T + instrument.position_sigma * rng.standard_normal(true.T.shape)
    turn = Rotation.from_rotvec(instrument.orientation_sigma * rng.standard_normal(true.T.shape))
    quaternion = (turn * Rotation.from_matrix(true.R)).as_quat(canonical=True, scalar_first=True)
    dataset = Dataset(
        robot=reference,
        pose=ids(visited),
        q=q[visited],
        position=position,
        orientation=quaternion,
        instrument=instrument,
    )
    q_held = draw_commands(machine, held_out, rng)
    commands = Commands(ids(np.arange(held_out)), q_held)
    return Simulation(
        name=f"case{seed:05d}",
        dataset=dataset,
        commands=commands,
        truth=machine.predict(q_held),
        machine=machine,
        true=true,
    )
