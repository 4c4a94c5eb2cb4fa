"""What is proposed to be measured next can be measured, and tells more than as many random poses."""

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from linear_problems import hypothesis
from scipy.stats import multivariate_normal

import gtpin
from gtpin.bench.simulator import Case, make_case, measure_at
from gtpin.data import Commands, Dataset
from gtpin.diagnosis.design import Observed
from gtpin.diagnosis.discrimination import CauseClass, Prediction, concerns, expected_gain, most_telling
from gtpin.diagnosis.evidence import NOTHING, Groups, Marginal, gain
from gtpin.diagnosis.hypothesis import Hypothesis
from gtpin.diagnosis.hypothesis_set import Untested
from gtpin.diagnosis.next_experiment import map_unknown, plan
from gtpin.diagnosis.priors import PRIORS
from gtpin.diagnosis.result import Experiment
from gtpin.diagnosis.smooth_terms import smooth_terms
from gtpin.diagnosis.trials import Known, possible, with_nights
from gtpin.effects.drive_errors import Linearity
from gtpin.effects.untestable import Untestable
from gtpin.instruments.readings import Readings

PAIRS = [
    ("linearity@cart2", "straightness@cart2"),
    ("backlash@cart1", "servo_lag@cart1"),
    ("link_compliance@link2a", "joint_runout@link2a"),
    ("cross_coupling@cart2", "linearity@cart2"),
]


@cache
def known_of(name: str, seed: int, without: tuple[str, ...] = ()) -> tuple[Case, Known]:
    """A machine with a weak effect, and what is known once its geometry is calibrated."""
    effect, _, site = name.partition("@")
    case = make_case(seed, effects=[(effect, site)], noncentrality=80.0, poses=100, without=without)
    baseline = gtpin.calibrate(case.dataset)
    observed = Observed.of(case.dataset, baseline)
    return case, Known(observed, baseline.model, observed.operating_points(baseline.model).references)


def class_of(*names: str) -> CauseClass:
    members = tuple((hypothesis(name), 1.0 / len(names)) for name in names)
    return CauseClass(members[0][0], 1.0, members)


def proposed(
    known: Known, *classes: CauseClass, untestable: tuple[str, ...] = (), seed: int = 0
) -> tuple[Experiment, ...]:
    rows = [Untested(hypothesis(name), Untestable("absorbed")) for name in untestable]
    rng = np.random.default_rng(seed)
    return plan(known, classes=classes, untestable=rows, unknown=None, rng=rng)


def measured(case: Case, q: np.ndarray, covariates: Mapping[str, np.ndarray], seed: int) -> Dataset:
    ids = np.array([f"new{i}" for i in range(len(q))], dtype=object)
    return measure_at(case, Commands(ids, q, dict(covariates)), seed)


def together(case: Case, later: Dataset, absent: Mapping[str, float] | None = None) -> Dataset:
    """Both datasets in one; covariates that the first lacks are as given."""
    first = {**case.dataset.covariates, **{n: np.full(len(case.dataset), v) for n, v in (absent or {}).items()}}
    return replace(
        case.dataset,
        pose=np.concatenate([case.dataset.pose, later.pose]),
        q=np.vstack([case.dataset.q, later.q]),
        position=np.vstack([case.dataset.position, later.position]),
        orientation=np.vstack([case.dataset.orientation, later.orientation]),
        covariates={name: np.concatenate([first[name], later.covariates[name]]) for name in first},
        row=np.arange(2, 2 + len(case.dataset) + len(later)),
    )


def log_evidence(known: Known, dataset: Dataset, name: str, unseen: int = 0) -> float:
    """Of an effect over none, by its best scale; the first rows may be ones whose covariate was not recorded."""
    noise = known.observed.noise.take(np.zeros(len(dataset), dtype=int))  # equal for all poses
    observed = replace(
        known.observed, measured=Readings.of(dataset, known.model.robot), covariates=dataset.covariates, noise=noise
    )
    design = replace(observed, weight=np.ones(len(dataset))).design(known.model)
    X = design.columns(hypothesis(name).basis(design.operating_points))
    X[: unseen * design.components] = 0.0
    groups: Groups[str] = Groups(Marginal(design.B), design.y)
    groups.add(name, X)
    return gain(groups, NOTHING, name)[0]


