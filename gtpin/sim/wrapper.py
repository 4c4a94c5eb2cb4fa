"""An environment whose simulator has the nominal robot, wrapped so that it behaves as a diagnosed machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from gtpin.compensation.compensate import machine_of
from gtpin.effects.situation import Column
from gtpin.errors import ModelError
from gtpin.model.model import Model
from gtpin.sim.simulator_commands import SimulatorCommands, commands_for_simulator


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
        found = self._commands(q)
        observation, reward, terminated, truncated, info = self.environment.step(found.q[0])
        return observation, reward, terminated, truncated, {**info, "simulator_commands": found}

    def _commands(self, q: npt.NDArray[np.float64]) -> SimulatorCommands:
        known: dict[str, Column] = {f"approach{i + 1}": np.array([a]) for i, a in enumerate(self._approach)}
        for name, value in self._conditions.items():
            known[name] = np.array([value]) if name != "session" else np.array([value], dtype=object)
        return commands_for_simulator(self.machine, q[None], known, simulator=self._simulator)
