"""What has changed since a model: what is found from ten poses, how often without a change, and what is said of the rest."""

import json
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from checked_machines import DOWN, OFF, classes, later, later_read, machine
from scipy.spatial.transform import Rotation
from scipy.stats import binom

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.diagnosis.against import changes, threshold
from gtpin.diagnosis.earlier import Earlier, usable
from gtpin.diagnosis.hypothesis import Scope
from gtpin.effects.catalogue import catalogue
from gtpin.extras.history.history import Entry
from gtpin.output.shown import present

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")  # a later day holds conditions constant
KEYS = {
    "schema",
    "verdict",
    "causes",
    "candidates",
    "where",
    "gap",
    "unexplained",
    "next_experiment",
    "warnings",
    "also",
    "rows",
}


KINDS = ("range", "plane")
"""Instruments of a check by readings."""


@pytest.mark.slow
@pytest.mark.parametrize("actuator", [0, 1, 2])
def test_a_zero_shifted_by_30_um_is_found_with_ten_poses(actuator):
    case, model = machine(21)
    found = gtpin.diagnose(later(case, actuator, shift={actuator: 3e-5}), against=model)
    assert found.verdict in ("explained", "ambiguous")
    assert any(("zero_shift", f"cart{actuator + 1}") in members for members in classes(found))


@pytest.mark.slow
def test_the_error_that_is_told_is_said_to_be_of_predictions_and_a_nominal_robot_not_to_be_identified():
    case, model = machine(21)
    known, never, read = (
        present(gtpin.diagnose(later(case, 0), against=earlier)).text()
        for earlier in (model, gtpin.read_model("gantry_tau"), replace(model, fit=None))
    )
    assert "position error, each pose predicted by the earlier model and all others, RMS" in known
    assert "never identified" not in known
    assert "never identified" not in read  # a model that was fitted to readings
    assert "each pose predicted by the nominal model and all others, RMS" in never
    assert "This model was never identified: its geometry was fitted to these poses within its tolerances" in never
    assert "since the model was identified" not in never


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
@pytest.mark.parametrize(("kind", "actuator"), [*(("tracker", i) for i in range(3)), *((kind, 2) for kind in KINDS)])
def test_a_backlash_is_found_leads_its_class_and_is_measured_to_its_sigma(tmp_path, kind, actuator):
    """Of 50 um by ten poses, and of 100 um by readings."""
    case, model = machine(22)
    if kind == "tracker":
        size, dataset = 5e-5, later(case, actuator, reversal={actuator: 5e-5})
    else:
        size, dataset = 1e-4, later_read(tmp_path / "day", case, 1, kind, reversal={actuator: 1e-4})
    found = gtpin.diagnose(dataset, against=model)
    assert [(c.effect, c.site) for c in found.causes] == [("backlash", f"cart{actuator + 1}")]
    reversal = found.causes[0].parameters["reversal"]
    assert abs(reversal.value + size) < 4.0 * reversal.sigma


@pytest.mark.slow
def test_a_change_of_three_tenths_of_a_millimetre_is_measured_to_its_sigma():
    case, model = machine(23)
    found = gtpin.diagnose(later(case, 1, shift={1: 3e-4}), against=model)
    shift = next(c for c in found.causes if c.effect == "zero_shift").parameters["shift"]
    assert abs(shift.value - 3e-4) < 4.0 * shift.sigma
    assert found.gap.explained_fraction > 0.95


@pytest.mark.slow
@pytest.mark.study
def test_machines_without_a_change_raise_no_more_alarms_than_chance_allows():
    alarms, checks = 0, 0
    for seed in (24, 25, 26):
        case, model = machine(seed)
        for number in range(4):
            alarms += gtpin.diagnose(later(case, number), against=model, seed=number).verdict != "none"
            checks += 1
    assert alarms <= binom.ppf(0.999, checks, 0.01)


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
        off = [[one.unknowns[f"ranges.station[{name}].{axis}"] for axis in "xyz"] for name in "ABC"]
        np.testing.assert_allclose(off, np.tile(OFF, (3, 1)), atol=2e-3)
    else:
        heights = [value for name, value in one.unknowns.items() if name.endswith("height")]
        np.testing.assert_allclose(np.abs(heights), DOWN, atol=2e-4)


