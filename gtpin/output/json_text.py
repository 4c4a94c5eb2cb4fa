"""Results as JSON, in which every number is finite."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator

from gtpin.errors import GtpinError


def json_text(content: object) -> str:
    """A result as JSON, from which exactly the same floats are read.

    Raises `GtpinError` if a number in it is not finite: no result is written then. The message names its key.
    """
    try:
        return json.dumps(content, indent=1, allow_nan=False) + "\n"
    except ValueError:
        where = next(_not_finite(content, ""), "a key")
        what = f"the result has no finite number for {where}, so nothing is written"
        raise GtpinError(
            what, hint="look for extreme numbers in the input, and say what they were in a bug report"
        ) from None


def _not_finite(content: object, key: str) -> Iterator[str]:
    """Keys of numbers that are not finite, such as ``gap.interval.0``."""
    if isinstance(content, dict):
        for name, value in content.items():
            yield from _not_finite(value, f"{key}.{name}" if key else str(name))
    elif isinstance(content, list | tuple):
        for index, value in enumerate(content):
            yield from _not_finite(value, f"{key}.{index}")
    elif isinstance(content, float) and not math.isfinite(content):
        yield key
