"""The page of a calibration: fit, parameters with their variance reduction, unobservable directions."""

from __future__ import annotations

import numpy as np

from gtpin.calibration.checks.prepared import with_positions
from gtpin.calibration.readings_result import ReadingsCalibration
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.report.ball_bar_plot import circular_tests
from gtpin.report.drawing import drawing
from gtpin.report.evidence import Bar
from gtpin.report.geometry_table import geometry_tables
from gtpin.report.instruments_table import fit_table, unknowns_table
from gtpin.report.maps import maps
from gtpin.report.page import Table, render
from gtpin.report.provenance import provenance
from gtpin.report.quality import cannot_judge, quality, scatters
from gtpin.report.residual_plots import ONE_LAYER, against_columns, components, selection
from gtpin.report.residuals import Residuals
from gtpin.report.words import counted, joined, length, percent, quantity, whole

CONTENTS = (
    ("instruments", "The instruments"),
    ("circles", "Circular tests"),
    ("maps", "Over the workspace"),
    ("covariates", "Against what was recorded"),
    ("parameters", "Parameters"),
    ("unseen", "What the data can't see"),
    ("data", "Data"),
    ("provenance", "Provenance"),
)
UNKNOWN = "noise as the fit shows it: it was not declared"
"""What the noise of readings is called where no instrument has declared it."""
SHOWN = 8
"""Largest number of listed correlations and unobservable directions."""


def calibration_page(calibration: Calibration, dataset: Dataset) -> str:
    """The whole report of a calibration as one self-contained HTML file."""
    robot = calibration.model.robot
    dataset = with_positions(dataset, robot)
    residuals = Residuals.of(dataset, calibration)
    seen, component = components(residuals, residuals.first_component)
    against = against_columns(residuals, {}, seen, (component, ONE_LAYER))
    views = maps(residuals, ONE_LAYER)
    tests = circular_tests(residuals, False)
    absent = {"instruments"} if residuals.of_poses else set[str]()
    absent |= set() if tests else {"circles"}
    moved, parameters = geometry_tables(calibration)
    tone, badge, headline, advice = _verdict(calibration)
    return render(
        "calibration.html",
        title=f"Calibration of {robot.name}",
        contents=[(id_, name) for id_, name in CONTENTS if id_ not in absent],
        plots={"against": against, "maps": views.plots, **{test.key: test.plots for test in tests}},
        provenance=provenance(dataset, robot),
        robot=robot.name,
        count=len(calibration.names),
        poses=calibration.poses,
        tone=tone,
        badge=badge,
        headline=headline,
        advice=advice,
        numbers=_numbers(calibration),
        sketch=drawing(calibration.model, dataset.q.mean(axis=0)),
        views=views,
        component=component,
        selection=selection(residuals),
        layers=ONE_LAYER,
        moved=moved,
        parameters=parameters,
        reduction=_variance_reduction(calibration),
        unseen=_unobservable(calibration),
        correlations=_correlations(calibration),
        zeros=_zeros(calibration),
        quality=quality(dataset, calibration),
        of_poses=residuals.of_poses,
        tests=tests,
        instruments=fit_table(calibration),
        unknowns=unknowns_table(calibration.model, calibration),
        words=calibration.words if isinstance(calibration, ReadingsCalibration) else (),
    )