@pytest.mark.slow
def test_draws_of_an_unchanged_machine_exceed_the_threshold_as_often_as_asked():
    """Fresh draws, with the earlier model's error drawn from its covariance by other code."""
    case, model = machine(21)
    sampler, design, earlier = problem(model, later(case, 3))
    rng = np.random.default_rng(5)
    level = threshold(sampler, 0.05, 4000, rng)
    errors = rng.multivariate_normal(np.zeros(len(model.covariance)), model.covariance, 3000, method="eigh")
    J = earlier.jacobian(design.operating_points.q, design.operating_points.covariates, design.operating_points.poses)
    moved = (design.whitening @ J).reshape(len(design.y), -1)
    y = rng.standard_normal((len(design.y), 3000)) + moved @ errors.T
    share = float((sampler.largest(y) > level).mean())
    assert 0.035 < share < 0.066  # four sigma of both counts


@pytest.mark.slow
def test_gains_of_draws_are_those_of_single_residuals():
    case, model = machine(21)
    sampler, design, _ = problem(model, later(case, 4))
    groups = sampler.hypotheses.groups
    for axes in sampler.axes:
        own = sampler.gains(axes, design.y[:, None].T @ axes.weights)[0]
        alone = sampler.hypotheses.alone(axes.hypothesis)
        assert own == pytest.approx(alone, rel=1e-9, abs=1e-9), groups


def problem(model, dataset):
    """The sampler of a check's gains, its linear problem, and the earlier model."""
    earlier, data = Earlier(model), usable(dataset, model)
    scope = Scope.of(catalogue(), (), 0.01, model.robot)
    sampler, _ = changes(earlier, data.observed, scope)
    return sampler, sampler.hypotheses.design, earlier


@pytest.mark.slow
def test_one_gross_error_is_set_aside_and_is_no_change():
    case, model = machine(22)
    dataset = later(case, 7)
    position = dataset.position.copy()
    position[4] += [2e-3, -1e-3, 5e-4]
    found = gtpin.diagnose(replace(dataset, position=position), against=model)
    assert found.set_aside == ("check4",)
    assert found.verdict == "none"


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


@pytest.mark.slow
def test_an_instrument_that_stands_elsewhere_is_no_change_where_its_place_is_free():
    case, model = machine(27, free=True)
    dataset = later(case, 1)
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    half = np.sqrt(0.5)
    w, x, y, z = dataset.orientation.T
    quaternions = half * np.column_stack([w - z, x - y, y + x, z + w])  # a quarter turn about z, before the rotation
    moved = replace(dataset, position=dataset.position @ turned.T + [3.0, -1.0, 0.2], orientation=quaternions)
    here, there = (gtpin.diagnose(data, against=model) for data in (dataset, moved))
    assert here.verdict == there.verdict == "none"
    assert there.gap.before == pytest.approx(here.gap.before, rel=1e-3)


@pytest.mark.slow
def test_a_check_with_a_free_instrument_says_that_it_hardly_sees_shifted_zeros():
    known, free = machine(21), machine(27, free=True)
    smallest = []
    for case, model in (known, free):
        found = gtpin.diagnose(later(case, 1), against=model)
        smallest.append(max(s.value for s in found.smallest if s.effect == "zero_shift"))
    assert smallest[0] < 3e-5 < 1e-4 < smallest[1]


@pytest.mark.slow
def test_what_can_not_be_seen_is_listed_with_its_reason():
    case, model = machine(21)
    dataset = later(case, 2)
    without = replace(dataset, covariates={n: v for n, v in dataset.covariates.items() if n != "approach2"})
    found = gtpin.diagnose(without, against=model)
    untested = {(c.effect, c.site): c.reason.kind for c in found.candidates if not c.testable}
    assert untested["backlash", "cart2"] == "missing"
    assert untested["rack_periodic", "cart1"] == "not_searched"
    assert {(s.effect, s.site) for s in found.smallest} == {(c.effect, c.site) for c in found.candidates if c.testable}


@pytest.mark.slow
def test_the_model_with_the_change_in_predicts_poses_that_were_not_measured():
    case, model = machine(23)
    found = gtpin.diagnose(later(case, 1, shift={1: 1e-4}), against=model)
    assert found.causes[0].effect == "zero_shift"
    other = later(case, 99, shift={1: 1e-4}, poses=40)
    errors = [
        np.linalg.norm(m.predict(other.q, other.covariates).T - other.position, axis=1) for m in (model, found.model)
    ]
    assert np.sqrt((errors[1] ** 2).mean()) < 0.5 * np.sqrt((errors[0] ** 2).mean())


@pytest.mark.slow
def test_a_check_against_the_updated_model_finds_nothing_more(tmp_path):
    case, model = machine(23)
    first = gtpin.diagnose(later(case, 1, shift={1: 1e-4}), against=model)
    first.save(tmp_path / "check")
    read = gtpin.read_model(tmp_path / "check")
    again = gtpin.diagnose(later(case, 2, shift={1: 1e-4}), against=read)
    assert again.verdict == "none"
    back = gtpin.diagnose(later(case, 3), against=read)
    assert any(("zero_shift", "cart2") in members for members in classes(back))


