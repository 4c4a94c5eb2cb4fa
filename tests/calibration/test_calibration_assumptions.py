"""What a dataset declares of noise, frame and machine is held against its fit; rows out of step are named."""

import re
from dataclasses import replace

import numpy as np
import pytest
from quick_first import quick_first

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.data import Dataset
from gtpin.errors import DatasetError
from gtpin.report.calibration_text import noise_words

SIGMAS = (1.5e-5, 5e-5)
ALONG_Y = np.array([0.0, 1.0, 0.0])
pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")


def clean(seed: int = 40, **options: object) -> Dataset:
    return make_case(seed, n_effects=0, poses=90, background=False, **options).dataset


def declared(dataset: Dataset, position: float, orientation: float) -> Dataset:
    own = dataset.instrument
    sigmas = {"position_sigma": position * own.position_sigma, "orientation_sigma": orientation * own.orientation_sigma}
    return replace(dataset, instrument=own.model_copy(update=sigmas))


def moved(dataset: Dataset, rows: slice, shift: float) -> Dataset:
    """Rows as an instrument reads them that is shifted along y, m."""
    position = dataset.position.copy()
    position[rows] += shift * ALONG_Y
    return replace(dataset, position=position)


def warned(dataset: Dataset) -> tuple[gtpin.Calibration, str]:
    found = gtpin.calibrate(dataset)
    return found, "; ".join(found.warnings)


@pytest.mark.parametrize("seed", quick_first(range(40, 45)))
def test_what_is_declared_truly_is_not_doubted(seed):
    dataset = clean(seed)
    found, said = warned(dataset)
    assert found.instrument == dataset.instrument
    assert said == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("position", "orientation", "unit"),
    [(1e3, 1.0, "millimetres"), (1e6, 1.0, "micrometres"), (1.0, 1e3, "milliradians"), (1.0, 57.3, "degrees")],
)
def test_a_sigma_in_another_unit_is_refused_and_the_unit_named(position, orientation, unit):
    key = "position_sigma" if position > 1.0 else "orientation_sigma"
    with pytest.raises(DatasetError, match=f"(?s)instrument.{key}.*looks like {unit}"):
        gtpin.calibrate(declared(clean(), position, orientation))


@pytest.mark.slow
def test_noise_three_times_overstated_is_warned_of_and_the_data_s_own_is_used():
    found, said = warned(declared(clean(), 3.0, 3.0))
    assert "position_sigma" in said
    assert "orientation_sigma" in said
    assert found.instrument.position_sigma is None
    assert found.noise.position_sigma == pytest.approx(SIGMAS[0], rel=0.2)
    assert found.noise.orientation_sigma == pytest.approx(SIGMAS[1], rel=0.2)
    assert "from the residuals (45.0 µm was declared)" in noise_words(found)[0].replace("\u00a0", " ")
    assert "from the residuals (150 µrad was declared)" in noise_words(found)[1].replace("\u00a0", " ")


@pytest.mark.slow
def test_noise_a_little_overstated_stays_as_declared():
    dataset = declared(clean(), 1.5, 1.5)
    found, said = warned(dataset)
    assert found.instrument == dataset.instrument
    assert said == ""


def test_noise_declared_a_million_times_too_small_is_refused_or_warned_of():
    try:
        _, said = warned(declared(clean(), 1e-6, 1e-6))
    except DatasetError as error:
        said = str(error)
    assert "times the noise" in said or "show a noise of" in said or "1 sigma per axis in m, from" in said


@pytest.mark.slow
def test_an_instrument_eight_millimetres_beside_the_base_is_warned_of_and_fitted_as_free():
    dataset = clean()
    found, said = warned(moved(dataset, slice(None), 0.008))
    assert 'frame = "free"' in said
    assert found.instrument.frame == "free"
    q = dataset.q[:20]
    expected = gtpin.calibrate(dataset).model.predict(q).T + 0.008 * ALONG_Y
    assert np.abs(found.model.predict(q).T - expected).max() < 2e-5


