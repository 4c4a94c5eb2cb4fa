"""Sessions between which nothing changed count as one, so that a second label for the same session makes no cause doubtful."""

from dataclasses import replace
from math import comb, log

import numpy as np
import pytest
from diagnosed import quietly
from linear_problems import calibrated
from scipy.stats import multivariate_normal

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.recipe import SimulatedConditions
from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import Marginal
from gtpin.diagnosis.hypothesis import Hypothesis
from gtpin.diagnosis.priors import PRIORS
from gtpin.diagnosis.propose import _together, merged_sessions
from gtpin.effects.drive_errors import ZeroShift
from gtpin.effects.measurement import FrameShift

HYPOTHESES = (Hypothesis(FrameShift(), "frame"), Hypothesis(ZeroShift(), "cart1"), Hypothesis(ZeroShift(), "cart2"))
LABELS = 6


def in_sessions(starts: tuple[int, ...], cause: Hypothesis, seed: int, timed: bool = True) -> Design:
    """Poses in six sessions of equal length, with noise of unit size and a shift of 5 typical sizes from some sessions on."""
    observed, baseline = calibrated()
    rng = np.random.default_rng(seed)
    time = np.asarray(observed.covariates["time"], dtype=float)
    number = np.argsort(np.argsort(time)) * LABELS // len(time)
    # Without a time, sessions are in the order of their names; with one, their names need not be.
    names = np.array(list("dbfaec" if timed else "abcdef"), dtype=object)[number]
    covariates = {"session": names} | ({"time": time} if timed else {})
    design = replace(observed, covariates=covariates).design(baseline.model)
    since = np.searchsorted(starts, number, side="right").astype(str).astype(object)
    at = design.operating_points.with_covariate("session", since)
    X = design.columns(cause.basis(at)).reshape(len(design.y), len(starts) + 1, -1)
    sizes = 5.0 * (-1.0) ** np.arange(len(starts) + 1)
    y = design.B @ rng.standard_normal(design.B.shape[1]) + rng.standard_normal(len(design.y))
    return replace(design, y=y + np.einsum("nkm,k->n", X, sizes))


def sessions(design: Design) -> tuple[list[list[int]], float]:
    """The numbers of the sessions that count as one, and the log prior odds against their effects."""
    found, odds = merged_sessions(design, Marginal(design.B), HYPOTHESES, PRIORS)
    before, after = (
        np.array([str(name) for name in d.operating_points.covariates["session"]]) for d in (design, found)
    )
    order = "dbfaec" if "time" in design.operating_points.covariates else "abcdef"
    groups: dict[str, list[int]] = {}
    for number, name in enumerate(order):
        (new,) = set(after[before == name])
        groups.setdefault(new, []).append(number)
    return list(groups.values()), odds


@pytest.mark.parametrize("timed", [True, False])
@pytest.mark.parametrize("cause", HYPOTHESES[:2], ids=str)
@pytest.mark.parametrize("starts", [(3,), (2,), (1, 4), (2, 3)])
def test_sessions_are_those_between_which_something_changed(starts, cause, timed) -> None:
    for seed in range(3):
        found, odds = sessions(in_sessions(starts, cause, seed, timed))
        assert found == [list(range(a, b)) for a, b in zip((0, *starts), (*starts, LABELS), strict=True)]
        assert odds == pytest.approx(log(comb(LABELS - 1, len(starts))))


def test_sessions_that_all_changed_are_left_as_they_are() -> None:
    design = in_sessions((1, 2, 3, 4, 5), HYPOTHESES[0], seed=1)
    found, odds = merged_sessions(design, Marginal(design.B), HYPOTHESES, PRIORS)
    assert found is design
    assert odds == 0.0


def test_two_sessions_are_left_where_nothing_changed() -> None:
    assert (
        len(sessions(replace(in_sessions((3,), HYPOTHESES[0], 1), y=np.zeros(len(calibrated()[0].weight) * 6)))[0]) == 2
    )


@pytest.mark.parametrize("apart", [0.0, 0.5, 1.0, 2.0, 3.0])
def test_neighbours_are_merged_where_equal_coefficients_have_the_larger_evidence(apart: float) -> None:
    rng = np.random.default_rng(3)
    X, scale, width = rng.standard_normal((30, 6)), 2.0, 2
    y = X @ np.array([4.0, -4.0, 1.0, 1.0, 1.0 + apart, 1.0 - apart]) + rng.standard_normal(30)
    covariance = np.linalg.inv(X.T @ X + np.eye(6) / scale**2)
    mean = covariance @ X.T @ y

    def evidence(columns: np.ndarray, variances: list[float]) -> float:
        return float(multivariate_normal(np.zeros(30), np.eye(30) + columns * variances @ columns.T).logpdf(y))

    apart_ = evidence(X, [scale**2] * 6)
    joined = X[:, :4] + np.hstack([np.zeros((30, 2)), X[:, 4:]])
    equal = evidence(joined, [scale**2] * 2 + [scale**2 / 2.0] * 2)
    found = _together(mean, covariance, scale, 6 // width)
    assert found == ([[0], [1, 2]] if equal > apart_ else [[0], [1], [2]])


@pytest.mark.slow
def test_a_shift_of_the_frame_stays_the_cause_where_each_session_has_four_labels() -> None:
    case = make_case(
        0,
        effects=[("frame_shift", "frame")],
        noncentrality=1500.0,
        poses=100,
        held_out=1,
        conditions=SimulatedConditions(sessions=3),
    )
    ordered = case.dataset.take(np.argsort(case.dataset.covariates["time"]))
    names = np.asarray(ordered.covariates["session"]).astype(str)
    labels = np.empty(len(names), dtype=object)
    for name in np.unique(names):
        own = np.flatnonzero(names == name)
        labels[own] = [f"{name} part {4 * i // len(own)}" for i in range(len(own))]
    found = quietly(gtpin.diagnose, replace(ordered, covariates={**ordered.covariates, "session": labels}))
    assert [c.effect for c in found.causes] == ["frame_shift"]
    assert found.causes[0].probability > 0.75  # where the target could have moved as well, the prior odds are 3 to 1
    (effect,) = found.model.effects
    assert set(effect.references.sessions) == set(labels)  # a prediction knows each of them
