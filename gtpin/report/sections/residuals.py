"""The instruments, circular tests, and residuals over the workspace and against what was recorded."""

from __future__ import annotations

import numpy as np

from gtpin.calibration.result import InstrumentFit
from gtpin.diagnosis.result import InstrumentGap
from gtpin.report.ball_bar import circular_tests
from gtpin.report.fit import FitPresentation
from gtpin.report.page import Block, Heading, Plots, Section, Table
from gtpin.report.residual_plots import MapScale, against_columns, maps, selection
from gtpin.report.words import quantity, whole

CIRCLES = (
    "Deviations of the radius along circles about a station, magnified, with the quantities of ISO 230-4: the "
    "circular deviation G is the range of the deviations of one direction, the bidirectional G(b) that of both "
    "together; F are the radial deviations, least to largest, positive away from the centre. Counterclockwise goes "
    "from the plane's first axis to its second (XY: from X to Y). As measured: about the least-squares circle of both "
    "directions. Left by geometry: measured less predicted, without another centring. The grey circle is zero "
    "deviation. Blue: counterclockwise; orange: clockwise."
)


def instruments(r: FitPresentation) -> Section | None:
    """Errors of each instrument's readings, and what was identified of the instruments; None for one tracker."""
    c, d = r.calibration, r.diagnosis
    if d is None:
        head = ["instrument", "kind", "readings", "error, nominal", "calibrated", "noise alone"]
        rows = [[one.name, one.kind, str(one.readings), *_errors(one)] for one in c.by_instrument if one.name]
    else:
        head = ["instrument", "kind", "error, left-out readings", "with the causes", "noise alone"]
        rows = [[one.name, one.kind, *_errors(one)] for one in d.gap.by_instrument]
    if not rows:
        return None
    content: list[Block] = [Table(head, rows, range(2, len(head)))]
    deviations = {name: value for one in (d or c).model.instruments for name, value in one.unknowns.items()}
    unknowns = []
    for one in c.unknowns:
        value = whole(f"{one.nominal + deviations.get(one.name, 0.0):.6f} {one.unit}")
        prior = quantity(one.sigma, one.unit) if np.isfinite(one.sigma) else "none"
        unknowns.append([one.name, value, quantity(c.unknown(one.name).sigma, one.unit), prior])
    if unknowns:
        columns = ("unknown", "value", "sigma, calibrated", "prior sigma")
        content += [Heading("What was identified of them"), Table(columns, unknowns, (1, 2, 3, 4))]
    return Section("instruments", "The instruments", content)


def _errors(one: InstrumentFit | InstrumentGap) -> list[str]:
    return [quantity(value, one.unit) for value in (one.before, one.after, one.floor)]


def circles(r: FitPresentation) -> Section | None:
    """The circular tests with their plots; None where nothing lies on circles."""
    tests = circular_tests(r.residuals, r.causes)
    if not tests:
        return None
    content: list[Block] = [CIRCLES]
    for title, plots in tests:
        content += [Heading(title), Plots(plots)]
    return Section("circles", "Circular tests", content)


def over_the_workspace(r: FitPresentation) -> Section:
    """Residuals over the workspace, without and with the causes."""
    scale = MapScale.of(r.residuals)
    plots, choices = maps(r.residuals, scale, r.layers)
    words = (
        "The position of the TCP at each reading, coloured by the size of the reading's residual in sigmas of its noise. "
        f"{selection(r.residuals)}"
    )
    if r.residuals.of_poses:
        words = (
            "Position residuals at the measured poses; lines show their directions, magnified "
            f"{scale.magnified:,.0f} times. {selection(r.residuals)}"
        )
    return Section("maps", "Over the workspace", [Plots(plots, words, choices)])


def against_what_was_recorded(r: FitPresentation) -> Section:
    """Residuals against each recorded column."""
    views, component = r.components
    share = {} if r.diagnosis is None else r.diagnosis.where.covariate
    plots = against_columns(r.residuals, share, views, (component, r.layers))
    order = ", the column with the strongest correlation first" if r.causes else ""
    made = "Orange: predicted from the causes, of geometry alone. " if r.causes else ""
    words = (
        f"Residuals at each pose{order}. {made}Line: mean of neighbouring poses, or the prediction along the column, all else "
        f"constant. Few values of a column: median, quartiles and ends. {selection(r.residuals)}"
    )
    return Section("covariates", "Against what was recorded", [Plots(plots, words, (r.layers, component))])
