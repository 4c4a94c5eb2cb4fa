"""Findings of every kind, made of one real diagnosis: what pages say must follow from them alone."""

from __future__ import annotations

import html
import re
from dataclasses import replace

from gtpin.diagnosis.result import Correlate, Diagnosis, Member, Unexplained
from gtpin.estimate import Estimate


def ambiguous(found: Diagnosis) -> Diagnosis:
    """The same cause, but another explains the data as well."""
    cause = found.causes[0]
    size = {"rms": Estimate(1.234e-5, 2e-7, "m")}
    own = Member(cause.effect, cause.site, 0.6, parameters=cause.parameters)
    members = (own, Member("linearity", "cart2", 0.4, parameters=size))
    return replace(found, verdict="ambiguous", causes=(replace(cause, probability=0.6, members=members),))


def unknown(found: Diagnosis) -> Diagnosis:
    """No cause, and a free motion of cart 1 with q3."""
    left = Unexplained(
        0.8,
        1e-9,
        (Correlate("cart1", "q1,q3", 1e-20, "along", 1.0), Correlate("platform", "time", 1e-6, "twist", 1e-3)),
    )
    return replace(found, verdict="unknown", causes=(), unexplained=left, model=replace(found.model, effects=()))


def text(whole: str) -> str:
    """What a reader of a page reads: no scripts, styles and tags."""
    seen = re.sub(r"<(script|style)\b.*?</\1>", " ", whole, flags=re.S)
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", seen)).replace("\u00a0", " ").split())
