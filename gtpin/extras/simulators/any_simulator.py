"""Commands that bring a simulator of the nominal robot to the poses of the diagnosed machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from gtpin.compensation.compensate import SINGULAR, machine_of, position_first
from gtpin.effects.operating_points import Column
from gtpin.errors import ModelError, UnreachableError
from gtpin.kinematics.kinematics import Kinematics, nominal
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.typing import Floats

STEPS = 25
"""Largest number of Gauss-Newton steps."""
CLOSE = 1e-12
"""Largest step of the commands, m or rad, that ends the iteration."""


@dataclass(frozen=True, eq=False)
class SimulatorCommands:
    """N commands for a simulator of the nominal robot, and the offsets of the TCP that these commands leave.

    The pose of the simulator's TCP at the commands ``q``, multiplied from the right by ``offset``, is ``poses``.

    Parameters
    ----------
    q
        (N, n) commands for the simulator, m or rad.
    poses
        N poses of the machine's TCP, base frame, m.
    offset
        N poses of the machine's TCP in the simulator's TCP frame, m. Identity up to rounding if the robot has six actuators
        or more and is not near a singular posture.
    residual
        (N, 6) position, m, and rotation vector, rad, base frame: the machine's TCP less the simulator's at ``q``. It is the
        error of a simulation without ``offset``.
    """

    q: Floats
    poses: Poses
    offset: Poses
    residual: Floats


def commands_for_simulator(
    model: Model,
    q: npt.ArrayLike,
    covariates: Mapping[str, Column] | None = None,
    *,
    simulator: Model | None = None,
) -> SimulatorCommands:
    """Commands, and offsets of the TCP, that give a nominal simulator the poses of a diagnosed machine at its commands q.

    With six actuators or more, the commands bring the simulator's TCP to the machine's pose, near a singular posture to its
    position and as near to its orientation as they can; with three to five, to its position; with fewer, to the reachable
    position closest to it. ``offset`` is the difference that remains. Commands and offset together are exact: geometry and
    effects are solved with the complete kinematics, nothing is linearised.

    Parameters
    ----------
    model
        The machine. Its instrument, and effects of the measurement, are ignored, with a warning where it has some: see
        :func:`~gtpin.compensation.machine_of`.
    q
        (N, n) commands of the machine, m or rad.
    covariates
        By name, (N,) each: conditions at the commands (payload, temperatures, approaches, ...), as for ``Model.predict``.
    simulator
        A model with the simulator's geometry and without effects; by default the robot's nominal geometry.

    Raises
    ------
    ModelError
        If a covariate that an effect needs is missing, q does not have the shape (N, n), or the simulator's model has effects.
    UnreachableError
        If the machine or the simulator can't close its loops at a command.

    Examples
    --------
    >>> import numpy as np
    >>> import gtpin
    >>> from gtpin.sim import commands_for_simulator
    >>> machine = gtpin.read_model("ur5").sample(1, np.random.default_rng(0))[0]
    >>> found = commands_for_simulator(machine, [[0.1, -1.2, 1.0, 0.3, 0.8, 0.0]])
    >>> bool(np.abs(found.residual).max() < 1e-9)
    True
    """
    commands = np.array(q, dtype=float)
    robot = model.robot
    if commands.ndim != 2 or commands.shape[1] != robot.n_actuators or not np.isfinite(commands).all():
        what = f"commands of shape {commands.shape} for {robot.n_actuators} actuators"
        raise ModelError(what, hint="give finite numbers, (N, n)")
    if simulator is not None and simulator.effects:
        raise ModelError("the simulator's model has effects", hint="give the geometry alone: simulator.without(...)")
    machine = machine_of(model)
    poses = machine.predict(commands, covariates)
    _all_there(poses, robot.name)
    shown = nominal(robot) if simulator is None else simulator.kinematics
    commands, simulated = _nearest(shown, commands, poses)
    _all_there(simulated, f"the simulated {robot.name}")
    inverse = np.swapaxes(simulated.R, 1, 2)
    offset = Poses(np.einsum("nij,nj->ni", inverse, poses.T - simulated.T), inverse @ poses.R)
    return SimulatorCommands(commands, poses, offset, poses.minus(simulated))


def _nearest(shown: Kinematics, q: Floats, wanted: Poses) -> tuple[Floats, Poses]:
    """The simulator's commands (N, n) for wanted poses, by Gauss-Newton from the machine's ``q``, and its poses at them."""
    poses = shown.forward(q)
    for _ in range(STEPS):
        _all_there(poses, "the simulated robot")
        jacobian, error = shown.command_jacobian(q, poses)[:, :6], wanted.minus(poses)
        if q.shape[1] >= 6:
            step = position_first(jacobian, error)
        else:
            step = np.einsum("nij,nj->ni", np.linalg.pinv(jacobian[:, :3], rcond=SINGULAR), error[:, :3])
        q, poses = q + step, shown.forward(q + step)
        if np.abs(step).max(initial=0.0) <= CLOSE:
            break
    return q, poses


def _all_there(poses: Poses, name: str) -> None:
    lost = np.flatnonzero(~poses.reached)
    if lost.size:
        raise UnreachableError(f"{name} can't reach command {lost[0] + 1}", hint="stay inside the workspace")


class Environment(Protocol):
    """The methods that an environment must have: those of Gymnasium, with the robot's commands q as actions."""

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """Start an episode: the observation, and further information."""

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Apply an action: observation, reward, terminated, truncated, further information."""


class Diagnosed:
    """An environment that behaves as diagnosed machines do: each episode has one of them, drawn at random.

    Actions are the commands q (n,), m or rad, that a controller sends. The environment gets other commands, with which its
    nominal robot takes the machine's pose: see :func:`commands_for_simulator`. ``info["simulator_commands"]`` of a step has
    these commands and the remaining ``offset``, which a simulator can apply to its TCP. The direction of approach of each
    actuator is that of its last motion, 0 before its first motion. All other attributes are the environment's.

    Parameters
    ----------
    environment
        The environment to wrap, with ``reset`` and ``step`` as in Gymnasium.
    machines
        Models of machines, such as ``model.sample(n, rng)``, or one model.
    rng
        Random generator that draws the machine of each episode.
    conditions
        By name, one value of each covariate that the models' effects need, besides the directions of approach; None: no others.
    simulator
        A model without effects, with the geometry of the simulator; None: the nominal geometry.

    Raises
    ------
    ModelError
        If there is no machine.

    Examples
    --------
    >>> import numpy as np
    >>> import gtpin
    >>> class Robot:
    ...     def reset(self, **options):
    ...         return np.zeros(6), {}
    ...
    ...     def step(self, action):
    ...         return action, 0.0, False, False, {}
    >>> rng = np.random.default_rng(0)
    >>> environment = gtpin.sim.Diagnosed(Robot(), gtpin.read_model("ur5").sample(20, rng), rng)
    >>> _, _ = environment.reset()
    >>> observation, _, _, _, info = environment.step([0.0, -1.2, 1.0, 0.3, 0.8, 0.0])
    >>> info["simulator_commands"].q.shape
    (1, 6)
    """

    def __init__(
        self,
        environment: Environment,
        machines: Model | Sequence[Model],
        rng: np.random.Generator,
        *,
        conditions: Mapping[str, float | str] | None = None,
        simulator: Model | None = None,
    ) -> None:
        given = [machines] if isinstance(machines, Model) else list(machines)
        if not given:
            raise ModelError("no machine for the environment", hint="give a model, or model.sample(n, rng)")
        self.environment = environment
        self.machines = tuple(machine_of(model) for model in given)
        self.machine = self.machines[0]
        self._rng, self._conditions, self._simulator = rng, dict(conditions or {}), simulator
        self._before = np.array(self.machine.robot.home_q)
        self._approach = np.zeros(len(self._before))

    def __getattr__(self, name: str) -> Any:
        if name == "environment":  # copy and pickle ask before it is set: else endless recursion
            raise AttributeError(name)
        return getattr(self.environment, name)

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """Start an episode with a machine drawn at random; returns what the environment's ``reset`` returns."""
        self.machine = self.machines[int(self._rng.integers(len(self.machines)))]
        self._before = np.array(self.machine.robot.home_q)
        self._approach = np.zeros(len(self._before))
        return self.environment.reset(**options)

    def step(self, action: npt.ArrayLike) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Send the commands ``action`` (n,), m or rad; returns what the environment's ``step`` returns, ``info`` extended."""
        q = np.array(action, dtype=float)
        self._approach = np.where(q == self._before, self._approach, np.sign(q - self._before))
        self._before = q
        known: dict[str, Column] = {f"approach{i + 1}": np.array([a]) for i, a in enumerate(self._approach)}
        for name, value in self._conditions.items():
            known[name] = np.array([value]) if name != "session" else np.array([value], dtype=object)
        found = commands_for_simulator(self.machine, q[None], known, simulator=self._simulator)
        observation, reward, terminated, truncated, info = self.environment.step(found.q[0])
        return observation, reward, terminated, truncated, {**info, "simulator_commands": found}
