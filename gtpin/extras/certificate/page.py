"""A certificate of accuracy as sentences, JSON, table, terminal text and page. The page can be printed, or saved as PDF by the
browser's print dialogue."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group, RenderableType

from gtpin.extras.certificate.budget import COVERAGE, Budget, Contribution
from gtpin.extras.certificate.quantity import Quantity
from gtpin.extras.certificate.result import Certificate
from gtpin.extras.certificate.terms import BASES, DEFINITIONS, HOW, ROWS, SOURCES, STATED, WHY
from gtpin.model.model_folder import model_json, write_model
from gtpin.output.results import json_text
from gtpin.output.shown import Presentation
from gtpin.report.page import Block, Heading, Items, Lead, Section, Table, report
from gtpin.report.provenance import digest, provenance
from gtpin.report.words import counted, joined, percent, quantity, whole
from gtpin.typing import Floats

if TYPE_CHECKING:
    import pandas as pd

AXES = ("x", "y", "z", "rx", "ry", "rz")
MODEL = "model/model.json"
"""The certified model, beside the certificate."""
CERTIFICATE = ("certificate.json", "certificate.html", "model")
"""Names of what a certificate's folder holds; the model is the one that corrects the machine."""


@dataclass(frozen=True)
class CertificatePresentation(Presentation):
    """A certificate; its table is that of its numbers."""

    certificate: Certificate
    files = CERTIFICATE

    def short(self) -> str:
        """The certified uncertainty."""
        c = self.certificate
        return f"Certificate of {c.model.robot.name}\n{headline(c)}\n{statement(c)[0]}"

    def text(self) -> str:
        """The statement, and all numbers."""
        c = self.certificate
        numbers = [f"{_name(q)}: {_value(q) or f'blank: {why(q)}'}" for q in c.quantities]
        return "\n".join([headline(c), *statement(c), *numbers]) + "\n"

    def terminal(self) -> RenderableType:
        """The statement, the numbers that the data suffice for, and the budget."""
        c = self.certificate
        known = [[_name(q), _value(q), str(q.poses)] for q in c.quantities if q.value is not None]
        budget = [
            [ROWS[row.source], quantity(row.position, "m"), _share(c.budget.share(row) or 0.0)]
            for row in c.budget.rows
            if row.position is not None
        ]
        blank = f"{len(c.quantities) - len(known)} of {len(c.quantities)} numbers are blank"
        return Group(
            headline(c),
            *statement(c),
            Table(("quantity", "value", "poses"), known, (1, 2)).printed(),
            Table(("contribution", "at the TCP", "share"), budget, (1, 2)).printed(),
            f"{blank}, because the data do not suffice: the page says why.",
        )

    def table(self) -> pd.DataFrame:
        """By symbol and site: value, standard uncertainty, unit, numbers of poses and rows, and why it is blank."""
        import pandas as pd

        return pd.DataFrame([_row(q) for q in self.certificate.quantities]).set_index(["symbol", "site"])

    def write(self, folder: Path) -> dict[str, object]:
        """Write the files of ``gtpin certify``; return the content of the JSON."""
        write_model(self.certificate.model, folder / "model")
        result = self.json()
        (folder / "certificate.json").write_text(json_text(result), encoding="utf-8")
        (folder / "certificate.html").write_text(certificate_page(self.certificate), encoding="utf-8")
        return result

    def json(self) -> dict[str, Any]:
        """The content of ``certificate.json``, in SI units. Where the data do not suffice, a value is None and has a
        ``reason``."""
        c, b = self.certificate, self.certificate.budget
        return {
            "schema": "gtpin-certificate/1",
            "robot": c.model.robot.name,
            **_of(c, "poses", "rows"),
            "set_aside": list(c.set_aside),
            "basis": c.basis,
            "basis_words": BASES[c.basis],
            "verdict": c.verdict,
            "effects": [active.name for active in c.model.effects],
            "model": {"file": MODEL, "sha256": digest(model_json(c.model).encode())},
            "noise": {
                "position_sigma": c.noise.position_sigma,
                "orientation_sigma": c.noise.orientation_sigma if b.orientation else None,
                "known": c.noise_known,
            },
            "statement": statement(c),
            "commands": limits(c),
            "quantities": [
                _row(q) | _of(DEFINITIONS[q.symbol], "formula", "standard", "estimate") for q in c.quantities
            ],
            "budget": {
                "poses": len(b.q),
                "contributions": [
                    {
                        "source": row.source,
                        "type": row.kind,
                        "input": row.input,
                        "unit": row.unit,
                        "sensitivity": row.sensitivity,
                        "standard_uncertainty": row.position,
                        "share": b.share(row),
                        "reason": why(row),
                        "method": HOW[row.source],
                    }
                    for row in b.rows
                ],
                "directions": [
                    {"changes": {name: change for name, change, _ in d.changes}, "standard_uncertainty": d.position}
                    for d in b.directions
                ],
                "combined": _by_axis(b, b.combined),
                "coverage_factor": COVERAGE,
                "expanded": _by_axis(b, COVERAGE * b.combined),
                "largest": _by_axis(b, b.largest),
                "radius": b.radius,
            },
            "sources": list(SOURCES),
            "seed": c.seed,
        }


