"""Figures of matplotlib, which the extra ``plots`` brings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from gtpin.errors import GtpinError, warn

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of a size in inches.

    Raises `GtpinError` if matplotlib is not there.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise GtpinError("figures need matplotlib", hint="pip install 'gtpin[plots]'") from None
    return Figure(figsize=(width, height), layout="constrained", dpi=120)


def write_figures(figures: Callable[[], Mapping[str, Figure]], folder: Path) -> None:
    """Make figures by name, and write each as ``NAME.png``.

    Warns: if matplotlib is missing: there are no figures then.
    """
    try:
        made = figures()
    except GtpinError as error:
        warn(f"no figures: {error}")
        return
    for name, figure in made.items():
        figure.savefig(folder / f"{name}.png", metadata={"Software": None})
