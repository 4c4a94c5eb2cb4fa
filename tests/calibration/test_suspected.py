"""A suspected mistake is an error only where data can't be fitted as they are, and can with the mistake corrected."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.calibration.checks.suspected import NO_FIT, UNCERTAIN, recalled, suspect
from gtpin.calibration.gauss_newton import FlatValleyError
from gtpin.data import Dataset, InstrumentSection
from gtpin.errors import ConvergenceError, DatasetError, GtpinError, GtpinWarning

MISTAKE = DatasetError("q1 looks reversed", column="q1", hint="change the sign of q1")


def of(position: float | None, orientation: float | None, *, trusted: bool = False) -> Dataset:
    known = InstrumentSection(position_sigma=position, orientation_sigma=orientation)
    return Dataset("ur5", ["a"], np.zeros((1, 6)), np.zeros((1, 3)), instrument=known, trusted=trusted)


@pytest.mark.parametrize(
    ("declared", "before", "after"),
    [
        ((2e-5, None), NO_FIT, (3e-5, 0.0)),  # only the corrected data can be fitted
        ((2e-5, None), (3e-4, 0.0), (2e-5, 0.0)),  # and to the noise
        ((2e-5, None), (0.3, 0.0), (5e-3, 0.0)),  # a rough machine, and a whole unit off
        ((None, None), (0.05, 0.0), (2e-4, 0.0)),
        ((2e-5, 5e-5), (2e-5, 5e-2), (2e-5, 1e-4)),  # orientations alone
    ],
)
def test_data_that_fit_only_with_the_correction_are_refused(
    declared: tuple[float | None, float | None], before: tuple[float, float], after: tuple[float, float]
) -> None:
    with pytest.raises(DatasetError, match="q1 looks reversed"):
        suspect(MISTAKE, of(*declared), before, after)
    with pytest.warns(GtpinWarning, match="q1 looks reversed"):
        suspect(MISTAKE, of(*declared, trusted=True), before, after)


@pytest.mark.parametrize(
    ("declared", "before", "after"),
    [
        ((2e-5, None), (1e-4, 0.0), (1e-5, 0.0)),  # five times the noise: an effect
        ((2e-5, None), (3e-3, 0.0), (1e-3, 0.0)),  # the correction leaves most of it
        ((2e-5, None), NO_FIT, NO_FIT),  # the correction does not fit either
        ((None, None), (2e-3, 0.0), (1.5e-3, 0.0)),
        ((2e-5, 5e-5), (2e-5, 2e-3), (2e-5, 1.6e-3)),
    ],
)
def test_otherwise_there_is_a_warning_with_both_residuals(
    declared: tuple[float | None, float | None], before: tuple[float, float], after: tuple[float, float]
) -> None:
    with pytest.warns(GtpinWarning, match="q1 looks reversed.*used as they are"):
        suspect(MISTAKE, of(*declared), before, after)


def test_a_convention_of_rotations_is_certain_where_it_leaves_exactly_the_noise_and_nothing_else_is_left() -> None:
    known = of(2e-5, 5e-5)
    with pytest.raises(DatasetError, match="q1 looks reversed"):
        suspect(MISTAKE, known, (2e-5, 2e-4), (2e-5, 5e-5), exact=True)
    for before, after in (
        ((2e-5, 9e-5), (2e-5, 5.5e-5)),  # an effect that a convention happens to resemble
        ((2e-5, 2e-4), (2e-5, 6e-5)),  # more than noise is left
        ((4e-5, 2e-4), (4e-5, 5e-5)),  # the positions have an error that is no convention
    ):
        with pytest.warns(GtpinWarning, match="used as they are"):
            suspect(MISTAKE, known, before, after, exact=True)


@pytest.mark.parametrize("error", [DatasetError("no"), ConvergenceError("no", hint="check"), FlatValleyError(None)])
def test_an_error_of_any_kind_has_the_suspicions_too(error: GtpinError) -> None:
    before = error.hint or ""
    with pytest.raises(type(error)) as raised, recalled([f"q1 looks reversed {UNCERTAIN}, ...)", "another warning"]):
        raise error
    assert raised.value is error
    assert str(error).endswith(f"{before}; suspected: q1 looks reversed".removeprefix("; "))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.parametrize("seed", range(3))
def test_a_large_error_of_orientation_outside_the_catalogue_is_no_convention(seed: int) -> None:
    data = make_case(661 + seed, robot="stewart", n_effects=0, poses=80, held_out=1).dataset
    assert data.orientation is not None
    turned = Rotation.from_quat(data.orientation.copy(), scalar_first=True)
    v = turned.as_rotvec()
    v = v / np.abs(v).max()
    error = np.column_stack([v[:, 1] * v[:, 2], v[:, 0] ** 2, np.abs(v[:, 1])]) * 3e-3
    wrong = replace(data, orientation=(Rotation.from_rotvec(error) * turned).as_quat(scalar_first=True))
    assert gtpin.calibrate(wrong).poses > 60


@pytest.mark.slow
def test_trusted_data_are_calibrated_and_the_result_has_the_warnings() -> None:
    data = make_case(671, n_effects=0, poses=80, held_out=1).dataset
    position = data.position.copy()
    position[len(data) // 2 :] += [0.0, 8e-4, -4e-4]
    order = {name: values for name, values in data.covariates.items() if name not in ("session", "time")}
    bumped = replace(data, position=position, covariates=order)
    with pytest.raises(DatasetError, match="bumped"):
        gtpin.calibrate(bumped)
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always", GtpinWarning)
        found = gtpin.calibrate(bumped, trust_data=True)
    assert any("bumped" in text for text in found.warnings)
    assert found.warnings == tuple(dict.fromkeys(str(w.message) for w in heard))
    assert found.to_json()["warnings"] == list(found.warnings)


@pytest.mark.slow
def test_warnings_of_fits_that_are_not_the_result_are_not_noted() -> None:
    data = make_case(672, n_effects=0, poses=60, held_out=1).dataset
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always", GtpinWarning)
        first = gtpin.calibrate(data)
        again = gtpin.calibrate(data)  # Python shows a warning of one line once; a result always has it
    assert first.warnings == again.warnings == tuple(dict.fromkeys(str(w.message) for w in heard))
