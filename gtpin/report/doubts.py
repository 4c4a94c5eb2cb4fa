"""Why something unknown is inferred, in words."""

from __future__ import annotations

from collections.abc import Iterable

from gtpin.diagnosis.inference.findings import Doubt
from gtpin.report.words import joined, site_words

WORDS = {
    "restless": "{site} errs from pose to pose by more than repeated visits let it scatter.",
    "held_out": (
        "Poses that were left out of the fit are farther off than the noise that was declared or that repeated visits show, "
        "or no nearer with causes than without."
    ),
    "excess": (
        "The residuals are larger than the declared noise, no effect explains the difference, and too few poses were visited "
        "twice to tell whether it repeats."
    ),
    "visits": (
        "Visits to the same commands differ otherwise than the declared noise and the drives' repeatability allow: something "
        "changes between them."
    ),
    "two_valued": (
        "The errors of {site} take two values, as play does whose direction of approach is not known: check {columns}, which "
        "may belong to other rows."
    ),
    "scatter": "Visits scatter by more than the instrument, and the columns that would tell why contradict each other.",
    "chi_square": "Poses are farther from the earlier model than noise and its uncertainty allow, and no change explains them.",
}
"""Sentences by reason. For other reasons there is a warning, a question or the headline."""


def doubt_words(doubts: Iterable[Doubt]) -> list[str]:
    """A sentence for each doubt that needs one."""
    return [
        WORDS[doubt.reason].format(site=site_words(doubt.site), columns=joined(list(doubt.over)))
        for doubt in doubts
        if doubt.reason in WORDS
    ]
