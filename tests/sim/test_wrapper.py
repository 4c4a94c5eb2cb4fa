"""An environment of the nominal robot that behaves as diagnosed machines do."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from with_effects import active

import gtpin
from gtpin.sim import Diagnosed

NOMINAL = gtpin.read_model("gantry_tau")


class Still:
    """The nominal robot at its commands; it observes the position of the TCP."""

    name = "still"

    def reset(self, **options: object) -> tuple[np.ndarray, dict[str, object]]:
        return NOMINAL.kinematics.home.T[0], dict(options)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, object]]:
        return NOMINAL.predict(action[None]).T[0], 0.0, False, False, {"own": 1}


def with_play(half: float) -> gtpin.Model:
    q, came = np.array([[0.1, 0.0, 0.0], [0.0, 0.1, 0.2]]), {"approach2": np.array([1.0, -1.0])}
    return replace(NOMINAL, effects=(active(NOMINAL, q, "backlash", "cart2", covariates=came, first=half),))


def test_play_follows_the_direction_of_the_last_change() -> None:
    environment = Diagnosed(Still(), with_play(-5e-5), np.random.default_rng(0))
    environment.reset()
    seen = [environment.step([0.0, q2, 0.0])[0] for q2 in (0.1, 0.2, 0.2, 0.1)]
    went = [0.1 - 5e-5, 0.2 - 5e-5, 0.2 - 5e-5, 0.1 + 5e-5]
    np.testing.assert_allclose(seen, [NOMINAL.predict([[0.0, q2, 0.0]]).T[0] for q2 in went], rtol=0, atol=1e-10)


@pytest.mark.slow
def test_each_episode_has_a_machine_of_its_own() -> None:
    machines = NOMINAL.sample(8, np.random.default_rng(0))
    environment = Diagnosed(Still(), machines, np.random.default_rng(0))
    seen = []
    for _ in range(40):
        environment.reset(seed=1)
        observation, _, _, _, info = environment.step(np.array([0.1, 0.0, 0.0]))
        np.testing.assert_allclose(observation, environment.machine.predict([[0.1, 0.0, 0.0]]).T[0], rtol=0, atol=1e-10)
        assert info["own"] == 1
        seen.append(tuple(observation.round(9)))
    assert len(set(seen)) == len(machines)


def test_it_passes_for_the_environment_and_can_be_copied() -> None:
    environment = Diagnosed(Still(), NOMINAL, np.random.default_rng(0))
    assert environment.name == "still"
    assert copy.copy(environment).name == "still"
    assert environment.reset(seed=3)[1] == {"seed": 3}


def test_without_machines_there_is_an_error() -> None:
    with pytest.raises(gtpin.GtpinError, match="no machine"):
        Diagnosed(Still(), [], np.random.default_rng(0))


def test_gymnasium_accepts_it_as_an_environment() -> None:
    gymnasium = pytest.importorskip("gymnasium")

    class Robot(Still, gymnasium.Env):
        observation_space = gymnasium.spaces.Box(-10.0, 10.0, (3,))
        action_space = gymnasium.spaces.Box(-0.2, 0.2, (3,))

    environment = Diagnosed(Robot(), NOMINAL, np.random.default_rng(0))
    environment.reset(seed=0)
    observation, *_ = environment.step(environment.action_space.sample())
    assert environment.observation_space.contains(observation.astype(np.float32))
