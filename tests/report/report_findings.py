"""Findings of every kind, made of one real diagnosis: what pages say must follow from them alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gtpin.data import Dataset
from gtpin.diagnosis.inference.findings import Member, Unexplained
from gtpin.diagnosis.result import Diagnosis
from gtpin.estimate import Estimate


@dataclass(frozen=True)
class Found:
    """A diagnosis, and the data that it is of."""

    diagnosis: Diagnosis
    dataset: Dataset


def ambiguous(found: Found) -> Found:
    """The same cause, but another explains the data as well."""
    cause = found.diagnosis.causes[0]
    size = {"rms": Estimate(1.234e-5, 2e-7, "m")}
    own = Member(cause.effect, cause.site, 0.6, parameters=cause.parameters)
    members = (own, Member("linearity", "cart2", 0.4, parameters=size))
    doubtful = replace(cause, probability=0.6, members=members)
    return Found(replace(found.diagnosis, verdict="ambiguous", causes=(doubtful,)), found.dataset)


def unknown(found: Found) -> Found:
    """No cause, and a free motion of cart 1 with q3."""
    left = Unexplained(0.8, 1e-9, (("cart1", "q1,q3", 1e-20), ("platform", "time", 1e-6)))
    plain = replace(found.diagnosis.model, effects=())
    diagnosis = replace(found.diagnosis, verdict="unknown", causes=(), unexplained=left, model=plain)
    return Found(diagnosis, found.dataset)
