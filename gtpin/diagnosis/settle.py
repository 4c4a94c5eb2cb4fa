"""The second step of a diagnosis: gross errors set aside, noise re-estimated, and the hypotheses for the remaining rows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import bdtrc

from gtpin.data import Dataset
from gtpin.data.instrument_tables import SocketTable
from gtpin.diagnosis.design import Observed
from gtpin.diagnosis.hypothesis import Scope
from gtpin.diagnosis.hypothesis_set import Explanation, HypothesisSet
from gtpin.diagnosis.noise import gross_errors, reestimate_noise, tails_of
from gtpin.diagnosis.prepare import Prepared
from gtpin.diagnosis.priors import Priors
from gtpin.diagnosis.propose import propose
from gtpin.diagnosis.search import MOST, rough_guess
from gtpin.effects.operating_points import OperatingPoints, References
from gtpin.effects.sites import loaded_along
from gtpin.effects.smooth import loads_of
from gtpin.errors import warn
from gtpin.typing import Floats, Mask

ROUNDS, LONG_ROUNDS = 2, 6
"""Most times that the noise is re-estimated, with and without rods. A search with too small a noise explains some of the noise
by causes. Without rods, each search starts from the last model, so that more repetitions cost little time.
"""

MOST_POSES = 3000
"""Most poses that a search uses: more make it slower, but hardly better. The causes are then fitted to all poses."""
FEW_POSES = 1000
"""Most poses that a search uses where the model that it finds is long. Assumed; on a real arm with about a hundred lines
(docs/real_arms.md), models from searches on 600 and on 1,000 poses predicted other poses equally well.
"""


@dataclass(frozen=True)
class SearchState:
    """The rows and hypotheses that a search uses.

    ``kept``: the rows that were not set aside. ``everything``: the same rows, with noise and weights. ``searched``,
    ``observed``: the rows that the search uses, and the same with noise and weights. ``hypotheses``: those that the data
    can test. ``guess``: a model of everything that is not noise, by one search.
    """

    kept: Dataset
    everything: Observed
    searched: Dataset
    observed: Observed
    hypotheses: HypothesisSet
    guess: Explanation

    @property
    def references(self) -> References:
        """References for the fit of the causes: with all sessions of the search, also those that count as one there."""
        found = self.hypotheses.design.operating_points.references
        recorded = self.observed.covariates.get("session", ())
        return replace(found, sessions=tuple(sorted({str(name) for name in recorded})) if found.sessions else ())


def settle(prepared: Prepared, rows: Mask, scope: Scope, rng: np.random.Generator) -> SearchState:
    """Decide which of the rows (N,) are gross errors, estimate the noise, and propose hypotheses.

    The search uses at most ``MOST_POSES`` random rows; ``FEW_POSES`` for a robot without rods whose model is long.
    """
    kept, baseline = prepared.dataset.take(rows), prepared.baseline
    readmitted = ~baseline.used(prepared.dataset)[rows]
    drawn = rng.permutation(len(kept))
    everything = Observed.of(kept, baseline)
    some = _part(drawn, readmitted, FEW_POSES if baseline.model.robot.joint_sites else MOST_POSES)
    observed, used, hypotheses, guess = _reestimated(everything.take(some), prepared, scope)
    if len(some) < min(len(kept), MOST_POSES) and len(guess.terms) <= MOST:
        del hypotheses, guess  # frees memory before the next are made
        some = _part(drawn, readmitted, MOST_POSES)
        observed, used, hypotheses, guess = _reestimated(everything.take(some), prepared, scope)
    searched = kept.take(some[used])
    if len(some) == len(kept):
        return SearchState(searched, observed, searched, observed, hypotheses, guess)
    good = ~np.isin(np.arange(len(kept)), some[~used])
    noise = everything.noise.sized_as(observed.noise)
    tails = tails_of(observed, hypotheses, guess)
    everything = replace(everything, noise=noise, tails=tails).take(good)
    return SearchState(kept.take(good), everything, searched, observed, hypotheses, guess)


def _part(drawn: npt.NDArray[np.intp], readmitted: Mask, most: int) -> npt.NDArray[np.intp]:
    """Sorted indices of the first ``most`` rows of a permutation.

    Up to half of them are rows that the calibration had set aside (``readmitted``, (N,)), so that their cause can be found.
    """
    first = drawn[readmitted[drawn]][: most // 2]
    return np.sort(np.concatenate([first, drawn[~readmitted[drawn]]])[:most])


def _reestimated(
    observed: Observed, prepared: Prepared, scope: Scope
) -> tuple[Observed, Mask, HypothesisSet, Explanation]:
    """Estimate outliers and noise again, given the model of a search.

    Returns the poses without outliers, (N,) which poses these are, their hypotheses, and the model of the last search.
    """
    model = prepared.baseline.model
    hypotheses = propose(observed.design(model), scope)
    guess = rough_guess(hypotheses)
    # Where a cause is large, the calibration could not find the outliers.
    outliers = gross_errors(hypotheses, guess)
    used = ~outliers | stand_together(hypotheses.design.operating_points, outliers, scope.priors)
    if not used.all() and guess.terms:
        observed = observed.take(used)
        del hypotheses  # frees memory before the next is made: it takes the most
        hypotheses = propose(observed.design(model), scope)
        guess = rough_guess(hypotheses, guess)
    else:
        used[:] = True
    for _ in range(LONG_ROUNDS if hypotheses.long else ROUNDS):
        noise = reestimate_noise(observed, hypotheses, guess, prepared.declared)
        if not noise.matters:
            break
        observed = noise.observed
        del hypotheses
        hypotheses = propose(observed.design(model), scope)
        guess = rough_guess(hypotheses, guess)
    return observed, used, hypotheses, guess


def readmit_outliers(prepared: Prepared, priors: Priors) -> Mask:
    """(N,) the rows that a search uses: those of the calibration, and its outliers that stand together."""
    dataset, baseline = prepared.dataset, prepared.baseline
    used = baseline.used(dataset)
    rows = np.flatnonzero(baseline.model.kinematics.forward(dataset.q).reached & ~_in_sockets(dataset))
    if (~used[rows]).any():
        at = Observed.of(dataset.take(rows), baseline).operating_points(baseline.model)
        together = rows[stand_together(at, ~used[rows], priors)]
        used[together] = True
        if len(together):
            named = ", ".join(dict.fromkeys(str(pose) for pose in dataset.pose[together]))
            warn(
                f"no gross errors, since they stand together over a command or a load: the diagnosis uses poses {named}"
            )
    return used


def stand_together(at: OperatingPoints, outliers: Mask, priors: Priors) -> Mask:
    """(N,) the outliers that stand together over a coordinate of the machine.

    Gross errors happen anywhere. Where at least half of the commands in an interval of one coordinate are outliers, something
    acts there: a pit of a track, play that a load takes up, a step near a track's end. For each interval that begins and ends
    at an outlier, the chance is that of so many outliers among its commands (binomial distribution, which bounds the
    hypergeometric one), times the number of such intervals of all coordinates (Bonferroni).

    ``outliers``: (N,) rows. Visits of one command count as one: what is wrong there can be wrong at each visit.
    """
    command = np.unique(at.q, axis=0, return_inverse=True)[1].ravel()
    bad = np.bincount(command, outliers) > 0
    count = int(bad.sum())
    together = np.zeros(len(bad), dtype=bool)
    if count < priors.readmitted:
        return together[command]
    # One row of each command: of those with outliers, an outlier, because directions of approach may differ.
    order = np.lexsort((~outliers, command))
    rows = order[np.flatnonzero(np.diff(command[order], prepend=-1))]
    coordinates = _coordinates(at)[rows]
    tries = coordinates.shape[1] * count * (count - 1) / 2.0
    for values in coordinates.T:
        ordered = np.argsort(values, kind="stable")
        before = np.concatenate([[0], np.cumsum(bad[ordered])])
        ends = np.unique(values[bad])
        low, high = (np.searchsorted(values[ordered], ends, side) for side in ("left", "right"))
        inside, hits = high[None] - low[:, None], before[high][None] - before[low][:, None]
        dense = (hits >= priors.readmitted) & (2 * hits >= inside)
        chance = bdtrc(np.maximum(hits - 1, 0), np.maximum(inside, 1), count / len(bad)) * tries
        for i, j in np.argwhere(dense & (chance < priors.together)):
            together |= bad & (values >= ends[i]) & (values <= ends[j])
    return outliers & together[command]


def _coordinates(at: OperatingPoints) -> Floats:
    """(N, m) commands, directions of approach, payload, and the loads of rods or joints."""
    names = [*(f"approach{k + 1}" for k in range(at.robot.n_actuators)), "payload"]
    columns = [at.q, *(at.covariate(name)[:, None] for name in names if at.varies(name))]
    return np.hstack([*columns, *(loads_of(at, site)[0] for site in loaded_along(at.robot))])


def _in_sockets(dataset: Dataset) -> Mask:
    """(N,) rows of a ball in a socket: its visits have nearly the same command, so that its gross errors stand together."""
    sockets = [i for i, table in enumerate(dataset.readings.tables) if isinstance(table, SocketTable)]
    return np.isin(dataset.readings.of, sockets)
