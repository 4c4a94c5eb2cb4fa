"""What has changed since a model, by other instruments than a tracker: what is found, how often without a change, refusals."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from checked_machines import classes, machine
from read_machines import DOWN, OFF, STATIONS, later_read
from scipy.stats import binom

import gtpin
from gtpin.health.history import Entry

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")  # a later day holds conditions constant
KINDS = ("range", "plane")


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_shifted_zero_is_found_by_its_readings(tmp_path, kind):
    case, model = machine(21)
    found = gtpin.diagnose(later_read(tmp_path / "day", case, 1, kind, shift={1: 3e-4}), against=model)
    assert any(("zero_shift", "cart2") in members for members in classes(found))
    assert found.poses == 30
    assert [one.name for one in found.gap.by_instrument] == [f"{kind}s"]
    assert found.gap.after < found.gap.before


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_backlash_is_measured_by_readings_to_its_sigma(tmp_path, kind):
    case, model = machine(22)
    found = gtpin.diagnose(later_read(tmp_path / "day", case, 1, kind, reversal={2: 1e-4}), against=model)
    assert [(c.effect, c.site) for c in found.causes] == [("backlash", "cart3")]
    reversal = found.causes[0].parameters["reversal"]
    assert abs(reversal.value + 1e-4) < 4.0 * reversal.sigma


@pytest.mark.slow
def test_unchanged_machines_raise_no_more_alarms_by_readings_than_chance_allows(tmp_path):
    alarms = 0
    for seed in (24, 25, 26):
        case, model = machine(seed)
        for kind in KINDS:
            alarms += gtpin.diagnose(later_read(tmp_path / "day", case, seed, kind), against=model).verdict != "none"
    assert alarms <= binom.ppf(0.999, 6, 0.01)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_place_of_an_instrument_is_found_and_is_no_change(tmp_path, kind):
    case, model = machine(23)
    found = gtpin.diagnose(later_read(tmp_path / "day", case, 2, kind), against=model)
    assert found.verdict == "none"
    (one,) = found.model.instruments
    if kind == "range":
        off = [[one.unknowns[f"ranges.station[{name}].{axis}"] for axis in "xyz"] for name in STATIONS]
        np.testing.assert_allclose(off, np.tile(OFF, (3, 1)), atol=2e-3)
    else:
        heights = [value for name, value in one.unknowns.items() if name.endswith("height")]
        np.testing.assert_allclose(np.abs(heights), DOWN, atol=2e-4)


@pytest.mark.slow
def test_a_gross_reading_is_set_aside_and_is_no_change(tmp_path):
    case, model = machine(22)
    dataset = later_read(tmp_path / "day", case, 7, "range")
    values = dataset.readings.columns["range"].copy()
    values[40] += 5e-3
    rows = replace(dataset.readings, columns={**dataset.readings.columns, "range": values})
    found = gtpin.diagnose(replace(dataset, readings=rows), against=model)
    assert found.set_aside == (str(dataset.pose[40]),)
    assert found.verdict == "none"


@pytest.mark.slow
def test_readings_whose_noise_is_not_declared_are_refused(tmp_path):
    case, model = machine(21)
    with pytest.raises(gtpin.GtpinError, match="noise of ranges is not declared"):
        gtpin.diagnose(later_read(tmp_path / "day", case, 1, "range", sigma=False), against=model)


@pytest.mark.slow
def test_a_check_by_readings_has_no_line_in_a_log_of_position_errors(tmp_path):
    case, model = machine(21)
    found = gtpin.diagnose(later_read(tmp_path / "day", case, 1, "plane"), against=model)
    with pytest.raises(gtpin.GtpinError, match="position errors"):
        Entry.of(found, datetime(2026, 1, 1, tzinfo=UTC))