def certificate_page(c: Certificate) -> str:
    """The whole certificate as one self-contained HTML file."""
    first, *further = statement(c)
    effects = ", ".join(active.name for active in c.model.effects)
    numbers = [(quantity(c.budget.radius, "m"), "95 % of position errors, corrected")]
    for symbol in ("AP_p_corrected_rms", "AP_p_nominal_rms", "RP_l_pooled"):
        if (value := c[symbol].value) is not None:
            numbers.append((quantity(value, c[symbol].unit), DEFINITIONS[symbol].name))
    certified = [
        *further,
        f"Measured commands: {limits(c)}.",
        f"The model corrects geometry and {effects}." if effects else "The model corrects geometry alone.",
        f"The model is {MODEL} in the folder of this page; its digest is at the end.",
    ]
    name, hint = c.model.robot.name, "To save this page as PDF, print it (Ctrl+P)."
    bind = "Definitions are in our own words; the standards themselves bind."
    sections = [
        Section("statement", "What is certified", [Items(certified)]),
        *_numbers(c),
        _budget(c),
        Section("blank", "What the data do not suffice for", [_blanks(c)]),
        Section("sources", "Standards", [bind, Items(SOURCES)]),
    ]
    origin = provenance(c.dataset, c.model.robot, c.seed)
    digests = Table(origin.head, [*origin.rows, [MODEL, f"sha256 {digest(model_json(c.model).encode())}"]])
    lead = Lead(f"Certificate of accuracy · {name}", headline(c), [first], numbers, hint=hint)
    return report(f"Certificate of {name}", lead, sections, digests, contents=False)


def _numbers(c: Certificate) -> tuple[Section, Section]:
    def table(found: Iterable[Quantity]) -> Table:
        rows = []
        for q in found:
            d = DEFINITIONS[q.symbol]
            after = f"{'resembles ' if d.estimate else ''}{d.standard}"
            rows.append([_name(q), _value(q), str(q.poses), str(q.rows), f"{d.formula}. {d.words}", after])
        return Table(("quantity", "value", "poses", "rows", "definition", "after"), rows, (1, 2, 3))

    any_side = "from any side: reversal is part of them. The standard asks for visits from one side"
    visits = f"Repeatabilities are of visits {'with the same directions of approach' if c.one_way else any_side}."
    known = [q for q in c.quantities if q.value is not None]
    about = (
        "Values with one standard uncertainty. Where a row resembles a clause, fewer visits or other poses than the standard "
        f"asks for were measured, and the value estimates what its test would show. {visits}"
    )
    single = table(q for q in known if q.site)
    actuators: list[Block] = ["The data do not suffice for any number of single actuators."]
    if single.rows:
        actuators = ["Deviations of an actuator's travel as the measured TCP shows them.", single]
    return (
        Section("poses", "Poses", [about, table(q for q in known if not q.site)]),
        Section("actuators", "Actuators", actuators),
    )


