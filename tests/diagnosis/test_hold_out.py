"""What is left out for the gap: blocks are what they are called, and a session never seen is predicted as such."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from diagnosed import LARGE, classes, machine, said
from linear_problems import bare_design
from numpy.testing import assert_allclose

import gtpin
from gtpin.diagnosis.design import Observed
from gtpin.diagnosis.gap import TIME_BLOCKS, as_unseen, blocks_of, gap
from gtpin.diagnosis.hypothesis import Hypothesis
from gtpin.diagnosis.result import Gap
from gtpin.effects.catalogue import effects_by_id

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")]

SEED, EFFECT = 5, "zero_shift"
SIGMA = 2e-5


def cut(hold_out: str, seed: int = 0, dataset: gtpin.Dataset | None = None) -> list[np.ndarray]:
    data = machine(SEED, EFFECT).dataset if dataset is None else dataset
    return blocks_of(data, hold_out, np.random.default_rng(seed))


@pytest.mark.parametrize("hold_out", ["region", "session", "time", "random"])
def test_every_row_is_left_out_once(hold_out):
    assert (np.sum(cut(hold_out), axis=0) == 1).all()


@pytest.mark.parametrize("hold_out", ["region", "random"])
def test_visits_to_one_pose_are_left_out_together(hold_out):
    visits = machine(SEED, EFFECT).dataset.visits
    for block in cut(hold_out):
        assert not set(visits[block]) & set(visits[~block])


def test_each_session_is_a_block():
    session = machine(SEED, EFFECT).dataset.covariates["session"]
    assert [set(session[block]) for block in cut("session")] == [{name} for name in sorted(set(session))]


def test_stretches_of_time_follow_each_other_and_are_of_equal_length():
    time = machine(SEED, EFFECT).dataset.covariates["time"]
    blocks = cut("time")
    assert len(blocks) == TIME_BLOCKS
    for earlier, later in pairwise(blocks):
        assert time[earlier].max() < time[later].min()
    assert np.ptp([block.sum() for block in blocks]) <= 1


def test_rows_of_one_time_are_in_one_stretch():
    data = machine(SEED, EFFECT).dataset
    time = np.floor(data.covariates["time"] / np.ptp(data.covariates["time"]) * 7.0)
    data = gtpin.Dataset(data.robot, data.pose, data.q, data.position, covariates={"time": time})
    for block in cut("time", dataset=data):
        assert not set(time[block]) & set(time[~block])


def test_random_groups_are_those_of_the_seed():
    assert all((a == b).all() for a, b in zip(cut("random", 3), cut("random", 3), strict=True))
    assert any((a != b).any() for a, b in zip(cut("random", 3), cut("random", 4), strict=True))


@pytest.mark.parametrize(("effect", "site", "freedoms"), [("zero_shift", "cart2", 1), ("frame_shift", "frame", 6)])
def test_a_session_never_seen_gets_the_mean_of_the_others(effect, site, freedoms):
    data = machine(SEED, EFFECT).dataset
    baseline = gtpin.calibrate(data)
    design = Observed.of(data, baseline).design(baseline.model)
    cause = Hypothesis(effects_by_id()[effect], site)
    seen = design.columns(cause.basis(design.operating_points))
    blocks = cut("session")
    unseen = as_unseen(design, cause, seen, blocks)
    for k, block in enumerate(blocks):
        rows = np.repeat(block, design.components)
        own = seen[rows].reshape(rows.sum(), len(blocks), freedoms)[:, k]
        found = unseen[rows].reshape(rows.sum(), len(blocks), freedoms)
        for j in range(len(blocks)):
            share = 0.0 if j == k else 1.0 / (len(blocks) - 1)
            assert_allclose(found[:, j], share * own, atol=1e-12 * np.abs(own).max())
    assert (as_unseen(design, cause, seen, cut("random")) == seen).all()


@cache
def by_session() -> gtpin.Diagnosis:
    return gtpin.diagnose(machine(SEED, EFFECT, noncentrality=LARGE).dataset, hold_out="session")


def test_shifts_between_sessions_are_named_and_predict_no_other_session():
    known, unseen = said(SEED, EFFECT), by_session()
    truth = {(effect.effect, effect.site) for effect in machine(SEED, EFFECT, noncentrality=LARGE).effects}
    assert not known.doubts
    assert not unseen.doubts
    assert classes(known) == classes(unseen) == truth  # nothing else could be it
    assert all(cause.probability > 0.9 for cause in (*known.causes, *unseen.causes))
    assert known.gap.interval[0] > 0.8
    # What a session's own zero is can't be known before it is measured.
    assert unseen.gap.explained_fraction < 0.3
    assert unseen.gap.interval[0] < 0.0
    assert unseen.gap.after > 2.0 * unseen.gap.floor


def test_the_method_says_what_was_left_out():
    assert "each of 3 sessions left out" in by_session().to_json()["gap"]["method"]
    assert "four neighbouring poses" in said(SEED, EFFECT).to_json()["gap"]["method"]


def test_only_where_there_is_one_session_the_interval_is_said_to_ignore_another_day():
    method = said(SEED, EFFECT).to_json()["gap"]["method"]
    assert "between days" not in method
    data = machine(SEED, "backlash", "cart1").dataset
    only = {name: values for name, values in data.covariates.items() if name != "session"}
    one = gtpin.Dataset(data.robot, data.pose, data.q, data.position, data.orientation, covariates=only)
    found = gtpin.diagnose(one, hold_out="random")
    assert "poses drawn at random" in found.to_json()["gap"]["method"]
    assert "the interval ignores changes between days" in found.to_json()["gap"]["method"]


def of_days(seed: int, days: int = 4) -> tuple[Gap, float]:
    """What is said of a linear world in which a cause differs from day to day, and its explained fraction on a day to come."""
    rng = np.random.default_rng(seed)
    n, p, k = 30, 4, 3
    modes, mean = rng.standard_normal((p + k, 3, 6)), 2.0 * rng.standard_normal(k)

    def day(poses):
        x = rng.uniform(-1.0, 1.0, (poses, 3))
        waves = np.stack([np.ones(poses), *x.T, np.cos(6.0 * x[:, 0]), np.sin(5.0 * x[:, 1])], axis=1)
        J = np.einsum("nm,jim->nij", waves, modes).reshape(3 * poses, -1)
        return J[:, :p], J[:, p:], J[:, p:] @ (mean + rng.standard_normal(k))

    geometry = rng.standard_normal(p)
    measured = [day(n) for _ in range(days)]
    B, E, moved = (np.concatenate([one[i] for one in measured]) for i in range(3))
    y = B @ geometry + moved + rng.standard_normal(len(B))
    W = np.broadcast_to(np.eye(3) / SIGMA, (n * days, 3, 3))
    masks = [np.arange(n * days) // n == i for i in range(days)]
    floor = np.full((n * days, 3), SIGMA**2)
    found = gap(bare_design(y, B, W, p), 2.0 * E, floor, masks, np.random.default_rng(0), of_blocks=True)
    B_new, E_new, moved = day(400)
    alone = np.linalg.solve(B.T @ B + np.eye(p), B.T @ y)
    J = np.hstack([B, 2.0 * E])
    both = np.linalg.solve(J.T @ J + np.eye(p + k), J.T @ y)
    truth = B_new @ geometry + moved
    after, before = truth - np.hstack([B_new, 2.0 * E_new]) @ both, truth - B_new @ alone
    return found, float(1.0 - (after**2).sum() / (before**2).sum())


def test_intervals_over_sessions_cover_what_another_session_shows():
    found = [of_days(seed) for seed in range(100)]
    inside = [told.interval[0] <= true <= told.interval[1] for told, true in found]
    assert np.mean(inside) >= 0.88, np.mean(inside)


def test_an_unknown_way_is_refused():
    with pytest.raises(gtpin.GtpinError, match="region, session, time, random"):
        gtpin.diagnose(machine(SEED, EFFECT).dataset, hold_out="day")
