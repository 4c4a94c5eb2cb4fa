"""A kept curve of a turning joint is known at the angles of its fit; elsewhere new poses decide whether it is extrapolated."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.effects.active import ActiveEffect
from gtpin.effects.situation import PARTS, References, Situation
from gtpin.model.model_folder import write_model

SITE, J = "elbow_joint", 2
SIGMA = 1e-5
PERIODS = 0.4, 0.31
C = 4e-4 * np.array([0.8, -0.5, 0.0, 0.0, -0.3, 0.9, 0.0, 0.0])
LOW, HIGH = -2.0, 0.4
"""Range of the earlier fit's commands, rad."""


@pytest.fixture(scope="module")
def robot():
    return gtpin.load_robot("ur5")


def curve(q):
    """The sum of both lines, rad: A cos(2 pi q / p) + B sin(2 pi q / p)."""
    waves = [f(2.0 * np.pi * q / p) for p in PERIODS for f in (np.cos, np.sin)]
    return C[[0, 1, 4, 5]] @ np.array(waves)


def earlier():
    """The effect as a fit of commands from ``LOW`` to ``HIGH`` would have it."""
    parts = np.zeros((6, PARTS), dtype=bool)
    measured = np.floor(np.linspace(LOW, HIGH, 1000) / (2.0 * np.pi) * PARTS).astype(int) % PARTS
    parts[:, measured] = True
    known = next(e for e in gtpin.catalogue() if e.id == "rack_periodic")
    fitted = References(
        temperature=20.0,
        time=(0.0, 1.0),
        sessions=(),
        force=(np.zeros(0), np.zeros(0)),
        direction=(np.zeros((0, 3)), np.zeros(0)),
        covariates=(),
        commands=(np.full(6, LOW), np.full(6, HIGH)),
        joints=(np.zeros((7, 6)), np.ones((7, 6))),
        angles=parts,
    )
    return ActiveEffect(known, SITE, PERIODS[0], C, np.zeros((8, 8)), fitted, PERIODS[1:])


def measured(robot, deviation, rng, count=150):
    """Poses by Pinocchio of an arm that is off, whose elbow errs by ``deviation``, as a tracker somewhere reads them."""
    model = robot.model.copy()
    for joint in range(1, model.njoints):
        model.jointPlacements[joint] = model.jointPlacements[joint] * pin.exp6(3e-4 * rng.standard_normal(6))
    data, frame = model.createData(), model.getFrameId(robot.tcp_frame)
    q = rng.uniform(-2.0, 2.0, (count, 6))
    turn, shift = Rotation.from_rotvec([0.3, -0.2, 1.0]), np.array([2.0, -1.0, 0.4])
    T, R = np.empty((count, 3)), np.empty((count, 3, 3))
    for i, row in enumerate(q):
        moved = row.copy()
        moved[J] += deviation(row[J])
        pin.framesForwardKinematics(model, data, moved)
        T[i], R[i] = data.oMf[frame].translation, data.oMf[frame].rotation
    noise = Rotation.from_rotvec(SIGMA * rng.standard_normal((count, 3)))
    return gtpin.Dataset(
        robot="ur5",
        pose=[str(i) for i in range(count)],
        q=q,
        position=turn.apply(T) + shift + SIGMA * rng.standard_normal((count, 3)),
        orientation=(noise * turn * Rotation.from_matrix(R)).as_quat(scalar_first=True),
        instrument=gtpin.data.Instrument(position_sigma=SIGMA, orientation_sigma=SIGMA, frame="free"),
    )


def off(model, data):
    """RMS distance of predicted and measured positions, m."""
    return float(np.sqrt(((model.predict(data.q).T - data.position) ** 2).sum(axis=1).mean()))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:set aside as gross errors")
def test_a_deviation_that_ends_where_the_fit_ended_is_not_extrapolated(robot):
    data = measured(robot, lambda q: curve(q) if q < HIGH else 0.0, np.random.default_rng(5))
    with pytest.warns(gtpin.GtpinWarning, match=f"rack_periodic@{SITE} count as zero"):
        found = gtpin.calibrate(data, keep_effects=[earlier()])
    assert [active.only_measured for active in found.model.effects] == [True]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        without = gtpin.calibrate(data)
    assert off(found.model, data) < 0.5 * off(without.model, data)


@pytest.mark.slow
def test_a_deviation_that_goes_on_is_extrapolated(robot):
    data = measured(robot, curve, np.random.default_rng(6))
    with pytest.warns(gtpin.GtpinWarning, match="extrapolated"):
        found = gtpin.calibrate(data, keep_effects=[earlier()])
    assert [active.only_measured for active in found.model.effects] == [False]
    assert off(found.model, data) < 3.0 * SIGMA * np.sqrt(3.0)


def basis_at(robot, q_of_joint):
    q = np.zeros((len(q_of_joint), 6))
    q[:, J] = q_of_joint
    kinematics = gtpin.Model(gtpin.Geometry.nominal(robot)).kinematics
    active = replace(earlier(), only_measured=True)
    at = Situation(kinematics, q, kinematics.forward(q), {}, fixed=active.references)
    return active.basis(at).command[1] @ C


def test_the_kept_curve_is_zero_elsewhere_and_the_same_after_a_whole_turn(robot):
    angle = np.linspace(-np.pi, np.pi, 500)
    kept = basis_at(robot, angle)
    assert np.abs(kept[(angle > LOW) & (angle < HIGH)]).max() > 1e-4
    margin = 2.0 * np.pi / PARTS
    assert not kept[(angle < LOW - margin) | (angle > HIGH + margin)].any()
    np.testing.assert_allclose(basis_at(robot, angle + 2.0 * np.pi), kept, atol=1e-12)


def test_the_kept_curve_differs_from_the_whole_one_by_what_the_geometry_absorbs(robot):
    angle = np.linspace(LOW, HIGH, 400)
    removed = curve(angle) - basis_at(robot, angle)
    absorbed = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)
    left = removed - absorbed @ np.linalg.lstsq(absorbed, removed, rcond=None)[0]
    assert np.abs(left).max() < 1e-12


@pytest.mark.slow
def test_a_model_file_keeps_where_a_curve_was_measured(robot, tmp_path):
    data = measured(robot, lambda q: curve(q) if q < HIGH else 0.0, np.random.default_rng(7))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        model = gtpin.calibrate(data, keep_effects=[earlier()]).model
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