def _budget(c: Certificate) -> Section:
    b, rows = c.budget, []
    for row in b.rows:
        if row.position is None:
            rows.append([ROWS[row.source], row.kind, "", "", "", "", f"Blank: {why(row)}."])
            continue
        size = "" if row.input is None else quantity(row.input, row.unit)
        sensitivity = "" if row.sensitivity is None else f"{row.sensitivity:.3g}"
        share = _share(b.share(row) or 0.0)
        about = [ROWS[row.source], row.kind, size, sensitivity]
        rows.append([*about, quantity(row.position, "m"), share, HOW[row.source]])
    sizes = [_by_axis(b, values) for values in (b.combined, COVERAGE * b.combined, b.largest)]
    combined = [
        [axis.replace("r", "about "), *(quantity(one[axis], "rad" if "r" in axis else "m") for one in sizes)]
        for axis in sizes[0]
    ]
    directions = [
        [", ".join(f"{name} {quantity(change, unit)}" for name, change, unit in d.changes), quantity(d.position, "m")]
        for d in b.directions
    ]
    head = ("contribution", "type", "standard uncertainty of the input", "sensitivity", "at the TCP", "share", "how")
    of_axes = ("axis", "combined standard uncertainty", f"expanded, k = {COVERAGE:g}", "expanded, largest")
    content: list[Block] = [
        "Standard uncertainties of the TCP's position (root of the summed variances of the three axes), root mean square over "
        f"{len(b.q)} poses between the measured ones. Type A is evaluated by statistics, type B by other knowledge (JCGM 100, "
        "4.2 and 4.3). A blank contribution is not in the sum.",
        Table(head, rows, (2, 3, 4, 5)),
        "Combined: the contributions' covariances at each pose are added (JCGM 100, 5.2). Expanded: U = k u with k = "
        f"{COVERAGE:g}, which covers 95 % of a normal distribution along an axis (JCGM 100, 6.2). Three axes together need "
        f"more than k = 2 (JCGM 102): 95 % of the position errors are shorter than {quantity(b.radius, 'm')}, by drawing "
        "machines from the posterior.",
        Table(of_axes, combined, (1, 2, 3)),
        Heading("What is least known"),
        "Parameters of geometry and effects are correlated. These are uncorrelated directions of them, the largest first: by "
        "how much each of three parameters changes with the direction, and what it contributes at the TCP. The squares of all "
        "directions add up to geometry and effects.",
        Table(("changes for one standard deviation", "at the TCP"), directions, (1,)),
    ]
    return Section("budget", "Uncertainty of the corrected machine", content)


def _blanks(c: Certificate) -> Table:
    """The blank numbers, each with its reason; actuators with the same reason are in one row."""
    rows: dict[tuple[str, str], list[str]] = {}
    for q in c.quantities:
        if q.value is None:
            d = DEFINITIONS[q.symbol]
            rows.setdefault((f"{d.name}: {d.formula} ({d.standard})", why(q)), []).append(q.site)
    cells = [[name, ", ".join(site or "TCP" for site in sites), why_] for (name, why_), sites in rows.items()]
    return Table(("quantity", "of", "why it is blank"), cells)


def _by_axis(b: Budget, values: Floats) -> dict[str, float]:
    return dict(zip(AXES[: 6 if b.orientation else 3], values.tolist(), strict=False))


def _row(q: Quantity) -> dict[str, Any]:
    return {**_of(q, "symbol", "site", "value", "sigma", "unit", "poses", "rows"), "reason": why(q)}


def _of(one: object, *names: str) -> dict[str, Any]:
    return {name: getattr(one, name) for name in names}


def _value(q: Quantity) -> str:
    return "" if q.value is None else quantity(q.value, q.unit, q.sigma)


def _name(q: Quantity) -> str:
    symbol = q.symbol.partition("_nominal")[0].partition("_corrected")[0]
    symbol = symbol.removesuffix("_pooled").removesuffix("_machine")
    return f"{DEFINITIONS[q.symbol].name}{f' of {q.site}' if q.site else ''}, {symbol}"


def _share(share: float) -> str:
    """A share of the variance; that of a correlation may be negative."""
    return percent(share) if share >= 0.0 else whole(f"{min(-1.0, 100.0 * share):.0f} %")


def why(q: Quantity | Contribution) -> str:
    """Why a number is blank."""
    if q.missing is None:
        return ""
    return WHY[q.missing].format(have=q.have if isinstance(q, Quantity) else "none or few")


def headline(c: Certificate) -> str:
    """The corrected machine's uncertainty, in one sentence."""
    return f"The corrected machine positions its TCP within {quantity(c.budget.radius, 'm')} in 95 % of cases."


def statement(c: Certificate) -> list[str]:
    """The certified uncertainty, its basis, and the limits within which it holds."""
    U = COVERAGE * c.budget.combined[:3]
    axes = joined([f"{axis} {quantity(float(u), 'm')}" for axis, u in zip("xyz", U, strict=True)])
    found = [
        f"Expanded uncertainty with k = {COVERAGE:g} (95 %), root mean square over the workspace: {axes}.",
        f"It rests on {counted(c.rows, 'measurement')} of {counted(c.poses, 'pose')}. {BASES[c.basis]}",
        "It holds between the measured commands, under the recorded conditions, and for a controller that uses the model.",
    ]
    found += [STATED[key] for key in (c.verdict, c.noise_known) if key in STATED]
    return [*found, f"Set aside: {joined(list(c.set_aside))}."] if c.set_aside else found


def limits(c: Certificate) -> str:
    """The ranges of commands in which the certificate holds."""
    low, high = c.dataset.q.min(axis=0), c.dataset.q.max(axis=0)
    units = ["rad" if turns else "m" for turns in np.asarray(c.model.robot.revolute)]
    return joined([f"{site} {low[i]:.3f} to {high[i]:.3f} {units[i]}" for i, site in enumerate(c.model.robot.sites)])
