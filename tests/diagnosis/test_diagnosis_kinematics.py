"""A diagnosis of rods with kinematics that were made without Pinocchio says the same."""

import numpy as np
import pytest
from by_simulator import BySimulator
from diagnosed import machine, quietly

import gtpin
from gtpin.model import model


@pytest.mark.slow
@pytest.mark.parametrize(("effect", "site"), [("backlash", "cart2"), ("link_compliance", "link2a")])
def test_a_diagnosis_with_the_simulator_s_own_kinematics_says_what_the_usual_one_says(monkeypatch, effect, site):
    dataset = machine(5, effect, site).dataset
    usual = quietly(gtpin.diagnose, dataset)
    before = BySimulator.calls
    monkeypatch.setattr(model, "kinematics_of", BySimulator)
    other = quietly(gtpin.diagnose, dataset)
    assert BySimulator.calls > before + 3
    assert other.verdict == usual.verdict
    assert [(c.effect, c.site) for c in other.causes] == [(c.effect, c.site) for c in usual.causes]
    one, two = (np.array([c.log_evidence for c in d.candidates if c.testable]) for d in (usual, other))
    np.testing.assert_allclose(two, one, rtol=0.0, atol=1e-6 * max(np.abs(one).max(), 10.0))
    assert other.gap.after == pytest.approx(usual.gap.after, rel=1e-6)
