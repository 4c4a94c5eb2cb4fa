"""Display of results: in a Python session, in a notebook, as text and as a table."""

from __future__ import annotations

from abc import ABC, abstractmethod
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

ROWS = 12
"""Rows of a table that a notebook shows; ``to_dataframe`` has all."""


class Presentation(ABC):
    """The display of a result; ``gtpin/report/show`` has one for each kind of result."""

    @abstractmethod
    def short(self) -> str:
        """The result in a few lines."""

    @abstractmethod
    def text(self) -> str:
        """The whole result as text."""

    @abstractmethod
    def table(self) -> pd.DataFrame:
        """The result as a table."""

    def html(self) -> str:
        """The few lines and the first rows of the table, as HTML."""
        first, *others = (escape(line) for line in self.short().splitlines())
        lines = "<br>".join([f"<b>{first}</b>", *others])
        table = self.table()
        return f"<p>{lines}</p>{table.to_html(max_rows=ROWS) if len(table) else ''}"


class Shown(ABC):
    """A result with a display as text, table and HTML.

    The display is imported when it is first used, so that results do not depend on the report.
    """

    @abstractmethod
    def _presentation(self) -> Presentation:
        """The display of this result."""

    def __repr__(self) -> str:
        return self._presentation().short()

    def _repr_html_(self) -> str:
        return self._presentation().html()

    def summary(self) -> str:
        """The whole result as text."""
        return self._presentation().text()

    def to_dataframe(self) -> pd.DataFrame:
        """The result as a table; ``docs/python.md`` explains its columns."""
        return self._presentation().table()
