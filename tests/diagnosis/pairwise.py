"""Rows that together hold every pair of values of any two factors: a covering array of strength two, built greedily."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from random import Random

Pair = frozenset[tuple[str, str]]

TRIES = 30
"""Candidates for each row."""


def pairs(factors: Mapping[str, Sequence[str]]) -> set[Pair]:
    """Every pair of values of two different factors."""
    return {
        frozenset({(one, a), (two, b)})
        for one, two in combinations(factors, 2)
        for a in factors[one]
        for b in factors[two]
    }


def held(row: Mapping[str, str]) -> set[Pair]:
    """The pairs that a row holds."""
    return {frozenset(pair) for pair in combinations(row.items(), 2)}


def all_pairs(factors: Mapping[str, Sequence[str]]) -> list[dict[str, str]]:
    """Rows, each the best of some tries to hold many pairs that are missing (Cohen et al. 1997, AETG); deterministic."""
    missing = dict.fromkeys(sorted(pairs(factors), key=sorted))
    rng, rows = Random(0), []
    while missing:
        tries = [_row(factors, missing, rng) for _ in range(TRIES)]
        rows.append(max(tries, key=lambda row: sum(pair in missing for pair in held(row))))
        for pair in held(rows[-1]):
            missing.pop(pair, None)
    return rows


def _row(factors: Mapping[str, Sequence[str]], missing: Mapping[Pair, None], rng: Random) -> dict[str, str]:
    """A row begun with a missing pair, and filled in any order with the values that add most pairs."""
    row = dict(rng.choice(list(missing)))
    for name in rng.sample([name for name in factors if name not in row], len(factors) - len(row)):
        values = rng.sample(list(factors[name]), len(factors[name]))
        row[name] = max(values, key=lambda v: sum(frozenset({(name, v), other}) in missing for other in row.items()))
    return {name: row[name] for name in factors}
