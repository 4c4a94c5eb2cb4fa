"""Models drawn from the posterior, and what models keep of their fit."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import gtpin
from gtpin.effects.active import ActiveEffect
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.operating_points import OperatingPoints
from gtpin.errors import ModelError
from gtpin.model.fit_conditions import FitConditions

NOMINAL = gtpin.read_model("gantry_tau")
SIGMA = 1e-6
FIT = FitConditions(1.5e-5, 5e-5, 1e-6, 1.2, 21.5)


def known_model(rho: float | None) -> gtpin.Model:
    """A drive's scale that correlates with a link's length, and nothing else that is uncertain by more than a nanometre."""
    q = np.array([[0.1, 0.0, 0.0], [0.0, 0.1, 0.2]])
    effect = effects_by_id()["encoder_scale"]
    at = OperatingPoints(NOMINAL.kinematics, q, NOMINAL.kinematics.forward(q), {})
    count, p = len(effect.basis(at, "cart1")), len(NOMINAL.geometry.parameters)
    whole = np.diag(np.full(p + count, 1e-18))
    whole[0, 0] = whole[p, p] = SIGMA**2
    if rho is not None:
        whole[0, p] = whole[p, 0] = rho * SIGMA**2
    active = ActiveEffect(effect, "cart1", None, 1e-4 * np.eye(count)[0], whole[p:, p:], at.references)
    return replace(
        NOMINAL, effects=(active,), covariance=whole[:p, :p], joint_covariance=None if rho is None else whole
    )


def drawn(model: gtpin.Model, n: int = 4000) -> np.ndarray:
    """(n, 2) deviations of the link's length and of the drive's scale from the model's."""
    machines = model.sample(n, np.random.default_rng(0))
    values = np.array([(one.geometry.values[0], one.effects[0].coefficients[0]) for one in machines])
    return values - [model.geometry.values[0], model.effects[0].coefficients[0]]


@pytest.mark.slow
@pytest.mark.parametrize("rho", [None, 0.9, -1.0])
def test_draws_have_the_joint_covariance(rho: float | None) -> None:
    values = drawn(known_model(rho))
    assert np.abs(values.mean(axis=0)).max() < 4.0 * SIGMA / np.sqrt(len(values))
    np.testing.assert_allclose(values.std(axis=0), SIGMA, rtol=0.05)
    assert np.corrcoef(values.T)[0, 1] == pytest.approx(rho or 0.0, abs=0.05)


def test_a_covariance_that_is_another_models_is_not_used() -> None:
    model = known_model(0.9)
    other = replace(model.effects[0], covariance=4.0 * model.effects[0].covariance)
    values = drawn(replace(model, effects=(other,)))
    assert abs(np.corrcoef(values.T)[0, 1]) < 0.05
    np.testing.assert_allclose(values.std(axis=0), [SIGMA, 2.0 * SIGMA], rtol=0.05)


def test_nominal_geometry_is_drawn_from_its_tolerances() -> None:
    machines = NOMINAL.sample(2000, np.random.default_rng(0))
    deviation = np.array([one.geometry.deviation for one in machines])
    np.testing.assert_allclose(deviation.std(axis=0), NOMINAL.geometry.tolerance, rtol=0.15)


def test_the_same_numbers_come_from_the_same_seed() -> None:
    one, other = (known_model(0.5).sample(3, np.random.default_rng(7)) for _ in range(2))
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a.geometry.values, b.geometry.values)


def test_without_an_effect_its_rows_are_gone() -> None:
    model = known_model(0.9)
    p = len(model.geometry.parameters)
    twice = replace(
        model,
        effects=(replace(model.effects[0], site="cart2"), *model.effects),
        joint_covariance=np.pad(model.joint_covariance, ((0, 3), (0, 3))),  # type: ignore[arg-type]
    )
    kept = twice.without({"encoder_scale@cart1"})
    assert [active.name for active in kept.effects] == ["encoder_scale@cart2"]
    assert kept.joint_covariance is not None
    np.testing.assert_array_equal(kept.joint_covariance, model.joint_covariance)
    assert len(kept.joint_covariance) == p + 3


def test_what_a_model_keeps_of_its_fit_is_read_as_it_was_written(tmp_path: Path) -> None:
    model = replace(known_model(0.5), fit=FIT)
    gtpin.write_model(model, tmp_path)
    read = gtpin.read_model(tmp_path)
    np.testing.assert_array_equal(read.joint_covariance, model.joint_covariance)
    assert read.fit == FIT


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("joint_covariance", [[1.0]]),
        ("joint_covariance", None),
        ("fit", {"position_sigma": -1.0}),
        ("fit", {"position_sigma": 1e-5, "orientation_sigma": 1e-5, "drives": 0.0, "misfit": 0.5}),
    ],
)
def test_a_wrong_one_is_refused_by_its_key_and_none_is_taken(tmp_path: Path, key: str, value: object) -> None:
    gtpin.write_model(replace(known_model(0.5), fit=FIT), tmp_path)
    file = tmp_path / "model.json"
    told = json.loads(file.read_text())
    told[key] = value
    file.write_text(json.dumps(told))
    if value is None:
        assert gtpin.read_model(tmp_path).joint_covariance is None
        return
    with pytest.raises(ModelError) as refused:
        gtpin.read_model(tmp_path)
    assert str(refused.value.column).startswith(key)
