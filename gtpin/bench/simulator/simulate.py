"""A robot drawn from its tolerances, measured by a noisy instrument."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gtpin.bench.simulator.arms.reach import in_front
from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.true_robot import Open, TrueRobot, true_robot
from gtpin.data import Commands, Dataset, Instrument
from gtpin.errors import GtpinError, UnreachableError
from gtpin.robot.geometry import Geometry
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

TRIES = 50
"""Number of draws for each wanted pose after which a robot counts as unable to reach its range."""
REPEATED = 0.1
"""Share of the poses that are visited twice, so that the noise can be estimated."""
CONDITIONED = 1.5
"""Largest ratio of the TCP's motion by unit commands to that at home: commands with a larger one are not used."""
RESOLUTION = 1e-6
"""Step to which commands are rounded, as by a controller, m or rad."""


@dataclass(frozen=True)
class Simulation:
    """A dataset whose truth is known.

    Parameters
    ----------
    dataset
        The measured poses.
    machine
        The simulated machine.
    commands
        Held-out commands, without measurements.
    truth
        True poses at the held-out commands, without noise, in the instrument's frame.
    """

    dataset: Dataset
    machine: TrueRobot
    commands: Commands
    truth: Poses


def draw_machine(robot: Robot, rng: np.random.Generator) -> TrueRobot:
    """A machine whose geometric parameters deviate from nominal by normal draws from their tolerances."""
    geometry = Geometry.nominal(robot)
    drawn = geometry.values + geometry.tolerance * rng.standard_normal(len(geometry.values))
    return true_robot(geometry.with_values(drawn))


def draw_commands(machine: TrueRobot, count: int, rng: np.random.Generator) -> Floats:
    """(count, n) commands, uniform over the part of the ranges where the machine is as well conditioned as around home.

    Raises
    ------
    UnreachableError
        If hardly any commands can be reached.
    """
    if isinstance(machine, Open):
        return in_front(machine.machine, count, rng)
    robot = machine.geometry.robot
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    at_home = _gain(machine, robot.home_q[None])[0]
    if not np.isfinite(at_home):
        equations, passive = 3 * len(robot.constraints), robot.n_passive
        raise UnreachableError(
            f"the loops of {robot.name} don't close at home with joints that are off by their tolerances",
            hint=f"{equations} closure equations for {passive} passive coordinates hold for an exact geometry alone: give the "
            "loops spherical or universal joints"
            if equations > passive
            else "give a home inside the workspace, or smaller tolerances",
        )
    found = np.zeros((0, robot.n_actuators))
    for _ in range(TRIES):
        drawn = np.round(rng.uniform(lower, upper, (count, robot.n_actuators)) / RESOLUTION) * RESOLUTION
        drawn = drawn[_gain(machine, drawn) <= CONDITIONED * at_home]
        found = np.vstack([found, drawn])
        if len(found) >= count:
            return found[:count]
    raise UnreachableError(
        f"{robot.name} reaches hardly any of the commands in its range", hint="narrow the range in the URDF"
    )


def _gain(machine: TrueRobot, q: Floats) -> Floats:
    """(N,) motion of the TCP by unit commands: the norm of its derivative; infinite out of reach."""
    poses = machine.predict(q)
    gain = np.full(len(q), np.inf)
    there = poses.reached
    gain[there] = np.linalg.norm(machine.command_jacobian(q[there], poses[there]), axis=(1, 2))
    return gain


def measure(machine: TrueRobot, q: Floats, instrument: Instrument, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Measured positions (N, 3), m, and quaternions (N, 4), scalar first, base frame, with the instrument's noise.

    Raises
    ------
    GtpinError
        If the instrument states no sigmas.
    """
    if instrument.position_sigma is None or instrument.orientation_sigma is None:
        raise GtpinError("the instrument has no sigmas", hint="give position_sigma and orientation_sigma")
    true = machine.predict(q)
    position = true.T + instrument.position_sigma * rng.standard_normal(true.T.shape)
    turn = Rotation.from_rotvec(instrument.orientation_sigma * rng.standard_normal(true.T.shape))
    quaternion = (turn * Rotation.from_matrix(true.R)).as_quat(canonical=True, scalar_first=True)
    return position, np.asarray(quaternion)


def simulate(
    robot: Robot,
    reference: str,
    *,
    poses: int = 200,
    seed: int = 0,
    instrument: Instrument | None = None,
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
    instrument = instrument or Instrument(position_sigma=1.5e-5, orientation_sigma=5e-5)
    rng = np.random.default_rng(seed)
    machine = draw_machine(robot, rng)
    q = draw_commands(machine, poses, rng)
    again = rng.choice(poses, size=int(REPEATED * poses), replace=False)
    visited = rng.permutation(np.concatenate([np.arange(poses), again]))
    position, quaternion = measure(machine, q[visited], instrument, rng)
    dataset = Dataset(
        robot=reference,
        pose=np.array([str(i) for i in visited], dtype=object),
        q=q[visited],
        position=position,
        orientation=quaternion,
        instrument=instrument,
    )
    q_held = draw_commands(machine, held_out, rng)
    commands = Commands(np.array([str(i) for i in range(held_out)], dtype=object), q_held)
    return Simulation(dataset, machine, commands, machine.predict(q_held))