@pytest.mark.slow
def test_planned_poses_part_causes_from_their_rivals_better_than_as_many_random_ones() -> None:
    planned, random, expected = [], [], []
    for truth, rival in PAIRS:
        words = {w for name in (truth, rival) for w in concerns(hypothesis(name), gtpin.load_robot("gantry_tau"))}
        for seed in range(2):
            case, known = known_of(truth, seed)
            (experiment,) = [e for e in proposed(known, class_of(truth, rival)) if truth in e.separates]
            poses, set_too = experiment.poses, experiment.covariates
            if not len(poses):  # nothing is expected of any poses: none are measured, nothing is won
                continue
            expected.append(experiment.expected_gain)
            planned.append(_gain(case, known, truth, rival, measured(case, poses, set_too, seed)))
            trials = possible(known, words, len(poses), np.random.default_rng(100 + seed))
            new = {name: trials.conditions.new[name] for name in set_too}
            random.append(_gain(case, known, truth, rival, measured(case, trials.q, new, seed)))
    assert len(planned) >= 5
    assert np.mean(planned) > 1.5 * np.mean(random)
    assert np.mean(np.array(planned) > np.array(random)) > 0.6
    assert 0.4 < np.mean(planned) / np.mean(expected) < 2.5


def _gain(case: Case, known: Known, truth: str, rival: str, later: Dataset) -> float:
    """What further measurements add to the log Bayes factor for the truth."""
    before, after = case.dataset, together(case, later)
    factors = [log_evidence(known, data, truth) - log_evidence(known, data, rival) for data in (before, after)]
    return factors[1] - factors[0]


@pytest.mark.slow
def test_recording_what_was_missing_reveals_the_effect_that_lacked_it_better_than_random_poses() -> None:
    name, planned, random = "backlash@cart1", [], []
    for seed in range(2):
        case, known = known_of(name, seed, without=("approach",))
        (experiment,) = proposed(known, untestable=(name,))
        assert {-1.0, 1.0} == set(experiment.covariates["approach1"])
        trials = possible(known, ("approach1",), len(experiment.poses), np.random.default_rng(100 + seed))
        for found, q, new in (
            (planned, experiment.poses, experiment.covariates),
            (random, trials.q, {"approach1": trials.conditions.new["approach1"]}),
        ):
            data = together(case, measured(case, q, new, seed), {"approach1": 1.0})
            found.append(log_evidence(known, data, name, unseen=len(case.dataset)))
    assert np.mean(planned) > max(3.0, np.mean(random))


@pytest.mark.slow
def test_pushes_that_are_proposed_turn_the_forces_of_the_links() -> None:
    case, known = known_of("linearity@cart2", 0)
    names = tuple(f"joint_clearance@{site}" for site in known.robot.rod_sites)
    assert all(hypothesis(n).effect.untestable(known.operating_points, hypothesis(n).site) for n in names)
    experiments = proposed(known, untestable=names)
    assert {name for e in experiments for name in e.separates} == set(names)
    (pushed,) = [e for e in experiments if len(e.poses)]
    later = measured(case, pushed.poses, pushed.covariates, 0)
    force = {name: 0.0 for name in ("fx", "fy", "fz") if name not in case.dataset.covariates}
    data = together(case, later, force)
    observed = replace(known.observed, measured=Readings.of(data, known.model.robot), covariates=data.covariates)
    at = observed.operating_points(known.model)
    assert len(pushed.separates) >= 3
    assert not any(hypothesis(n).effect.untestable(at, hypothesis(n).site) for n in pushed.separates)


def test_expected_gain_is_the_mean_log_density_ratio_of_data_drawn_from_the_true_hypothesis() -> None:
    rng = np.random.default_rng(0)
    predictions = [Prediction(rng.standard_normal((5, 2)), 0.7 * rng.standard_normal((5, 2, 3))) for _ in range(2)]
    rows = np.array([3, 1])
    densities = []
    for p in predictions:
        L = p.spread[rows].reshape(4, 3)
        densities.append(multivariate_normal(p.mean[rows].ravel(), np.eye(4) + L @ L.T))
    drawn = densities[0].rvs(200_000, random_state=1)
    ratio = densities[0].logpdf(drawn) - densities[1].logpdf(drawn)
    expected = expected_gain(predictions, [(0, 1, 3.0)], rows)
    assert expected == pytest.approx(ratio.mean(), abs=5.0 * ratio.std() / np.sqrt(len(drawn)))


