"""MJCF: effects of a model, brought to rest in MuJoCo; and the error that the export prints where it holds one in part."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn_machines import told
from with_effects import OF_GANTRY, active

import gtpin

pytest.importorskip("mujoco")
sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "simulator"))
from mujoco_machine import MujocoMachine

HELD = [
    ("gantry_tau", "backlash", "cart1", -5e-5),
    *OF_GANTRY,
    ("linear_delta", "backlash", "cart1", -5e-5),
    ("linear_delta", "link_compliance", "link2a", 4e-6),
    ("stewart", "backlash", "leg2", -5e-5),
    ("stewart", "linearity", "leg1", 5e-5),
    ("ur5", "backlash", "shoulder_lift_joint", -1e-4),
    ("ur5", "backlash", "elbow_joint", 1e-4),
    ("ur5", "joint_compliance", "shoulder_lift_joint", 3e-6),
    ("ur5", "bearing_compliance", "shoulder_pan_joint", 1e-5),
    ("ur5", "link_compliance", "arm", 2e-6),
    ("panda", "joint_compliance", "panda_joint2", 5e-6),
]


def commands(name: str, n: int = 60) -> tuple[gtpin.Model, np.ndarray, dict[str, np.ndarray]]:
    """A nominal model, commands (n, k) that it reaches, and directions of approach."""
    rng = np.random.default_rng(len(name))
    model = gtpin.read_model(name)
    robot = model.robot
    lower, upper = np.maximum(robot.lower, -1.5), np.minimum(robot.upper, 1.5)
    q = lower + (upper - lower) * rng.uniform(0.1, 0.9, (20 * n, robot.n_actuators))
    q = q[model.kinematics.forward(q).reached][:n]
    return model, q, {f"approach{i + 1}": rng.choice([-1.0, 1.0], n) for i in range(robot.n_actuators)}


def in_mujoco(
    model: gtpin.Model,
    file: Path,
    q: np.ndarray,
    covariates: dict[str, np.ndarray],
    rows: slice = slice(None),
    session: str | None = None,
) -> tuple[gtpin.Poses, gtpin.Poses, list[str]]:
    """Poses at rest and as the model predicts, of some rows of the commands; and what the export told."""
    words = [word for word in told(model, file, session=session) if "mesh" not in word]
    some = {name: values[rows] for name, values in covariates.items()}
    poses = MujocoMachine(file, model.robot.tcp_frame).poses(q[rows], some)
    return poses, model.predict(q[rows], some), words


def rms(one: gtpin.Poses, other: gtpin.Poses) -> float:
    return 1e6 * float(np.sqrt(((one.T - other.T) ** 2).sum(axis=1).mean()))


def printed(words: Sequence[str], pattern: str) -> float:
    (size,) = [float(found) for word in words for found in re.findall(pattern, word)]
    return size


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "effect", "site", "first"), HELD)
def test_the_core_of_an_effect_is_held_to_two_micrometres(
    robot: str, effect: str, site: str, first: float, tmp_path: Path
) -> None:
    nominal, q, approach = commands(robot)
    model = replace(nominal, effects=(active(nominal, q, effect, site, covariates=approach, first=first),))
    poses, expected, words = in_mujoco(model, tmp_path / "robot.xml", q, approach, slice(8))
    assert rms(expected, nominal.predict(q[:8])) > 5.0
    assert rms(poses, expected) < 2.0
    assert not [word for word in words if "does not hold" in word]


PARTLY = [
    ("gantry_tau", "backlash", "cart2"),
    ("gantry_tau", "cart_compliance", "cart2"),
    ("ur5", "joint_compliance", "shoulder_lift_joint"),
    ("ur5", "link_compliance", "arm"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "effect", "site"), PARTLY)
def test_the_error_that_is_printed_is_the_error_in_mujoco(robot: str, effect: str, site: str, tmp_path: Path) -> None:
    """All coefficients, the modulation five times as large as usual so that the error stands out."""
    nominal, q, approach = commands(robot)

    def drawn(sigma: np.ndarray) -> np.ndarray:
        found = sigma * np.random.default_rng(3).normal(size=len(sigma)) * np.where(sigma < sigma[0], 2.0, 0.5)
        found[0] = sigma[0] * (-2.0 if effect == "backlash" else 2.0)
        return found

    model = replace(nominal, effects=(active(nominal, q, effect, site, covariates=approach, drawn=drawn),))
    poses, expected, words = in_mujoco(model, tmp_path / "robot.xml", q, approach, slice(30))
    remainder = printed(words, r"to within (\S+) um")
    assert remainder > 1.0
    assert rms(poses, expected) == pytest.approx(remainder, rel=0.5)


WHOLE = [
    ("gantry_tau", "linearity", "cart1"),
    ("gantry_tau", "straightness", "cart3"),
    ("linear_delta", "straightness", "cart2"),
    ("linear_delta", "cart_rotation", "cart1"),
    ("stewart", "linearity", "leg3"),
    ("ur5", "linearity", "elbow_joint"),
    ("gantry_tau", "encoder_scale", "cart2"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "effect", "site"), WHOLE)
def test_curves_are_held_with_all_their_waves(robot: str, effect: str, site: str, tmp_path: Path) -> None:
    nominal, q, approach = commands(robot)

    def drawn(sigma: np.ndarray) -> np.ndarray:
        return 3.5 * sigma * np.random.default_rng(4).normal(size=len(sigma))

    model = replace(nominal, effects=(active(nominal, q, effect, site, covariates=approach, drawn=drawn),))
    poses, expected, words = in_mujoco(model, tmp_path / "robot.xml", q, approach, slice(12))
    assert not words
    assert rms(expected, nominal.predict(q[:12])) > 20.0
    assert rms(poses, expected) < 2.0


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "sign"), [("gantry_tau", 1.0), ("linear_delta", 1.0), ("gantry_tau", -1.0)])
def test_a_play_that_varies_along_the_track_is_held(robot: str, sign: float, tmp_path: Path) -> None:
    """Without the part that goes with the load; also that of a drive that overshoots."""
    nominal, q, approach = commands(robot)
    coefficients = sign * np.array([-5e-5, 2e-5, -1e-5, 0.0, 0.0])
    one = active(nominal, q, "backlash", "cart2", covariates=approach, drawn=lambda _: coefficients)
    model = replace(nominal, effects=(one,))
    poses, expected, words = in_mujoco(model, tmp_path / "robot.xml", q, approach, slice(12))
    assert not words
    assert rms(poses, expected) < 2.0
    core = replace(model, effects=(replace(one, coefficients=sign * np.array([-5e-5, 0.0, 0.0, 0.0, 0.0])),))
    assert rms(poses, core.predict(q, approach)[:12]) > 5.0


@pytest.mark.slow
def test_friction_and_place_of_a_soft_cart_are_held(tmp_path: Path) -> None:
    """What friction adds is as large at all loads in the file: a part of it remains."""
    nominal, q, approach = commands("gantry_tau")
    one = active(nominal, q, "cart_compliance", "cart3", covariates=approach, first=4e-7)
    coefficients = one.coefficients.copy()
    coefficients[[6, 9, 15]] = 3e-8, 3e-8, -2e-8
    model = replace(nominal, effects=(replace(one, coefficients=coefficients),))
    poses, expected, words = in_mujoco(model, tmp_path / "robot.xml", q, approach)
    lost = rms(replace(nominal, effects=(one,)).predict(q, approach), expected)
    assert lost > 15.0
    assert rms(poses, expected) < 0.4 * lost
    assert rms(poses, expected) == pytest.approx(printed(words, r"to within (\S+) um"), rel=0.5, abs=1.0)


def test_play_is_in_the_middle_where_a_command_is_reached_from_rest(tmp_path: Path) -> None:
    nominal, q, approach = commands("gantry_tau")
    model = replace(nominal, effects=(active(nominal, q, "backlash", "cart1", covariates=approach, first=-5e-5),))
    told(model, tmp_path / "robot.xml")
    home = nominal.robot.home_q[None]
    poses = MujocoMachine(tmp_path / "robot.xml", nominal.robot.tcp_frame).poses(home, {})
    assert rms(poses, nominal.predict(home)) < 1.0


@pytest.mark.slow
def test_zero_shifts_are_held_for_a_session_that_is_named(tmp_path: Path) -> None:
    nominal, q, _ = commands("gantry_tau")
    sessions = {"session": np.array(["a", "b"] * 30, dtype=object)}
    model = replace(nominal, effects=(active(nominal, q, "zero_shift", "cart2", covariates=sessions, first=8e-5),))
    for k, session in enumerate(("a", "b")):
        poses, expected, words = in_mujoco(model, tmp_path / f"{session}.xml", q, sessions, slice(k, 8, 2), session)
        assert rms(poses, expected) < 1.0
        assert not words
    words = told(model, tmp_path / "none.xml")
    assert printed(words, r"does not hold zero_shift@cart2 \((\S+) um\)") > 10.0


@pytest.mark.slow
def test_several_effects_of_one_machine_are_held_together_under_a_payload(tmp_path: Path) -> None:
    nominal, q, approach = commands("ur5")
    known = {**approach, "payload": np.linspace(0.0, 4.0, 60)}
    parts = [
        ("backlash", "shoulder_lift_joint", -1e-4),
        ("encoder_scale", "shoulder_lift_joint", 1e-4),
        ("joint_compliance", "shoulder_lift_joint", 2e-6),
        ("bearing_compliance", "elbow_joint", 5e-6),
        ("link_compliance", "arm", 1e-6),
        ("link_compliance", "forearm_link", 1e-6),
    ]
    effects = tuple(active(nominal, q, name, site, covariates=known, first=first) for name, site, first in parts)
    model = replace(nominal, effects=effects)
    poses, expected, words = in_mujoco(model, tmp_path / "robot.xml", q, known, slice(None, None, 8))
    assert not words
    assert rms(poses, expected) < 2.0


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_mimics_and_a_link_called_world_are_no_matter_in_mujoco(name: str, tmp_path: Path) -> None:
    """The second finger of panda's hand is a ``<mimic>`` of the first; ``world`` is a body of MuJoCo's own."""
    nominal, q, _ = commands(name, 4)
    assert nominal.robot.followers if name == "panda" else "world" in {f.name for f in nominal.robot.model.frames}
    poses, expected, _ = in_mujoco(nominal, tmp_path / "robot.xml", q, {})
    assert rms(poses, expected) < 1.0
