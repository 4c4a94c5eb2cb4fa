"""A comparison of the paper's models as plain text."""

from __future__ import annotations

from gtpin.comparison.result import Comparison


def comparison_text(comparison: Comparison) -> str:
    """Position errors of each model on held-out poses."""
    lines = ["model   mean (95 %)          max     rms    um, held-out position error"]
    for row, interval in zip(comparison.table().itertuples(), comparison.intervals(), strict=True):
        low, high = interval["mean_um"] or (float("nan"), float("nan"))
        mean = f"{row.model:>5}   {row.mean_um:5.0f} ({low:.0f} .. {high:.0f})"
        lines.append(f"{mean:<28}{row.max_um:6.0f}  {row.rms_um:6.0f}")
    return "\n".join(lines)