def test_the_first_row_chosen_is_the_best_single_one_and_the_second_the_best_beside_it() -> None:
    rng = np.random.default_rng(2)
    predictions = [Prediction(rng.standard_normal((30, 3)), rng.standard_normal((30, 3, 4))) for _ in range(2)]
    pairs = [(0, 1, 1.0)]
    first, second = most_telling(predictions, pairs, 2)
    alone = [expected_gain(predictions, pairs, np.array([i])) for i in range(30)]
    assert first == np.argmax(alone)
    pairs = [expected_gain(predictions, pairs, np.array([first, i])) if i != first else -1.0 for i in range(30)]
    assert second == np.argmax(pairs)


def test_a_plan_is_worth_more_than_every_random_choice_out_of_the_same_rows() -> None:
    rng = np.random.default_rng(3)
    predictions = [Prediction(rng.standard_normal((80, 6)), rng.standard_normal((80, 6, 10))) for _ in range(3)]
    pairs = [(0, 1, 0.6), (1, 0, 0.6), (0, 2, 0.3), (2, 0, 0.3)]
    plan = expected_gain(predictions, pairs, most_telling(predictions, pairs, 10))
    drawn = [expected_gain(predictions, pairs, rng.choice(80, 10, replace=False)) for _ in range(200)]
    assert plan > max(drawn)


@pytest.mark.slow
def test_same_stream_same_plan() -> None:
    _, known = known_of("linearity@cart2", 0)
    first, same, other = (
        [e.to_json() for e in proposed(known, class_of(*PAIRS[1]), untestable=("zero_shift@cart1",), seed=seed)]
        for seed in (0, 0, 1)
    )
    assert first == same
    assert first != other


@pytest.mark.slow
@pytest.mark.parametrize(
    "names",
    [("thermal_links@arm", "tracker_drift@frame"), ("zero_shift@cart2", "frame_shift@frame"), PAIRS[1]],
    ids=" ".join,
)
def test_a_plan_can_be_measured(names: tuple[str, str]) -> None:
    case, known = known_of("linearity@cart2", 0)
    for experiment in proposed(
        known, class_of(*names), untestable=("joint_clearance@link2a", "target_offset@platform")
    ):
        json.dumps(experiment.to_json(), allow_nan=False)
        assert "\n" not in experiment.measure
        assert ((experiment.poses >= known.robot.lower) & (experiment.poses <= known.robot.upper)).all()
        for name, values in experiment.covariates.items():
            assert len(values) == len(experiment.poses), name
        moving = [n for n in experiment.covariates if n.startswith("speed")]
        for name in moving:
            speed, side = experiment.covariates[name], experiment.covariates.get(name.replace("speed", "approach"))
            assert side is None or (speed * side >= 0.0).all()
        if len(experiment.poses):
            assert experiment.expected_gain > experiment.random_gain
            free = {n: v for n, v in experiment.covariates.items() if n not in ("temp_link", "temp_frame")}
            assert len(measured(case, experiment.poses, free, 0)) == len(experiment.poses)


@pytest.mark.slow
def test_both_states_of_a_machine_are_asked_for_where_its_warmth_is_in_question() -> None:
    _, known = known_of("thermal_links@arm", 0)
    experiment = proposed(known, class_of("thermal_links@arm", "tracker_drift@frame"))[0]
    cold = experiment.covariates["temp_link"] == known.observed.temperature
    assert 3 <= cold.sum() <= len(cold) - 3


@pytest.mark.slow
def test_what_geometry_absorbs_is_not_promised_to_any_poses() -> None:
    _, known = known_of("linearity@cart2", 0)
    (experiment,) = proposed(known, untestable=("target_offset@platform",))
    assert experiment.poses.shape == (0, 3)
    assert experiment.measure.startswith("No reachable poses")


