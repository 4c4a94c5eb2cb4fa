"""Evidence, posteriors and gains equal those of dense multivariate normal densities."""

from dataclasses import replace

import numpy as np
import pytest
from linear_problems import Dense
from numpy.testing import assert_allclose

from gtpin.diagnosis.evidence import (
    NOTHING,
    SCALES,
    Groups,
    Marginal,
    _rescaled,
    all_gains,
    best_scales,
    exchanged,
    fixed,
    gain,
    given,
    shares,
    tuned,
    without,
)

WIDTHS = {"a": 1, "b": 3, "c": 4, "d": 6, "e": 7, "f": 12}
SOME = [{"b": 0.7}, {"a": 2.0, "d": 0.3}, {"f": 1.0, "c": 5.0, "b": 0.1}]


@pytest.fixture(scope="module", params=(1, 2))
def dense(request: pytest.FixtureRequest) -> Dense:
    return Dense.draw(request.param, WIDTHS)


@pytest.mark.parametrize("scales", SOME)
def test_evidence_of_a_model_is_the_density_with_the_geometry_marginalised(dense, scales):
    found = fixed(dense.groups, tuple(scales), tuple(scales.values()))
    assert_allclose(found.log_evidence, dense.log_evidence(scales), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("scales", SOME)
def test_coefficients_of_a_model_are_the_conditional_mean_and_covariance(dense, scales):
    found = fixed(dense.groups, tuple(scales), tuple(scales.values()))
    E = np.hstack([s * dense.E[n] for n, s in scales.items()])
    sizes = np.repeat(list(scales.values()), [dense.E[n].shape[1] for n in scales])
    # Of jointly normal coefficients (unit) and y: mean E' S^-1 y and covariance I - E' S^-1 E.
    S = dense.covariance(scales)
    assert_allclose(found.mean, sizes * (E.T @ np.linalg.solve(S, dense.y)), atol=1e-9)
    covariance = np.eye(E.shape[1]) - E.T @ np.linalg.solve(S, E)
    assert_allclose(found.covariance, np.outer(sizes, sizes) * covariance, atol=1e-9)


@pytest.mark.parametrize("others", [{}, *SOME[:2]])
def test_gain_is_the_largest_density_over_the_scales_beside_a_model(dense, others):
    groups = dense.groups
    model = fixed(groups, tuple(others), tuple(others.values()))
    for name in set(WIDTHS) - set(others):
        trials = [dense.log_evidence({**others, name: s}) - dense.log_evidence(others) for s in SCALES]
        value, scale = gain(groups, model, name)
        assert_allclose(value, max(trials), rtol=1e-9, atol=1e-8)
        assert scale == SCALES[int(np.argmax(trials))]


def test_gains_of_groups_of_unequal_width_in_one_batch_are_those_one_by_one(dense):
    groups = dense.groups
    groups.add("bent", dense.E["d"], core=(0, 2))
    model = fixed(groups, ("b",), (0.7,))
    names = [n for n in (*WIDTHS, "bent") if n != "b"]
    together = all_gains(groups, model, names)
    assert set(together) == set(names)
    for name in names:
        gram, moment = given(groups, model, name)
        value, scale = best_scales(gram[None], moment[None], groups.core[name])
        assert_allclose(together[name], (value[0], scale[0]), rtol=1e-9, atol=1e-9)


def test_the_geometry_that_explains_a_residual_best_is_its_conditional_mean_and_products_are_marginal(dense):
    S = dense.covariance({})
    assert_allclose(Marginal(dense.B).deviation(dense.y), dense.B.T @ np.linalg.solve(S, dense.y), atol=1e-9)
    assert_allclose(
        Marginal(dense.B).product(dense.E["c"], dense.E["d"]),
        dense.E["c"].T @ np.linalg.solve(S, dense.E["d"]),
        atol=1e-9,
    )
    # The power without a group is chi-square.
    assert_allclose(dense.groups.power, dense.y @ np.linalg.solve(S, dense.y), rtol=1e-9)


def test_a_model_without_one_of_its_groups_is_the_model_of_the_others(dense):
    groups = dense.groups
    model = fixed(groups, ("a", "d", "b"), (2.0, 0.3, 0.7))
    less = without(groups, model, "d")
    assert less.terms == ("a", "b")
    plain = fixed(groups, ("a", "b"), (2.0, 0.7))
    assert_allclose(less.log_evidence, dense.log_evidence({"a": 2.0, "b": 0.7}), rtol=1e-9)
    assert_allclose(less.mean, plain.mean, atol=1e-9)
    assert_allclose(less.covariance, plain.covariance, atol=1e-9)
    assert without(groups, fixed(groups, ("a",), (1.0,)), "a") == NOTHING


@pytest.mark.parametrize("sweeps", [1, 2])
def test_scales_are_those_of_a_coordinate_ascent_that_builds_every_model_anew(dense, sweeps):
    groups, names, scale = dense.groups, ("b", "d", "f", "c"), [1.0, 1.0, 0.3, 5.0]
    found = tuned(groups, names, scale, sweeps)
    for _ in range(sweeps):
        for i, name in enumerate(names):
            others = [n for n in names if n != name]
            rest = fixed(groups, others, [s for n, s in zip(names, scale, strict=True) if n != name])
            scale[i] = gain(groups, rest, name)[1]
    assert found.scale == tuple(scale)
    whole = fixed(groups, names, scale)
    assert_allclose(found.log_evidence, whole.log_evidence, rtol=1e-12)
    assert_allclose(found.covariance, whole.covariance, atol=1e-9)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("form", [True, False])
def test_bends_gain_as_if_all_were_form_beside_a_form_of_their_size_and_little_without(seed, form):
    rng = np.random.default_rng(seed)
    m, t = 300, np.linspace(-1.0, 1.0, 300)
    column = np.sign(rng.standard_normal(m))  # of typical size as large as the noise
    bends = np.stack([column * np.cos(np.pi / 2.0 * k * (t + 1.0)) for k in (1, 2, 3)], axis=1)
    size = 0.1 if form else 1.0
    y = rng.standard_normal(m) + form * column + size * bends @ rng.standard_normal(3)
    groups = Groups(Marginal(rng.standard_normal((m, 4))), y)
    X = np.column_stack([column, 0.2 * bends])
    groups.add("with form", X, core=(0,))
    groups.add("all form", X)
    bound, free = (gain(groups, NOTHING, name)[0] for name in ("with form", "all form"))
    if form:
        assert_allclose(bound, free, rtol=1e-9)
    else:
        assert bound < free / 4.0


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(("spread", "named"), [(0.05, False), (1.0, True)])
def test_an_effect_whose_core_the_data_hardly_determine_is_not_named_for_its_modulation(seed, spread, named):
    """A load that hardly varies, beside a geometry that absorbs a constant: load times direction is the direction."""
    rng = np.random.default_rng(seed)
    m = 200
    load, direction = 1.0 + spread * rng.standard_normal(m), rng.choice([-1.0, 1.0], m)
    groups = Groups(Marginal(np.full((m, 1), 100.0)), rng.standard_normal(m) + 10.0 * load + 1.5 * direction)
    groups.add("compliance", np.column_stack([10.0 * load, 0.5 * np.abs(load) * direction]), core=(0,))
    groups.add("backlash", direction[:, None])
    compliance, backlash = (gain(groups, NOTHING, name)[0] for name in ("compliance", "backlash"))
    assert (compliance > backlash) == named


@pytest.mark.parametrize("before", [("a", "c", "d"), ("c", "a"), ("d",)])
@pytest.mark.parametrize("after", [("a", "c", "d"), ("c", "a"), ("d",), ("a",), ("c", "a", "d"), ("d", "a")])
def test_a_group_exchanged_for_another_gives_the_model_with_the_other(dense, before, after):
    groups = dense.groups
    groups.join("old", before)
    groups.join("new", after)
    model = fixed(groups, ("e", "old", "b"), (0.4, 1.7, 0.9))
    found, direct = exchanged(groups, model, "old", "new"), fixed(groups, ("e", "new", "b"), (0.4, 1.7, 0.9))
    assert (found.terms, found.widths, found.scale) == (direct.terms, direct.widths, direct.scale)
    assert_allclose(found.log_evidence, direct.log_evidence, rtol=1e-9, atol=1e-9)
    assert_allclose(found.mean, direct.mean, rtol=1e-7, atol=1e-9)
    assert_allclose(found.covariance, direct.covariance, rtol=1e-7, atol=1e-10)


def test_a_group_of_several_has_the_evidence_of_their_columns_together(dense):
    groups = dense.groups
    groups.join("both", ("a", "c"))
    groups.add("whole", np.hstack([dense.E["a"], dense.E["c"]]))
    one, other = (fixed(groups, ("b", name), (0.7, 1.3)) for name in ("both", "whole"))
    assert_allclose(one.log_evidence, other.log_evidence, rtol=1e-12)
    assert_allclose(groups.columns("both"), groups.columns("whole"))
    for repeat in (lambda: groups.join("both", ("a",)), lambda: groups.add("b", dense.E["b"] * 2.0)):
        with pytest.raises(ValueError, match="there already"):
            repeat()
    assert_allclose(groups.columns("b"), dense.E["b"])


@pytest.mark.parametrize("removed", ["a", "d"])
def test_a_covariance_that_rounding_has_made_indefinite_is_computed_again(dense, removed):
    terms, scale = ("a", "d"), (2.0, 0.3)
    sound = fixed(dense.groups, terms, scale)
    spoilt = replace(sound, covariance=sound.covariance - 1.01 * np.diag(np.diag(sound.covariance)))
    assert np.linalg.eigvalsh(spoilt.covariance).min() < 0.0
    for sweeps in (0, 2):
        expected, found = (without(dense.groups, model, removed, sweeps) for model in (sound, spoilt))
        assert_allclose(found.log_evidence, expected.log_evidence, rtol=1e-9)
        assert_allclose(found.covariance, expected.covariance, rtol=1e-9)
    assert_allclose(_rescaled(dense.groups, spoilt, 0).mean, _rescaled(dense.groups, sound, 0).mean, rtol=1e-9)


def test_groups_that_the_geometry_takes_up_whole_have_a_posterior_in_spite_of_rounding():
    """Beside 1e8 noises of each column of the geometry, what is left of the groups' inner products is rounding errors."""
    rng = np.random.default_rng(1)
    B = 1e8 * rng.standard_normal((60, 12))
    groups: Groups[str] = Groups(Marginal(B), rng.standard_normal(60))
    for i in range(8):
        groups.add(str(i), B @ rng.standard_normal((12, 6)))
    gram = np.vstack([groups.across(n, tuple(groups.core)) for n in tuple(groups.core)])
    assert np.linalg.eigvalsh(np.eye(len(gram)) + 1e4 * gram).min() < 0.0  # the test tests something
    found = fixed(groups, tuple(groups.core), [100.0] * 8)
    assert np.isfinite(found.log_evidence)
    assert np.linalg.eigvalsh(found.covariance).min() >= -1e-6 * 100.0**2


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_shares_are_of_the_true_displacements_beyond_geometry_also_where_terms_overlap(seed):
    rng = np.random.default_rng(seed)
    m, B = 600, rng.standard_normal((600, 2))
    alike = 10.0 * rng.standard_normal(m)
    X, Z = (np.column_stack([alike + 3.0 * rng.standard_normal(m), rng.standard_normal(m)]) for _ in range(2))
    moved = (X @ [1.0, 0.5] + 30.0 * B[:, 0], Z @ [0.6, -0.5])  # the geometry takes a part that is larger than all
    off = [r - B @ np.linalg.lstsq(B, r, rcond=None)[0] for r in moved]
    true = float(off[0] @ off[0]) / sum(float(r @ r) for r in off)
    groups = Groups(Marginal(1e3 * B), sum(moved) + rng.standard_normal(m))
    groups.add("x", X)
    groups.add("z", Z)
    found = shares(groups, tuned(groups, ("x", "z"), (1.0, 1.0)))
    assert found["x"] + found["z"] == pytest.approx(1.0)
    assert found["x"] == pytest.approx(true, abs=0.05)
