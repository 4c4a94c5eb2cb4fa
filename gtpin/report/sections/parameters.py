"""The parameters of the geometry: values, a controller's table of a serial arm, and what the data can't see."""

from __future__ import annotations

import numpy as np

from gtpin.calibration.result import Calibration
from gtpin.model.dh import DhParameter, controller_table
from gtpin.model.model import Model
from gtpin.report.calibration_text import SHOWN, grouped
from gtpin.report.page import Bar, Bars, Block, Fold, Heading, Section, Table
from gtpin.report.sections import Reported, section
from gtpin.report.words import counted, percent, quantity, whole

MOVED = 8
"""Number of parameters with the largest changes, which are shown first."""
SIGNIFICANT = 3.0
"""Number of sigmas from which a correction of an arm's table is named."""
STEADY = 1e-3
"""Share of its sigma below which a correction that is not determined is zero."""
UNTESTED = "Effects may move them beyond their sigmas: run gtpin diagnose first."


@section(110)
def parameters(r: Reported) -> Section:
    """Of a calibration: mean variance reduction of each kind, the parameters, and the drives' zeros. Of a diagnosis: the
    parameters without and with the causes."""
    c, d = r.calibration, r.diagnosis
    moved, every = geometry_tables(c, d.model if d is not None and d.causes else None)
    if d is None:
        arm = controller_blocks(c.model, UNTESTED) if c.explained else []
    else:
        arm = controller_blocks(d.model) if d.verdict != "unknown" else []
    content: list[Block] = [*arm, Heading("Placements")] if arm else []
    if d is None:
        kinds: dict[str, list[float]] = {}
        for name, reduction in zip(c.names, c.variance_reduction, strict=True):
            kinds.setdefault(name.partition("[")[0].replace("_", " "), []).append(float(reduction))
        means = {f"{kind} ({counted(len(v), 'parameter')})": float(np.mean(v)) for kind, v in kinds.items()}
        content += [
            "Variance reduction, mean of each kind of parameter: 1 − (sigma / tolerance)²; at 0 % the data give no information "
            "beyond the tolerance.",
            Bars([Bar(kind, float(np.clip(mean, 0.0, 1.0)), percent(mean)) for kind, mean in means.items()]),
            Heading("Largest deviations from nominal"),
        ]
    else:
        content.append(
            "The geometric parameters with the largest deviations from nominal. Variance reduction: 1 − (sigma / tolerance)²."
        )
    content += [moved, Fold(f"All {len(every.rows)} parameters{'' if d is None else ' of the geometry'}", [every])]
    if d is None and c.zeros and not arm:
        rows = [[z.site, quantity(z.value, z.unit), quantity(z.sigma, z.unit)] for z in c.zeros]
        content += [
            Heading("Zeros of the drives"),
            "The zero of a drive is not a separate parameter: a shifted zero moves all that the drive carries equally, and is "
            "part of the values above. Their common shift, as a shift of the zero:",
            Table(("drive", "equivalent shift of its zero", "sigma"), rows, (1, 2)),
        ]
    return Section("parameters", "Parameters", content)


def geometry_tables(calibration: Calibration, model: Model | None = None) -> tuple[Table, Table]:
    """Two tables: the parameters with the largest changes in units of the tolerances, and all parameters.

    ``model``: geometry that was fitted together with causes; it is shown in addition to the geometry alone.
    """
    c, known = calibration, calibration.model.geometry.parameters
    head = ["parameter", "nominal", "identified − nominal", "in tolerances", "variance reduction"]
    head += ["with the causes − nominal"] if model is not None else []
    rows, changes = [], list[float]()
    for p, value, sigma, reduction in zip(known, c.values, c.sigma, c.variance_reduction, strict=True):
        moved = float(value - p.nominal)
        changes.append(moved / p.tolerance)
        row = [p.name, whole(f"{p.nominal:.6f} {p.unit}"), quantity(moved, p.unit, float(sigma))]
        row += [whole(f"{changes[-1]:+.1f}"), f"{100.0 * reduction:.0f} %"]
        row += [quantity(model.geometry[p.name] - p.nominal, p.unit)] if model is not None else []
        rows.append(row)
    most = np.argsort(-np.abs(changes), kind="stable")[:MOVED]
    numbers = range(1, len(head))
    return Table(head, [rows[i] for i in most], numbers), Table(head, rows, numbers)


def controller_words(model: Model, folder: str, doubt: str = "") -> list[str]:
    """What to change in a controller's table of a serial arm, and the command that writes it; empty for other robots.

    ``folder``: that of the model. ``doubt``: what else the changes may contain, a sentence.
    """
    moved = [
        f"{p.name} of {p.site} {'+' if p.correction > 0.0 else ''}{quantity(p.correction, p.unit, p.sigma)}"
        for p in controller_table(model)
        if p.site != "tool" and p.name != "beta" and p.determined and abs(p.correction) > SIGNIFICANT * p.sigma
    ]
    said = f"Add to the controller's table (Denavit-Hartenberg): {', '.join(moved)}."
    every = f"All of it: gtpin export {folder} -o dh.csv --format dh"
    return [" ".join(filter(None, [said, doubt, every]))] if moved else []


def controller_advice(c: Calibration, folder: str) -> list[str]:
    """`controller_words` of a calibration; none from a fit that does not explain the data."""
    return controller_words(c.model, folder, UNTESTED) if c.explained else []


def controller_blocks(model: Model, doubt: str = "") -> list[Block]:
    """The table of a serial arm with what to add to it; empty for other robots. ``doubt``: as in `controller_words`."""
    rows = [[p.site, p.name, _to_add(p), whole(f"{p.nominal:z.6f} {p.unit}")] for p in controller_table(model)]
    words = (
        "What to add to the parameters of the controller; theta is the zero of a joint. They belong together; one that is not "
        "determined stays near nominal. Where the controller's a and alpha have the other sign, so have what is added to them."
    )
    table = Table(("joint", "parameter", "to add", "nominal"), rows, (2, 3))
    title = Heading("The controller's table (Denavit-Hartenberg)")
    return [title, " ".join(filter(None, [words, doubt])), table] if rows else []


def _to_add(p: DhParameter) -> str:
    if not p.determined and not abs(p.correction) > STEADY * p.sigma:
        return "not determined"
    return quantity(p.correction, p.unit, p.sigma) + ("" if p.determined else " (hardly determined)")


@section(120)
def what_the_data_can_t_see(r: Reported) -> Section | None:
    """Directions that the data of a calibration hardly show, and the strongest correlations."""
    if r.diagnosis is not None:
        return None
    c, rows = r.calibration, []
    for direction in c.unobservable[:SHOWN]:
        terms = [whole(f"{weight:+.2f} {name}") for name, weight in direction.weights.items()]
        rows.append([" ".join(terms[:4] + ["…"] * (len(terms) > 4)), percent(direction.variance_reduction)])
    content: list[Block] = ["The data determine every direction of the geometry."]
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