class Twin(Linearity):
    """Displaces what linearity displaces, by another name."""

    id = "twin"


def test_twins_are_not_promised_to_be_told_apart_by_poses() -> None:
    _, known = known_of("linearity@cart2", 0)
    members = ((hypothesis("linearity@cart2"), 0.5), (Hypothesis(Twin(), "cart2"), 0.5))
    (experiment,) = proposed(known, CauseClass(members[0][0], 1.0, members))
    assert experiment.poses.shape == (0, 3)
    assert experiment.expected_gain == pytest.approx(0.0, abs=1e-6)
    assert "measure cart2 directly" in experiment.measure


@pytest.mark.parametrize(
    ("coordinates", "moves"), [("q2", {1}), ("q1,q3", {0, 2}), ("approach1", {0, 1, 2}), ("direction", {0, 1, 2})]
)
def test_an_unknown_is_traced_along_its_coordinates_and_nothing_else_moves(coordinates: str, moves: set[int]) -> None:
    case, known = known_of("linearity@cart2", 0)
    rng = np.random.default_rng(0)
    (experiment,) = plan(known, classes=(), untestable=(), unknown=("cart1", coordinates), rng=rng)
    assert experiment.separates == ("unknown",)
    assert set(np.flatnonzero(np.ptp(experiment.poses, axis=0) > 0.1)) == moves
    assert set(np.flatnonzero(np.ptp(experiment.poses, axis=0) > 0.0)) == moves
    assert len(measured(case, experiment.poses, experiment.covariates, 0)) == len(experiment.poses) >= 16
    if coordinates == "approach1":
        ways = {}
        for q, way in zip(experiment.poses, experiment.covariates["approach1"], strict=True):
            ways.setdefault(tuple(q), set()).add(way)
        assert all(both == {-1.0, 1.0} for both in ways.values())


def test_a_cause_without_a_rival_is_confirmed_where_it_is_not_sure() -> None:
    _, known = known_of("linearity@cart2", 0)
    cause = hypothesis("linearity@cart2")
    (experiment,) = proposed(known, CauseClass(cause, 1.0, ((cause, 0.7),)))
    assert experiment.separates == (str(cause),)
    assert experiment.expected_gain > experiment.random_gain > 0.0
    assert not proposed(known, CauseClass(cause, 1.0, ((cause, 0.99),)))


@pytest.mark.slow
def test_every_free_motion_can_be_traced() -> None:
    case, known = known_of("linearity@cart2", 0)
    frees = {free.over: free for free, _ in smooth_terms(known.operating_points, PRIORS)}
    assert len(frees) > 10
    for free in frees.values():
        experiment = map_unknown(known, free.site, free.words, 20)
        assert 10 <= len(experiment.poses) <= 30
        assert all(len(values) == len(experiment.poses) for values in experiment.covariates.values())
        at_will = {n: v for n, v in experiment.covariates.items() if not n.startswith("temp_")}
        assert len(measured(case, experiment.poses, at_will, 0)) == len(experiment.poses)


@pytest.mark.slow
def test_data_without_any_covariate_get_a_plan_too() -> None:
    bare = ("time", "session", "temp", "payload", "approach", "speed", "f")
    _, known = known_of("linearity@cart2", 1, without=bare)
    names = ("servo_lag@cart1", "tracker_drift@frame", "thermal_links@arm", "frame_shift@frame")
    experiments = proposed(known, class_of("linearity@cart2", "straightness@cart2"), untestable=names)
    recorded = {name for e in experiments for name in e.covariates}
    assert {"speed1", "time", "temp_link", "session"} <= recorded
    assert all(len(e.poses) for e in experiments)


def test_a_machine_that_is_measured_cold_has_had_a_night() -> None:
    rows = {
        "time": 25.0 * np.arange(5),
        "temp_frame": np.array([25.0, 25.0, 20.0, 20.0, 20.0]),
        "temp_link": np.full(5, 26.0),
    }
    found = np.diff(np.asarray(with_nights(rows, 20.0)["time"], dtype=float))
    np.testing.assert_allclose(found, [25.0, 25.0 + 8.0 * 3600.0, 25.0, 25.0])
    only = {"time": rows["time"]}
    assert with_nights(only, 20.0) == only
