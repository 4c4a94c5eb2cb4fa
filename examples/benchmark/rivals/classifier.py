"""A trained classifier: multinomial logistic regression on the evidence of every effect at every site alone.

It is trained on machines of the same robot and instrument, drawn from other seeds, with one effect, none, or an unlisted one
(``examples/benchmark/train.py``). Its classes are the effects, ``none`` and ``unknown``. The site is the one with the largest
evidence among those of the effect; members of the class are effects with a probability of 0.05 or more.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
from problem import Problem, answered, cause
from scipy.optimize import minimize

from gtpin.bench.benchmark.answer import Answer
from gtpin.diagnosis.hypothesis import Hypothesis

Floats = npt.NDArray[np.float64]
Words = npt.NDArray[np.str_]
NONE, UNKNOWN = "none", "unknown"
SHARE = 0.05
PENALTIES = (0.003, 0.03, 0.3)
FOLDS = 5
TRAINED: Path = Path("training")
"""Folder of the training cases' features; ``run.py`` sets it."""


def features(problem: Problem) -> dict[str, float]:
    """By ``effect@site``: log(1 + evidence), and its share of the largest; and the log of the energy that geometry leaves."""
    largest = max(max(problem.gains.values()), 1.0)
    found = {}
    for term, gain in problem.gains.items():
        found[str(Hypothesis(term.effect, term.site))] = float(np.log1p(max(gain, 0.0)))
        found[f"share {Hypothesis(term.effect, term.site)}"] = max(gain, 0.0) / largest
    found["power"] = float(np.log(problem.hypotheses.groups.power / problem.hypotheses.design.dof))
    return found


@dataclass(frozen=True)
class Classifier:
    """Weights of standardised features: the probability of a class is softmax(W [x, 1])."""

    names: list[str]
    mean: Floats
    spread: Floats
    classes: Words
    W: Floats

    @staticmethod
    def trained(rows: list[dict[str, float]], labels: list[str]) -> Classifier:
        """Fit by maximum likelihood with the penalty on W^2 that predicts left-out fifths of the cases best."""
        names, found = sorted(set().union(*rows)), np.array(labels)
        X = np.array([[row.get(name, 0.0) for name in names] for row in rows])
        mean, spread = X.mean(axis=0), np.maximum(X.std(axis=0), 1e-3)
        X, classes = (X - mean) / spread, np.unique(found)
        fold = np.random.default_rng(0).permutation(len(X)) % FOLDS

        def left_out(penalty: float) -> float:
            right = 0.0
            for k in range(FOLDS):
                W = _fit(X[fold != k], found[fold != k], classes, penalty)
                right += float((classes[np.argmax(_with_one(X[fold == k]) @ W.T, axis=1)] == found[fold == k]).sum())
            return right

        return Classifier(names, mean, spread, classes, _fit(X, found, classes, max(PENALTIES, key=left_out)))

    def probabilities(self, row: dict[str, float]) -> dict[str, float]:
        """Probability of each class."""
        x = (np.array([row.get(name, 0.0) for name in self.names]) - self.mean) / self.spread
        z = self.W @ np.append(x, 1.0)
        shares = np.exp(z - np.logaddexp.reduce(z))
        return dict(zip(self.classes.tolist(), shares.tolist(), strict=True))


def _with_one(X: Floats) -> Floats:
    return np.hstack([X, np.ones((len(X), 1))])


def _fit(X: Floats, labels: Words, classes: Words, penalty: float) -> Floats:
    """(classes, features + 1) weights."""
    A, hot = _with_one(X), (labels[:, None] == classes).astype(float)

    def cost(w: Floats) -> tuple[float, Floats]:
        W = w.reshape(len(classes), -1)
        z = A @ W.T
        log = z - np.logaddexp.reduce(z, axis=1)[:, None]
        gradient = (np.exp(log) - hot).T @ A / len(A)
        value = -float((hot * log).sum()) / len(A) + 0.5 * penalty * float((W[:, :-1] ** 2).sum())
        gradient[:, :-1] += penalty * W[:, :-1]
        return value, gradient.ravel()

    start = np.zeros(len(classes) * A.shape[1])
    return np.asarray(minimize(cost, start, jac=True, method="L-BFGS-B", options={"maxiter": 300}).x).reshape(
        len(classes), -1
    )


@lru_cache
def _of_block(file: Path) -> Classifier:
    kept = np.load(file, allow_pickle=False)
    names = kept["names"].tolist()
    return Classifier.trained(
        [dict(zip(names, row, strict=True)) for row in kept["X"].tolist()], kept["labels"].tolist()
    )


def answer(folder: Path) -> Answer:
    """The answer to one case, by the classifier of its robot and instrument."""
    problem = Problem.of(folder)
    shares = _of_block(TRAINED / f"{folder.name.rsplit('-', 1)[0]}.npz").probabilities(features(problem))
    first = max(shares, key=shares.__getitem__)
    if first in (NONE, UNKNOWN):
        return answered(folder, problem.baseline, [], unknown=first == UNKNOWN)
    best: dict[str, Hypothesis] = {}
    for term in sorted(problem.gains, key=problem.gains.__getitem__):
        best[term.effect.id] = term
    if first not in best:  # this dataset can't test it
        return answered(folder, problem.baseline, [])
    others = [best[name] for name, share in shares.items() if name in best and name != first and share >= SHARE]
    return answered(folder, problem.fitted([best[first]]), [cause(best[first], shares[first], others)])
