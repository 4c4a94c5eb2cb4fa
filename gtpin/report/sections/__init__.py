"""The sections of the pages of calibrations and diagnoses, in their order. A new one is a function, and its line here."""

from __future__ import annotations

from collections.abc import Callable

from gtpin.report.fit import FitPresentation
from gtpin.report.page import Section
from gtpin.report.sections import causes, data, evidence, parameters, residuals

SECTIONS: list[Callable[[FitPresentation], Section | None]] = [
    evidence.where_it_lies,
    causes.the_causes,
    evidence.what_is_left,
    residuals.instruments,
    residuals.circles,
    residuals.over_the_workspace,
    residuals.against_what_was_recorded,
    evidence.evidence,
    causes.what_can_t_be_distinguished,
    evidence.what_could_not_be_tested,
    parameters.parameters,
    parameters.what_the_data_can_t_see,
    data.data,
]
"""Each makes a section; None where the page has none."""


def sections(reported: FitPresentation) -> list[Section]:
    """All sections of a page, in their order."""
    return [one for make in SECTIONS if (one := make(reported)) is not None]
