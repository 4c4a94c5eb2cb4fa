"""A mistake in an effect of a user's is refused with the name of the effect, and what to do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gtpin
from gtpin.diagnosis.hypothesis import Hypothesis, Scope
from gtpin.effects import Displacement, Effect, OperatingPoints, along_track
from gtpin.errors import ModelError

ROBOT = gtpin.load_robot("gantry_tau")


@pytest.fixture(scope="module")
def at() -> OperatingPoints:
    kinematics = gtpin.Model(gtpin.Geometry.nominal(ROBOT)).kinematics
    q = np.random.default_rng(0).uniform(-0.3, 0.3, (7, 3))
    return OperatingPoints(kinematics, q, kinematics.forward(q), {})


class Own(Effect):
    id, title, coefficient = "own", "an effect of a user's", ("size", "m")

    def __init__(self, basis: Any) -> None:
        self._basis = basis

    def basis(self, at, site, shape_parameter=None):
        return self._basis(at, site)


ONE, TWO = np.array([1e-4]), np.array([1e-4, 2e-4])
MISTAKES = {
    "one column and two sizes": lambda at, site: along_track(at, site, at.q[:, :1], TWO),
    "two columns and one size": lambda at, site: along_track(at, site, at.q[:, :2], ONE),
    "no column": lambda at, site: along_track(at, site, at.q[:, 0], ONE),
    "a size that is no array": lambda at, site: along_track(at, site, at.q[:, :1], 1e-4),
    "no number": lambda at, site: along_track(at, site, at.q[:, :1] * np.nan, ONE),
    "a negative size": lambda at, site: along_track(at, site, at.q[:, :1], -ONE),
    "too few poses": lambda at, site: along_track(at, site, at.q[1:, :1], ONE),
    "a twist of five numbers": lambda at, site: Displacement(ONE, twist=np.ones((len(at), 6))),
    "an array": lambda at, site: at.q,
    "another site": lambda at, site: along_track(at, "cart9", at.q[:, :1], ONE),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_displacements_that_can_not_be_are_refused_with_the_effect(name: str, at: OperatingPoints) -> None:
    with pytest.raises(ModelError, match="own@cart1") as refused:
        Hypothesis(Own(MISTAKES[name]), "cart1").checked(at)
    assert refused.value.hint


def test_right_displacements_are_given(at: OperatingPoints) -> None:
    right = Own(lambda at, site: along_track(at, site, at.q[:, :2], TWO))
    assert Hypothesis(right, "cart1").checked(at).displacement(at).shape == (7, 6, 2)


def test_a_class_in_place_of_an_effect_is_refused() -> None:
    with pytest.raises(ModelError, match="no effect"):
        Scope.of([Own], (), 0.05, ROBOT)


def test_an_effect_without_an_id_is_refused() -> None:
    class Nameless(Own):
        id = property()

    with pytest.raises(ModelError, match="Nameless has no id"):
        Scope.of([Nameless(None)], (), 0.05, ROBOT)
