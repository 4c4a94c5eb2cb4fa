"""Sections of a page that calibration and diagnosis have in common: instruments, circular tests, maps, plots against what was
recorded, and the data."""

from __future__ import annotations

from collections.abc import Sequence

from gtpin.report.ball_bar_plot import circular_tests
from gtpin.report.embedded import Plot, PlotChoice
from gtpin.report.maps import maps
from gtpin.report.page import Block, Fold, Heading, Plots, Section, Table
from gtpin.report.quality import Quality
from gtpin.report.residual_plots import selection
from gtpin.report.residuals import Residuals

CIRCLES = (
    "Deviations of the radius along circles about a station, magnified, with the quantities of ISO 230-4: the "
    "circular deviation G is the range of the deviations of one direction, the bidirectional G(b) that of both "
    "together; F are the radial deviations, least to largest, positive away from the centre. Counterclockwise goes "
    "from the plane's first axis to its second (XY: from X to Y). As measured: about the least-squares circle of both "
    "directions. Left by geometry: measured less predicted, without another centring. The grey circle is no "
    "deviation."
)


def instrument_sections(errors: Table, unknowns: Table) -> list[Section]:
    """Errors of each instrument's readings, and what was identified of the instruments; none for one tracker."""
    if not errors.rows:
        return []
    content: list[Block] = [Table(errors.head, errors.rows, range(2, len(errors.head)))]
    if unknowns.rows:
        content += [Heading("What was identified of them"), Table(unknowns.head, unknowns.rows, (1, 2, 3, 4))]
    return [Section("instruments", "The instruments", content)]


def circle_sections(residuals: Residuals, causes: bool) -> list[Section]:
    """The circular tests with their plots; none where nothing lies on circles."""
    tests = circular_tests(residuals, causes)
    if not tests:
        return []
    content: list[Block] = []
    for test in tests:
        content += [Heading(test.title), Plots(test.plots)]
    return [Section("circles", "Circular tests", [Plots(tests[0].plots, CIRCLES, legend=True, drawn=False), *content])]


def map_section(residuals: Residuals, layers: PlotChoice) -> Section:
    """Residuals over the workspace, without and with the causes."""
    views = maps(residuals, layers)
    if residuals.of_poses:
        words = (
            "Position residuals at the measured poses; lines show their directions, magnified "
            f"{views.magnified} times. {selection(residuals)}"
        )
    else:
        words = (
            "Where the TCP was at each reading, coloured by the size of what is left of the reading, in sigmas of its noise. "
            f"{selection(residuals)}"
        )
    choices = [layers, *([views.instrument] if views.instrument else [])]
    return Section("maps", "Over the workspace", [Plots(views.plots, words, choices, f"{views.top} {views.unit}")])


def column_section(residuals: Residuals, plots: Sequence[Plot], choices: Sequence[PlotChoice], causes: bool) -> Section:
    """Residuals against each recorded column."""
    order = ", the column with the strongest correlation first" if causes else ""
    words = f"Residuals at each pose{order}. {selection(residuals)}"
    return Section("covariates", "Against what was recorded", [Plots(plots, words, choices, legend=True)])


def data_section(quality: Quality, *more: Block) -> Section:
    """What was measured, what was set aside, and the ranges of all columns."""
    content: list[Block] = [*quality.facts]
    if quality.set_aside.rows:
        about = "These poses were not used. Off by: distance from the prediction of the calibrated geometry."
        content += [Heading("Set aside"), about, Table(quality.set_aside.head, quality.set_aside.rows, (1, 2))]
    else:
        content.append("No pose was set aside.")
    ranges = Table(quality.ranges.head, quality.ranges.rows, (1, 2))
    return Section("data", "Data", [*content, Fold("Ranges of commands and covariates", [ranges]), *more])
