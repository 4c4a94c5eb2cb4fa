"""What a diagnosis makes of data that lack something, are many, few, foul, or out of order."""

import json
from dataclasses import replace

import numpy as np
import pytest
from diagnosed import LARGE, POSES, classes, machine, said

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.recipe import SimulatedNoise
from gtpin.data import Dataset
from gtpin.diagnosis import diagnose as room
from gtpin.diagnosis.result import Diagnosis
from gtpin.effects.untestable import Untestable
from gtpin.errors import GtpinError

TOOTH = ("rack_periodic", "cart2")


def names(found: Diagnosis) -> set[tuple[str, str]]:
    return {(c.effect, c.site) for c in found.causes}


def tooth(
    poses: int = POSES, noise: SimulatedNoise | None = None, without: tuple[str, ...] = (), seed: int = 1
) -> Dataset:
    case = make_case(seed, effects=[TOOTH], noncentrality=LARGE, poses=poses, noise=noise, without=without)
    return case.dataset


@pytest.mark.slow
def test_the_same_data_and_seed_give_the_same_bytes():
    once = said(1, "rack_periodic")
    again = gtpin.diagnose(machine(1, "rack_periodic").dataset)
    assert json.dumps(once.to_json()) == json.dumps(again.to_json())


@pytest.mark.slow
def test_the_order_of_rows_means_nothing():
    dataset = machine(1, "rack_periodic").dataset
    once = said(1, "rack_periodic")
    again = gtpin.diagnose(dataset.take(np.random.default_rng(1).permutation(len(dataset))))
    assert again.verdict == once.verdict
    assert names(again) == names(once)
    assert classes(again) == classes(once)
    evidence = [{(c.effect, c.site): c.log_evidence for c in found.candidates} for found in (once, again)]
    for key, value in evidence[0].items():
        assert np.isclose(evidence[1][key], value, rtol=1e-3, atol=0.05), key
    assert np.isclose(again.gap.before, once.gap.before, rtol=1e-3)
    assert np.isclose(again.gap.after, once.gap.after, rtol=1e-2)


@pytest.mark.slow
def test_a_covariate_of_no_effect_changes_nothing():
    dataset = machine(2, "backlash").dataset
    humidity = np.random.default_rng(1).uniform(30.0, 60.0, len(dataset))
    more = replace(dataset, covariates={**dataset.covariates, "humidity": humidity})
    once, again = said(2, "backlash").to_json(), gtpin.diagnose(more).to_json()
    for part in ("verdict", "causes", "candidates", "where", "gap", "unexplained"):
        assert again[part] == once[part], part


@pytest.mark.slow
def test_positions_alone_show_the_cause():
    found = gtpin.diagnose(tooth(noise=SimulatedNoise(orientations=False)))
    assert TOOTH in classes(found)
    assert found.verdict in ("explained", "ambiguous")
    assert set(found.where.axis) == {"x", "y", "z"}


@pytest.mark.slow
def test_noise_that_is_not_declared_is_no_hindrance():
    found = gtpin.diagnose(tooth(noise=SimulatedNoise(declared=False)))
    assert TOOTH in names(found)
    # Position's noise of 15 um an axis, which nobody told, and a machine that repeats to a few um.
    assert abs(np.log(found.gap.floor / (np.sqrt(3.0) * 1.5e-5))) < 0.2


@pytest.mark.slow
def test_repeatability_larger_than_the_instruments_noise_is_in_the_floor():
    noise = SimulatedNoise(repeatability=(2.4e-5, 2.6e-5))
    case = make_case(1, effects=[], poses=POSES, noise=noise)
    found = gtpin.diagnose(case.dataset)
    assert found.verdict == "none"
    still = make_case(1, effects=[], poses=POSES, noise=noise.model_copy(update={"repeatability": (0.0, 0.0)}))
    scatter = ((case.true.T - still.true.T) ** 2).sum(axis=1).mean() + 3.0 * 1.5e-5**2
    assert abs(np.log(found.gap.floor**2 / scatter)) < 0.35


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
def test_gross_errors_are_no_cause():
    found = gtpin.diagnose(tooth(noise=SimulatedNoise(gross=0.04)))
    assert TOOTH in names(found)
    assert found.gap.explained_fraction > 0.0
    clean = gtpin.diagnose(make_case(2, effects=[], poses=POSES, noise=SimulatedNoise(gross=0.04)).dataset)
    assert clean.verdict == "none"


@pytest.mark.slow
def test_what_a_missing_covariate_would_show_is_untestable_and_says_so():
    found = gtpin.diagnose(tooth(without=("temp", "speed", "approach", "session", "payload", "time")))
    assert TOOTH in names(found)
    untestable = {(c.effect, c.site): c.reason for c in found.candidates if not c.testable}
    for effect, site, word in (
        ("servo_lag", "cart1", "speed1"),
        ("backlash", "cart3", "approach3"),
        ("thermal_links", "arm", "temp_link"),
        ("thermal_track", "cart2", "temp_frame"),
        ("zero_shift", "cart1", "session"),
        ("frame_shift", "frame", "session"),
        ("tracker_drift", "frame", "time"),
    ):
        assert untestable[effect, site] == Untestable("missing", word)


@pytest.mark.slow
def test_bare_commands_and_poses_are_enough():
    dataset = replace(machine(2).dataset, covariates={})
    found = gtpin.diagnose(dataset)
    assert found.verdict == "none"
    assert any(c.testable for c in found.candidates)


@pytest.mark.slow
@pytest.mark.parametrize("poses", [8, 12, 20])
@pytest.mark.parametrize("effect", [[], [TOOTH]])
@pytest.mark.parametrize(
    "noise", [None, SimulatedNoise(orientations=False, declared=False)], ids=["poses", "positions"]
)
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
def test_few_poses_are_diagnosed_or_refused_in_one_line(poses, effect, noise):
    dataset = make_case(1, effects=effect, noncentrality=LARGE, poses=poses, noise=noise).dataset
    refused = ""
    try:
        found = gtpin.diagnose(dataset)
    except GtpinError as error:
        refused = str(error)
    assert "\n" not in refused
    if refused:
        return
    assert json.dumps(found.to_json(), allow_nan=False)
    if not effect:
        assert found.verdict == "none"
        assert found.causes == ()


@pytest.mark.slow
@pytest.mark.parametrize("station", [None, (1.5, -7.0, 0.3)])
def test_more_poses_than_a_search_is_made_on_are_all_fitted(station, monkeypatch):
    dataset = machine(1, "rack_periodic").dataset
    dataset = replace(dataset, instrument=dataset.instrument.model_copy(update={"station": station}))
    monkeypatch.setattr(room, "MOST_POSES", 100)
    found = gtpin.diagnose(dataset)
    (truth,) = machine(1, "rack_periodic").effects
    assert (truth.effect, truth.site) in classes(found)
    residual = dataset.position - found.model.predict(dataset.q, dataset.covariates).T
    assert np.sqrt((residual**2).mean()) < 2.0 * 1.5e-5
    assert len(found.model.predict(dataset.q, dataset.covariates).T) == len(dataset) > 100


@pytest.mark.slow
def test_an_instrument_in_a_frame_of_its_own_is_no_cause():
    found = gtpin.diagnose(make_case(3, effects=[], poses=POSES, noise=SimulatedNoise(free=True)).dataset)
    assert found.verdict == "none"
