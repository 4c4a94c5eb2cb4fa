"""The measurements that best distinguish the members of a class, by expected log Bayes factors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.special import logsumexp

from gtpin.diagnosis.evidence import NOTHING, Groups, Marginal, fixed, gain
from gtpin.diagnosis.hypothesis import Hypothesis, SmoothTerm
from gtpin.diagnosis.priors import PRIORS, SURE, Priors
from gtpin.diagnosis.result import Experiment
from gtpin.diagnosis.smooth_terms import COMMON, smooth_terms
from gtpin.diagnosis.trials import Known, Trials, kind, numbers, possible
from gtpin.effects.displacement import Displacement
from gtpin.effects.operating_points import Column
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

Rows = npt.NDArray[np.intp]
Pair = tuple[int, int, float]
"""Indices of two hypotheses, of which the first is assumed to be true, and the weight of this pair."""
IGNORED_VARIANCE = 3e-3
"""Mean variance per row, relative to that of the noise, below which a direction is ignored in the choice of rows."""
SIMULATED = 400
"""Number of simulated measurements. The standard error of a probability is 2.5 % at most."""
PROMISED = 0.8
"""Probability of settling the question from which one experiment is said to be enough."""
MOST_ROUNDS = 10
"""Most rounds of the same measurements that are considered."""


@dataclass(frozen=True)
class Prediction:
    """The predictive distribution of M further rows with c whitened numbers each, under a hypothesis, given the measured rows.

    ``mean``: (M, c). ``spread``: (M, c, r) root of the covariance without noise, that of rows i and j being spread[i] @
    spread[j]'. The noise adds I.
    """

    mean: Floats
    spread: Floats

    @staticmethod
    def of(trials: Trials, columns: Floats) -> Prediction:
        """The prediction for whitened displacements ((N + M) c, m) of standard normal coefficients, and the geometry."""
        c, p = trials.design.components, trials.design.B.shape[1] + columns.shape[1]
        J = np.hstack([trials.design.B, columns])
        old, new = J[trials.old], J[trials.old.stop :]
        factor = cho_factor(np.eye(p) + old.T @ old, lower=True)
        mean = new @ cho_solve(factor, old.T @ trials.design.y[trials.old])
        spread = solve_triangular(factor[0], new.T, lower=True).T
        return Prediction(mean.reshape(-1, c), spread.reshape(len(trials), c, -1))

    def factor(self, rows: Rows, times: int = 1) -> Floats:
        """The lower triangular factor of the covariance of some rows, with noise, each measured ``times`` times and averaged.

        In units of the averages' noise.
        """
        L = np.sqrt(times) * self.spread[rows].reshape(-1, self.spread.shape[2])
        # By QR: where L is very large, I would be lost by rounding in I + L L'.
        upper = np.linalg.qr(np.vstack([L.T, np.eye(len(L))]), mode="r")
        return np.asarray((upper * np.sign(np.diag(upper))[:, None]).T)


def expected_gain(predictions: Sequence[Prediction], pairs: Sequence[Pair], rows: Rows) -> float:
    """Expected log Bayes factor, nats, for the true hypothesis by measuring some rows; weighted mean over pairs.

    For a pair (a, b) it is the Kullback-Leibler divergence of N(mu_a, I + L_a L_a') from N(mu_b, I + L_b L_b'), with mu the
    means and L the spreads of the two predictions.
    """
    factors = [p.factor(rows) for p in predictions]
    total = 0.0
    for true, rival, weight in pairs:
        lower = factors[true]
        shift = (predictions[true].mean - predictions[rival].mean)[rows].ravel()
        solved = solve_triangular(factors[rival], np.column_stack([lower, shift]), lower=True)
        logs = np.log(np.diag(factors[rival])).sum() - np.log(np.diag(lower)).sum()
        total += weight * float(0.5 * ((solved**2).sum() - len(shift)) + logs)
    return total / sum(weight for *_, weight in pairs)


def most_telling(predictions: Sequence[Prediction], pairs: Sequence[Pair], count: int) -> Rows:
    """(count,) rows that together distinguish the hypotheses best, chosen one by one.

    The criterion is the sum of ln(1 + gain) over the pairs, so that a pair with a large gain already adds little.
    """
    spreads = [_main(p.spread) for p in predictions]
    # Mean and root of the covariance of the errors of a rival's predictions of all rows, where the other one is true.
    shifts = [predictions[true].mean - predictions[rival].mean for true, rival, _ in pairs]
    errors = [spreads[true] for true, _, _ in pairs]
    weights, gains = np.array([[weight] for *_, weight in pairs]), np.zeros(len(pairs))
    M, c = predictions[0].mean.shape
    chosen: list[int] = []
    while len(chosen) < min(count, M):
        covariances = [np.eye(c) + s @ np.swapaxes(s, 1, 2) for s in spreads]
        inverses = [np.linalg.inv(S) for S in covariances]
        logs = [np.linalg.slogdet(S)[1] for S in covariances]
        steps = np.empty((len(pairs), M))  # gain by measuring each row next
        for i, (true, rival, _) in enumerate(pairs):
            trace = (inverses[rival] * (np.eye(c) + errors[i] @ np.swapaxes(errors[i], 1, 2))).sum(axis=(1, 2))
            squared = np.einsum("ni,nij,nj->n", shifts[i], inverses[rival], shifts[i])
            steps[i] = 0.5 * (trace + squared - c + (logs[rival] - logs[true]))
        criterion = (weights * np.log1p(gains[:, None] + steps)).sum(axis=0)
        criterion[chosen] = -np.inf
        best = int(criterion.argmax())
        chosen.append(best)
        gains = gains + steps[:, best]
        for i, (_, rival, _) in enumerate(pairs):
            update = (spreads[rival] @ spreads[rival][best].T) @ inverses[rival][best]
            shifts[i] = shifts[i] - update @ shifts[i][best]
            errors[i] = np.concatenate([errors[i] - update @ errors[i][best], update], axis=2)
        spreads = [_known(s, best, S) for s, S in zip(spreads, covariances, strict=True)]
    return np.array(chosen, dtype=np.intp)


def _main(spread: Floats) -> Floats:
    """(M, c, few) approximation of a root of the covariance (M, c, r) by its largest directions."""
    flat = spread.reshape(-1, spread.shape[2])
    values, vectors = np.linalg.eigh(flat.T @ flat)
    return np.asarray(spread @ vectors[:, values > IGNORED_VARIANCE * len(spread)])


def _known(spread: Floats, row: int, covariances: Floats) -> Floats:
    """The root of the covariance after a row was measured (Potter's square-root update for several numbers at a time)."""
    values, vectors = np.linalg.eigh(covariances[row])
    middle = (vectors / (np.sqrt(values) * (np.sqrt(values) + 1.0))) @ vectors.T
    return np.asarray(spread - (spread @ spread[row].T) @ (middle @ spread[row]))


@dataclass(frozen=True)
class Rivals:
    """The hypotheses of a class, then the smooth terms in their place, with their predictions and probabilities.

    ``named``: number of hypotheses. Of the smooth terms only the most probable counts, as in the diagnosis. ``temperature``:
    the temperature of the diagnosis."""

    predictions: Sequence[Prediction]
    probabilities: Sequence[float]
    named: int
    temperature: float

    def settling_probability(self, rows: Rows, rng: np.random.Generator, rounds: int = 1) -> float:
        """Probability that one hypothesis has a probability of 0.95 or more after some rows are measured ``rounds`` times.

        Measurements are simulated from each hypothesis as often as it is probable. Log Bayes factors are divided by the
        temperature. What is not listed has the rest of the probability, and gains as much as the strongest alternative of the
        leader.
        """
        n, share = self.named, np.array(self.probabilities)
        rest = max(1.0 - share[:n].sum() - share[n:].max(initial=0.0), 0.0)
        means = [np.sqrt(rounds) * p.mean[rows].ravel() for p in self.predictions]
        factors = [p.factor(rows, rounds) for p in self.predictions]
        true = rng.choice(n, SIMULATED, p=share[:n] / share[:n].sum())
        noise = rng.standard_normal((SIMULATED, len(means[0])))
        measured = np.stack([means[t] + factors[t] @ z for t, z in zip(true, noise, strict=True)], axis=1)
        gain = np.stack([_log_density(measured, *p) for p in zip(means, factors, strict=True)]) / self.temperature
        with np.errstate(divide="ignore"):
            after = np.log(share)[:, None] + gain
            named, smooth = after[:n], after[n:].max(axis=0, initial=-np.inf)
            leader = named.max(axis=0)
            others = np.where(named == leader, -np.inf, gain[:n]).max(axis=0)
            whole = logsumexp(np.vstack([named, smooth, np.log(rest) + others]), axis=0)
        return float(np.mean(np.exp(leader - whole) >= SURE))

    def rounds_needed(self, rows: Rows, rng: np.random.Generator) -> tuple[float, int | None]:
        """The probability that one round settles the question, and how many rounds are enough; None: more than ten."""
        # A stream of its own, so that other plans do not depend on whether this is computed. The random numbers are the same
        # for each number of rounds, so that more rounds are not worse by chance.
        seed, found = int(rng.spawn(1)[0].integers(2**31)), list[float]()
        for rounds in range(1, MOST_ROUNDS + 1):
            found.append(self.settling_probability(rows, np.random.default_rng(seed), rounds))
            if found[-1] >= PROMISED:
                return found[0], rounds
        return found[0], None


def _log_density(measured: Floats, mean: Floats, factor: Floats) -> Floats:
    """(D,) log density of (m, D) numbers under N(mean, factor @ factor'), less a constant."""
    solved = solve_triangular(factor, measured - mean[:, None], lower=True)
    return np.asarray(-0.5 * (solved**2).sum(axis=0) - np.log(np.diag(factor)).sum())


DISCRIMINATING_ROWS = 200
"""Number of random rows from which the most informative are chosen."""
RIVALS = 3
"""Most members of a class from which its leader is distinguished."""
RANDOM_PLANS = 5
"""Number of random choices with which a plan is compared."""
LEAST_EXPECTED = 1.0
"""Log Bayes factor expected of the whole experiment, nats, below which another measurement than poses is also proposed."""
NONE_EXPECTED = 0.1
"""Log Bayes factor expected of the whole experiment, nats, below which no poses are proposed."""


@dataclass(frozen=True)
class CauseClass:
    """A fitted cause and its scale, with the members of its class and their probabilities; the cause is one of them.

    Where the cause is alone in its class and not sure, the next hypothesis in probability is added. ``temperature``: the
    temperature of the diagnosis. ``smooth``: the most probable smooth terms in the place of the cause, each with its
    probability if it were the only one."""

    cause: Hypothesis
    scale: float
    members: tuple[tuple[Hypothesis, float], ...]
    temperature: float = PRIORS.temperature
    smooth: tuple[tuple[SmoothTerm, float], ...] = ()
    priors: Priors = PRIORS


def discriminate(
    known: Known, classes: Sequence[CauseClass], which: int, poses: int, rng: np.random.Generator
) -> Experiment:
    """The experiment that best distinguishes the leader of a class from its most probable alternatives, given all other causes.

    A cause without an alternative is distinguished from no effect. ``which`` is the index of the class in ``classes``.
    """
    robot, own = known.robot, classes[which]
    members = sorted(own.members, key=lambda member: -member[1])[: RIVALS + 1]
    words = {word for hypothesis, _ in members for word in concerns(hypothesis, robot)}
    trials = possible(known, words, DISCRIMINATING_ROWS, rng)
    others = other_causes(trials, [s for i, s in enumerate(classes) if i != which], words)
    at = trials.design.operating_points

    def prediction(basis: Displacement, lines: Sequence[tuple[Displacement, Displacement]] = ()) -> Prediction:
        """The prediction of a term given the other causes, at the scale that the measured rows give it.

        ``lines``: its displacements where one value of its nonlinear parameter is a standard deviation smaller, and larger. Its
        uncertainty is a further column, at the coefficients of largest probability.
        """
        design, old = trials.design, trials.old
        X = design.columns(basis)
        groups: Groups[str] = Groups(Marginal(np.hstack([design.B, others])[old]), design.y[old])
        groups.add("it", X[old])
        scale = gain(groups, NOTHING, "it")[1]
        mean = fixed(groups, ["it"], [scale]).mean
        off = [(design.columns(high) - design.columns(low)) @ mean / 2.0 for low, high in lines]
        return Prediction.of(trials, np.column_stack([others, X * scale, *off]))

    def shifted(hypothesis: Hypothesis) -> Iterator[tuple[Displacement, Displacement]]:
        """The displacements with each value of the nonlinear parameter a standard deviation smaller, and larger."""
        for k, (value, sigma) in enumerate(hypothesis.lines):
            around = [[*hypothesis.values[:k], value + way * sigma, *hypothesis.values[k + 1 :]] for way in (-1.0, 1.0)]
            low, high = (hypothesis.effect.basis_of(at, hypothesis.site, values) for values in around)
            yield low, high

    predictions = [prediction(hypothesis.basis(at), list(shifted(hypothesis))) for hypothesis, _ in members]
    probabilities = [p for _, p in members]
    if len(members) == 1:
        predictions.append(Prediction.of(trials, others))
        probabilities.append(1.0 - probabilities[0])
    # The probability of a single alternative can be zero.
    weights = probabilities[1:] if len(probabilities) > 2 else [1.0]
    pairs = [(*pair, p) for i, p in enumerate(weights, start=1) for pair in ((0, i), (i, 0))]
    rows, expected, random = best_rows(trials, predictions, pairs, poses, rng)
    effects = tuple(hypothesis.place for hypothesis, _ in members)
    sites = tuple(site for _, site in effects)
    found = Experiment(
        "discriminate",
        robot,
        effects,
        np.zeros((0, robot.n_actuators)),
        expected_gain=expected,
        random_gain=random,
        reference_temperature=known.observed.temperature,
        watch=sites,
    )
    if expected < NONE_EXPECTED:
        return found
    share = dict(own.smooth)
    smooth = [(t, b) for t, b in smooth_terms(at, own.priors) if t in share and t.motion not in COMMON] if share else []
    every = [*predictions, *(prediction(basis) for _, basis in smooth)]
    shares = [*probabilities, *(share[term] for term, _ in smooth)]
    settles, rounds = Rivals(every, shares, len(predictions), own.temperature).rounds_needed(rows, rng)
    return replace(
        found,
        poses=trials.q[rows],
        covariates=chosen(trials, rows, words),
        settles=settles,
        rounds=rounds,
        watch=sites if expected < LEAST_EXPECTED or rounds is None else (),
    )


def concerns(hypothesis: Hypothesis, robot: Chain) -> tuple[str, ...]:
    """Covariates and coordinates that a hypothesis depends on."""
    return (*hypothesis.covariates(robot), *hypothesis.effect.coordinates(robot, hypothesis.site))


def other_causes(trials: Trials, classes: Sequence[CauseClass], words: set[str]) -> Floats:
    """((N + M) c, m) whitened displacements of the other causes, at the scale of their priors, and of changes between sessions.

    Such changes (the pose of the instrument, the drives' zeros) are left out where ``words`` contains the session.
    """
    at = trials.design.operating_points
    columns = [trials.design.columns(s.cause.basis(at)) * s.scale for s in classes]
    return np.hstack([np.zeros((len(trials.design.y), 0)) if "session" in words else trials.since, *columns])


def best_rows(
    trials: Trials,
    predictions: Sequence[Prediction],
    pairs: Sequence[Pair],
    count: int,
    rng: np.random.Generator,
) -> tuple[Rows, float, float]:
    """The rows with the largest expected gain, in the order of measurement; this gain; and the mean gain of random rows."""
    rows = most_telling(predictions, pairs, count)
    drawn = [rng.choice(len(trials), len(rows), replace=False) for _ in range(RANDOM_PLANS)]
    random = float(np.mean([expected_gain(predictions, pairs, r) for r in drawn]))
    return rows[_order(trials, rows)], expected_gain(predictions, pairs, rows), random


def _order(trials: Trials, rows: Rows) -> Rows:
    """Order of measurement: by session, warm before cold, by payload, then along the first actuator; or by time."""
    new = trials.conditions.new
    if trials.conditions.timed:
        return np.argsort(numbers(new["time"])[rows])
    keys = [trials.q[rows, 0]]
    if "payload" in new:
        keys.append(numbers(new["payload"])[rows])
    keys += [-numbers(new[name])[rows] for name in new if kind(name) == "temperature"][:1]
    if "session" in new:
        keys.append(np.unique(new["session"][rows].astype(str), return_inverse=True)[1])
    return np.lexsort(keys)


def chosen(trials: Trials, rows: Rows, words: set[str]) -> Mapping[str, Column]:
    """The covariates to set at the chosen rows: those that vary, those in ``words``, and a new session where it is needed."""
    new = trials.conditions.new
    wanted = {"session"} | ({"payload", "fx", "fy", "fz"} if "load" in words else set()) | words
    if not trials.conditions.timed:
        wanted -= {"time"}
    return {name: new[name][rows] for name in sorted(new) if name in wanted}
