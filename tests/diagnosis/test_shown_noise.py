"""The verdict is judged against the noise that was declared or that visits show, never against what is left of a fit."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pinocchio_arm as arm
import pytest
from diagnosed import machine, quietly
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.bench.simulator import simulate_measured
from gtpin.diagnosis import noise as check
from gtpin.diagnosis.diagnose import FALSE_ALARM
from gtpin.diagnosis.hypothesis import Scope
from gtpin.diagnosis.prepare import prepare
from gtpin.diagnosis.priors import PRIORS
from gtpin.model.measured_robot import robot_of

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")]

SIGMA, TURN = 3e-5, 1e-4


def measured(seed, *, scatter=0.0, visits=1, sigmas=(SIGMA, TURN), poses=90):
    """An arm within its tolerances whose target is off by a random shift at each pose, the same at all visits of the pose."""
    rng = np.random.default_rng(seed)
    robot = gtpin.load_robot("ur5")
    model = robot.model.copy()
    for joint in robot.moving_joints:
        model.jointPlacements[joint] = model.jointPlacements[joint] * pin.exp6(3e-4 * rng.standard_normal(6))
    data, q = model.createData(), rng.uniform(-1.5, 1.5, (poses, 6))
    T, R = np.empty((poses, 3)), np.empty((poses, 3, 3))
    for i, row in enumerate(q):
        pin.forwardKinematics(model, data, robot.with_commands(robot.neutral, row))
        at = data.oMi[robot.tcp_joint] * robot.tcp_placement
        T[i], R[i] = at.translation, at.rotation
    T = T + scatter * rng.standard_normal(T.shape)
    again = np.repeat(np.arange(poses), visits)
    turns = Rotation.from_rotvec(TURN * rng.standard_normal((len(again), 3))) * Rotation.from_matrix(R[again])
    return gtpin.Dataset(
        robot="ur5",
        pose=[str(i) for i in again],
        q=q[again],
        position=T[again] + SIGMA * rng.standard_normal((len(again), 3)),
        orientation=turns.as_quat(scalar_first=True),
        instrument=gtpin.data.InstrumentSection(position_sigma=sigmas[0], orientation_sigma=sigmas[1]),
    )


def test_noise_as_declared_is_nothing_beyond_noise():
    found = gtpin.diagnose(measured(1))
    assert found.verdict == "none"
    assert found.noise_source == "declared"
    assert found.gap.floor == pytest.approx(SIGMA * np.sqrt(3.0), rel=0.15)


def test_scatter_beyond_the_declared_noise_is_unknown_and_visits_are_proposed():
    found = gtpin.diagnose(measured(2, scatter=1.2e-4))
    assert found.verdict == "unknown"
    assert [doubt.reason for doubt in found.doubts] == ["excess"]
    assert found.gap.floor == pytest.approx(SIGMA * np.sqrt(3.0), rel=0.05)
    assert found.gap.inferred > 2.0 * found.gap.floor
    assert any("of the measured poses twice more each" in e.measure for e in found.next_experiment)
    assert found.to_json()["gap"]["noise_inferred"] == found.gap.inferred
    assert "don't show whether it is noise" in " ".join(str(found.summary()).split())


@pytest.mark.parametrize("declared", [1.0, 1.0 / 3.0])
def test_scatter_that_repeats_at_each_pose_is_no_noise(declared):
    sigmas = (declared * SIGMA, declared * TURN)
    found = gtpin.diagnose(measured(3, scatter=1.2e-4, visits=2, poses=45, sigmas=sigmas))
    assert found.verdict == "unknown"


@pytest.mark.parametrize("schema", [1, 2])
@pytest.mark.parametrize("seed", [5, 6, 7])
def test_noise_three_times_the_declared_that_visits_show_is_no_effect(seed, schema, tmp_path):
    data = measured(seed, visits=2, poses=60, sigmas=(SIGMA / 3.0, TURN / 3.0))
    if schema == 2:
        data.write(tmp_path / "d")
        toml = (tmp_path / "d" / "dataset.toml").read_text()
        section = '[[instrument]]\nname = "laser"\nkind = "tracker"\nfile = "poses.csv"'
        toml = toml.replace("gtpin-dataset/1", "gtpin-dataset/2").replace("[instrument]", section)
        (tmp_path / "d" / "dataset.toml").write_text(toml)
        data = gtpin.Dataset.read(tmp_path / "d")
    found = gtpin.diagnose(data)
    assert (found.verdict, found.causes, found.doubts) == ("none", (), ())
    assert found.noise_source == "repeats"
    assert found.noise_ratio == pytest.approx(3.0, rel=0.15)
    said = " ".join(str(found.summary()).split())
    assert "scatter between visits" in said
    assert "only noise is left" not in said
    for key in ("position_sigma", "orientation_sigma"):
        assert len([text for text in found.warnings if key in text]) == 1
    if schema == 1:
        assert found.gap.floor == pytest.approx(SIGMA * np.sqrt(3.0), rel=0.15)
        calibrated = " ".join(str(gtpin.calibrate(data).summary()).split())
        assert "agree with the scatter between visits" in calibrated
        assert "agree with the noise of instrument" not in calibrated


def test_noise_three_times_the_declared_without_visits_is_scatter_and_no_unlisted_effect():
    found = gtpin.diagnose(measured(8, sigmas=(SIGMA / 3.0, TURN / 3.0)))
    assert [doubt.reason for doubt in found.doubts] == ["excess"]
    said = " ".join(str(found.summary()).split())
    assert "beyond the declared noise" in said
    assert "catalogue" not in said
    assert "noise is not known" not in said
    assert found.gap.floor == pytest.approx(SIGMA / np.sqrt(3.0), rel=0.05)


@pytest.mark.parametrize("visits", [1, 3])
def test_noise_that_was_not_declared_is_an_assumption_unless_visits_show_it(visits):
    data = measured(4, visits=visits, sigmas=(None, None), poses=90 if visits == 1 else 45)
    found = gtpin.diagnose(data)
    assert found.verdict == "none"
    assert found.noise_source == ("residuals" if visits == 1 else "repeats")
    assert ("It is assumed that" in " ".join(str(found.summary()).split())) == (visits == 1)


@pytest.mark.parametrize(("robot", "size"), [("ur5", 3.0), ("gantry_tau", 6.0)])
@pytest.mark.study
def test_an_error_of_one_station_is_no_noise(robot: str, size: float, tmp_path: Path) -> None:
    simulate_measured(gtpin.load_robot(robot), robot, ["range"], poses=120, seed=7, held_out=1).write_dataset(
        tmp_path / "d"
    )
    data = gtpin.Dataset.read(tmp_path / "d")
    assert gtpin.diagnose(data).verdict == "none"
    rows, sigma = data.readings, data.readings.tables[0].sigma
    drum = size * sigma * np.sin(2.0 * np.pi * rows.columns["range"] / 0.17)  # a wire's drum that is eccentric
    read = rows.columns["range"] + np.where(rows.columns["station"] == "A", drum, 0.0)
    found = gtpin.diagnose(replace(data, readings=replace(rows, columns={**rows.columns, "range": read})))
    assert found.verdict == "unknown"
    assert [(doubt.reason, doubt.site) for doubt in found.doubts] == [("part", "wire A")]
    assert "in the readings of wire A" in " ".join(str(found.summary()).split())


class SearchedError(Exception):
    """There was a search."""


def searched(*_: object) -> None:
    raise SearchedError


def test_repeated_visits_without_more_noise_end_the_check(monkeypatch: pytest.MonkeyPatch) -> None:
    dataset = machine(1, "linearity", "cart2").dataset
    robot = robot_of(dataset)
    prepared = prepare(dataset, robot)
    assert prepared.baseline.chi2_per_dof > PRIORS.misfit
    scope = Scope.of(gtpin.catalogue(), (), FALSE_ALARM, robot, PRIORS)
    without = dataset.take(
        [int(row) for row in dict(zip(dataset.visits.tolist(), range(len(dataset)), strict=True)).values()]
    )
    monkeypatch.setattr(check, "rough_guess", searched)
    assert check.understated_noise(prepared, scope) == {}
    with pytest.raises(SearchedError):  # one visit of each pose says nothing of the noise
        check.understated_noise(prepare(without, robot), scope)


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize(("size", "verdict"), [(0.0, "none"), (1.0, "unknown")])
def test_residuals_that_correlate_by_more_than_chance_are_not_none(size, verdict, seed):
    """A field moves the target by as much as one sigma: too little for the prior odds of an effect that nobody lists."""

    def field(campaign):
        q = campaign.q
        return (
            size
            * arm.SHIFT
            * np.stack([np.sin(3.0 * q[:, 1] * q[:, 2]), np.cos(4.0 * q[:, 2]), np.sin(3.0 * q[:, 1])], 1)
        )

    found = gtpin.diagnose(arm.measured(seed, tool=field, poses=160))
    assert (found.verdict, found.causes) == (verdict, ())


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_sigmas_that_are_declared_a_third_too_small_are_no_correlation(seed):
    data = arm.measured(seed, poses=160)
    small = {key: 0.67 * getattr(data.instrument, key) for key in ("position_sigma", "orientation_sigma")}
    found = quietly(gtpin.diagnose, replace(data, instrument=data.instrument.model_copy(update=small)))
    assert found.causes == ()
    assert "smooth_term" not in [doubt.reason for doubt in found.doubts]
