"""Faults of the data: two measurements in one table, and play whose directions belong to other rows, are told from noise."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from diagnosed import quietly
from linear_problems import every_effect

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.recipe import SimulatedConditions, SimulatedNoise
from gtpin.diagnosis.design import Observed
from gtpin.diagnosis.doubts import two_groups
from gtpin.diagnosis.evidence import NOTHING
from gtpin.diagnosis.noise import left_over, searchable_rows
from gtpin.diagnosis.prepare import Prepared
from gtpin.diagnosis.priors import PRIORS
from gtpin.diagnosis.propose import propose
from gtpin.errors import GtpinWarning


def groups_of(dataset: gtpin.Dataset):
    baseline = quietly(gtpin.calibrate, dataset)
    design = Observed.of(dataset, baseline).design(baseline.model)
    residual, _ = left_over(propose(design, every_effect()), NOTHING)
    return two_groups(design, residual, (1.5e-5, 5e-5))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("repeatability", [(1e-6, 4e-6), (4e-5, 6e-5)])
def test_noise_and_scatter_of_drives_are_one_group(seed: int, repeatability: tuple[float, float]) -> None:
    noise = SimulatedNoise(repeatability=repeatability)
    assert groups_of(make_case(seed, n_effects=0, poses=120, held_out=1, noise=noise).dataset) is None


@pytest.mark.slow
@pytest.mark.parametrize(("effect", "site"), [("linearity", "cart3"), ("thermal_links", "arm"), ("backlash", "cart1")])
def test_effects_are_one_group(effect: str, site: str) -> None:
    assert (
        groups_of(make_case(4, effects=[(effect, site)], noncentrality=1500.0, poses=120, held_out=1).dataset) is None
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", [5, 6])
def test_two_frames_in_one_table_are_told_with_their_rows(seed: int) -> None:
    dataset = make_case(seed, n_effects=0, poses=120, held_out=1).dataset
    rng = np.random.default_rng(seed)
    other = np.isin(dataset.visits, rng.permutation(120)[:50])
    moved = replace(dataset, position=dataset.position + np.where(other[:, None], [4e-4, -3e-4, 2e-4], 0.0))
    found = groups_of(moved)
    assert found is not None
    assert (found.smaller == other).mean() > 0.95
    assert found.apart == pytest.approx(np.linalg.norm([4e-4, -3e-4, 2e-4]), rel=0.3)


@pytest.mark.slow
def test_no_verdict_of_silence_stands_on_two_groups() -> None:
    dataset = make_case(7, n_effects=0, poses=120, held_out=1).dataset
    half = np.random.default_rng(7).permutation(len(dataset))[: len(dataset) // 2]
    position = dataset.position.copy()
    position[half] += [6e-4, 0.0, -6e-4]
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always", GtpinWarning)
        found = gtpin.diagnose(replace(dataset, position=position))
    assert found.verdict == "unknown"
    assert any("two groups" in str(w.message) for w in heard)


STILL = SimulatedConditions(rest=1.0)


@pytest.mark.slow
def test_play_with_directions_of_other_rows_on_a_machine_that_stands_still_is_not_called_nothing():
    case = make_case(1, effects=[("backlash", "cart1")], noncentrality=4000.0, poses=130, held_out=1, conditions=STILL)
    order = np.random.default_rng(1).permutation(len(case.dataset))
    mixed = {n: v[order] if n.startswith("approach") else v for n, v in case.dataset.covariates.items()}
    found = quietly(gtpin.diagnose, replace(case.dataset, covariates=mixed))
    assert found.verdict == "unknown"
    assert not [c for c in found.causes if c.probability >= 0.95 and c.effect != "backlash"]


@pytest.mark.slow
def test_scatter_stays_what_it_was_where_nobody_declared_the_sigmas() -> None:
    noise = SimulatedNoise(declared=False, repeatability=(2e-5, 2e-5))
    dataset = make_case(1, effects=[], poses=100, noise=noise).dataset
    baseline = quietly(gtpin.calibrate, dataset)
    assert baseline.noise.repeatability > 0.0
    observed = Observed.of(dataset, baseline)
    J = observed.design(baseline.model).by_command_seen
    before, after = (
        np.trace(n.covariance(J, 6)[:, :3, :3], axis1=1, axis2=2).mean() for n in (baseline.noise, observed.noise)
    )
    assert observed.noise.repeatability == 0.0
    assert after == pytest.approx(before, rel=0.01)


@pytest.mark.slow
def test_a_command_out_of_reach_is_no_pose_to_believe() -> None:
    dataset = make_case(2, effects=[], poses=80).dataset
    q = dataset.q.copy()
    once = np.flatnonzero(np.bincount(dataset.visits)[dataset.visits] == 1)[
        :4
    ]  # visits to one pose have the same commands
    q[once] = [2.0, -2.0, 2.0]
    wild = replace(dataset, q=q)
    baseline = quietly(gtpin.calibrate, wild)
    rows = searchable_rows(Prepared(wild, wild, baseline, (None, None)), PRIORS)
    assert not rows[once].any()
    assert (rows == baseline.used(wild)).all()


@pytest.mark.slow
def test_hysteresis_is_asked_for_its_direction_where_the_fit_knew_it() -> None:
    case = make_case(3, effects=[("link_compliance", "link3a")], noncentrality=2000.0, poses=120)
    found = quietly(gtpin.diagnose, case.dataset)
    assert "link_compliance" in {cause.effect for cause in found.causes}
    without = {name: v for name, v in case.commands.covariates.items() if not name.startswith("approach")}
    with pytest.raises(gtpin.GtpinError, match="approach"):
        found.model.predict(case.commands.q, without)
