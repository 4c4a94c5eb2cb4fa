"""One number of a certificate, or why there is none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Missing = Literal[
    "few_cycles",
    "few_visits",
    "few_targets",
    "within_noise",
    "no_orientation",
    "no_approach",
    "free_target",
    "too_many_drives",
    "known_in_mean",
    "fitted_poses",
    "not_declared",
    "not_stated",
]
"""Why a number is blank; in words: ``WHY`` in ``gtpin/extras/certificate/terms.py``."""


@dataclass(frozen=True)
class Quantity:
    """A number of a certificate.

    Parameters
    ----------
    symbol
        Its key among the definitions: ``AP_p``, ``RP_l``, ``B``, ...
    value, sigma
        The value and its standard uncertainty, both in ``unit``; None where not known.
    unit
        ``m`` or ``rad``.
    poses, rows
        Number of different poses, and of measurements, from which it is computed.
    missing
        Why ``value`` is None; None where there is a value.
    site
        The actuator; empty for the TCP.
    have
        Where ``missing`` says that the data have too few of something: how many they have (``few_cycles``: visits to the pose
        with most visits; ``few_targets``: targets of the longest line).
    """

    symbol: str
    value: float | None
    unit: str
    sigma: float | None = None
    poses: int = 0
    rows: int = 0
    missing: Missing | None = None
    site: str = ""
    have: int = 0


def blank(symbol: str, unit: str, missing: Missing, *, site: str = "", have: int = 0) -> Quantity:
    """A quantity without a value, and the reason for it."""
    return Quantity(symbol, None, unit, missing=missing, site=site, have=have)
