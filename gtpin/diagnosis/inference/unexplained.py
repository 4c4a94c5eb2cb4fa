"""What is left after the causes: how much, whether noise could be it, and what it goes with."""

from __future__ import annotations

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis_set import Pool
from gtpin.diagnosis.linear.evidence import Posterior, beside
from gtpin.diagnosis.result import Unexplained
from gtpin.distributions import chi2

CORRELATES = 5
"""Free motions that are reported at most."""
SEEN = 1e-3
"""P-value below which one is."""
ACCOUNTS = 0.8
"""Share of the evidence of the best free motion from which an effect that can't be tested could be what is unknown."""

SURELY = 10.0
"""Gain in log evidence that it must bring at least."""


def unexplained(pool: Pool, model: Posterior, unknown: bool) -> Unexplained:
    """Chi-square of what a model leaves, and the free motions that go with it.

    Parameters
    ----------
    model
        The causes that are named.
    unknown
        Whether something unknown is beside them.
    """
    groups, design = pool.groups, pool.design
    power = _power(pool, model)
    gram = np.vstack([np.zeros((0, len(model.mean))), *(groups.across(n, model.names) for n in model.names)])
    taken = float(np.einsum("ij,ji->", model.covariance, gram))
    dof = max(len(design.y) - design.n_geometry - taken, 1.0)
    excess = groups.power - len(design.y) + design.n_geometry
    correlates = []
    for name, free in pool.free.items():
        own, seen = beside(groups, model, name)
        values, vectors = np.linalg.eigh(own)
        kept = values > 1e-6 * max(float(values.max()), 1e-300)
        statistic = float(((vectors.T @ seen)[kept] ** 2 / values[kept]).sum())
        correlates.append((free.site, free.words, float(chi2.sf(statistic, int(kept.sum())))))
    correlates.sort(key=lambda row: row[2])
    share = float(np.clip((power - dof) / excess, 0.0, 1.0)) if excess > 1e-9 else 0.0
    kept_rows = tuple(row for row in correlates[:CORRELATES] if row[2] < SEEN)
    return Unexplained(share, float(chi2.sf(power, dof)), kept_rows, _could_be(pool, model) if unknown else ())


def marginal_chance(pool: Pool, model: Posterior) -> float:
    """Chance of a larger chi-square from noise, from geometry within its tolerances and from the causes of a model.

    y' (I + B B' + sum_k s_k^2 E_k E_k')^-1 y is chi-square with as many degrees of freedom as y has numbers, however few.
    """
    return float(chi2.sf(_power(pool, model), len(pool.design.y)))


def _power(pool: Pool, model: Posterior) -> float:
    """Squares of the whitened residual, with geometry and a model's causes marginalised."""
    moment = np.concatenate([np.zeros(0), *(pool.groups.moment(n) for n in model.names)])
    return pool.groups.power - float(moment @ model.mean)


def _could_be(pool: Pool, model: Posterior) -> tuple[tuple[str, str], ...]:
    """What nobody could test, but accounts for the unknown nearly as well as the best free motion, the best first."""
    best = max(pool.gains(model, pool.free).values(), default=0.0)
    gains = pool.gains(model, pool.hidden)
    enough = [name for name in sorted(gains, key=lambda n: -gains[n]) if gains[name] >= max(ACCOUNTS * best, SURELY)]
    candidates = [pool.hidden[name].candidate for name in enough]
    return tuple((c.effect.id, c.site) for c in candidates if c.name not in model.names)
