"""A real machine: 108 poses of Jugglebot."""

import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from closures import Closures, nominal
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.data.split import random

FOLDER = Path(__file__).parents[2] / "examples/jugglebot/sample"

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not FOLDER.is_dir(), reason="the examples are not here")]


@cache
def dataset() -> gtpin.Dataset:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        return gtpin.Dataset.read(FOLDER)


def legs(values: dict[str, float], data: gtpin.Dataset) -> np.ndarray:
    """(N, 6) by how much legs are longer than parameters of these names say, m: joints' distances at the measured poses."""
    measured: Closures = nominal("stewart_jugglebot")
    machine = measured.off({name: value - start(name, measured) for name, value in values.items()})
    R = Rotation.from_quat(data.orientation, scalar_first=True).as_matrix()
    return machine.residual(data.q, data.position, R)


def start(name: str, machine: Closures) -> float:
    word, owner = name.split("[")[0], name.split("[")[1][:4]
    if word == "scale":
        return 1.0
    i = machine.rod(owner)
    table = {"length": machine.L0, "platform_joint": machine.P, "base_joint": machine.C0}[word][i]
    return float(table if word == "length" else table["xyz".index(name[-1])])


def calibrated(data: gtpin.Dataset) -> gtpin.Calibration:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        return gtpin.calibrate(data)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean()))


def test_poses_that_are_left_out_come_as_near_as_by_plain_least_squares_of_leg_lengths() -> None:
    """In position and orientation. Leg lengths alone that fit leaves 0.41 mm of, by the README of the poses."""
    names = list(nominal("stewart_jugglebot").parameters())
    at = np.array([start(name, nominal("stewart_jugglebot")) for name in names])
    off: dict[str, list[np.ndarray]] = {"gtpin": [], "plain": []}
    for held in random(dataset(), 4):
        train, test = dataset().take(~held), dataset().take(held)
        mine = calibrated(train).model
        assert mine.geometry.names == tuple(names)
        plain = least_squares(
            lambda x, d=train: 1e3 * legs(dict(zip(names, x, strict=True)), d).ravel(), at, method="lm"
        )
        other = replace(mine, geometry=mine.geometry.with_values(plain.x))
        for name, model in (("gtpin", mine), ("plain", other)):
            seen = model.predict(test.q, test.covariates)
            turn = Rotation.from_quat(test.orientation, scalar_first=True) * Rotation.from_matrix(seen.R).inv()
            off[name].append(np.hstack([test.position - seen.T, turn.as_rotvec()]))
    mine, plain = (np.sqrt((np.concatenate(off[name]) ** 2).mean(axis=0)) for name in ("gtpin", "plain"))
    for unit in (slice(0, 3), slice(3, 6)):
        assert rms(mine[unit]) <= 1.02 * rms(plain[unit])


def test_what_neighbouring_poses_share_is_no_repeatability() -> None:
    noise = calibrated(dataset()).noise
    assert noise.source == "residuals"
    assert noise.repeatability == 0.0


def test_the_causes_that_are_named_make_poses_that_were_not_fitted_come_nearer() -> None:
    held = random(dataset(), 3)[0]
    train, test = dataset().take(~held), dataset().take(held)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        found = gtpin.diagnose(train)
    assert ("link_compliance", "arm") in {(cause.effect, cause.site) for cause in found.causes}

    def left(model: gtpin.Model) -> float:
        off = model.predict(test.q, test.covariates).T - test.position
        return rms(np.linalg.norm(off, axis=1))

    assert left(found.model) < 0.9 * left(found.baseline.model)
