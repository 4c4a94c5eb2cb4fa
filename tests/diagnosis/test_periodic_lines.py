"""Periodic errors: all lines of a joint are found as one cause, and none that scatter alone would show."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.bench.simulator import simulate
from gtpin.diagnosis import noise
from gtpin.diagnosis.evidence import NOTHING
from gtpin.diagnosis.priors import PRIORS
from gtpin.diagnosis.scan import FittedLines
from gtpin.diagnosis.search import rough_guess

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")

Floats = npt.NDArray[np.float64]

POSES, RANGE = 150, 4.0
"""Poses, and the range of the joint's commands, rad."""
FREQUENCIES = np.arange(0.5, 12.0, 0.05)
"""Cycles per rad that are tried: six in each of the resolution 1 / ``RANGE`` and a little more."""
DRAWS = 120


def waves(q: Floats) -> Floats:
    """(f, N, 2) cosine and sine of each frequency."""
    phase = 2.0 * np.pi * FREQUENCIES[:, None] * q
    return np.stack([np.cos(phase), np.sin(phase)], axis=2)


def searched(
    shapes: Floats, errors: Floats, variance: Floats, lines: int, effective_parameters: float = 0.0
) -> FittedLines:
    """Errors with the lines that a search finds in them, each the one that takes most of what the others leave."""
    left, found, orthonormal = errors, [], np.linalg.qr(shapes)[0]
    for _ in range(lines):
        along = left @ orthonormal  # (f, 2): what a least-squares fit of each frequency takes
        best = int(np.argmax((along**2).sum(axis=1)))
        found.append(shapes[best])
        left = left - orthonormal[best] @ along[best]
    return FittedLines(errors, variance, tuple(found), len(FREQUENCIES), effective_parameters)


def of_one_drive(kind: str, count: int, rng: np.random.Generator) -> FittedLines:
    """Errors along a joint's own travel, with some lines: of gears, or of what differs from pose to pose beside one turn."""
    q = rng.uniform(0.0, 5.5, 200)
    if kind == "gears":
        cycles, sizes, phases = (
            rng.uniform(3.0, 100.0, count),
            rng.uniform(0.3, 1.0, count),
            rng.uniform(0.0, 6.3, count),
        )
        errors = np.cos(q[:, None] * cycles + phases) @ sizes
    else:
        errors = rng.standard_normal(len(q)) + (0.5 * np.cos(q) if kind == "scatter and a turn" else 0.0)
    errors = errors / errors.std() + 0.2 * rng.standard_normal(len(q))
    lines = tuple(np.zeros((len(q), 2)) for _ in range(count))
    return FittedLines(errors, np.full(len(q), 0.04), lines, 1000, command=q)


@pytest.mark.parametrize(
    ("kind", "count", "holds"),
    [
        ("gears", 2, True),
        ("gears", 8, True),
        ("scatter", 2, False),
        ("scatter", 8, False),
        ("scatter and a turn", 8, False),
    ],
)
def test_lines_of_gears_hold_at_commands_that_did_not_choose_them_and_those_of_scatter_do_not(
    kind: str, count: int, holds: bool
) -> None:
    rng = np.random.default_rng(5)
    periods = 2.0 * np.pi / np.arange(1.0, 202.0, 2.0 * np.pi / (6.0 * 5.5))
    assert [of_one_drive(kind, count, rng).held(periods) >= PRIORS.lines_hold for _ in range(10)] == [holds] * 10


@pytest.mark.slow
@pytest.mark.parametrize("spread", [0.0, 1.0])
def test_scatter_is_significant_no_more_often_than_is_said(spread: float) -> None:
    rng = np.random.default_rng(11)
    significant = 0
    for _ in range(DRAWS):
        q, size = rng.uniform(0.0, RANGE, POSES), 10.0 ** rng.uniform(-1.0, 2.0)
        variance = np.exp(spread * rng.standard_normal(POSES))
        errors = np.sqrt(variance + size**2) * rng.standard_normal(POSES)
        significant += searched(waves(q), errors, variance, lines=2).chance() <= 0.05
    assert significant <= 14  # 6 are expected at most; more than 14 has a probability of 1 in 1,000


