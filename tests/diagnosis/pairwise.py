"""Rows that together hold every pair of values of any two factors: a covering array of strength two, built greedily."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

Pair = frozenset[tuple[str, str]]


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
    """Rows, each begun with a pair that is missing and filled with the values that add most pairs; deterministic."""
    missing = dict.fromkeys(sorted(pairs(factors), key=sorted))
    rows = []
    while missing:
        row = dict(next(iter(missing)))
        for name in [name for name in factors if name not in row]:
            gains = {
                value: sum(frozenset({(name, value), other}) in missing for other in row.items())
                for value in factors[name]
            }
            row[name] = max(gains, key=lambda value: gains[value])
        for pair in held(row):
            missing.pop(pair, None)
        rows.append({name: row[name] for name in factors})
    return rows
