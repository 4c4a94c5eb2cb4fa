"""The page of a certificate. It can be printed, or saved as PDF by the browser's print dialogue."""

from __future__ import annotations

from gtpin.certificate.budget import COVERAGE
from gtpin.certificate.quantity import Quantity
from gtpin.certificate.result import Certificate
from gtpin.model.model_folder import model_json
from gtpin.report.certificate_definitions import DEFINITIONS, SOURCES
from gtpin.report.certificate_json import MODEL
from gtpin.report.certificate_words import HOW, ROWS, headline, limits, share_words, statement, visits_words, why
from gtpin.report.page import Table, render
from gtpin.report.provenance import digest, provenance
from gtpin.report.words import quantity

AXES = ("x", "y", "z", "about x", "about y", "about z")
HEAD = ("quantity", "value", "poses", "rows", "definition", "after")


def certificate_page(c: Certificate) -> str:
    """The whole certificate as one self-contained HTML file."""
    first, *further = statement(c)
    return render(
        "certificate.html",
        title=f"Certificate of {c.model.robot.name}",
        provenance=_provenance(c),
        model=MODEL,
        robot=c.model.robot.name,
        headline=headline(c),
        advice=[first],
        further=further,
        commands=limits(c),
        effects=[active.name for active in c.model.effects],
        numbers=_numbers(c),
        poses_table=_table([q for q in c.quantities if not q.site]),
        actuators=_table([q for q in c.quantities if q.site]),
        blanks=_blanks(c),
        visits=visits_words(c),
        budget=_budget(c),
        budget_poses=len(c.budget.q),
        combined=_combined(c),
        directions=_directions(c),
        coverage=f"{COVERAGE:g}",
        radius=quantity(c.budget.radius, "m"),
        sources=SOURCES,
    )


def _provenance(c: Certificate) -> Table:
    """Where the numbers come from, and which model is certified."""
    table = provenance(c.dataset, c.model.robot, c.seed)
    return Table(table.head, [*table.rows, [MODEL, f"sha256 {digest(model_json(c.model).encode())}"]])


def _numbers(c: Certificate) -> list[tuple[str, str]]:
    found = [(quantity(c.budget.radius, "m"), "95 % of position errors, corrected")]
    for name, what in (
        ("AP_p_corrected_rms", "position accuracy, corrected, RMS"),
        ("AP_p_nominal_rms", "position accuracy, not corrected, RMS"),
        ("RP_l_pooled", "position repeatability, as measured"),
    ):
        q = c[name]
        if q.value is not None:
            found.append((quantity(q.value, q.unit), what))
    return found


def value_of(q: Quantity) -> str:
    """A number with its standard uncertainty."""
    return "" if q.value is None else quantity(q.value, q.unit, q.sigma)


def name_of(q: Quantity) -> str:
    """A number's name, with its symbol."""
    symbol = q.symbol.partition("_nominal")[0].partition("_corrected")[0]
    symbol = symbol.removesuffix("_pooled").removesuffix("_machine")
    site = f" of {q.site}" if q.site else ""
    return f"{DEFINITIONS[q.symbol].name}{site}, {symbol}"


def _table(found: list[Quantity]) -> Table:
    rows = []
    for q in found:
        d = DEFINITIONS[q.symbol]
        if q.value is not None:
            after = f"{'resembles ' if d.estimate else ''}{d.standard}"
            rows.append([name_of(q), value_of(q), str(q.poses), str(q.rows), f"{d.formula}. {d.words}", after])
    return Table(HEAD, rows)


def _blanks(c: Certificate) -> Table:
    """The blank numbers, each with its reason; actuators with the same reason are in one row."""
    rows: dict[tuple[str, str], list[str]] = {}
    for q in c.quantities:
        if q.value is None:
            d = DEFINITIONS[q.symbol]
            rows.setdefault((f"{d.name}: {d.formula} ({d.standard})", why(q)), []).append(q.site)
    return Table(
        ("quantity", "of", "why it is blank"),
        [[name, ", ".join(site or "TCP" for site in sites), reason] for (name, reason), sites in rows.items()],
    )


def _budget(c: Certificate) -> Table:
    b, rows = c.budget, []
    for row in b.rows:
        if row.position is None:
            rows.append([ROWS[row.source], row.kind, "", "", "", "", f"Blank: {why(row)}."])
            continue
        share = b.share(row) or 0.0
        rows.append(
            [
                ROWS[row.source],
                row.kind,
                "" if row.input is None else quantity(row.input, row.unit),
                "" if row.sensitivity is None else f"{row.sensitivity:.3g}",
                quantity(row.position, "m"),
                share_words(share),
                HOW[row.source],
            ]
        )
    return Table(
        ("contribution", "type", "standard uncertainty of the input", "sensitivity", "at the TCP", "share", "how"), rows
    )


def _combined(c: Certificate) -> Table:
    b, rows = c.budget, []
    for i, axis in enumerate(AXES[: 6 if c.budget.orientation else 3]):
        unit = "m" if i < 3 else "rad"
        values = (b.combined[i], COVERAGE * b.combined[i], b.largest[i])
        rows.append([axis, *(quantity(float(v), unit) for v in values)])
    return Table(("axis", "combined standard uncertainty", f"expanded, k = {COVERAGE:g}", "expanded, largest"), rows)


def _directions(c: Certificate) -> Table:
    rows = [
        [", ".join(f"{name} {quantity(change, unit)}" for name, change, unit in d.changes), quantity(d.position, "m")]
        for d in c.budget.directions
    ]
    return Table(("changes for one standard deviation", "at the TCP"), rows)
