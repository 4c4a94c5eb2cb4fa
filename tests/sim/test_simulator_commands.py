"""Commands and offsets with which a nominal simulator, or an environment of it, shows a diagnosed machine."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from with_effects import active

import gtpin
from gtpin.kinematics.poses import Poses
from gtpin.sim import Diagnosed, commands_for_simulator

RNG = np.random.default_rng(5)


def machine(name: str, effects: list[tuple[str, str]], q: np.ndarray, covariates: dict) -> gtpin.Model:
    """A machine with a geometry of its own, and effects of typical sizes."""
    model = gtpin.read_model(name).sample(1, np.random.default_rng(len(name)))[0]

    def drawn(sigma: np.ndarray) -> np.ndarray:
        return sigma * RNG.normal(size=len(sigma))

    found = (active(model, q, *place, covariates=covariates, drawn=drawn) for place in effects)
    return replace(model, effects=tuple(found))


def followed(simulated: Poses, offset: Poses) -> tuple[np.ndarray, np.ndarray]:
    return simulated.T + np.einsum("nij,nj->ni", simulated.R, offset.T), simulated.R @ offset.R


CASES = {
    "gantry_tau": [("linearity", "cart1"), ("backlash", "cart2"), ("straightness", "cart3")],
    "linear_delta": [("linearity", "cart1"), ("link_compliance", "arm")],
    "stewart": [("linearity", "leg1"), ("backlash", "leg2")],
    "ur5": [("joint_compliance", "shoulder_lift_joint"), ("backlash", "elbow_joint")],
}


@pytest.fixture(params=CASES)
def shown(request: pytest.FixtureRequest) -> tuple[gtpin.Model, np.ndarray, dict[str, np.ndarray]]:
    robot = gtpin.load_robot(request.param)
    lower, upper = np.maximum(robot.lower, -1.5), np.minimum(robot.upper, 1.5)
    q = robot.home_q + 0.6 * RNG.uniform(lower - robot.home_q, upper - robot.home_q, (40, robot.n_actuators))
    covariates = {f"approach{i + 1}": RNG.choice([-1.0, 1.0], len(q)) for i in range(robot.n_actuators)}
    return machine(request.param, CASES[request.param], q, covariates), q, covariates


def test_the_nominal_robot_with_the_commands_and_the_offset_is_where_the_machine_is(shown) -> None:
    model, q, covariates = shown
    found = commands_for_simulator(model, q, covariates)
    T, R = followed(gtpin.read_model(model.robot.name).predict(found.q), found.offset)
    expected = model.predict(q, covariates)
    assert np.abs(T - expected.T).max() < 1e-12
    assert np.abs(R - expected.R).max() < 1e-12
    assert np.abs(gtpin.read_model(model.robot.name).predict(q).T - expected.T).max() > 1e-5


def test_the_residual_is_what_the_commands_alone_leave(shown) -> None:
    model, q, covariates = shown
    found = commands_for_simulator(model, q, covariates)
    simulated, expected = gtpin.read_model(model.robot.name).predict(found.q), model.predict(q, covariates)
    turn = Rotation.from_matrix(expected.R @ np.swapaxes(simulated.R, 1, 2)).as_rotvec()
    np.testing.assert_allclose(found.residual, np.hstack([expected.T - simulated.T, turn]), rtol=0, atol=1e-12)


def test_with_six_actuators_commands_show_the_pose_and_with_three_the_position(shown) -> None:
    model, q, covariates = shown
    residual = np.abs(commands_for_simulator(model, q, covariates).residual)
    if model.robot.name != "ur5":  # some of whose postures are near singular ones
        assert residual[:, : 6 if model.robot.n_actuators == 6 else 3].max() < 1e-10
    else:
        assert np.median(residual.max(axis=1)) < 1e-10


def test_rows_do_not_depend_on_each_other(shown) -> None:
    model, q, covariates = shown
    all_rows = commands_for_simulator(model, q, covariates)
    one = commands_for_simulator(model, q[7:8], {name: values[7:8] for name, values in covariates.items()})
    np.testing.assert_allclose(one.q[0], all_rows.q[7], rtol=0, atol=1e-12)


def test_near_a_singular_posture_the_commands_stay_near_and_the_offset_takes_the_rest() -> None:
    model = gtpin.read_model("ur5").sample(1, np.random.default_rng(3))[0]
    q = np.array([[0.2, -1.1, 1.3, 0.4, 1e-9, 0.3]])  # two axes of the wrist in line
    found = commands_for_simulator(model, q)
    assert np.abs(found.q - q).max() < 0.1
    assert np.abs(found.residual[:, :3]).max() < 1e-10  # the position first
    T, R = followed(gtpin.read_model("ur5").predict(found.q), found.offset)
    np.testing.assert_allclose(T, model.predict(q).T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(R, model.predict(q).R, rtol=0, atol=1e-12)


def test_a_simulator_may_have_a_geometry_of_its_own() -> None:
    first, second = gtpin.read_model("gantry_tau").sample(2, np.random.default_rng(1))
    q = np.zeros((1, 3))
    found = commands_for_simulator(first, q, simulator=second)
    T, _ = followed(second.predict(found.q), found.offset)
    np.testing.assert_allclose(T, first.predict(q).T, rtol=0, atol=1e-12)


def test_what_is_wrong_is_an_error_of_one_line() -> None:
    model = gtpin.read_model("gantry_tau")
    with pytest.raises(gtpin.GtpinError, match="shape"):
        commands_for_simulator(model, [[0.0, 0.0]])
    with pytest.raises(gtpin.GtpinError, match="command 2"):
        commands_for_simulator(model, [[0.0, 0.0, 0.0], [9.0, -9.0, 9.0]])
    q = np.zeros((2, 3))
    played = machine("gantry_tau", [("backlash", "cart1")], q, {"approach1": np.array([-1.0, 1.0])})
    with pytest.raises(gtpin.GtpinError, match="approach1"):
        commands_for_simulator(played, q)
    soft = machine("gantry_tau", [("linearity", "cart1")], np.zeros((2, 3)), {})
    with pytest.raises(gtpin.GtpinError, match="has effects"):
        commands_for_simulator(model, np.zeros((1, 3)), simulator=soft)


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
