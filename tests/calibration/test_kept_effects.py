"""Effects of an earlier model stay as they are while the geometry is identified.

A kept curve of a turning joint is known at the angles of its fit; elsewhere new poses decide whether it is extrapolated.
"""

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner
from virtual_arm import ROBOT, Arm

import gtpin
from gtpin.cli import app
from gtpin.effects.active import ActiveEffect
from gtpin.effects.operating_points import PARTS, OperatingPoints, References
from gtpin.model.model_folder import write_model
from gtpin.model.predict import predict

SITE, J = "elbow_joint", 2
SIGMA = 1e-5
LOW, HIGH = -2.0, 2.0
"""Range of the new commands, rad."""
WAVE = {0.4: 8e-4 * np.array([np.cos(0.7), np.sin(0.7)])}
"""Coefficients of cosine and sine, rad, by the period, rad."""
TWO = {0.4: 4e-4 * np.array([0.8, -0.5]), 0.31: 4e-4 * np.array([-0.3, 0.9])}
END = 0.4
"""Where the range of the earlier fit's commands ended, for a curve that was measured in a part alone, rad."""


def curve(waves, q):
    """A cos(2 pi q / p) + B sin(2 pi q / p), summed over the periods p, rad."""
    return sum(c @ np.array([np.cos(2.0 * np.pi * q / p), np.sin(2.0 * np.pi * q / p)]) for p, c in waves.items())


def active(waves=WAVE, effect="rack_periodic", site=SITE, high=HIGH, parts=None):
    """The effect as a fit of commands up to ``high`` would have it; ``parts``: the parts of a turn that it knows."""
    known = next(e for e in gtpin.catalogue() if e.id == effect)
    c = np.concatenate([[*pair, 0.0, 0.0] for pair in waves.values()])
    fitted = References(
        temperature=20.0,
        time=(0.0, 1.0),
        sessions=(),
        force=(np.zeros(0), np.zeros(0)),
        direction=(np.zeros((0, 3)), np.zeros(0)),
        covariates=(),
        commands=(np.full(6, LOW), np.full(6, high)),
        joints=(np.zeros((7, 6)), np.ones((7, 6))),
    )
    fitted = fitted if parts is None else replace(fitted, angles=parts)
    first, *more = waves if effect == "rack_periodic" else (None,)
    return ActiveEffect(known, site, first, c, np.zeros((len(c), len(c))), fitted, tuple(more))


def in_part():
    """Two lines as a fit of commands from ``LOW`` to ``END`` would have them."""
    parts = np.zeros((6, PARTS), dtype=bool)
    parts[:, np.floor(np.linspace(LOW, END, 1000) / (2.0 * np.pi) * PARTS).astype(int) % PARTS] = True
    return active(TWO, high=END, parts=parts)


def machine(deviation, rng):
    """An arm that is off, whose elbow errs by ``deviation`` of its command, rad."""
    return Arm.drawn(rng, 3e-4, off=lambda q: np.where(np.arange(6) == J, deviation(q[J]), 0.0))


def measured(arm, rng, count):
    return arm.measured(rng.uniform(LOW, HIGH, (count, 6)), rng, (SIGMA, SIGMA))


@pytest.fixture(scope="module")
def case():
    rng = np.random.default_rng(11)
    arm = machine(lambda q: curve(WAVE, q), rng)
    return arm, measured(arm, rng, 60)


def off(model, data):
    """RMS distance of predicted and measured positions, m."""
    return float(np.sqrt(((model.predict(data.q).T - data.position) ** 2).sum(axis=1).mean()))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
def test_geometry_and_kept_effects_together_predict_other_poses(case):
    arm, data = case
    fitted = gtpin.calibrate(data, keep_effects=[active()])
    assert fitted.warnings == ()
    other = measured(arm, np.random.default_rng(12), 200)
    assert off(fitted.model, other) < 3.0 * SIGMA
    assert 0.7 < fitted.chi2_per_dof < 1.4
    usual, same = gtpin.calibrate(data), gtpin.calibrate(data, keep_effects=[])
    assert off(usual.model, other) > 10.0 * SIGMA
    np.testing.assert_array_equal(same.values, usual.values)


@pytest.mark.slow
def test_what_only_one_day_had_is_left_out_with_a_warning(case):
    of_its_day = [active(effect="frame_shift", site="frame"), active(effect="target_shift", site="platform")]
    with pytest.warns(gtpin.GtpinWarning, match="frame_shift@frame, target_shift@platform"):
        fitted = gtpin.calibrate(case[1], keep_effects=[active(), *of_its_day])
    assert [one.name for one in fitted.model.effects] == [f"rack_periodic@{SITE}"]


def test_an_effect_of_another_robot_is_refused(case):
    with pytest.raises(gtpin.GtpinError, match="cart1"):
        gtpin.calibrate(case[1], keep_effects=[active(site="cart1")])


