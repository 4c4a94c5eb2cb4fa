"""Tails and quantiles against scipy.stats."""

import numpy as np
import pytest
from scipy import stats

from gtpin.distributions import chi2, f, norm

X = np.concatenate([[-1.0, -1e-17, 0.0], np.geomspace(1e-3, 1e3, 50), [np.inf, np.nan]])
P = np.array([0.0, 1e-300, 1e-9, 0.025, 0.5, 0.975, 1.0])


@pytest.mark.parametrize("dof", [0, 1, 3, 3.7, 200, 1e5])
def test_chi_square(dof):
    for name, x in (("cdf", X), ("sf", X), ("ppf", P), ("isf", P)):
        np.testing.assert_array_equal(getattr(chi2, name)(x, dof), getattr(stats.chi2, name)(x, dof), err_msg=name)
    assert dof == 0 or chi2.median(dof) == stats.chi2.median(dof)


@pytest.mark.parametrize("dof", [(3, 5), (200.0, 20.5), (0, 5), (5, 0)])
def test_f(dof):
    np.testing.assert_array_equal(f.sf(X, *dof), stats.f.sf(X, *dof))
    np.testing.assert_array_equal(f.isf(P[2:6], *dof), stats.f.isf(P[2:6], *dof))


def test_normal():
    np.testing.assert_array_equal(norm.sf(X), stats.norm.sf(X))
    np.testing.assert_array_equal(norm.isf(P), stats.norm.isf(P))
