"""The truth of a case is what it says: energies, poses, noise, bytes."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from gtpin.bench.simulator import Case, digest, draw_case, make_case
from gtpin.bench.simulator.case import bulk_recipe, drawn_recipe
from gtpin.bench.simulator.recipe import SimulatedConditions, SimulatedNoise
from gtpin.bench.simulator.rods import Rods
from gtpin.data import Commands, Dataset
from gtpin.errors import GtpinError
from gtpin.kinematics.rotations import from_quaternions, log

POSITION, TURN = 15e-6, 50e-6


def whole_energy(case: Case, displacement: np.ndarray) -> float:
    """E by the book: the whole matrix I + B B', its B by finite differences of the whole chain."""
    machine, q = case.machine, case.visits.q
    sigma = np.array([POSITION] * 3 + [TURN] * 3)
    geometry = machine.geometry
    columns = []
    for j, tolerance in enumerate(geometry.tolerance):
        step = np.zeros(len(geometry.values))
        step[j] = 1e-2 * tolerance
        moved = [Rods(geometry.with_values(geometry.values + s * step)) for s in (1, -1)]
        there, back = (kinematics.predict(q) for kinematics in moved)
        columns.append((there.minus(back) / 2e-2 / sigma).ravel())
    B = np.array(columns).T
    d = (displacement / sigma).ravel()
    return float(d @ np.linalg.solve(np.eye(len(d)) + B @ B.T, d))


@pytest.mark.slow
@pytest.mark.parametrize("effect", [("straightness", "cart3"), ("link_compliance", "arm"), ("hose_drag", "platform")])
def test_energy_is_what_was_asked_and_what_the_whole_matrix_gives(effect: tuple[str, str]) -> None:
    case = make_case(5, effects=[effect], noncentrality=700.0, poses=60)
    (truth,) = case.effects
    assert truth.noncentrality == pytest.approx(700.0, rel=2e-3)
    assert whole_energy(case, truth.displacement) == pytest.approx(truth.noncentrality, rel=1e-4)


def test_energies_are_drawn_between_30_and_4000_uniformly_in_the_logarithm() -> None:
    """That a machine has the energy that its recipe asks for is another test's."""
    energies = [drawn_recipe(seed, effects=[("linearity", None)]).wanted[0].noncentrality for seed in range(60)]
    assert min(energies) > 29.9
    assert max(energies) < 4010.0
    uniform = stats.uniform(np.log(30.0), np.log(4000.0 / 30.0))
    assert stats.kstest(np.log(energies), uniform.cdf).pvalue > 1e-3


def test_an_effect_that_geometry_absorbs_stays_at_a_size_that_machines_have() -> None:
    (truth,) = make_case(1, effects=[("target_offset", "platform")], noncentrality=4000.0).effects
    assert truth.noncentrality < 15.8
    assert np.abs(truth.displacement[:, :3]).max() < 3e-3


@pytest.mark.slow
def test_weak_others_are_weak_and_weaker_where_nothing_else_is() -> None:
    for seed in range(8):
        assert 0.0 < make_case(seed).background < 15.0
        null = make_case(seed, n_effects=0)
        assert null.effects == ()
        assert 0.0 < null.background < 5.0


@pytest.mark.slow
def test_all_that_a_null_adds_to_the_geometry_is_weak_and_some_micrometres_of_repeatability() -> None:
    case = make_case(3, n_effects=0)
    off = case.true.minus(case.machine.predict(case.visits.q))
    assert whole_energy(case, off) < 0.35 * 6 * len(off)
    assert np.sqrt((off[:, :3] ** 2).sum(axis=1).mean()) < 60e-6


@pytest.mark.parametrize("seed", [0, 1])
def test_measurements_less_the_truth_are_noise_of_the_sigmas_declared(seed: int) -> None:
    case = make_case(seed, poses=280)
    off = case.dataset.position - case.true.T
    turned = log(from_quaternions(case.dataset.orientation) @ np.swapaxes(case.true.R, 1, 2))
    for noise in (off / case.dataset.instrument.position_sigma, turned / case.dataset.instrument.orientation_sigma):
        assert stats.chi2(noise.size).cdf((noise**2).sum()) == pytest.approx(0.5, abs=0.4999)
        assert stats.kstest(noise.ravel(), "norm").pvalue > 1e-3


def test_visits_to_one_pose_differ_by_noise_and_repeatability_where_nothing_else_is() -> None:
    case = make_case(4, n_effects=0, poses=280, background=False)
    repeated = pd.Series(case.dataset.pose).duplicated(keep=False)
    assert repeated.sum() == 2 * 28
    both = case.true.T[np.argsort(case.dataset.pose, kind="stable")][
        np.sort(case.dataset.pose).searchsorted(np.unique(case.dataset.pose[repeated]))[:, None] + [0, 1]
    ]
    spread = np.sqrt(((both[:, 0] - both[:, 1]) ** 2).sum(axis=1).mean() / 2.0)
    assert 1e-6 < spread < 12e-6


@pytest.mark.slow
def test_heavy_tails_keep_their_sigma_and_gross_errors_are_as_many_as_asked() -> None:
    heavy = make_case(6, n_effects=0, poses=3000, held_out=1, noise=SimulatedNoise(tails=6.0), background=False)
    off = (heavy.dataset.position - heavy.true.T) / POSITION
    assert off.std() == pytest.approx(1.0, abs=0.05)
    assert stats.kurtosis(off.ravel()) > 1.0
    gross = make_case(6, n_effects=0, poses=3000, held_out=1, noise=SimulatedNoise(gross=0.05), background=False)
    far = np.linalg.norm(np.hstack([(gross.dataset.position - gross.true.T) / POSITION]), axis=1) > 6.0
    assert 0.02 < far.mean() < 0.06