@pytest.mark.slow
def test_the_json_is_that_of_a_diagnosis_with_one_key_more():
    case, model = machine(21)
    dataset = later(case, 1, shift={0: 3e-5})
    told = [gtpin.diagnose(dataset, against=model, seed=3).to_json() for _ in range(2)]
    assert set(told[0]) == {*KEYS, "against"}
    assert told[0]["schema"] == "gtpin-diagnosis/1"
    assert json.dumps(told[0]) == json.dumps(told[1])
    assert told[0]["against"]["power"] == 0.95
    assert all(one["value"] is None or one["value"] > 0.0 for one in told[0]["against"]["smallest"])


@pytest.mark.slow
@pytest.mark.study
def test_the_smallest_change_is_found_with_its_power_on_machines_drawn_from_the_model():
    """The machine is drawn from the model's covariance, and measured by the exact closures and noise of the test's own."""
    case, model = machine(22)
    dataset = later(case, 1)
    size = smallest_zero_shift(model, dataset)
    rng = np.random.default_rng(8)
    found = {factor: sum(alarm(model, dataset, factor * size, rng) for _ in range(12)) for factor in (1.0, 0.5)}
    assert found[1.0] >= binom.ppf(0.001, 12, 0.95)
    # The change that is found in 95 % lies above the threshold by 1.6 sigma, so that half of it lies below a threshold of more
    # than 1.6 sigma: it is found in less than half of the draws.
    assert found[0.5] <= binom.ppf(0.999, 12, 0.5)


def smallest_zero_shift(model, dataset):
    found = gtpin.diagnose(dataset, against=model)
    return next(s.value for s in found.smallest if (s.effect, s.site) == ("zero_shift", "cart2"))


def alarm(model, dataset, size, rng):
    """Whether a machine drawn from the model, its second zero shifted, raises an alarm."""
    values = rng.multivariate_normal(model.geometry.values, model.covariance, method="eigh")
    drawn = gtpin.Model(model.geometry.with_values(values), model.frame)
    q = dataset.q.copy()
    q[:, 1] += size
    poses = drawn.predict(q)
    noise = model.fit
    turns = Rotation.from_rotvec(noise.orientation_sigma * rng.standard_normal((len(q), 3)))
    measured = replace(
        dataset,
        position=poses.T + noise.position_sigma * rng.standard_normal(poses.T.shape),
        orientation=(turns * Rotation.from_matrix(poses.R)).as_quat(scalar_first=True),
    )
    return gtpin.diagnose(measured, against=model, seed=int(rng.integers(1000))).verdict != "none"


@pytest.mark.slow
def test_a_model_with_effects_is_checked_with_them_in():
    """A backlash that the model has is no change; that it has grown is one."""
    case = make_case(
        41, effects=[("backlash", "cart1")], noncentrality=3000.0, poses=140, held_out=10, background=False
    )
    model = gtpin.diagnose(case.dataset).model
    assert [active.name for active in model.effects] == ["backlash@cart1"]
    same = gtpin.diagnose(later(case, 1), against=model)
    grown = gtpin.diagnose(later(case, 2, reversal={0: 6e-5}), against=model)
    assert same.verdict == "none"
    assert ("backlash", "cart1") in classes(grown)[0]


@pytest.mark.slow
def test_an_arm_is_checked_too():
    case, model = machine(51, robot="ur5")
    assert gtpin.diagnose(later(case, 1), against=model).verdict == "none"
    found = gtpin.diagnose(later(case, 2, shift={2: 1e-3}), against=model)  # 1 mrad of the elbow
    assert any(site == "elbow_joint" for members in classes(found) for _, site in members)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.take(slice(0, 2)), "2 usable poses"),
        (lambda d: replace(d, q=d.q[:, :2], covariates={}), "2 commands a pose"),
        (lambda d: replace(d, position=1e3 * d.position), "millimetres"),
    ],
)
def test_data_that_can_be_no_check_of_a_model_are_refused(change, words):
    case, model = machine(21)
    with pytest.raises(gtpin.GtpinError, match=words):
        gtpin.diagnose(change(later(case, 1)), against=model)


@pytest.mark.slow
def test_a_robot_beside_an_earlier_model_is_refused():
    case, model = machine(21)
    with pytest.raises(gtpin.GtpinError, match="against alone"):
        gtpin.diagnose(later(case, 1), model.robot, against=model)  # type: ignore[call-overload]
