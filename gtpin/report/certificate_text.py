"""A short summary of a certificate for a terminal."""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table

from gtpin.certificate.result import Certificate
from gtpin.report.certificate_page import name_of, value_of
from gtpin.report.certificate_words import ROWS, headline, share_words, statement
from gtpin.report.words import quantity


def certificate_summary(c: Certificate) -> RenderableType:
    """The statement, the numbers that the data suffice for, and the budget."""
    numbers = Table(box=SIMPLE_HEAD, pad_edge=False)
    numbers.add_column("quantity")
    numbers.add_column("value", justify="right", no_wrap=True)
    numbers.add_column("poses", justify="right")
    for q in c.quantities:
        if q.value is not None:
            numbers.add_row(name_of(q), value_of(q), str(q.poses))
    rows = Table(box=SIMPLE_HEAD, pad_edge=False)
    rows.add_column("contribution")
    rows.add_column("at the TCP", justify="right", no_wrap=True)
    rows.add_column("share", justify="right", no_wrap=True)
    for row in c.budget.rows:
        if row.position is not None:
            rows.add_row(ROWS[row.source], quantity(row.position, "m"), share_words(c.budget.share(row) or 0.0))
    left = sum(q.value is None for q in c.quantities)
    blanks = f"{left} of {len(c.quantities)} numbers are blank, because the data do not suffice: the page says why."
    return Group(headline(c), *statement(c), numbers, rows, blanks)
