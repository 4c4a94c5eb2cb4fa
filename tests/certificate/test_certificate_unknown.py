"""Certificates of an arm that Pinocchio alone moves: beside something unknown, and of a target off the TCP."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from by_pinocchio import placed
from with_effects import active

import gtpin
from gtpin.errors import GtpinError, GtpinWarning
from gtpin.extras.certificate.page import statement

LOW, HIGH = np.array([-2.5, -2.4, 0.4, -2.5, 0.4, -2.5]), np.array([2.5, -0.3, 2.2, 2.5, 2.2, 2.5])
SIGMA, OFF = 1.5e-5, 3e-4
"""Noise of the tracker, and standard deviation of the placements, m and rad."""
Floats = np.ndarray


def drawn(rng: np.random.Generator) -> tuple[pin.Model, str]:
    """A UR10 whose joints are misplaced, and its nominal URDF."""
    text = gtpin.load_robot("ur10").description.xml
    real = pin.buildModelFromXML(text)
    for joint in range(1, real.njoints):
        real.jointPlacements[joint] = real.jointPlacements[joint] * pin.exp6(pin.Motion(rng.normal(0.0, OFF, 6)))
    return real, text


def sagging(q: Floats, tank: Floats) -> Floats:
    """The shoulder gives way as a tank fills that gtpin does not know, rad."""
    return q + 2e-4 * np.sin(4.0 * tank)[:, None] * np.eye(6)[1]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_scatter_of_visits_beside_something_unknown_is_no_noise(seed: int) -> None:
    """The tank's level differs between the visits too, so that their scatter has the unknown error in it."""
    rng = np.random.default_rng(seed)
    real, _ = drawn(rng)
    number = np.r_[np.arange(130), np.arange(14)]
    q = rng.uniform(LOW, HIGH, (130, 6)).round(6)[number]
    tank = rng.uniform(0.0, 3.0, len(q))
    seen = placed(real, sagging(q, tank))[0] + SIGMA * rng.standard_normal((len(q), 3))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        found = gtpin.certify(gtpin.Dataset("ur10", [f"p{k}" for k in number], q, seen, None, {"tank": tank}))
    assert found.verdict == "unknown"
    new, level = rng.uniform(LOW, HIGH, (600, 6)), rng.uniform(0.0, 3.0, 600)
    off = np.linalg.norm(placed(real, sagging(new, level))[0] - found.model.predict(new, {"tank": level}).T, axis=1)
    accuracy = found["AP_p_corrected_rms"]
    assert accuracy.value == pytest.approx(np.sqrt((off**2).mean()), rel=0.25)
    assert found.budget.radius == pytest.approx(np.quantile(off, 0.95), rel=0.25)


@pytest.mark.slow
def test_the_way_to_certify_a_target_off_the_tcp_is_told_and_works(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    real, text = drawn(rng)
    at = np.array([0.06, 0.0, 0.02])
    q = rng.uniform(LOW, HIGH, (80, 6)).round(6)
    T, R = placed(real, q)
    seen = T + R @ at + SIGMA * rng.standard_normal((80, 3))
    instrument = {"position_sigma": SIGMA, "target": at.tolist()}
    dataset = gtpin.Dataset("ur10", [f"p{n}" for n in range(80)], q, seen, None, {}, instrument)
    with pytest.raises(GtpinError, match=re.escape("target = [x, y, z] this is not the TCP")) as refused:
        gtpin.certify(dataset)
    assert "give the robot's file a link there, write its name as tcp in dataset.toml" in str(refused.value)
    link = '<link name="ball"/><joint name="to_ball" type="fixed"><parent link="tool0"/><child link="ball"/>'
    more = f'{link}<origin xyz="{at[0]} {at[1]} {at[2]}" rpy="0 0 0"/></joint></robot>'
    (tmp_path / "ball.urdf").write_text(text.replace("</robot>", more), encoding="utf-8")
    here = gtpin.Dataset(
        str(tmp_path / "ball.urdf"), dataset.pose, q, seen, None, {}, {"position_sigma": SIGMA}, tcp="ball"
    )
    found = gtpin.certify(here, gtpin.calibrate(here).model)
    new = rng.uniform(LOW, HIGH, (400, 6))
    T, R = placed(real, new)
    off = np.linalg.norm(T + R @ at - found.model.predict(new).T, axis=1)
    assert found.budget.radius == pytest.approx(np.quantile(off, 0.95), rel=0.5)


@pytest.mark.parametrize("cause", ["joint_compliance", "linearity"])
def test_a_certificate_of_a_cause_by_load_says_whose_masses_it_assumes(cause: str) -> None:
    rng, plain = np.random.default_rng(2), gtpin.read_model("ur10")
    q = rng.uniform(LOW, HIGH, (40, 6))
    effect = active(plain, q, cause, "shoulder_lift_joint", first=1e-6)
    model = replace(plain, effects=(effect,), covariance=np.diag((0.01 * plain.geometry.tolerance) ** 2))
    read = model.predict(q).T + SIGMA * rng.standard_normal((40, 3))
    dataset = gtpin.Dataset("ur10", [f"p{k}" for k in range(40)], q, read, instrument={"position_sigma": SIGMA})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        said = " ".join(statement(gtpin.certify(dataset, model)))
    assert ("masses in the robot's file, taken as exact" in said) is (cause == "joint_compliance")
