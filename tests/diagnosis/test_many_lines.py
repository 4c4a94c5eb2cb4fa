"""Joints with many periodic errors: all of their lines are found, as one cause each."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import simulate
from gtpin.diagnosis.inference import settle
from gtpin.diagnosis.inference.search import rough_guess
from gtpin.diagnosis.linear.posterior import NOTHING

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")]

LINES = {
    "shoulder_pan_joint": {12.0: 2.0e-4, 23.0: 1.5e-4, 5.0: 1.2e-4, 31.0: 1.0e-4},
    "wrist_1_joint": {
        10.0: 3.0e-4,
        22.0: 1.8e-4,
        4.0: 2.0e-4,
        13.0: 1.5e-4,
        25.0: 1.7e-4,
        19.0: 1.9e-4,
        7.0: 2.5e-4,
        31.0: 1e-4,
    },
}
"""Of each joint its lines: periods a turn, and their amplitudes, rad. Gears of real arms err so: docs/real_arms.md."""


def erring(seed: int) -> gtpin.Dataset:
    """A machine without another fault, whose joints turn by the sum of their lines too far."""
    rng = np.random.default_rng(seed)
    robot = gtpin.load_robot("ur5")
    data = simulate(robot, "ur5", poses=260, seed=seed).dataset
    q = data.q.copy()
    for joint, lines in LINES.items():
        j = robot.sites.index(joint)
        phases = rng.uniform(-np.pi, np.pi, len(lines))
        for _ in range(30):  # the command that brings the joint to where the machine was measured
            off = sum(a * np.cos(n * q[:, j] - p) for (n, a), p in zip(lines.items(), phases, strict=True))
            q[:, j] = data.q[:, j] - off
    return replace(data, q=q)


@pytest.fixture(scope="module")
def found() -> gtpin.Diagnosis:
    return gtpin.diagnose(erring(3))


def test_each_joint_is_one_cause_and_nothing_else_is_named(found):
    assert found.verdict == "explained"
    assert {(c.effect, c.site) for c in found.causes} == {("rack_periodic", joint) for joint in LINES}


@pytest.mark.parametrize("joint", LINES)
def test_lines_are_in_the_order_of_their_amplitudes(found, joint):
    (cause,) = (c for c in found.causes if c.site == joint)
    sizes = [estimate for name, estimate in cause.parameters.items() if name.startswith("amplitude")]
    assert len(sizes) > 1
    assert all(b.value <= a.value + 2.0 * np.hypot(a.sigma, b.sigma) for a, b in pairwise(sizes))
    strongest = max(LINES[joint], key=lambda line: LINES[joint][line])
    assert 2.0 * np.pi / cause.parameters["period"].value == pytest.approx(strongest, abs=0.5)


@pytest.mark.parametrize("joint", LINES)
def test_every_line_has_its_period_and_amplitude(found, joint):
    (cause,) = (c for c in found.causes if c.site == joint)
    names = [name for name in cause.parameters if name.startswith("period")]
    turns = np.array([2.0 * np.pi / cause.parameters[name].value for name in names])
    assert len(turns) == len(LINES[joint])
    for count, amplitude in LINES[joint].items():
        name = names[int(np.abs(turns - count).argmin())]
        period, size = cause.parameters[name], cause.parameters[name.replace("period", "amplitude")]
        np.testing.assert_allclose(2.0 * np.pi / period.value, count, rtol=0.02)
        assert abs(period.value - 2.0 * np.pi / count) < 4.5 * period.sigma  # 12 lines: 1 in 10,000
        assert abs(size.value - amplitude) < 4.5 * size.sigma


def test_what_is_left_of_the_gap_is_noise(found):
    assert found.gap.after < 1.1 * found.gap.floor < 0.5 * found.gap.before


@pytest.mark.parametrize(("most", "is_long"), [(0, True), (5, False)])
def test_only_a_long_model_stays_with_few_poses(most, is_long, monkeypatch):
    data, seen = erring(3), []

    def spied(hypotheses, before=NOTHING):
        seen.append(len(hypotheses.design.situation))
        return rough_guess(hypotheses, before)

    monkeypatch.setattr(settle, "FEW_POSES", 150)
    monkeypatch.setattr(settle, "MOST", most)
    monkeypatch.setattr(settle, "rough_guess", spied)
    found = gtpin.diagnose(data)
    assert seen[0] == 150
    assert seen[-1] == (150 if is_long else len(data))
    assert {c.site for c in found.causes} == set(LINES)
