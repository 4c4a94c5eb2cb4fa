"""A certificate of accuracy as sentences, JSON, table, terminal text and page. The page can be printed, or saved as PDF by the
browser's print dialogue."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group, RenderableType

from gtpin.compensation.compensate import NOT_THE_MACHINE
from gtpin.extras.certificate.budget import COVERAGE, Budget, Contribution
from gtpin.extras.certificate.quantity import Quantity
from gtpin.extras.certificate.result import Certificate
from gtpin.extras.certificate.terms import BASES, DEFINITIONS, HOW, ROWS, SOURCES, STATE, STATED, WHY
from gtpin.model.model_folder import model_json, write_model
from gtpin.model.place import movers
from gtpin.output.results import fields, json_text
from gtpin.report.page import (
    Block,
    Fold,
    Heading,
    Items,
    Lead,
    PagePresentation,
    Section,
    Step,
    Table,
    digest,
    in_terminal,
    provenance,
)
from gtpin.report.words import capital, counted, joined, percent, quantity, typeset
from gtpin.typing import Floats

if TYPE_CHECKING:
    import pandas as pd

POINTS = {"tcp": "its TCP", "target": "the measured target"}
"""What is certified, in words."""
AT = {"tcp": "at the TCP", "target": "at the target"}
"""Heading of a column of motions of what is certified."""
AXES = ("x", "y", "z", "rx", "ry", "rz")
MODEL = "model/model.json"
"""The certified model, beside the certificate."""
CERTIFICATE = ("certificate.json", "certificate.html", "model")
"""Names of what a certificate's folder holds; the model is the one that corrects the machine."""


@dataclass(frozen=True)
class CertificatePresentation(PagePresentation):
    """A certificate; its table is that of its numbers."""

    certificate: Certificate
    files = CERTIFICATE

    @cached_property
    def lead(self) -> Lead:
        """The certified uncertainty, what it is based on, and what is blank."""
        c, name = self.certificate, f"Certificate of {self.certificate.model.robot.name}"
        apart = ", apart from where the machine stands" if c.stands == "fitted" else ""
        of = "of position errors" if c.point == "tcp" else "of errors of the measured target"
        numbers = [(quantity(c.budget.radius, "m"), f"95 % {of}, corrected{apart}")]
        own = "RP_l_pooled" if c["RP_l_machine"].value is None else "RP_l_machine"
        for symbol in ("AP_p_corrected_rms", "AP_p_nominal_rms", own):
            if (value := c[symbol].value) is not None:
                numbers.append((quantity(value, c[symbol].unit, c[symbol].sigma), DEFINITIONS[symbol].name))
        program = "A program, corrected by the certified model:"
        return Lead(
            name,
            f"The corrected machine positions {POINTS[c.point]} within {numbers[0][0]} in 95 % of cases{apart}.",
            [*statement(c), *blank_words(c)],
            numbers,
            steps=[Step(program, "gtpin export DIR --commands program.csv -o corrected.csv")],
            warnings=c.warnings,
            tab=name,
        )

    @cached_property
    def sections(self) -> Sequence[Section]:
        """What is certified, the numbers, the budget, what is blank, and the standards."""
        c = self.certificate
        effects = ", ".join(active.name for active in c.model.effects if active.site not in NOT_THE_MACHINE)
        certified = [
            *what(c),
            f"Measured commands: {typeset(limits(c))}.",
            f"The model corrects geometry and {effects}." if effects else "The model corrects geometry alone.",
            f"The model is {MODEL} in the folder of this page; its digest is at the end.",
        ]
        bind = "Definitions are in our own words. Only the standards themselves are binding."
        return [
            Section("statement", "What is certified", [Items(certified)]),
            _numbers(c),
            _budget(c),
            Section("blank", "What is blank", _blanks(c)),
            Section("sources", "Standards", [bind, Items(SOURCES)]),
        ]

    @property
    def origin(self) -> Table:
        """Versions, seed and digests, also of the certified model."""
        c = self.certificate
        origin = provenance(c.dataset, c.model.robot, c.seed)
        return Table(origin.head, [*origin.rows, [MODEL, f"sha256 {digest(model_json(c.model).encode())}"]])

    def terminal(self, folder: Path | None = None) -> RenderableType:
        """The first screen, the numbers that the data suffice for, and the budget."""
        tables = [_known(self.certificate), _contributions(self.certificate)]
        return Group(super().terminal(folder), *in_terminal(tables))

    def table(self) -> pd.DataFrame:
        """By symbol and site: value, standard uncertainty, unit, numbers of poses and rows, and why it is blank."""
        import pandas as pd

        return pd.DataFrame([_row(q) for q in self.certificate.quantities]).set_index(["symbol", "site"])

    def write(self, folder: Path) -> dict[str, object]:
        """Write the files of ``gtpin certify``; return the content of the JSON."""
        write_model(self.certificate.model, folder / "model")
        result = self.json()
        (folder / "certificate.json").write_text(json_text(result), encoding="utf-8")
        (folder / "certificate.html").write_text(self.page(), encoding="utf-8")
        return result

    def json(self) -> dict[str, Any]:
        """The content of ``certificate.json``, in SI units. Where the data do not suffice, a value is None and has a
        ``reason``; ``state``: whether it is blank until the user states what is known without a measurement."""
        c, b = self.certificate, self.certificate.budget
        return {
            "schema": "gtpin-certificate/1",
            "robot": c.model.robot.name,
            **fields(c, "poses", "rows"),
            "point": c.point,
            "stands": c.stands,
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
                _row(q) | fields(DEFINITIONS[q.symbol], "formula", "standard", "estimate") for q in c.quantities
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
                        "state": row.missing in STATE,
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
            "warnings": list(c.warnings),
        }