def test_readings_of_other_instruments_are_refused(tmp_path):
    made = CliRunner().invoke(
        app, ["simulate", "--robot", "ur5", "--instrument", "range", "--poses", "40", "-o", str(tmp_path / "wire")]
    )
    assert made.exit_code == 0, made.output
    with pytest.raises(gtpin.GtpinError, match="one tracker"):
        gtpin.calibrate(gtpin.Dataset.read(tmp_path / "wire"), keep_effects=[active()])


@pytest.mark.slow
def test_commands_outside_the_range_of_the_fit_are_said(case):
    model = gtpin.calibrate(case[1], keep_effects=[active()]).model
    q = np.zeros((4, 6))
    q[1:3, J] = HIGH + 0.5, LOW - 0.5
    commands = gtpin.Commands(pose=list("abcd"), q=q)
    with pytest.warns(gtpin.GtpinWarning, match=r"2 of 4 commands of elbow_joint .* extrapolated"):
        predict(model, commands)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        predict(model, replace(commands, q=np.zeros((4, 6))))


@pytest.mark.slow
def test_the_command_keeps_the_effects_of_a_folder(case, tmp_path):
    _, data = case
    write_model(gtpin.calibrate(data, keep_effects=[active()]).model, tmp_path / "earlier")
    data.save(tmp_path / "data")
    done = CliRunner().invoke(
        app,
        ["calibrate", str(tmp_path / "data"), "--keep-effects", str(tmp_path / "earlier"), "-o", str(tmp_path / "out")],
    )
    assert done.exit_code == 0, done.output
    again = gtpin.read_model(tmp_path / "out")
    assert [one.name for one in again.effects] == [f"rack_periodic@{SITE}"]
    assert off(again, data) < 3.0 * SIGMA


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
def test_a_deviation_that_ends_where_the_fit_ended_is_not_extrapolated_nor_in_the_file_of_the_model(tmp_path):
    rng = np.random.default_rng(5)
    data = measured(machine(lambda q: curve(TWO, q) if q < END else 0.0, rng), rng, 150)
    with pytest.warns(gtpin.GtpinWarning, match=f"rack_periodic@{SITE} count as zero"):
        model = gtpin.calibrate(data, keep_effects=[in_part()]).model
    assert [one.only_measured for one in model.effects] == [True]
    assert off(model, data) < 0.5 * off(gtpin.calibrate(data).model, data)

    write_model(model, tmp_path / "model")
    again = gtpin.read_model(tmp_path / "model")
    assert again.effects[0].only_measured
    np.testing.assert_allclose(again.predict(data.q).T, model.predict(data.q).T, atol=1e-12)
    path = tmp_path / "model" / "model.json"
    text = json.loads(path.read_text())
    del text["effects"][0]["references"]["commands"]["measured"]
    path.write_text(json.dumps(text))
    with pytest.raises(gtpin.GtpinError, match="only_measured"):
        gtpin.read_model(tmp_path / "model")


@pytest.mark.slow
def test_a_deviation_that_goes_on_is_extrapolated():
    rng = np.random.default_rng(6)
    data = measured(machine(lambda q: curve(TWO, q), rng), rng, 150)
    with pytest.warns(gtpin.GtpinWarning, match="extrapolated"):
        found = gtpin.calibrate(data, keep_effects=[in_part()])
    assert [one.only_measured for one in found.model.effects] == [False]
    assert off(found.model, data) < 3.0 * SIGMA * np.sqrt(3.0)


def kept_at(angle):
    """The kept curve, rad, at commands of the elbow."""
    q = np.where(np.arange(6) == J, angle[:, None], 0.0)
    kinematics = gtpin.Model(gtpin.Geometry.nominal(ROBOT)).kinematics
    one = replace(in_part(), only_measured=True)
    at = OperatingPoints(kinematics, q, kinematics.forward(q), {}, fixed=one.references)
    return one.basis(at).command[1] @ one.coefficients


def test_the_kept_curve_is_zero_elsewhere_and_the_same_after_a_whole_turn():
    angle = np.linspace(-np.pi, np.pi, 500)
    kept = kept_at(angle)
    assert np.abs(kept[(angle > LOW) & (angle < END)]).max() > 1e-4
    margin = 2.0 * np.pi / PARTS
    assert not kept[(angle < LOW - margin) | (angle > END + margin)].any()
    np.testing.assert_allclose(kept_at(angle + 2.0 * np.pi), kept, atol=1e-12)


def test_the_kept_curve_differs_from_the_whole_one_by_what_the_geometry_absorbs():
    angle = np.linspace(LOW, END, 400)
    removed = curve(TWO, angle) - kept_at(angle)
    absorbed = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)
    left = removed - absorbed @ np.linalg.lstsq(absorbed, removed, rcond=None)[0]
    assert np.abs(left).max() < 1e-12
