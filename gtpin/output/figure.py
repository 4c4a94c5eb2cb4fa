"""An empty figure of matplotlib, which the extra ``plots`` brings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gtpin.errors import GtpinError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of a size in inches.

    Raises
    ------
    GtpinError
        If matplotlib is not there.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise GtpinError("figures need matplotlib", hint="pip install 'gtpin[plots]'") from None
    return Figure(figsize=(width, height), layout="constrained", dpi=120)
