"""Planted causes: the displacement by hand formulas, the energy as asked, and answers counted as the words say."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.effects import OperatingPoints
from gtpin.effects.active import ActiveEffect
from gtpin.model.model import FittedInstrument

sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "planted"))

import plant
from answers import half
from background import Background, series
from halves import compared
from outside import Form


def random_commands(robot: gtpin.Robot, count: int) -> np.ndarray:
    return np.random.default_rng(0).uniform(-1.2, 1.2, (count, len(robot.sites)))


@pytest.fixture(scope="module")
def background() -> Background:
    """Readings of a nominal UR5 with 50 um of noise, of which nothing is named."""
    model = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("ur5")))
    q = random_commands(model.robot, 40)
    read = model.predict(q).T + np.random.default_rng(1).normal(0.0, 5e-5, (40, 3))
    data = gtpin.Dataset(robot="ur5", pose=np.array([str(k) for k in range(40)], dtype=object), q=q, position=read)
    tested = {"effect": "rack_periodic", "site": "elbow_joint"}
    return Background("ur5", data, {"causes": [], "candidates": [tested], "reasons": {}}, model, model)


def acting(background: Background, site: str, size: float) -> gtpin.Model:
    q, model = background.dataset.q, background.model
    at = OperatingPoints(model.kinematics, q, model.kinematics.forward(q), {})
    form = Form("product_of_joints", 3)
    return replace(model, effects=(ActiveEffect(form, site, None, np.array([size]), np.eye(1), at.references),))


def test_a_deviation_of_the_first_joint_turns_the_readings_about_its_axis(background: Background) -> None:
    q, size = background.dataset.q, 0.1
    other = int(np.random.default_rng(3).choice(range(1, 6)))  # the form's second joint
    x = 2.0 * (q - q.min(axis=0)) / np.ptp(q, axis=0) - 1.0
    turn = Rotation.from_rotvec((size * x[:, 0] * x[:, other])[:, None] * [0.0, 0.0, 1.0])
    dataset, _ = background.planted(acting(background, "shoulder_pan_joint", size), {}, np.full(3, 5e-5))
    exact = background.model.predict(q).T
    expected = background.dataset.position + turn.apply(exact) - exact
    np.testing.assert_allclose(dataset.position, expected, atol=1e-12)


def test_the_residuals_scatter_is_the_noise(background: Background) -> None:
    assert background.sigma(background.model) == pytest.approx(np.full(3, 5e-5), rel=0.3)


@pytest.mark.parametrize("listed", [True, False])
def test_a_drawn_case_has_the_energy_that_was_asked_for(background: Background, listed: bool) -> None:
    planter = plant.Planter(background)
    case = planter.draw(300.0, listed, np.random.default_rng(5))
    J, r = planter.project.J, case.whitened
    assert r @ np.linalg.solve(np.eye(len(r)) + J @ J.T, r) == pytest.approx(300.0, rel=0.03)
    moved = (case.dataset.position - background.dataset.position) / planter.sigma
    np.testing.assert_allclose(moved.ravel(), r, atol=1e-6)
    assert case.truth()["listed"] == listed


def test_a_ball_stays_in_its_socket_at_other_angles(tmp_path: Path) -> None:
    robot = gtpin.load_robot("panda")
    q = random_commands(robot, 12)[:, :7]
    table = pd.DataFrame(q, columns=[f"q{k}" for k in range(1, 8)])
    table.insert(0, "pose", range(12))
    (tmp_path / "real" / "panda").mkdir(parents=True)
    table.assign(socket=["a/hole_0", "a/hole_1"] * 6).to_csv(tmp_path / "real" / "panda" / "ball.csv", index=False)
    ((name, dataset),) = series(tmp_path / "real", tmp_path)
    known = gtpin.load_robot("panda", dataset.tcp, dataset.actuators)
    instrument = FittedInstrument(dataset.readings.tables[0])
    model = gtpin.Model(gtpin.Geometry.nominal(known), instruments=(instrument,))
    b = Background(name, dataset, {}, model, model)
    active = acting(b, known.sites[3], 1e-3)
    moved, r = b.planted(active, {}, np.full(3, 1e-4))
    before, after = model.predict(dataset.q), active.predict(moved.q)
    still = b.shift(before, after, model)
    assert np.abs(still).max() < 1e-9
    d = 1e-4 * r.reshape(6, 2, 3)  # the rows of the two sockets in turn: a socket's place is the mean of its balls
    changed = replace(b, dataset=moved).residual(model) - b.residual(model)
    np.testing.assert_allclose(changed, (d - d.mean(axis=0)).reshape(12, 3), atol=0.02 * np.abs(d).max())


def test_visits_to_one_pose_are_in_one_half(background: Background) -> None:
    twice = background.dataset.take(np.repeat(np.arange(40), 2))
    kept = half(twice)
    assert len(kept) == 40
    assert (np.unique(kept.pose, return_counts=True)[1] == 2).all()


def test_a_certain_cause_that_the_other_half_lacks_is_false() -> None:
    def said(probability: float, value: float, also: str = "arm") -> dict[str, object]:
        cause = {"effect": "linearity", "site": "elbow", "probability": probability}
        cause |= {"class": [dict(cause)], "parameters": {"rms": {"value": value, "sigma": 1.0}}}
        weak = [{"class": [{"effect": "linearity", "site": also}]}]
        return {"causes": [cause] if probability else [], "also": weak}

    nothing = {"causes": [], "also": []}
    assert compared(said(0.95, 0.0), nothing)["false"] == ["linearity@elbow"]
    assert compared(said(0.95, 0.0), said(0.0, 0.0, "elbow"))["false"] == []
    assert compared(said(0.8, 0.0), nothing)["sure"] == 0
    assert compared(said(0.95, 0.0), said(0.95, 2.0)) == {"sure": 2, "false": [], "in both": 2, "same size": 2}
    assert compared(said(0.95, 0.0), said(0.95, 4.0))["same size"] == 0