@pytest.mark.slow
def test_a_drive_s_zero_thirty_millimetres_off_is_named_with_its_size():
    dataset = clean()
    found, said = warned(replace(dataset, q=dataset.q + 0.03 * ALONG_Y))
    value, sigma = re.search(r"zero of cart2 (\S+) \+- (\S+) mm", said).groups()
    assert float(value) == pytest.approx(-30.0, abs=4.0)
    assert abs(float(value) + 30.0) < 4.0 * float(sigma)
    assert found.chi2_per_dof < 1.3


@pytest.mark.slow
@pytest.mark.parametrize(("by", "fits"), [(1, "after"), (-1, "before")])
@pytest.mark.parametrize("start", [0.3, 0.7])
def test_commands_one_row_off_from_some_row_on_are_named(by, fits, start):
    dataset = clean()
    first = int(start * len(dataset))
    q, pose = dataset.q.copy(), dataset.pose.copy()
    q[first:], pose[first:] = np.roll(q[first:], by, axis=0), np.roll(pose[first:], by)
    with pytest.raises(DatasetError, match=f"one row off in rows .*row {fits}") as caught:
        gtpin.calibrate(replace(dataset, q=q, pose=pose))
    assert caught.value.row == pytest.approx(dataset.row[first], abs=2)


@pytest.mark.slow
@pytest.mark.parametrize(("start", "end"), [(0.5, 1.0), (0.3, 0.55)])
def test_a_bump_is_refused_and_one_of_the_size_of_an_effect_warned_of_with_its_rows(start, end):
    dataset = clean()
    rows = slice(int(start * len(dataset)), int(end * len(dataset)))
    with pytest.raises(DatasetError, match="bumped or set up anew") as caught:
        gtpin.calibrate(moved(dataset, rows, 3e-3))
    assert caught.value.row == pytest.approx(dataset.row[rows.start], abs=2)
    (bumped,) = [text for text in gtpin.calibrate(moved(dataset, rows, 3e-4)).warnings if "bumped or set up" in text]
    assert int(bumped.split("rows ")[1].split()[0]) == pytest.approx(dataset.row[rows.start], abs=2)


def test_an_instrument_set_up_anew_in_a_session_of_its_own_is_left_to_the_diagnosis():
    dataset = clean()
    rows = slice(len(dataset) // 2, len(dataset))
    session = np.array(["1"] * len(dataset), dtype=object)
    session[rows] = "2"
    bumped = moved(dataset, rows, 3e-4)
    found = gtpin.calibrate(replace(bumped, covariates={**dataset.covariates, "session": session}))
    assert not any("bumped" in text for text in found.warnings)


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["tracker_drift", "link_compliance", "thermal_track"])
def test_what_drifts_or_follows_a_recorded_column_is_no_bump(effect):
    found = gtpin.calibrate(make_case(41, effects=[(effect, None)], noncentrality=8000.0, poses=90).dataset)
    assert found.poses > 0  # not refused


@pytest.mark.slow
def test_a_machine_a_third_of_a_metre_off_nominal_is_reached():
    dataset = make_case(11, effects=[("link_compliance", None)], robot="stewart_jugglebot").dataset
    nominal = gtpin.Geometry.nominal(gtpin.load_robot("stewart_jugglebot"))
    off = np.linalg.norm(dataset.position - gtpin.Model(nominal).predict(dataset.q).T, axis=1)
    assert np.median(off) > 0.2
    found = gtpin.calibrate(dataset)
    assert np.sqrt((found.residual[:, :3] ** 2).sum(axis=1).mean()) < 1e-4


@pytest.mark.slow
def test_a_stretch_of_rows_with_commands_of_others_is_refused_with_its_rows():
    dataset = clean()
    q = dataset.q.copy()
    half = len(q) // 2
    q[half:, 1] = q[half:, 1][::-1]
    with pytest.raises(DatasetError, match=r"rows? "):
        gtpin.calibrate(replace(dataset, q=q, pose=np.arange(len(q))))
