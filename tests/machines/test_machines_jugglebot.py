"""A real machine: 108 poses of Jugglebot."""

import warnings
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


def test_calibration_leaves_hardly_more_than_the_least_that_48_parameters_can() -> None:
    """A plain least-squares fit of leg lengths is the least: 0.41 mm by the README of the poses."""
    calibration = calibrated(dataset())
    left = legs(dict(zip(calibration.names, calibration.model.geometry.values, strict=True)), dataset())
    names = list(nominal("stewart_jugglebot").parameters())
    at = np.array([start(name, nominal("stewart_jugglebot")) for name in names])
    plain = least_squares(lambda x: 1e3 * legs(dict(zip(names, x, strict=True)), dataset()).ravel(), at, method="lm")
    least = float(np.sqrt((plain.fun**2).mean())) * 1e-3
    assert len(calibration.names) == len(names) == 48
    assert rms(left) <= 0.43e-3
    assert rms(left) <= 1.02 * least


def test_what_the_noise_is_made_of_is_told_without_repeats() -> None:
    """Nobody declared the noise: most of it lies along single legs, and neighbouring poses share it."""
    noise = calibrated(dataset()).noise
    assert noise.source == "residuals"
    assert noise.repeatability == 0.0
    assert 0.2e-3 < noise.model_discrepancy < 0.6e-3
    assert noise.position_sigma < 0.3 * noise.model_discrepancy


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
