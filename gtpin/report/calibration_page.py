"""The page of a calibration: fit, parameters with their variance reduction, unobservable directions."""

from __future__ import annotations

import numpy as np

from gtpin.calibration.checks.prepared import with_positions
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.report.geometry_table import UNTESTED, controller_blocks, geometry_tables
from gtpin.report.instruments_table import fit_table, unknowns_table
from gtpin.report.page import Bar, Bars, Block, Fold, Heading, Lead, Section, Table, report
from gtpin.report.provenance import provenance
from gtpin.report.quality import cannot_judge, error_of, quality, scatters
from gtpin.report.residual_plots import ONE_LAYER, against_columns, components
from gtpin.report.residual_sections import (
    circle_sections,
    column_section,
    data_section,
    instrument_sections,
    map_section,
)
from gtpin.report.residuals import Residuals
from gtpin.report.sketch import drawing
from gtpin.report.unseen_words import grouped
from gtpin.report.words import counted, joined, percent, quantity, whole

UNKNOWN = "noise as the fit shows it: neither declared nor shown by repeated visits"
"""What the noise is called where it was neither declared nor shown by repeated visits."""
SHOWN = 8
"""Largest number of listed correlations and unobservable directions."""


def calibration_page(calibration: Calibration, dataset: Dataset) -> str:
    """The whole report of a calibration as one self-contained HTML file."""
    c, robot = calibration, calibration.model.robot
    dataset = with_positions(dataset, robot)
    residuals = Residuals.of(dataset, c)
    views, component = components(residuals, residuals.first_component)
    against = against_columns(residuals, {}, views, (component, ONE_LAYER))
    tone, badge, headline, advice = _verdict(c)
    return report(
        f"Calibration of {robot.name}",
        Lead(
            f"Calibration of {robot.name} · {len(c.names)} parameters from {c.poses} measurements",
            headline,
            advice,
            _numbers(c),
            badge,
            tone,
            drawing(c.model, dataset.q.mean(axis=0)),
        ),
        [
            *instrument_sections(fit_table(c), unknowns_table(c.model, c)),
            *circle_sections(residuals, False),
            map_section(residuals, ONE_LAYER),
            column_section(residuals, against, (ONE_LAYER, component), False),
            _parameters(c),
            _unseen(c),
            data_section(quality(dataset, c)),
        ],
        provenance(dataset, robot),
    )


def _verdict(c: Calibration) -> tuple[str, str, str, list[str]]:
    """Colour, badge, headline and advice."""
    changes, others = [], []
    for one in c.by_instrument:
        before, after, out = (quantity(value, one.unit) for value in (one.before, one.after, one.left_out))
        changes.append(f"the {error_of(one)} from {before} to {after}")
        others.append(out if len(c.by_instrument) == 1 else f"{out} ({error_of(one)})")
    headline = (
        f"Calibration reduces {joined(changes)}, RMS, on the fitted poses. "
        f"At poses that are left out of the fit {'it is' if len(others) == 1 else 'they are'} {joined(others)}."
    )
    if c.enlarged > 1.0:
        advice = [
            f"The mean residuals of the poses are {c.enlarged:.2f} times their noise: "
            "geometry alone does not explain these data.",
            "gtpin diagnose finds the causes of the rest. The sigmas below are enlarged accordingly.",
        ]
        return "warn", "not all explained", headline, advice
    if why := cannot_judge(c):
        advice = [f"Declare the sigmas. Of chi-square: {why}."]
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
    numbers = []
    for one in c.by_instrument:
        numbers.append((quantity(one.before, one.unit), f"{error_of(one)}, nominal"))
        numbers.append((quantity(one.after, one.unit), "calibrated"))
        numbers.append((quantity(one.left_out, one.unit), "at poses left out of the fit"))
        numbers.append((quantity(one.floor, one.unit), "noise alone" if c.noise_known else UNKNOWN))
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


def _parameters(c: Calibration) -> Section:
    """Mean variance reduction of each kind of parameter, the parameters, and the drives' zeros."""
    kinds: dict[str, list[float]] = {}
    for name, reduction in zip(c.names, c.variance_reduction, strict=True):
        kinds.setdefault(name.partition("[")[0].replace("_", " "), []).append(float(reduction))
    means = {f"{kind} ({counted(len(v), 'parameter')})": float(np.mean(v)) for kind, v in kinds.items()}
    moved, every = geometry_tables(c)
    arm = controller_blocks(c.model, UNTESTED)
    content: list[Block] = [
        *([*arm, Heading("Placements")] if arm else []),
        "Variance reduction, mean of each kind of parameter: 1 − (sigma / tolerance)²; at 0 % the data give no information "
        "beyond the tolerance.",
        Bars([Bar(kind, float(np.clip(mean, 0.0, 1.0)), percent(mean)) for kind, mean in means.items()]),
        Heading("Largest deviations from nominal"),
        Table(moved.head, moved.rows, (1, 2, 3, 4)),
        Fold(f"All {len(every.rows)} parameters", [Table(every.head, every.rows, (1, 2, 3, 4))]),
    ]
    if c.zeros and not arm:
        rows = [[z.site, quantity(z.value, z.unit), quantity(z.sigma, z.unit)] for z in c.zeros]
        content += [
            Heading("Zeros of the drives"),
            "The zero of a drive is not a separate parameter: a shifted zero moves all that the drive carries equally, and is "
            "part of the values above. Their common shift, as a shift of the zero:",
            Table(("drive", "equivalent shift of its zero", "sigma"), rows, (1, 2)),
        ]
    return Section("parameters", "Parameters", content)


def _unseen(c: Calibration) -> Section:
    """Directions that the data hardly show, and the strongest correlations."""
    content: list[Block] = ["The data determine every direction of the geometry."]
    rows = []
    for direction in c.unobservable[:SHOWN]:
        terms = [whole(f"{weight:+.2f} {name}") for name, weight in list(direction.weights.items())[:4]]
        rows.append(
            [" ".join(terms) + (" …" if len(direction.weights) > 4 else ""), percent(direction.variance_reduction)]
        )
    if rows:
        content = [
            "Directions of the geometry that are hardly observable with these data. Their values are the prior means, and "
            "change no prediction near the measured poses.",
            *grouped(c.words, c.remedies),
            Table(("direction, weights in tolerances", "variance reduction"), rows, (1,)),
        ]
    if pairs := [[a, b, whole(f"{rho:+.3f}")] for a, b, rho in c.correlated()[:SHOWN]]:
        table = Table(("parameter", "parameter", "correlation"), pairs, (2,))
        content += [Heading("The strongest correlations"), table]
    return Section("unseen", "What the data can't see", content)