@pytest.mark.slow
@pytest.mark.parametrize(
    ("part", "others", "lines", "seed"),
    [(1.0, POSES // 2, 6, 13), (0.5, 4 * POSES // 5, 1, 14), (0.9, 4 * POSES // 5, 1, 14)],
)
def test_scatter_is_not_significant_more_often_beside_causes_that_fit_a_part_of_it(
    part: float, others: int, lines: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    significant = 0
    for _ in range(DRAWS):
        functions = np.linalg.qr(rng.standard_normal((POSES, others)))[0]  # of other coordinates
        H = part * functions @ functions.T
        apart = np.eye(POSES) - H
        shapes, errors = apart @ waves(rng.uniform(0.0, RANGE, POSES)), apart @ rng.standard_normal(POSES)
        found = searched(shapes, errors, np.full(POSES, 1e-4), lines, np.trace(2.0 * H - H @ H))
        significant += found.chance() <= 0.05
    assert significant <= 14  # 6 are expected at most; more than 14 has a probability of 1 in 1,000


def test_errors_that_other_causes_fit_completely_show_no_line() -> None:
    shapes = waves(np.linspace(0.0, RANGE, 4))
    for effective_parameters in (4.0, 5.0):
        assert searched(shapes, np.full(4, 1e-9), np.ones(4), 1, effective_parameters).chance() == 1.0


def test_a_line_with_a_third_of_the_power_is_significant() -> None:
    rng = np.random.default_rng(12)
    for _ in range(20):
        q = rng.uniform(0.0, RANGE, POSES)
        line = np.cos(2.0 * np.pi * rng.uniform(1.0, 11.0) * q - rng.uniform(0.0, 2.0 * np.pi))
        assert searched(waves(q), line + rng.standard_normal(POSES), np.full(POSES, 0.1), lines=4).chance() < 1e-3


def erring(seed: int, size: float) -> gtpin.Dataset:
    """An arm without another fault, one joint of which is off by another random angle at every command, repeatably."""
    rng = np.random.default_rng(seed)
    robot = gtpin.load_robot("ur5")
    data = simulate(robot, "ur5", poses=200, seed=seed).dataset
    q, j = data.q.copy(), robot.sites.index("wrist_1_joint")
    same = np.unique(q, axis=0, return_inverse=True)[1].ravel()
    q[:, j] -= size * rng.standard_normal(same.max() + 1)[same]
    return replace(data, q=q)


@pytest.mark.slow
def test_a_joint_with_random_errors_is_unknown_and_no_periodic_error() -> None:
    found = gtpin.diagnose(erring(1, 1e-4))
    assert found.verdict == "unknown"
    assert not found.causes
    assert {doubt.site for doubt in found.doubts} == {"wrist_1_joint"}


def rough(q: Floats, length: float, size: float, rng: np.random.Generator) -> Floats:
    """A random function of a command without a period: a Gaussian process, ``length`` a share of the range."""
    grid = np.linspace(q.min(), q.max(), 300)
    covariance = np.exp(-0.5 * ((grid[:, None] - grid) / (length * np.ptp(q))) ** 2) + 1e-8 * np.eye(300)
    return np.interp(q, grid, size * np.linalg.cholesky(covariance) @ rng.standard_normal(300))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
@pytest.mark.study
def test_rough_errors_without_a_period_are_no_certain_periodic_errors(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = gtpin.load_robot("ur5")
    data = simulate(robot, "ur5", poses=220, seed=seed).dataset
    sizes = dict.fromkeys(robot.sites, 1e-4) | {"shoulder_pan_joint": 3e-4}
    errors = np.column_stack([rough(data.q[:, i], 0.04, sizes[site], rng) for i, site in enumerate(robot.sites)])
    j = robot.sites.index("wrist_1_joint")
    errors[:, j] += rough(data.q[:, j], 0.1, 6e-4, rng)
    found = gtpin.diagnose(replace(data, q=data.q + errors))
    assert found.verdict == "unknown"
    assert all(cause.probability < 0.95 for cause in found.causes)
    best = found.unexplained.correlates[0]  # the largest of the errors
    assert (best.site, best.coordinates) == ("shoulder_pan_joint", "q1")


@pytest.mark.slow
@pytest.mark.study
def test_a_line_at_few_commands_that_are_visited_often_is_named() -> None:
    rng = np.random.default_rng(2)
    robot = gtpin.load_robot("ur5")
    data = simulate(robot, "ur5", poses=200, seed=2).dataset
    visited = data.take(np.repeat(np.unique(data.visits, return_index=True)[1][:50], 4))
    noise = [1.5e-5 * rng.standard_normal((200, 3)), 5e-5 * rng.standard_normal((200, 3))]
    q, j = visited.q.copy(), robot.sites.index("wrist_1_joint")
    for _ in range(30):  # the command that brings the joint to where the machine was measured
        q[:, j] = visited.q[:, j] - 1.5e-4 * np.cos(9.0 * q[:, j])
    turned = Rotation.from_rotvec(noise[1]) * Rotation.from_quat(visited.orientation, scalar_first=True)
    found = gtpin.diagnose(
        replace(
            visited,
            q=q,
            position=visited.position + noise[0],
            orientation=turned.as_quat(scalar_first=True),
            pose=np.arange(200).astype(str).astype(object),
        )
    )
    assert [(c.effect, c.site) for c in found.causes] == [("rack_periodic", "wrist_1_joint")]


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


def with_lines(seed: int) -> gtpin.Dataset:
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
    return gtpin.diagnose(with_lines(3))


@pytest.mark.slow
def test_each_joint_is_one_cause_and_nothing_else_is_named(found):
    assert found.verdict == "explained"
    assert {(c.effect, c.site) for c in found.causes} == {("rack_periodic", joint) for joint in LINES}


@pytest.mark.slow
@pytest.mark.parametrize("joint", LINES)
def test_lines_are_in_the_order_of_their_amplitudes(found, joint):
    (cause,) = (c for c in found.causes if c.site == joint)
    sizes = [estimate for name, estimate in cause.parameters.items() if name.startswith("amplitude")]
    assert len(sizes) > 1
    assert all(b.value <= a.value + 2.0 * np.hypot(a.sigma, b.sigma) for a, b in pairwise(sizes))
    strongest = max(LINES[joint], key=lambda line: LINES[joint][line])
    assert 2.0 * np.pi / cause.parameters["period"].value == pytest.approx(strongest, abs=0.5)


@pytest.mark.slow
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


@pytest.mark.slow
def test_what_is_left_of_the_gap_is_noise(found):
    assert found.gap.after < 1.1 * found.gap.floor < 0.5 * found.gap.before


@pytest.mark.slow
@pytest.mark.parametrize(("most", "is_long"), [(0, True), (5, False)])
def test_only_a_long_model_stays_with_few_poses(most, is_long, monkeypatch):
    data, seen = with_lines(3), []

    def spied(hypotheses, before=NOTHING):
        seen.append(len(hypotheses.design.operating_points))
        return rough_guess(hypotheses, before)

    monkeypatch.setattr(noise, "FEW_POSES", 150)
    monkeypatch.setattr(noise, "MOST_TERMS", most)
    monkeypatch.setattr(noise, "rough_guess", spied)
    found = gtpin.diagnose(data)
    assert seen[0] == 150
    assert seen[-1] == (150 if is_long else len(data))
    assert {c.site for c in found.causes} == set(LINES)
