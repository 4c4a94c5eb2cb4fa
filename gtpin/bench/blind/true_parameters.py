"""True values of an effect's parameters: what a fit as in a diagnosis, with the geometry free, gives of noise-free data.

The geometry and the unknowns of instruments, with their tolerances and priors, are fitted to the true displacement together
with the effect's basis. The coefficients, in units of their typical sizes, are (X' M X + I / s^2)^-1 X' M d with
M = (I + B B')^-1, and d, X and B as in `difficulty.py`. So what calibration absorbs of an effect, such as a straight line in
the form of a track, is no error of a parameter. The scale s and the nonlinear parameters (a period, a place) are those of
largest evidence.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.bench.blind.difficulty import BATCH, Best, Difficulty
from gtpin.typing import Floats

Values = Sequence[float]
"""Values of the nonlinear parameter of an effect at one site: none, one, or several periods of a gear."""

TRIED, ROUNDS, SWEEPS = 13, 4, 3
"""Values that are tried between the neighbours of the best one of a scan, repetitions with a smaller step, and times that each
of several values is refined given the others."""


def true_parameters(difficulty: Difficulty, best: Best, displacement: Floats) -> dict[str, float]:
    """Parameters, by name, of an effect in its textbook form that is nearest to a true displacement (rows, 6).

    Several values of the nonlinear parameter are refined from those of ``best``; a single one is scanned again, because
    ``best`` has the value that explains most energy, not that of largest evidence.
    """
    d = difficulty.true(displacement)
    values, scale = _values(difficulty, best, difficulty.orthogonal(d))
    basis = best.effect.basis_of(difficulty.situation, best.site, values)
    X = difficulty.whitened(basis.displacement(difficulty.situation) * basis.sigma)
    MX = difficulty.orthogonal(X)
    c = np.linalg.solve(MX.T @ X + np.eye(X.shape[1]) / scale**2, MX.T @ d) * basis.sigma
    found = best.effect.parameters_of(difficulty.situation.robot, best.site, c, values)
    return {name: value for name, (value, _) in found.items()}


def _values(difficulty: Difficulty, best: Best, past: Floats) -> tuple[Values, float]:
    """The values of the nonlinear parameter and the scale of largest evidence."""
    if not best.values:
        return (), best.scale
    tried = np.sort(best.effect.nonlinear_values(difficulty.situation, best.site))
    values, scale = list(best.values), best.scale
    if len(values) == 1:
        values = list(_likeliest(difficulty, best, [(value,) for value in tried], past)[0])
    for _ in range(SWEEPS if len(values) > 1 else 1):
        for i in range(len(values)):
            place = int(np.searchsorted(tried, values[i]))
            low, high = tried[[max(place - 1, 0), min(place + 1, len(tried) - 1)]]
            for _ in range(ROUNDS):
                near = np.linspace(low, high, TRIED)
                together, scale = _likeliest(difficulty, best, [(*values[:i], v, *values[i + 1 :]) for v in near], past)
                values[i] = together[i]
                low, high = values[i] - (near[1] - near[0]), values[i] + (near[1] - near[0])
    return values, scale


def _likeliest(difficulty: Difficulty, best: Best, trials: Sequence[Values], past: Floats) -> tuple[Values, float]:
    """The values of largest evidence, of some trials, and the scale."""
    found: list[tuple[float, float]] = []
    for start in range(0, len(trials), BATCH):
        some = trials[start : start + BATCH]
        bases = [best.effect.basis_of(difficulty.situation, best.site, values) for values in some]
        _, scales, evidence = difficulty.by_basis(bases, past)
        found += zip(evidence.tolist(), scales.tolist(), strict=True)
    top = max(range(len(trials)), key=lambda i: found[i][0])
    return tuple(map(float, trials[top])), found[top][1]
