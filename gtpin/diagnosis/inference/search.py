"""Which explanations, together, are worth most: forward steps from several beginnings, swaps and removals."""

from __future__ import annotations

from collections.abc import Sequence

from gtpin.diagnosis.hypotheses.hypothesis_set import Pool
from gtpin.diagnosis.linear.evidence import NOTHING, Posterior, all_gains, tuned, without

BEAM = 3
"""Beginnings that are grown side by side: the best single explanation need not be one of the best pair."""
MOST = 5
"""Explanations that a model has at most."""


def search(pool: Pool, names: Sequence[str], singles: dict[str, float], beginnings: int = BEAM) -> Posterior:
    """The model that was found to be worth most, out of some explanations.

    Parameters
    ----------
    names
        Of the explanations that it may have.
    singles
        Gain in log evidence of each by itself.
    beginnings
        How many are grown side by side.
    """
    order = sorted(names, key=lambda n: -(singles.get(n, 0.0) - pool.cost(n)))
    best = NOTHING
    for name in order[:beginnings]:
        if singles.get(name, 0.0) < pool.cost(name):
            break
        if name in best.names:
            continue
        pool.adopt(name)
        grown = _grow(pool, tuned(pool.groups, (name,), (1.0,)), names)
        if pool.worth(grown) > pool.worth(best):
            best = grown
    return best


def _grow(pool: Pool, model: Posterior, names: Sequence[str]) -> Posterior:
    while len(model.names) < MOST:
        gains = pool.net_gains(model, names)
        name = max(gains, key=lambda n: gains[n], default=None)
        if name is None or gains[name] < 0.0:
            return model
        pool.adopt(name)
        larger = tuned(pool.groups, (*model.names, name), (*model.scale, 1.0))
        larger = _pruned(pool, _swapped(pool, larger, names))
        if pool.worth(larger) <= pool.worth(model) + 1e-9:
            return model
        model = larger
    return model


def _swapped(pool: Pool, model: Posterior, names: Sequence[str]) -> Posterior:
    """The model after every exchange of one explanation for another that raises its worth."""
    for _ in range(3):
        before = model
        for name in model.names:
            rest = without(pool.groups, model, name, sweeps=1)
            others = [n for n in names if n in pool.groups.columns and n not in rest.names]
            gains = {n: value - pool.cost(n) for n, (value, _) in all_gains(pool.groups, rest, others).items()}
            other = max(gains, key=lambda n: gains[n])
            if other != name and gains[other] > gains[name] + 0.5:
                trial = tuned(pool.groups, (*rest.names, other), (*rest.scale, 1.0))
                if pool.worth(trial) > pool.worth(model):
                    model = trial
                    break
        if model is before:
            return model
    return model


def _pruned(pool: Pool, model: Posterior) -> Posterior:
    """The model without the explanations that are not worth their cost."""
    while model.names:
        smaller = [without(pool.groups, model, n, sweeps=1) for n in model.names]
        best = max(smaller, key=pool.worth)
        if pool.worth(best) < pool.worth(model):
            return model
        model = best
    return model
