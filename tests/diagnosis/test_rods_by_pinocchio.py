"""A diagnosis of rods with poses and derivatives by Pinocchio, pose by pose, is that with arrays."""

import warnings
from functools import cached_property

import numpy as np
import pytest
from diagnosed import machine

import gtpin
from gtpin.kinematics import kinematics
from gtpin.kinematics.pinocchio_rods import PinocchioRods
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rod_kinematics import RodKinematics

pytestmark = pytest.mark.slow

POSE = 1e-12
"""Largest difference of a pose, m and rad."""
EVIDENCE = 1e-6
"""Largest difference of a log evidence, over the largest log evidence of the case."""


class ByPinocchio(RodKinematics):
    """Forward kinematics and the derivatives by commands and by parameters are Pinocchio's; each is held to the arrays'."""

    calls = 0

    @cached_property
    def _pinocchio(self) -> PinocchioRods:
        return PinocchioRods(self.geometry)

    def forward(self, q, start=None):
        expected, found = super().forward(q, start), self._pinocchio.forward(q)
        reached = expected.reached
        np.testing.assert_array_equal(found.reached, reached)
        np.testing.assert_allclose(found.T[reached], expected.T[reached], rtol=0.0, atol=POSE)
        np.testing.assert_allclose(found.R[reached], expected.R[reached], rtol=0.0, atol=POSE)
        ByPinocchio.calls += 1
        return Poses(found.T, found.R, expected.joints)

    def command_jacobian(self, q, poses, at=None):
        return self._pinocchio.command_jacobian(q, poses)

    def geometry_jacobian(self, q, poses):
        return self._pinocchio.geometry_jacobian(q, poses)


@pytest.mark.parametrize(("effect", "site"), [("backlash", "cart2"), ("link_compliance", "link2a")])
def test_a_diagnosis_by_pinocchio_says_what_the_one_by_arrays_says(monkeypatch, effect, site):
    dataset = machine(5, effect, site).dataset
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        arrays = gtpin.diagnose(dataset)
        monkeypatch.setattr(kinematics, "RodKinematics", ByPinocchio)
        ByPinocchio.calls = 0
        pinocchio = gtpin.diagnose(dataset)
    assert ByPinocchio.calls > 3
    assert pinocchio.verdict == arrays.verdict
    assert [(c.effect, c.site) for c in pinocchio.causes] == [(c.effect, c.site) for c in arrays.causes]
    one, two = (np.array([c.log_evidence for c in d.candidates if c.testable]) for d in (arrays, pinocchio))
    np.testing.assert_allclose(two, one, rtol=0.0, atol=EVIDENCE * max(np.abs(one).max(), 10.0))
    assert pinocchio.gap.after == pytest.approx(arrays.gap.after, rel=1e-6)
