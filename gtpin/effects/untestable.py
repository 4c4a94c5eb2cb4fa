"""The reason why data can't show an effect, as a typed value. ``gtpin.report.phrases`` writes it as a sentence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal[
    "missing",
    "unusable",
    "constant",
    "too_few_commands",
    "one_sign",
    "no_load",
    "no_masses",
    "single_joint",
    "absorbed",
    "small",
    "stations",
    "unrecorded_payload",
    "not_searched",
    "uncertain",
    "other",
]


@dataclass(frozen=True)
class Untestable:
    """The reason why data can't show an effect at a site.

    Parameters
    ----------
    kind
        ``missing``, ``unusable``, ``constant``: a covariate that the effect depends on has no column, has values that can't be
        right, or does not vary.
        ``too_few_commands``: the commands are too few, or too close together, for its nonlinear parameter.
        ``one_sign``: the link's force does not change its sign.
        ``no_load``: the joint carries nothing about its own axis. ``no_masses``: no load is known, because the
        links have no masses, and no payload or force was recorded.
        ``single_joint``: the cart carries one joint. A rotation of the cart about it has no effect on the TCP.
        ``absorbed``: geometric calibration absorbs it, even at a large size (``large`` of the priors).
        ``small``: geometry absorbs only part of it, but even at that size the rest is too small to show.
        ``stations``: a free frame for each session absorbs it.
        ``unrecorded_payload``: the payload may have varied without being recorded. The effect can be tested with the
        recorded loads only. With other loads it could be the cause although that test does not find it.
        ``not_searched``: a check of few poses does not search for periods and places of steps.
        ``uncertain``: the uncertainty of the earlier model, and the unknown pose of the instrument, hide it from a check.
        ``other``: the reason that a user's own effect gives, in ``words``.
    covariate
        The column that is missing or insufficient: a covariate, or ``q1``, ``q2``, ... for commands. Empty where there is none.
    words
        Of kind ``other``: the reason.
    """

    kind: Kind
    covariate: str = ""
    words: str = ""


def as_untestable(found: Untestable | str | None) -> Untestable | None:
    """The result of ``Effect.untestable`` as a typed value. A user's own effect may return a string: kind ``other``."""
    if isinstance(found, str):
        return Untestable("other", words=found) if found else None
    return found