@pytest.mark.slow
def test_noise_by_range_is_larger_far_from_the_instrument() -> None:
    case = make_case(7, n_effects=0, poses=3000, held_out=1, noise=SimulatedNoise(by_range=1.0), background=False)
    distance = np.linalg.norm(case.true.T - np.array(SimulatedNoise().station), axis=1)
    off = np.linalg.norm(case.dataset.position - case.true.T, axis=1)
    far = distance > np.median(distance)
    assert off[far].mean() > 1.05 * off[~far].mean()


def test_what_is_not_declared_or_not_measured_is_not_in_the_dataset() -> None:
    case = make_case(
        8,
        noise=SimulatedNoise(declared=False, orientations=False),
        conditions=SimulatedConditions(without=("temp", "time")),
    )
    assert case.dataset.instrument.position_sigma is None
    assert case.dataset.orientation is None
    assert not {"time", "temp_frame", "temp_link"} & set(case.dataset.covariates)
    assert not {"time", "temp_frame", "temp_link"} & set(case.commands.covariates)


@pytest.mark.slow
def test_an_instrument_with_a_frame_of_its_own_sees_the_same_machine_from_elsewhere() -> None:
    robot, free = (make_case(9, noise=SimulatedNoise(free=value)) for value in (False, True))
    assert free.dataset.instrument.frame == "free"
    between = [np.linalg.norm(c.truth.T[1:] - c.truth.T[:-1], axis=1) for c in (robot, free)]
    np.testing.assert_allclose(between[0], between[1], atol=1e-12)
    assert np.linalg.norm(robot.truth.T - free.truth.T, axis=1).min() > 0.01


@pytest.mark.slow
def test_same_seed_same_bytes_and_other_seeds_other_machines(tmp_path: Path) -> None:
    for name in "ab":
        draw_case(11).write(tmp_path / name)
    draw_case(12).write(tmp_path / "c", name="case00011")
    files = [sorted(p.relative_to(tmp_path / n) for p in (tmp_path / n).rglob("*") if p.is_file()) for n in "abc"]
    assert files[0] == files[1] == files[2]
    for file in files[0]:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    assert (tmp_path / "a/case00011/poses.csv").read_bytes() != (tmp_path / "c/case00011/poses.csv").read_bytes()


def test_a_case_is_written_as_blind_reads_it(tmp_path: Path) -> None:
    case = make_case(13, n_effects=2, conditions=SimulatedConditions(sessions=2))
    case.write(tmp_path, name="two")
    dataset, commands = Dataset.read(tmp_path / "two"), Commands.read(tmp_path / "two" / "commands.csv")
    np.testing.assert_array_equal(dataset.position, case.dataset.position)
    np.testing.assert_array_equal(commands.q, case.commands.q)
    truth = json.loads((tmp_path / "two.truth.json").read_text())
    assert [set(effect) for effect in truth["effects"]] == [{"effect", "site", "energy"}] * 2
    poses = pd.read_csv(tmp_path / "two.truth.csv", dtype={"pose": str})
    assert list(poses.columns) == ["pose", "x", "y", "z", "qw", "qx", "qy", "qz"]
    assert list(poses["pose"]) == list(commands.pose)
    np.testing.assert_array_equal(poses[["x", "y", "z"]], case.truth.T)
    case.write(tmp_path, name="two")  # what is there already is replaced


def test_bulk_draws_every_kind_of_case() -> None:
    recipes = [bulk_recipe(seed) for seed in range(60)]
    assert {0, 1, 2} == {len(recipe.wanted) for recipe in recipes}
    assert len({recipe.wanted[0].effect for recipe in recipes if recipe.wanted}) > 15
    assert all(140 <= recipe.poses <= 280 for recipe in recipes)


def test_rough_bulk_draws_small_datasets_with_columns_missing_and_undeclared_noise() -> None:
    recipes = [bulk_recipe(seed, rough=True) for seed in range(30)]
    assert all(70 <= recipe.poses <= 200 for recipe in recipes)
    assert {recipe.noise.declared for recipe in recipes} == {True, False}
    assert any("approach" in recipe.conditions.without for recipe in recipes)


@pytest.mark.slow
@pytest.mark.parametrize("rough", [False, True])
def test_a_case_drawn_in_bulk_is_made_as_its_recipe_says(rough: bool) -> None:
    for seed in range(0, 30, 3):
        case, recipe = draw_case(seed, rough=rough), bulk_recipe(seed, rough=rough)
        assert {(truth.effect, truth.site) for truth in case.effects} == {(w.effect, w.site) for w in recipe.wanted}
        assert len(set(case.dataset.pose)) == recipe.poses
        assert (case.dataset.instrument.position_sigma is not None) == recipe.noise.declared
        lacking = recipe.conditions.without
        assert not [name for name in case.dataset.covariates if lacking and name.startswith(lacking)]
    assert rough == any(bulk_recipe(seed, rough=rough).conditions.without for seed in range(0, 30, 3))


def test_too_few_poses_or_an_effect_at_no_site_of_its_own_are_one_line() -> None:
    for asked in ({"poses": 1}, {"effects": [("backlash", "arm")]}, {"effects": [("magic", None)]}, {"held_out": 0}):
        with pytest.raises(GtpinError) as error:
            make_case(0, **asked)
        assert "\n" not in str(error.value)


def test_the_simulator_s_digest_is_that_of_its_sources(monkeypatch: pytest.MonkeyPatch) -> None:
    before = digest()
    assert re.fullmatch(r"[0-9a-f]{64}", before)
    assert digest() == before
    monkeypatch.setattr(
        Path, "read_bytes", lambda path, real=Path.read_bytes: real(path) + b"\n" * (path.name == "case.py")
    )
    assert digest() != before
