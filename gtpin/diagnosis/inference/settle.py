"""The second step of a diagnosis: hypotheses for the rows of the bulk, with the noise that a first search leaves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.data import Dataset
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet, Model
from gtpin.diagnosis.hypotheses.propose import Proposal, propose
from gtpin.diagnosis.hypotheses.scope import Scope
from gtpin.diagnosis.inference.readmit_outliers import MOST_POSES
from gtpin.diagnosis.inference.reestimate_noise import gross_errors, reestimate_noise
from gtpin.diagnosis.inference.search import MOST, rough_guess
from gtpin.diagnosis.linear.observed import Observed
from gtpin.diagnosis.preparation.prepare import Prepared

Mask = npt.NDArray[np.bool_]

ROUNDS, LONG_ROUNDS = 2, 6
"""Times that the noise is re-estimated: a first search with too little noise explains some of it away. Of a robot without rods,
whose models can be long, the search goes on where it was, so that more rounds cost little.
"""

FEW_POSES = 1000
"""Poses that a search is made on where the model that it finds is long. Assumed; on a real arm with some hundred lines
(docs/real_arms.md), models searched on 600 and on 1,000 poses predicted other poses alike.
"""


@dataclass(frozen=True)
class Settled:
    """What a search is made on.

    Parameters
    ----------
    kept
        The rows that were not set aside.
    everything
        These, as they were observed.
    searched, observed
        Those of them that the search is made on, likewise.
    declared
        Whether the position's and the orientation's sigma are known.
    proposal
        The hypotheses.
    guess
        The model of everything that is no noise, as far as one search found it.
    """

    kept: Dataset
    everything: Observed
    searched: Dataset
    observed: Observed
    declared: tuple[bool, bool]
    proposal: Proposal
    guess: Model

    @property
    def hypotheses(self) -> HypothesisSet:
        """The hypotheses that the data can test."""
        return self.proposal.hypotheses


def settle(prepared: Prepared, rows: Mask, scope: Scope, rng: np.random.Generator) -> Settled:
    """Settle which of some rows (N,) belong to the bulk, how large their noise is, and what may explain them.

    Of more rows than ``MOST_POSES`` a random part is searched: of a robot without rods ``FEW_POSES`` where the model is long.
    """
    kept, baseline = prepared.dataset.take(rows), prepared.baseline
    readmitted = ~baseline.used(prepared.dataset)[rows]
    drawn = rng.permutation(len(kept))
    everything = Observed.of(kept, baseline)
    instrument = kept.instrument
    declared = (instrument.position_sigma is not None, instrument.orientation_sigma is not None)
    some = _part(drawn, readmitted, MOST_POSES if baseline.model.robot.rods else FEW_POSES)
    observed, used, proposal, guess = _reestimated(everything.take(some), prepared, scope, declared)
    if len(some) < min(len(kept), MOST_POSES) and len(guess.terms) <= MOST:
        del proposal, guess  # before the next are made, as below
        some = _part(drawn, readmitted, MOST_POSES)
        observed, used, proposal, guess = _reestimated(everything.take(some), prepared, scope, declared)
    searched = kept.take(some[used])
    if len(some) == len(kept):
        return Settled(searched, observed, searched, observed, declared, proposal, guess)
    good = ~np.isin(np.arange(len(kept)), some[~used])
    noise = everything.noise.sized_as(observed.noise)
    everything = replace(everything, noise=noise).take(good)
    return Settled(kept.take(good), everything, searched, observed, declared, proposal, guess)


def _part(drawn: npt.NDArray[np.intp], readmitted: Mask, most: int) -> npt.NDArray[np.intp]:
    """At most so many rows, in the order of a permutation.

    Of those (N,) that the calibration had set aside as many as half of them, so that their cause is there to be found and they
    to be judged again.
    """
    first = drawn[readmitted[drawn]][: most // 2]
    return np.sort(np.concatenate([first, drawn[~readmitted[drawn]]])[:most])


def _reestimated(
    observed: Observed, prepared: Prepared, scope: Scope, declared: tuple[bool, bool]
) -> tuple[Observed, Mask, Proposal, Model]:
    """Outliers and noise, re-estimated given a search; which (N,) are no outliers, and their hypotheses with a guess."""
    model = prepared.baseline.model
    proposal = propose(observed.design(model), scope)
    guess = rough_guess(proposal.hypotheses)
    # Given a large cause, a calibration can't see them.
    used = ~gross_errors(proposal.hypotheses, guess)
    if not used.all() and guess.terms:
        observed = observed.take(used)
        del proposal  # before the next is made: two of them are what takes most memory
        proposal = propose(observed.design(model), scope)
        guess = rough_guess(proposal.hypotheses, guess)
    else:
        used[:] = True
    for _ in range(ROUNDS if model.robot.rods else LONG_ROUNDS):
        noise = reestimate_noise(observed, proposal.hypotheses, guess, declared)
        if not noise.matters:
            break
        observed = noise.observed
        del proposal
        proposal = propose(observed.design(model), scope)
        guess = rough_guess(proposal.hypotheses, guess)
    return observed, used, proposal, guess
