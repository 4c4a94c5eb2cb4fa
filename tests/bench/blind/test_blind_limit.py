"""The rival that knows the true displacements: its evidence, what it names where all is plain, and where nothing is there."""

import sys
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from gtpin.bench.blind.draw import truth_of
from gtpin.bench.simulator.case import Case, make_case
from gtpin.diagnosis.evidence import SCALES, Groups, Marginal
from gtpin.diagnosis.hypothesis import Hypothesis
from gtpin.diagnosis.priors import PRIORS
from gtpin.effects.catalogue import effects_by_id

sys.path.insert(0, str(Path(__file__).parents[3] / "examples" / "blind"))

from limit import CLASS_NATS, Enumeration, Limit

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")  # poses set aside


def tiny(
    rng: np.random.Generator, strength: Sequence[float]
) -> tuple[Enumeration[str], np.ndarray, dict[str, np.ndarray]]:
    """Five groups of one column in 40 numbers; the geometry has three columns."""
    B = rng.normal(size=(40, 3))
    columns = {name: rng.normal(size=(40, 1)) for name in "abcde"}
    columns["e"] = columns["a"] + 0.02 * rng.normal(size=(40, 1))  # nearly the same as a
    y = B @ rng.normal(size=3) + rng.normal(size=40)
    y = y + sum(s * columns[name][:, 0] for name, s in zip("abcd", strength, strict=True))
    groups: Groups[str] = Groups(Marginal(B), y)
    for name, column in columns.items():
        groups.add(name, column)
    return Enumeration(groups, tuple("abcde"), lambda term: term), B, columns


def flat(terms: Sequence[str]) -> float:
    return 5.0 * len(terms)


def log_evidence(y: np.ndarray, B: np.ndarray, columns: Sequence[np.ndarray], scale: Sequence[float]) -> float:
    """Of the density itself, over that of no group."""
    plain = np.eye(len(y)) + B @ B.T
    whole = plain + sum((s**2 * X @ X.T for s, X in zip(scale, columns, strict=True)), np.zeros_like(plain))
    found = [multivariate_normal(cov=cov).logpdf(y) for cov in (whole, plain)]
    return float(found[0] - found[1] - sum(0.5 * (np.log(s) / PRIORS.scale_spread) ** 2 for s in scale))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_the_best_set_is_that_of_the_densities_of_all_sets_and_scales(seed: int) -> None:
    found, B, columns = tiny(np.random.default_rng(seed), (0.0, 3.0, 0.0, -2.0))
    best = found.best(flat)
    worths = {}
    for size in (1, 2):
        for names in combinations("abcde", size):
            grid = np.stack(np.meshgrid(*[SCALES[::3]] * size), axis=-1).reshape(-1, size)
            values = [log_evidence(found.groups.y, B, [columns[n] for n in names], s) for s in grid]
            worths[names] = max(values) - 5.0 * size
    assert set(best.terms) == set(max(worths, key=lambda names: worths[names])) == {"b", "d"}
    mine = log_evidence(found.groups.y, B, [columns[n] for n in best.terms], best.scale)
    assert best.log_evidence == pytest.approx(mine, abs=1e-8)
    assert best.log_evidence - flat(best.terms) >= max(worths.values())


def test_a_class_has_what_changes_the_evidence_little() -> None:
    found, B, columns = tiny(np.random.default_rng(4), (3.0, 0.0, 3.0, 0.0))
    best = found.best(flat)
    assert len(set(best.terms) & {"a", "e"}) == 1
    mine = next(term for term in best.terms if term in "ae")
    members = found.members(best, mine)
    assert set(members) == {"a", "e"}
    assert members[mine] == pytest.approx(0.0, abs=1e-6)
    assert set(found.members(best, "c")) == {"c"}
    (other,) = set(members) - {mine}
    values = [
        log_evidence(found.groups.y, B, [columns["c"], columns[other]], (s, t)) for s in SCALES for t in SCALES[::2]
    ]
    assert members[other] >= max(values) - best.log_evidence - 1e-6
    assert members[other] > -CLASS_NATS


@pytest.mark.slow
def test_three_are_found_where_three_are_there_and_none_where_none_is() -> None:
    assert set(tiny(np.random.default_rng(5), (0.0, 3.0, 3.0, 3.0))[0].best(flat).terms) == {"b", "c", "d"}
    silent = [not tiny(np.random.default_rng(100 + i), (0.0,) * 4)[0].best(flat).terms for i in range(40)]
    assert (
        np.mean(silent) > 0.8
    )  # five hypotheses at odds of exp(5): by Markov's inequality 0.97, scales chosen afterwards


def made(*effects: tuple[str, str]) -> Case:
    return make_case(11, effects=list(effects), noncentrality=600.0, poses=90, held_out=1, background=False)


@pytest.fixture(scope="module")
def pair() -> Limit:
    case = made(("straightness", "cart2"), ("backlash", "cart3"))
    return Limit.of(case.dataset, truth_of(case, "two"))


@pytest.mark.slow
@pytest.mark.parametrize("odds", ["diagnosis", "flat"])
def test_a_strong_pair_far_apart_is_named_and_nothing_else(pair: Limit, odds: str) -> None:
    said = pair.statement(odds)  # type: ignore[arg-type]
    assert set(said.names) == {"straightness@cart2", "backlash@cart3"}
    assert said.verdict == "explained"


@pytest.mark.slow
def test_a_true_form_has_one_coefficient_and_no_other_of_its_place_beside_it(pair: Limit) -> None:
    groups, paid = pair._prepared
    assert [groups.width(term) for term in pair.forms] == [1, 1]
    places = [term.place for term in paid if term.place in {true.place for true in pair.forms}]
    assert len(places) == 2
    assert all(paid[true] == 0.0 for true in pair.forms)
    assert any(cost > 1.0 for term, cost in paid.items() if term.effect.has_nonlinear)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_named_where_no_effect_is_although_forms_of_some_are_known(seed: int) -> None:
    case = make_case(seed, effects=[], poses=90, held_out=1)
    plain = Limit.of(case.dataset, truth_of(case, "none"))
    design = plain.hypotheses.design
    known = [h for h in plain.hypotheses.linear if str(h) in ("straightness@cart2", "backlash@cart3")]
    forms = {Hypothesis(h.effect, h.site): design.columns(h.basis(design.operating_points))[:, :1] for h in known}
    assert len(forms) == 2
    assert plain.statement("flat").verdict == "none"
    assert Limit(plain.hypotheses, forms).statement("flat").verdict == "none"


@pytest.mark.slow
def test_an_effect_that_is_in_no_catalogue_is_left_out() -> None:
    case = made(("hose_drag", "platform"))
    rival = Limit.of(case.dataset, truth_of(case, "unlisted"))
    assert not rival.forms
    assert "hose_drag" not in effects_by_id()
