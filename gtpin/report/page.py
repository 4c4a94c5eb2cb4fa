"""Pages: one self-contained HTML file each, made of sections, with interactive plots.

A :class:`Section` is one topic: paragraphs, tables, bars and plots in their order. A page is a list of them.
"""

from __future__ import annotations

import base64
import hashlib
import platform
import tempfile
from abc import abstractmethod
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import pinocchio as pin
from markupsafe import Markup
from rich.box import SIMPLE_HEAD
from rich.console import Console, Group, RenderableType
from rich.table import Table as Printed

from gtpin.data import Dataset
from gtpin.output.ownership import MARKER
from gtpin.output.shown import SavedPresentation
from gtpin.report.figure import DARK, INK, LIGHT, LINE, Drawing, Plot, PlotChoice, Shared, alone, escaped, has_plotly
from gtpin.report.words import typeset
from gtpin.robot.chain import Chain

if TYPE_CHECKING:
    from jinja2 import Environment
    from plotly.graph_objects import Figure

WIDTH = 120
"""Characters of a line of text."""
BASIC = frozenset({"scatter", "bar", "pie"})
"""Kinds of traces that the small script of plotly draws."""
ROW, LOWEST, HIGHEST = 26, 8, 600
"""Of a table as a figure: height of a row, pixels; width of the narrowest column, characters; largest height, pixels: a higher
table scrolls."""


