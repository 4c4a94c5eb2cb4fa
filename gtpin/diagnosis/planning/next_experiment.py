"""What to measure next: to distinguish the members of a class, to map an unknown effect, to make effects testable."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.hypotheses.propose import Untested
from gtpin.diagnosis.inference.classes import ranked
from gtpin.diagnosis.inference.findings import Cause
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.linear.observed import Observed
from gtpin.diagnosis.planning.discrimination import RIVALS, CauseClass, discriminate
from gtpin.diagnosis.planning.experiment import Experiment
from gtpin.diagnosis.planning.make_testable import make_testable
from gtpin.diagnosis.planning.map_unknown import map_unknown, visit_again
from gtpin.diagnosis.planning.trials import Known
from gtpin.diagnosis.priors import SURE
from gtpin.effects.situation import References
from gtpin.model.model import Model

POSES = 20
"""Poses of an experiment: about ten minutes of work."""
LARGEST = 2000
"""Most measured poses that are used. Of more, a random part is used, so that the expected gains are a little too small."""
CLASSES = 3
"""Most classes for which an experiment is proposed, those of the largest causes."""


def classes(found: Conclusion, causes: Sequence[Cause], hypotheses: HypothesisSet) -> list[CauseClass]:
    """Causes with their classes, the largest first."""
    by_place = {hypothesis.place: hypothesis for hypothesis in found.classes}
    named = [by_place[c.effect, c.site] for c in causes]
    return [_class(found, hypothesis, hypotheses) for hypothesis in named]


def _class(found: Conclusion, cause: Hypothesis, hypotheses: HypothesisSet) -> CauseClass:
    """A cause with its class and, where it is not sure, with what else has a part of the probability."""
    members = [(m.hypothesis, m.probability) for m in found.classes[cause]]
    if len(members) == 1 and members[0][1] >= SURE:
        return CauseClass(cause, found.scale[cause], tuple(members))
    every = ranked(hypotheses, found.model, cause)
    if len(members) == 1:
        others = (m for m in every.named if m.hypothesis.place != cause.place)
        members += [(m.hypothesis, m.probability) for m in others][:1]
    return CauseClass(cause, found.scale[cause], tuple(members), every.heat, every.smooth[:RIVALS], hypotheses.priors)


def plan(
    observed: Observed,
    model: Model,
    references: References,
    *,
    classes: Sequence[CauseClass],
    untestable: Sequence[Untested],
    unknown: tuple[str, str] | None,
    unseen_noise: bool = False,
    rng: np.random.Generator,
    poses: int = POSES,
) -> tuple[Experiment, ...]:
    """Propose experiments: first for open classes, then for the unknown, then for untestable effects.

    Expected gains are those of linear Gaussian predictions given all measured rows, with geometry and other causes
    marginalised.

    Parameters
    ----------
    observed, model, references
        The poses of the diagnosis, the calibrated geometry without causes, and the reference values of covariates.
    classes
        The causes with their classes, the largest first; a cause with a probability of 0.95 or more needs no experiment.
    untestable
        Effects that these data can't show.
    unknown
        Site and coordinates of the smooth term that best explains the unknown; None where nothing unknown is assumed.
    unseen_noise
        Whether residuals exceed the declared noise, and no visits tell whether the excess repeats.
    rng
        Source of the random rows among which an experiment is chosen; the same state gives the same plan.
    poses
        Number of poses of each experiment.
    """
    if len(observed.weight) > LARGEST:
        observed = observed.take(rng.choice(len(observed.weight), LARGEST, replace=False))
    known = Known(observed, model, references)
    open_ = [i for i, s in enumerate(classes) if len(s.members) > 1 or s.members[0][1] < SURE][:CLASSES]
    found = [discriminate(known, classes, i, poses, rng) for i in open_]
    if unknown is not None:
        found.append(map_unknown(known, *unknown, poses))
    if unseen_noise:
        found.append(visit_again(known))
    return (*found, *make_testable(known, classes, untestable, poses, rng))
