"""Which poses to measure: what a plan chooses, writes and refuses."""

import numpy as np
import pytest
from checked_machines import machine

import gtpin
from gtpin.noise.noise import Noise
from gtpin.output.shown import present
from gtpin.planning.choice import PoseChoice


def test_no_exchange_of_one_pose_improves_a_choice_much_and_random_ones_are_worse():
    rng = np.random.default_rng(3)
    choice = PoseChoice(rng.standard_normal((40, 3, 8)), np.ones(8), [[6], [7]])
    rows = list(choice.best(5))
    own = score(choice, rows)
    assert own > max(score(choice, list(rng.choice(40, 5, replace=False))) for _ in range(200))


def score(choice, rows):
    """Minus the sum of the log variances of the wanted unknowns, by the information matrix."""
    J = choice.J[rows].reshape(-1, choice.J.shape[2])
    C = np.linalg.inv(np.diag(1.0 / choice.prior) + J.T @ J)
    return -sum(np.linalg.slogdet(C[np.ix_(g, g)])[1] / len(g) for g in choice.groups)


def test_the_score_of_one_more_pose_is_that_of_the_information_matrix():
    rng = np.random.default_rng(4)
    choice = PoseChoice(rng.standard_normal((12, 2, 6)), np.array([1.0, 1.0, 4.0, 1.0, 100.0, 9.0]), [[4, 5], [2]])
    found = choice.scores([3, 7])
    assert found[3] == found[7] == -np.inf
    for row in (0, 5, 11):
        assert found[row] == pytest.approx(score(choice, [3, 7, row]), rel=1e-9)


@pytest.mark.slow
def test_ten_planned_poses_show_a_zero_shift_of_30_um_and_a_backlash_of_50_um():
    case, model = machine(21)
    found = gtpin.plan(model, "health", 10, q=case.dataset.q)
    assert len(found.commands) == 10
    for i in range(3):
        assert set(found.commands.covariates[f"approach{i + 1}"]) == {-1.0, 1.0}
    measured = {tuple(np.round(q, 6)) for q in case.dataset.q}
    assert {tuple(q) for q in found.commands.q} <= measured
    smallest = {(s.effect, s.site): s.value for s in found.smallest}
    for site in model.robot.sites:
        assert smallest["zero_shift", site] < 3e-5
        assert smallest["backlash", site] < 2.5e-5  # the half width


@pytest.mark.slow
def test_more_poses_show_smaller_changes():
    case, model = machine(21)
    sizes = []
    for count in (5, 20):
        found = gtpin.plan(model, "health", count, q=case.dataset.q)
        sizes.append(max(s.value for s in found.smallest if s.effect == "backlash"))
    assert sizes[1] < 0.8 * sizes[0]


def test_a_plan_to_tell_two_effects_apart_is_better_than_random_poses():
    case, model = machine(21)
    pair = ("backlash@cart1", "servo_lag@cart1")
    found = gtpin.plan(model, "discrimination", 8, between=pair, q=case.dataset.q)
    assert {f"{one.effect}@{one.site}" for one in found.told} == set(pair)
    assert all(one.sigma < one.sigma_random for one in found.told)
    assert {"approach1", "speed1", "payload"} <= set(found.commands.covariates)


def test_a_plan_for_one_effect_does_not_tell_it_apart_from_itself():
    case, model = machine(21)
    found = gtpin.plan(model, "discrimination", 4, between=["backlash@cart1"], q=case.dataset.q)
    assert present(found).words()[0].startswith("4 poses that distinguish 1 effect from")


def test_a_plan_for_a_calibration_tells_more_than_random_poses():
    model = gtpin.read_model("gantry_tau")
    found = gtpin.plan(model, "calibration", 12, noise=Noise(1.5e-5, 5e-5))
    assert found.information is not None
    assert found.information.nats > found.information.nats_random
    assert found.information.error < found.information.error_random


@pytest.mark.slow
def test_an_arm_has_plans_too():
    model = gtpin.read_model("ur5")
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (60, 6))
    found = gtpin.plan(model, "health", 10, noise=Noise(2e-5, 5e-5), q=q)
    assert {s.unit for s in found.smallest if s.effect == "zero_shift"} == {"rad"}


@pytest.mark.parametrize(
    ("purpose", "poses", "options", "words"),
    [
        ("repair", 10, {}, "no plan is called"),
        ("health", 2, {}, "2 poses"),
        ("health", 1000, {}, "1000 poses"),
        ("discrimination", 10, {"between": ("rust",)}, "rust"),
    ],
)
def test_plans_that_can_not_be_are_refused(purpose, poses, options, words):
    _, model = machine(21)
    with pytest.raises(gtpin.GtpinError, match=words):
        gtpin.plan(model, purpose, poses, **options)


def test_a_nominal_model_without_noise_is_refused():
    with pytest.raises(gtpin.GtpinError, match="noise"):
        gtpin.plan(gtpin.read_model("gantry_tau"), "health", 10)