@dataclass(frozen=True)
class Table:
    """A table of texts.

    - ``head``, ``rows``: names of the columns, and the cells of each row.
    - ``numbers``: indices of the columns that are set to the right.
    - ``shades``: shares, 0 to 1, of the colour behind each cell, by row and column; None: no colours.
    - ``wide``: indices of the columns of sentences.
    - ``whole``: whether no cell is divided into lines in a terminal.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: Collection[int] = ()
    shades: Sequence[Sequence[float]] | None = None
    wide: Collection[int] = ()
    whole: bool = False

    def printed(self) -> Printed:
        """The table for a terminal; only the first column and columns of numbers keep their lines whole."""
        made = Printed(box=SIMPLE_HEAD, pad_edge=False)
        for k, name in enumerate(self.head):
            right = k in self.numbers
            made.add_column(name, justify="right" if right else "left", no_wrap=self.whole or right or k == 0)
        for row in self.rows:
            made.add_row(*row)
        return made

    def figure(self, title: str) -> Figure:
        """The table as a figure of plotly."""
        columns = [[typeset(escaped(row[k])) for row in self.rows] for k in range(len(self.head))]
        look = {"align": "left", "line": {"color": LINE}, "font": {"color": INK}, "height": ROW}
        head = {"values": [f"<b>{escaped(name)}</b>" for name in self.head], "fill": {"color": LIGHT["panel"]}}
        cells = {"values": columns, "fill": {"color": LIGHT["paper"]}}
        widths = [max(LOWEST, *map(len, (name, *column))) for name, column in zip(self.head, columns, strict=True)]
        trace = {"type": "table", "header": head | look, "cells": cells | look, "columnwidth": widths}
        return alone(Drawing([trace]), title, height=min(HIGHEST, 120 + ROW * (len(self.rows) + 2)))


@dataclass(frozen=True)
class Bar:
    """A bar: name, length relative to the longest, value as text, and whether it is a named cause."""

    name: str
    share: float
    value: str
    lead: bool = False


@dataclass(frozen=True)
class Bars:
    """Horizontal bars, in groups beside each other; a group without a title is alone."""

    groups: Sequence[tuple[str, Sequence[Bar]]]


@dataclass(frozen=True)
class Heading:
    """A heading inside a section."""

    words: str


@dataclass(frozen=True)
class Items:
    """A list of sentences."""

    words: Sequence[str]


@dataclass(frozen=True)
class Fold:
    """Content that the reader can fold away, under a title."""

    title: str
    content: Sequence[Block]


@dataclass(frozen=True)
class Note:
    """Content in a frame."""

    content: Sequence[Block]


@dataclass(frozen=True)
class Plots:
    """Plots beside each other, as far as there is room.

    - ``words``, ``choices``: a paragraph above them, and the reader's choices at its end. Where plots can't be drawn, a
      hint is in its place.
    """

    plots: Sequence[Plot]
    words: str = ""
    choices: Sequence[PlotChoice] = ()


Block = str | Table | Bars | Heading | Items | Fold | Note | Plots
"""A part of a section; a text is a paragraph."""


@dataclass(frozen=True)
class Section:
    """A topic of a page: its id, its title, its content, and its name in the list of contents if that is another."""

    id: str
    title: str
    content: Sequence[Block]
    entry: str = ""


@dataclass(frozen=True)
class Step:
    """Something to do now, and the command to type; empty: none. In a command, DIR is the folder of the result."""

    words: str
    command: str = ""


@dataclass(frozen=True)
class Lead:
    """The first screen of a page and of a terminal.

    - ``eyebrow``, ``tab``: what the page is of, and its title in a browser.
    - ``headline``, ``advice``: the result, a sentence a line, and paragraphs below it.
    - ``numbers``: key figures: value, and what it is.
    - ``badge``, ``tone``: a short verdict, and the name of its colour; empty: none.
    - ``sketch``, ``caption``: a drawing of the machine as SVG, and the text below it.
    - ``content``: what follows the headline.
    - ``steps``: what to do now.
    - ``warnings``: all warnings about the data.
    """

    eyebrow: str
    headline: str
    advice: Sequence[str] = ()
    numbers: Sequence[tuple[str, str]] = ()
    badge: str = ""
    tone: str = ""
    sketch: Markup | None = None
    caption: str = ""
    content: Sequence[Block] = ()
    steps: Sequence[Step] = ()
    warnings: Sequence[str] = ()
    tab: str = ""

    @property
    def title(self) -> str:
        """What it is of, and the short verdict."""
        return f"{self.eyebrow}: {self.badge}" if self.badge else self.eyebrow

    def short(self) -> str:
        """The result in a few lines."""
        return "\n".join([self.title, "; ".join(f"{value} {what}" for value, what in self.numbers), self.headline])

    def printed(self, folder: Path | str = "DIR") -> Group:
        """The first screen for a terminal, without the warnings, which are printed when they arise.

        ``folder``: where the result is written.
        """
        wide = max((len(value) for value, _ in self.numbers), default=0)
        numbers = [f"  {value:>{wide}}  {what}" for value, what in self.numbers]
        steps = [line for step in self.steps for line in (f"  {step.words}", f"    {step.command}") if line.strip()]
        todo = ["", "What to do now", *(line.replace("DIR", str(folder)) for line in steps)] if steps else []
        return Group(self.title, *numbers, "", self.headline, *in_terminal(self.content), *self.advice, *todo)


def in_terminal(content: Iterable[Block]) -> Iterator[RenderableType]:
    """Content for a terminal; of plots nothing is printed."""
    for block in content:
        match block:
            case Table():
                yield block.printed()
            case Bars():
                for title, rows in block.groups:
                    yield Table((title, ""), [(bar.name, bar.value) for bar in rows], (1,)).printed()
            case Heading():
                yield f"\n{block.words}"
            case Items():
                yield from (f"- {words}" for words in block.words)
            case Fold():
                yield f"\n{block.title}"
                yield from in_terminal(block.content)
            case Note():
                yield from in_terminal(block.content)
            case Plots():
                pass
            case _:
                yield block.striptags() if isinstance(block, Markup) else block


def as_text(*parts: RenderableType) -> str:
    """Sentences and tables as plain text, `WIDTH` wide."""
    console = Console(highlight=False, markup=False, width=WIDTH, color_system=None)
    with console.capture() as captured:
        console.print(*parts, sep="\n")
    return "\n".join(line.rstrip() for line in captured.get().splitlines()) + "\n"


class PagePresentation(SavedPresentation):
    """A result with a page, which its texts are made from too."""

    @property
    @abstractmethod
    def lead(self) -> Lead:
        """The first screen."""

    @property
    @abstractmethod
    def sections(self) -> Sequence[Section]:
        """What follows the first screen."""

    @property
    @abstractmethod
    def origin(self) -> Table:
        """Versions, and digests of what was read."""

    def short(self) -> str:
        """The result in a few lines."""
        return self.lead.short()

    def terminal(self, folder: Path | None = None) -> RenderableType:
        """What the result's command prints; ``folder``: where the result is written."""
        return self.lead.printed(folder or "DIR")

    def text(self) -> str:
        """The page as plain text, `WIDTH` wide: its words and tables."""
        parts: list[RenderableType] = [self.lead.printed()]
        warned = Section("warnings", "Warnings", [Items(self.lead.warnings)])
        for section in [*self.sections, *([warned] if self.lead.warnings else [])]:
            if content := list(in_terminal(section.content)):
                parts += [f"\n{section.title.upper()}\n", *content]
        return as_text(*parts)

    def page(self) -> str:
        """The whole report as one self-contained HTML file."""
        return report(self.lead, [*self.sections, Section("provenance", "Provenance", [self.origin])])


