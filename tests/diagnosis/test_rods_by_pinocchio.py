"""A diagnosis of rods with poses and derivatives by Pinocchio, posture by posture, is that with arrays."""

import numpy as np
import pytest
from diagnosed import machine, quietly
from pinocchio_rods import PinocchioRods

import gtpin
from gtpin.kinematics import kinematics
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rod_kinematics import RodKinematics


class ByPinocchio(RodKinematics):
    """Poses and derivatives by commands and by parameters are Pinocchio's; the coordinates of joints are the arrays'."""

    calls = 0

    def forward(self, q, start=None):
        expected, found = super().forward(q, start), PinocchioRods(self.geometry).forward(q)
        np.testing.assert_array_equal(found.reached, expected.reached)
        ByPinocchio.calls += 1
        return Poses(found.T, found.R, expected.joints)

    def command_jacobian(self, q, poses, at=None):
        return PinocchioRods(self.geometry).command_jacobian(q, poses)

    def geometry_jacobian(self, q, poses, at=None):
        return PinocchioRods(self.geometry).geometry_jacobian(q, poses)


@pytest.mark.slow
@pytest.mark.parametrize(("effect", "site"), [("backlash", "cart2"), ("link_compliance", "link2a")])
def test_a_diagnosis_by_pinocchio_says_what_the_one_by_arrays_says(monkeypatch, effect, site):
    dataset = machine(5, effect, site).dataset
    arrays = quietly(gtpin.diagnose, dataset)
    monkeypatch.setattr(kinematics, "RodKinematics", ByPinocchio)
    pinocchio = quietly(gtpin.diagnose, dataset)
    assert ByPinocchio.calls > 3
    assert pinocchio.verdict == arrays.verdict
    assert [(c.effect, c.site) for c in pinocchio.causes] == [(c.effect, c.site) for c in arrays.causes]
    one, two = (np.array([c.log_evidence for c in d.candidates if c.testable]) for d in (arrays, pinocchio))
    np.testing.assert_allclose(two, one, rtol=0.0, atol=1e-6 * max(np.abs(one).max(), 10.0))
    assert pinocchio.gap.after == pytest.approx(arrays.gap.after, rel=1e-6)
