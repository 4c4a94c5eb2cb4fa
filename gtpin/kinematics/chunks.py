"""Rows in chunks: computations that are independent for each pose are made for a few thousand poses at a time."""

from __future__ import annotations

CHUNK = 4096
"""Number of poses in a chunk: large enough that the loop takes little time, small enough for a processor's cache."""


def chunks(count: int) -> list[slice]:
    """Slices of at most ``CHUNK`` rows that cover ``count`` rows in order."""
    return [slice(i, min(i + CHUNK, count)) for i in range(0, count, CHUNK)]