def report(lead: Lead, sections: Sequence[Section]) -> str:
    """A page of sections as one self-contained HTML file, in which text is escaped.

    No plot is drawn if a kind of them needs plotly and it is not installed.
    """
    blocks = [*lead.content, *(block for section in sections for block in section.content)]
    plots = [plot for block in blocks if isinstance(block, Plots) for plot in block.plots]
    shared, environment = Shared(), _environment()
    by_plot = {id(plot): shared.embed(plot) for plot in plots}
    library = plotly_js(frozenset(shared.kinds)) if plots else None
    scripts = (library, Markup(environment.get_template("plots.js").render())) if library else ()
    # The page's security policy allows only scripts with these hashes.
    hashes = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    return environment.get_template("report.html").render(
        lead=lead,
        sections=sections,
        embedded=lambda plot: by_plot[id(plot)],
        drawn=library is not None or not plots,
        scripts=scripts,
        script_hashes=[f"'sha256-{one}'" for one in hashes],
        shared=shared.json,
        version=version("gtpin"),
    )


@cache
def plotly_js(kinds: frozenset[str]) -> Markup | None:
    """The script of plotly that draws some kinds of traces: the small one, which gtpin has, or that of the package plotly.

    None where the package (the extra ``plots``) is needed and not installed.
    """
    if kinds <= BASIC:
        return Markup(files("gtpin.report").joinpath("plotly_basic", "plotly-basic.min.js").read_text("utf-8"))
    if not has_plotly():
        return None
    from plotly.offline import get_plotlyjs

    return Markup(get_plotlyjs())


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    found = Environment(
        loader=PackageLoader("gtpin.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.globals.update(light=LIGHT, dark=DARK)
    found.filters["typeset"] = lambda cell: cell if isinstance(cell, Markup) else typeset(str(cell))
    return found


def versions() -> list[list[str]]:
    """Name and version of gtpin, of the packages that it computes with, and of Python.

    The version of Pinocchio is that of its module, because the distribution is called ``pin`` on PyPI and can have another name
    elsewhere.
    """
    packages = [[name, version(name)] for name in ("numpy", "scipy")]
    return [["gtpin", version("gtpin")], ["pin", pin.__version__], *packages, ["Python", platform.python_version()]]


def provenance(dataset: Dataset | None, robot: Chain, seed: int | None = None) -> Table:
    """Versions, seed and sha256 of the dataset's files and of the robot's URDF.

    A dataset that was not read from files is identified by the digests of the files that `Dataset.write` makes, so that it can
    be compared with a folder.
    """
    rows = versions()
    if seed is not None:
        rows.append(["seed", str(seed)])
    rows.append(["robot", robot.name])
    rows.append([Path(robot.description.source).name, f"sha256 {digest(robot.description.xml.encode())}"])
    if dataset is not None and dataset.path is None:
        where = "handed over in memory, not read from files; written as a folder, its files have these digests:"
        rows.append(["dataset", where])
        with tempfile.TemporaryDirectory() as folder:
            dataset.write(Path(folder) / "dataset")
            rows += _digests(sorted(f for f in (Path(folder) / "dataset").iterdir() if f.name != MARKER))
    elif dataset is not None and dataset.path is not None:
        carts = dataset.carts.file if dataset.carts is not None else None
        rows += _digests([dataset.path / "dataset.toml", *dataset.readings.files, carts])
    return Table(("what", "which"), rows)


def _digests(files: Iterable[Path | None]) -> list[list[str]]:
    return [[file.name, f"sha256 {digest(file.read_bytes())}"] for file in files if file is not None and file.is_file()]


def digest(content: bytes) -> str:
    """A content's sha256."""
    return hashlib.sha256(content).hexdigest()
