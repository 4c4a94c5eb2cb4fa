"""The parameters of the geometry: values, a controller's table of a serial arm, and what the data can't see."""

from __future__ import annotations

import numpy as np

from gtpin.calibration.result import Calibration
from gtpin.model.departures import departures
from gtpin.model.dh import DhParameter, chain_of, controller_table
from gtpin.model.model import Model
from gtpin.report.calibration_text import SHOWN, grouped
from gtpin.report.fit import FitPresentation
from gtpin.report.geometry import all_departures, point_of, zero_size
from gtpin.report.page import Block, Fold, Heading, Section, Table
from gtpin.report.words import percent, quantity, whole

STEADY = 1e-3
"""Share of its sigma below which a correction that is not determined is zero."""


def parameters(r: FitPresentation) -> Section:
    """The departures of the geometry from nominal, the controller's table of a serial arm, and all parameters; of a diagnosis
    without and with the causes."""
    c, d = r.calibration, r.diagnosis
    model = c.model if d is None else d.model
    found = departures(model, r.dataset.q)
    content: list[Block] = []
    if found:
        words = (
            f"The departures from nominal, and the displacement of the {point_of(model)} by each, root mean square over the "
            "measured poses. Motions of the whole machine that no instrument shows are subtracted."
        )
        content = [words, Fold(f"All {len(found)} departures", [all_departures(found, point_of(model))])]
    # What is not explained moves the parameters by more than their sigmas.
    explained = c.explained if d is None else d.verdict != "unknown"
    content += zero_blocks(c) if not chain_of(model.robot) else controller_blocks(model) if explained else []
    words = "Variance reduction: 1 − (sigma / tolerance)²; at 0 % the data give no information beyond the tolerance."
    every = parameter_table(c, model if d is not None and d.causes else None)
    content += [Heading("Parameters of the fit"), words, Fold(f"All {len(every.rows)} parameters", [every])]
    return Section("parameters", "Parameters", content)


def parameter_table(calibration: Calibration, model: Model | None = None) -> Table:
    """All parameters, those that were held at the end.

    ``model``: geometry that was fitted together with causes; it is shown in addition to the geometry alone.
    """
    c = calibration
    head = ["parameter", "nominal", "identified − nominal", "in tolerances", "variance reduction"]
    head += ["with the causes − nominal"] if model is not None else []
    rows = []
    for p, value, sigma, reduction in zip(
        c.model.geometry.parameters, c.values, c.sigma, c.variance_reduction, strict=True
    ):
        moved = float(value - p.nominal)
        row = [p.name, whole(f"{p.nominal:.6f} {p.unit}"), quantity(moved, p.unit, float(sigma))]
        row += [whole(f"{moved / p.tolerance:+.1f}"), percent(float(np.clip(reduction, 0.0, 1.0)))]
        row += [quantity(model.geometry[p.name] - p.nominal, p.unit)] if model is not None else []
        rows.append(row)
    for p, value in c.model.geometry.held:
        row = [p.name, whole(f"{p.nominal:.6f} {p.unit}"), whole(f"{quantity(value - p.nominal, p.unit)} (held)")]
        rows.append([*row, whole(f"{(value - p.nominal) / p.tolerance:+.1f}"), ""] + [row[2]] * (model is not None))
    return Table(head, rows, range(1, len(head)))


def controller_blocks(model: Model) -> list[Block]:
    """The table of a serial arm with what to add to it; empty for other robots."""
    rows = [[p.site, p.name, _to_add(p), whole(f"{p.nominal:z.6f} {p.unit}")] for p in controller_table(model)]
    words = (
        "What to add to the parameters of the controller; theta is the zero of a joint. Use all of them together: a parameter "
        "that is not determined stays near nominal. If a or alpha has the opposite sign in the controller, add the opposite."
    )
    if model.geometry.target is not None:
        words += (
            " The tool stays as it is: the data do not determine it, because the place of the target on it was unknown."
        )
    table = Table(("joint", "parameter", "to add", "nominal"), rows, (2, 3))
    return [Heading("The controller's table (Denavit-Hartenberg)"), words, table] if rows else []


def zero_blocks(c: Calibration) -> list[Block]:
    """The zeros of the drives of a robot with loops; empty where there are none."""
    rows = [[z.site, zero_size(z.value, z.unit, z.sigma)] for z in c.zeros]
    words = (
        "A wrong zero displaces all that its drive carries: the common part of these displacements, as a shift of it."
    )
    table = Table(("drive", "shift of its zero"), rows, (1,))
    return [Heading("Equivalent zeros of the drives"), words, table] if rows else []


def _to_add(p: DhParameter) -> str:
    if not p.determined and not abs(p.correction) > STEADY * p.sigma:
        return "not determined"
    return quantity(p.correction, p.unit, p.sigma) + ("" if p.determined else " (not well determined)")


def what_the_data_can_t_see(r: FitPresentation) -> Section | None:
    """Directions that the data of a calibration do not determine, and the strongest correlations."""
    if r.diagnosis is not None:
        return None
    c, rows = r.calibration, []
    for direction in c.unobservable[:SHOWN]:
        terms = [whole(f"{weight:+.2f} {name}") for name, weight in direction.weights.items()]
        rows.append([" ".join(terms[:4] + ["…"] * (len(terms) > 4)), percent(direction.variance_reduction)])
    content: list[Block] = ["The data determine every direction of the geometry."]
    if rows:
        content = [
            "Directions of the geometry that these data do not determine. Their values are the prior means, and change no "
            "prediction near the measured poses.",
            *grouped(c.words, c.remedies),
            Table(("direction, weights in tolerances", "variance reduction"), rows, (1,)),
        ]
    if pairs := [[a, b, whole(f"{rho:+.3f}")] for a, b, rho in c.correlated()[:SHOWN]]:
        table = Table(("parameter", "parameter", "correlation"), pairs, (2,))
        content += [Heading("The strongest correlations"), table]
    return Section("unseen", "What the data can't see", content)
