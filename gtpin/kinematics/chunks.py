"""Rows in chunks: what is computed of each pose by itself needs memory for a few thousand of them at once."""

from __future__ import annotations

CHUNK = 4096
"""Poses that are worked on together: enough that the loop costs nothing, and few enough for a processor's cache."""


def chunks(count: int) -> list[slice]:
    """Slices of at most ``CHUNK`` rows that cover ``count`` rows in order."""
    return [slice(i, min(i + CHUNK, count)) for i in range(0, count, CHUNK)]
