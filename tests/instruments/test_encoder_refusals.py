"""Encoders whose joint, readings or description can't be: one error with place and remedy, and those that only look wrong."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from readable import check_as_they_stand
from virtual_five_bar import SIGMA, FiveBar, commands, drawn, encoder, table, urdf, written

import gtpin
from gtpin.errors import DatasetError, RobotError
from gtpin.robot.description import RobotDescription

Floats = np.ndarray
TURN = 2.0 * np.pi


def readings(count: int = 60, zero: float = 4e-3) -> tuple[Floats, Floats, np.random.Generator]:
    """Commands, what an encoder at the first elbow reads, and the generator for more."""
    rng = np.random.default_rng(5)
    machine, q = FiveBar.off(drawn(rng)), commands(rng, count)
    return q, machine.elbows(q)[:, 0] + zero + rng.normal(0.0, SIGMA, count), rng


def calibrated(folder: Path, q: Floats, read: Floats, kind: str = "revolute", **said: object) -> gtpin.Calibration:
    one = encoder("elbow1", **said)
    return gtpin.calibrate(gtpin.Dataset.read(written(folder, [one], {"elbow1": table(q, reading=read)}, kind)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("joint", "what"),
    [
        ("drive1", "joint drive1 is driven by q1"),
        ("nowhere", "five_bar has no joint 'nowhere'"),
    ],
)
def test_a_joint_that_can_t_be_read_is_refused_with_those_that_can(tmp_path: Path, joint: str, what: str) -> None:
    q, read, _ = readings()
    with pytest.raises(DatasetError, match=what) as caught:
        calibrated(tmp_path, q, read, joint=joint)
    assert caught.value.column == "instrument.0.joint"
    assert caught.value.file == tmp_path / "dataset.toml"
    assert "elbow1, elbow2" in caught.value.hint


@pytest.mark.parametrize(
    ("joint", "what"),
    [
        ("finger", "follows drive1 by <mimic>"),
        ("flange", "joint flange does not move: it is fixed"),
        ("spare", "joint spare does not move"),
        ("float", "joint float has 6 coordinates: an encoder reads one"),
    ],
)
def test_a_joint_that_follows_rests_or_has_several_coordinates_is_refused(joint: str, what: str) -> None:
    """A finger that mimics a drive, a fixed flange, an arm beside the loop that nothing moves, a body that loops hold alone."""
    body, hung = ('<link name="{0}"/><joint name="{1}" type="{2}"><parent link="{3}"/><child link="{0}"/>', "</joint>")
    limit = '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'
    more = (
        body.format("tip", "finger", "revolute", "right") + limit + '<mimic joint="drive1"/>' + hung,
        body.format("plate", "flange", "fixed", "left_far") + hung,
        body.format("arm", "spare", "revolute", "base") + limit + hung,
        body.format("held", "float", "floating", "base") + hung,
    )
    held = "".join(
        f'<loop_joint name="hold{i}"><link1 link="held" xyz="{p}"/><link2 link="left" xyz="{p}"/></loop_joint>'
        for i, p in enumerate(("0 0 0", "0.1 0 0", "0 0.1 0"))
    )
    text = urdf().replace("<gtpin>", "".join(more) + (held if joint == "float" else "") + "<gtpin>")
    if joint != "float":
        text = text.replace(more[3], "")
    robot = RobotDescription.parse(text)
    with pytest.raises(RobotError, match=what):
        gtpin.Robot(robot).measuring([joint])


def test_a_robot_without_loops_has_no_joint_to_read() -> None:
    with pytest.raises(RobotError, match="driven by q1") as caught:
        gtpin.load_robot("ur5").measuring(["shoulder_pan_joint"])
    assert caught.value.hint == "no joint of this robot is moved by its loops alone"


def named(folder: Path, q: Floats, read: Floats) -> None:
    """Check readings that no fit explains as they stand, and any fit with the mistake corrected."""
    path = written(folder, [encoder("elbow1")], {"elbow1": table(q, reading=read)})
    check_as_they_stand(gtpin.Dataset.read(path))


Change = Callable[[Floats, np.random.Generator], Floats]
WRONG: dict[str, tuple[Change, str, Callable[[Path, Floats, Floats], object]]] = {
    "degrees": (lambda read, _: np.rad2deg(read), "readings look like degrees ", named),
    "the other way": (lambda read, _: -read, "readings have the other sign", calibrated),
    "degrees the other way": (lambda read, _: -np.rad2deg(read), "degrees of the other sign", named),
    "another zero": (lambda read, _: read + 0.5, "farther off than zero_sigma says", calibrated),
    "shuffled": (lambda read, rng: rng.permutation(read), "mrad off what the nominal robot gives", named),
    "nothing": (lambda read, _: 0.0 * read, "mrad off what the nominal robot gives", calibrated),
}
"""What was done to readings, what is said of it, and who says it: a whole calibration fits them for up to half a minute."""


@pytest.mark.slow
@pytest.mark.parametrize("name", WRONG)
def test_readings_that_can_t_be_say_what_they_look_like(tmp_path: Path, name: str) -> None:
    q, read, rng = readings()
    change, what, said = WRONG[name]
    with pytest.raises(DatasetError, match=what) as caught:
        said(tmp_path, q, change(read, rng))
    assert caught.value.hint


@pytest.mark.slow
def test_readings_that_wrap_by_full_turns_calibrate_the_same(tmp_path: Path) -> None:
    q, read, rng = readings()
    plain = calibrated(tmp_path / "a", q, read)
    continuous = calibrated(tmp_path / "b", q, read, "continuous")
    turned = calibrated(tmp_path / "c", q, read + TURN * rng.integers(-3, 4, len(read)))
    for other in (continuous, turned):
        np.testing.assert_allclose(other.model.geometry.values, plain.model.geometry.values, rtol=0, atol=1e-10)


@pytest.mark.slow
def test_readings_that_wrap_within_the_range_calibrate_where_the_zero_may_be_anywhere(tmp_path: Path) -> None:
    q, read, _ = readings()
    wrapped = (read + 2.9 + np.pi) % TURN - np.pi  # the elbow's half turn is in the middle of its range
    assert np.ptp(wrapped) > 6.0
    plain, found = (calibrated(tmp_path / n, q, r, zero_sigma=5.0) for n, r in (("a", read), ("b", wrapped)))
    np.testing.assert_allclose(found.model.geometry.values, plain.model.geometry.values, rtol=0, atol=1e-7)
    assert found.unknown("elbow1.zero").value - plain.unknown("elbow1.zero").value == pytest.approx(2.9, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [SIGMA, None], ids=["declared", "undeclared"])
@pytest.mark.parametrize("count", [1, 3, 5])
def test_fewer_readings_than_a_fit_needs_are_refused(tmp_path: Path, count: int, sigma: float | None) -> None:
    q, read, _ = readings()
    with pytest.raises(DatasetError, match="degrees of freedom"):
        calibrated(tmp_path, q[:count], read[:count], sigma=sigma)


@pytest.mark.slow
def test_an_encoder_has_no_target(tmp_path: Path) -> None:
    q, read, _ = readings()
    with pytest.raises(DatasetError, match="an encoder has no target"):
        calibrated(tmp_path, q, read, target=[0.0, 0.0, 0.1])


@pytest.mark.slow
def test_gross_errors_are_set_aside_and_nothing_else(tmp_path: Path) -> None:
    q, read, rng = readings()
    bad = rng.choice(len(q), 3, replace=False)
    read[bad] += 2e-3 * rng.choice([-1.0, 1.0], 3)
    with pytest.warns(gtpin.GtpinWarning, match="set aside"):
        found = calibrated(tmp_path, q, read)
    assert sorted(found.rejected) == sorted(f"p{i}" for i in bad)