def _known(c: Certificate) -> Table:
    """The numbers that the data suffice for."""
    rows = []
    for q in c.quantities:
        if q.value is not None:
            d = DEFINITIONS[q.symbol]
            after = f"{'resembles ' * d.estimate}{d.standard}"
            rows.append([_name(q), quantity(q.value, q.unit, q.sigma), str(q.poses), str(q.rows), after])
    return Table(("quantity", "value", "poses", "rows", "after"), rows, (1, 2, 3))


def _numbers(c: Certificate) -> Section:
    any_side = "from any side: reversal is part of them. The standard requires visits from one side"
    visits = f"Repeatabilities are of visits {'with the same directions of approach' if c.one_way else any_side}."
    about = (
        "Values with one standard uncertainty. Where a row resembles a clause, there are fewer visits or other poses than the "
        "standard requires, and the value is an estimate of the result of its test. Numbers of single actuators are deviations "
        f"of their travel, computed from the measured TCP. {visits}"
    )
    symbols = dict.fromkeys(q.symbol for q in c.quantities if q.value is not None)
    meanings = [f"{capital(d.name)}: {d.formula}. {d.words}" for d in map(DEFINITIONS.__getitem__, symbols)]
    return Section("numbers", "Accuracy and repeatability", [about, _known(c), Fold("Definitions", [Items(meanings)])])


def _contributions(c: Certificate) -> Table:
    rows = []
    for row in c.budget.rows:
        if row.position is None:
            rows.append([ROWS[row.source], row.kind, "", "", "blank", ""])
            continue
        size = "" if row.input is None else quantity(row.input, row.unit)
        sensitivity = "" if row.sensitivity is None else f"{row.sensitivity:.3g}"
        share = percent(c.budget.share(row) or 0.0)
        rows.append([ROWS[row.source], row.kind, size, sensitivity, quantity(row.position, "m"), share])
    return Table(("contribution", "type", "input, 1 sigma", "sensitivity", AT[c.point], "share"), rows, (2, 3, 4, 5))


def _budget(c: Certificate) -> Section:
    b, point = c.budget, POINTS[c.point].replace("its", "the")
    sizes = [_by_axis(b, values) for values in (b.combined, COVERAGE * b.combined, b.largest)]
    combined = [
        [axis.replace("r", "about "), *(quantity(one[axis], "rad" if "r" in axis else "m") for one in sizes)]
        for axis in sizes[0]
    ]
    directions = [
        [", ".join(f"{name} {quantity(change, unit)}" for name, change, unit in d.changes), quantity(d.position, "m")]
        for d in b.directions
    ]
    of_axes = ("axis", "combined standard uncertainty", f"expanded, k = {COVERAGE:g}", "expanded, largest")
    content: list[Block] = [
        f"Standard uncertainties of the position of {point} (root of the summed variances of the three axes), root mean "
        f"square over {len(b.q)} poses between the measured ones. Type A is evaluated by statistics, type B by other knowledge "
        "(JCGM 100, 4.2 and 4.3). A blank contribution is not in the sum.",
        _contributions(c),
        Items([f"{capital(ROWS[row.source])}: {HOW[row.source]}." for row in b.rows if row.missing is None]),
        "Combined: the contributions' covariances at each pose are added (JCGM 100, 5.2). Expanded: U = k u with k = "
        f"{COVERAGE:g}, which covers 95 % of a normal distribution along an axis (JCGM 100, 6.2). Three axes together need "
        f"more than k = 2 (JCGM 102): 95 % of the position errors are shorter than {quantity(b.radius, 'm')}, by drawing "
        "machines from the posterior.",
        Table(of_axes, combined, (1, 2, 3)),
        Heading("The largest uncertainties of the model"),
        "Parameters of geometry and effects are correlated. These are uncorrelated directions of them, the largest first: the "
        "change of each of three parameters along the direction, and its contribution at the TCP. The squares of all "
        "directions add up to the square of the model's contribution.",
        Table(("changes for one standard deviation", AT[c.point]), directions, (1,)),
    ]
    return Section("budget", "Uncertainty of the corrected machine", content)


