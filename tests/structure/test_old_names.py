"""Names of before: they warn, and are the new ones."""

from pathlib import Path

import numpy as np
import pytest

import gtpin
import gtpin.bench.simulator
import gtpin.data
import gtpin.effects
from gtpin.bench.simulator import EffectTruth, make_case
from gtpin.bench.simulator.case import scenario_recipe
from gtpin.diagnosis.hypothesis import Scope
from gtpin.effects.active import ActiveEffect


@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        (gtpin.data, "Instrument", "InstrumentSection"),
        (gtpin.bench.simulator, "Noise", "SimulatedNoise"),
        (gtpin.effects, "Basis", "Displacement"),
        (gtpin.effects, "Range", "ParameterRange"),
        (gtpin.effects, "Situation", "OperatingPoints"),
        (gtpin.effects, "carts", "actuators"),
        (gtpin.effects, "sliding_carts", "sliding_actuators"),
    ],
)
def test_an_old_name_of_a_module_warns_and_is_the_new_one(module, old, new):
    with pytest.warns(DeprecationWarning, match=f"{old} is now called {new}"):
        assert getattr(module, old) is getattr(module, new)


def test_a_name_that_never_was_is_an_error():
    with pytest.raises(AttributeError, match="no attribute 'Carts'"):
        gtpin.effects.Carts  # noqa: B018


@pytest.mark.parametrize(
    ("owner", "old", "new"),
    [
        (gtpin.Calibration, "enlarged", "sigma_scale"),
        (gtpin.Component, "usual", "initial_sigma"),
        (gtpin.Instrument, "minus", "residual_at"),
        (gtpin.Model, "seen", "in_instrument_frame"),
        (ActiveEffect, "nonlinear", "shape_parameter"),
        (EffectTruth, "energy", "noncentrality"),
    ],
)
def test_an_old_attribute_warns_and_is_the_new_one(owner, old, new):
    assert new in {*dir(owner), *getattr(owner, "__annotations__", ())}
    one = type("One", (), {old: vars(owner)[old], new: 3.0})()
    with pytest.warns(DeprecationWarning, match=f"{old} is now called {new}"):
        assert getattr(one, old) == 3.0


def test_an_effect_of_before_gives_its_expected_range():
    told = {"rate": gtpin.effects.ParameterRange(0.0, 1.0, "it pulls")}
    with pytest.warns(DeprecationWarning, match="usual is now called expected_range"):

        class Own(gtpin.effects.Effect):
            usual = told

    assert Own.expected_range is told


def test_a_case_of_before_is_the_same():
    with pytest.warns(DeprecationWarning, match="energy is now called noncentrality"):
        old = make_case(1, effects=[("backlash", "cart1")], energy=100.0, poses=8, held_out=1, background=False)
    new = make_case(1, effects=[("backlash", "cart1")], noncentrality=100.0, poses=8, held_out=1, background=False)
    np.testing.assert_array_equal(old.dataset.position, new.dataset.position)


def test_all_links_and_the_instrument_are_read_as_sites(tmp_path: Path):
    excluded = ("link_compliance@all_links", "tracker_drift@instrument", "backlash@cart1", "linearity")
    scope = Scope.of(gtpin.catalogue(), excluded, 0.01, gtpin.load_robot("gantry_tau"))
    assert scope.exclude == {"link_compliance@arm", "tracker_drift@frame", "backlash@cart1", "linearity"}
    file = tmp_path / "scenario.toml"
    given = (("thermal_links", "all_links"), ("tracker_drift", "instrument"))
    file.write_text("".join(f'[[effect]]\nid = "{effect}"\nsite = "{site}"\n' for effect, site in given))
    assert [wanted.site for wanted in scenario_recipe(file).wanted] == ["arm", "frame"]