def _verdict(c: Calibration) -> tuple[str, str, str, list[str]]:
    """Colour, badge, headline and advice."""
    if isinstance(c, ReadingsCalibration):
        changes = [
            f"{quantity(one.before, one.unit)} to {quantity(one.after, one.unit)} ({one.name})"
            for one in c.by_instrument
        ]
        others = [f"{quantity(one.left_out, one.unit)} ({one.name})" for one in c.by_instrument]
        headline = (
            f"Calibration reduces the errors of the readings, RMS, from {joined(changes)} on the fitted poses. "
            f"At poses that are left out of the fit they are {joined(others)}."
        )
    else:
        values = c.to_json()
        before, after, out = (length(values[f"position_rms_{which}"]) for which in ("before", "after", "left_out"))
        headline = (
            f"Calibration reduces the position error from {before} to {after}, RMS, on the fitted poses. "
            f"At poses that are left out of the fit it is {out}."
        )
    if c.enlarged > 1.0:
        advice = [
            f"The mean residuals of the poses are {c.enlarged:.2f} times their noise: "
            "geometry alone does not explain these data.",
            "gtpin diagnose finds the causes of the rest. The sigmas below are enlarged accordingly.",
        ]
        return "warn", "not all explained", headline, advice
    if why := cannot_judge(c):
        advice = [f"Chi-square can't judge the fit ({why}): declare the sigmas."]
        return "accent", "fit not judged", headline, advice
    if hidden := scatters(c):
        return (
            "accent",
            "fits within its scatter",
            headline,
            [hidden, "gtpin diagnose tests whether it has a cause."],
        )
    return "good", "fits", headline, ["The residuals agree with the noise of instrument and repeatability."]


def _numbers(c: Calibration) -> list[tuple[str, str]]:
    values, known = c.to_json(), c.model.unexplained is None or c.model.unexplained.noise_known
    if isinstance(c, ReadingsCalibration):
        numbers = []
        for one in c.by_instrument:
            numbers.append((quantity(one.before, one.unit), f"error of {one.name}, nominal"))
            numbers.append((quantity(one.after, one.unit), "calibrated"))
            numbers.append((quantity(one.left_out, one.unit), "at poses left out of the fit"))
            numbers.append((quantity(one.floor, one.unit), "noise alone" if known else UNKNOWN))
    else:
        numbers = [
            (length(values["position_rms_before"]), "position error, nominal"),
            (length(values["position_rms_after"]), "calibrated"),
            (length(values["position_rms_left_out"]), "at poses left out of the fit"),
        ]
        if known:
            numbers.append((length(values["position_noise_floor"]), "noise alone"))
        else:
            numbers.append(("not known", "noise: neither declared nor shown by repeated visits"))
    if values["orientation_rms_after"] is not None:
        numbers.append((quantity(values["orientation_rms_before"], "rad"), "orientation error, nominal"))
        numbers.append((quantity(values["orientation_rms_after"], "rad"), "calibrated"))
        numbers.append((quantity(values["orientation_rms_left_out"], "rad"), "at poses left out of the fit"))
    numbers.append(
        (
            f"{c.chi2_per_dof:.2f}",
            "chi-square per degree of freedom"
            + (
                ", which can't judge the fit here"
                if cannot_judge(c)
                else f", 1 ± {np.sqrt(2.0 / c.dof):.2f} if it fits"
            ),
        )
    )
    return numbers


def _variance_reduction(c: Calibration) -> list[Bar]:
    """Mean variance reduction of each kind of parameter."""
    kinds: dict[str, list[float]] = {}
    for name, reduction in zip(c.names, c.learned, strict=True):
        kinds.setdefault(name.partition("[")[0].replace("_", " "), []).append(float(reduction))
    return [
        Bar(
            f"{kind} ({counted(len(values), 'parameter')})",
            float(np.clip(np.mean(values), 0.0, 1.0)),
            percent(float(np.mean(values))),
        )
        for kind, values in kinds.items()
    ]


def _unobservable(c: Calibration) -> Table:
    rows = []
    for direction in c.unobservable[:SHOWN]:
        terms = [whole(f"{weight:+.2f} {name}") for name, weight in list(direction.weights.items())[:4]]
        rows.append([" ".join(terms) + (" …" if len(direction.weights) > 4 else ""), percent(direction.learned)])
    return Table(("direction, weights in tolerances", "variance reduction"), rows)


def _zeros(c: Calibration) -> Table:
    rows = [[z.site, quantity(z.value, z.unit), quantity(z.sigma, z.unit)] for z in c.zeros]
    return Table(("drive", "equivalent shift of its zero", "sigma"), rows)


def _correlations(c: Calibration) -> Table:
    return Table(
        ("parameter", "parameter", "correlation"),
        [[a, b, whole(f"{rho:+.3f}")] for a, b, rho in c.correlated()[:SHOWN]],
    )