def blank_words(c: Certificate) -> list[str]:
    """How many numbers are blank: what the user has to state, and how many need further measurements."""
    blank = _blank(c)
    state = [why(one) for one in blank if one.missing in STATE]
    found = [f"For you to fill in: {'; '.join(dict.fromkeys(state))}."] if state else []
    if measured := len(blank) - len(state):
        found.append(
            f"{counted(measured, 'number')} stay blank until more is measured: see the section on what is blank."
        )
    return found


def _blank(c: Certificate) -> list[Quantity | Contribution]:
    every: list[Quantity | Contribution] = [*c.quantities, *c.budget.rows]
    return [one for one in every if one.missing is not None]


def _blanks(c: Certificate) -> list[Block]:
    """The blank numbers by reason: those that the user has to fill in, then those that need measurements."""
    reasons: dict[tuple[bool, str], dict[str, list[str]]] = {}
    for one in _blank(c):
        name, site = (DEFINITIONS[one.symbol].name, one.site) if isinstance(one, Quantity) else (ROWS[one.source], "")
        reasons.setdefault((one.missing in STATE, why(one)), {}).setdefault(name, []).append(site)
    content: list[Block] = []
    for state, title in ((True, "For you to fill in"), (False, "To be measured")):
        found = [
            f"{capital(joined([name + f' of {joined(sites)}' * any(sites) for name, sites in names.items()]))}: {reason}."
            for (of, reason), names in reasons.items()
            if of == state
        ]
        content += [Heading(title), Items(found)] if found else []
    return content or ["No number is blank."]


def _by_axis(b: Budget, values: Floats) -> dict[str, float]:
    return dict(zip(AXES[: 6 if b.orientation else 3], values.tolist(), strict=False))


def _row(q: Quantity) -> dict[str, Any]:
    return {**fields(q, "symbol", "site", "value", "sigma", "unit", "poses", "rows"), "reason": why(q)}


def _name(q: Quantity) -> str:
    symbol = q.symbol.partition("_nominal")[0].partition("_corrected")[0]
    symbol = symbol.removesuffix("_pooled").removesuffix("_machine")
    return f"{DEFINITIONS[q.symbol].name}{f' of {q.site}' if q.site else ''}, {symbol}"


def why(q: Quantity | Contribution) -> str:
    """Why a number is blank."""
    if q.missing is None:
        return ""
    return WHY[q.missing].format(have=q.have if isinstance(q, Quantity) else "none or few")


def what(c: Certificate) -> list[str]:
    """What is certified, where it is not the TCP in the base frame."""
    found = []
    if c.point == "target":
        sat = [", ".join(f"{1e3 * at:.1f}" for at in place.translation) for place in c.model.targets.values()]
        found.append(
            f"Certified is the measured target{f', at {joined(sat)} mm in the frame of the tool' if sat else ''}, and not the "
            f"tool, {c.model.robot.tcp_frame}: where it sits was not measured, and it is off by as much. To certify "
            "the tool, measure a target whose place on it is known."
        )
    if c.stands == "fitted":
        found.append(
            "Errors are those of the machine placed best in the instrument's frame, which was free: where it stands is not "
            "certified."
        )
    return found


def statement(c: Certificate) -> list[str]:
    """The certified uncertainty, its basis, and the limits within which it holds."""
    U = COVERAGE * c.budget.combined[:3]
    axes = joined([f"{axis} {quantity(float(u), 'm')}" for axis, u in zip("xyz", U, strict=True)])
    found = [
        *what(c),
        f"Expanded uncertainty with k = {COVERAGE:g} (95 %), root mean square over the workspace: {axes}.",
        f"It is computed from {counted(c.rows, 'measurement')} of {counted(c.poses, 'pose')}. {BASES[c.basis]}",
        "It is valid between the measured commands, under the recorded conditions, and for a controller that uses the model.",
    ]
    if names := movers(c.model):
        frame = f"Positions are in the mean of the base frame over the measurements: {joined(list(names))} moved it"
        found.append(f"{frame}, and is not corrected.")
    if loaded := [active.name for active in c.model.effects if "load" in active.effect.depends_on]:
        exact = "are those of the masses in the robot's file, taken as exact: their uncertainty is stated nowhere"
        where = "Where they are wrong, the error at other postures and payloads can be larger"
        found.append(f"The loads of {joined(loaded)} {exact}. {where}.")
    found += [STATED[key] for key in (c.verdict, c.noise_known) if key in STATED]
    return [*found, f"Set aside: {joined(list(c.set_aside))}."] if c.set_aside else found


def limits(c: Certificate) -> str:
    """The ranges of commands in which the certificate holds."""
    low, high = c.dataset.q.min(axis=0), c.dataset.q.max(axis=0)
    units = ["rad" if turns else "m" for turns in np.asarray(c.model.robot.revolute)]
    return joined([f"{site} {low[i]:.3f} to {high[i]:.3f} {units[i]}" for i, site in enumerate(c.model.robot.sites)])
