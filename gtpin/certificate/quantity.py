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
    "no_effects",
    "frame_is_base",
]
"""Why a number is blank:

``few_cycles``
    No pose was visited as often as ISO 9283 requires.
``few_visits``
    Too few repeated visits to estimate a scatter.
``few_targets``
    Not enough targets on a line, each approached often enough from both sides, as ISO 230-2 requires.
``within_noise``
    The scatter is no larger than the instrument's own noise.
``no_orientation``
    Orientation was not measured.
``no_approach``
    The directions of approach were not recorded, or were all the same.
``free_target``
    The position of the target on the platform is not known, so that the uncorrected machine's error is not known either.
``too_many_drives``
    The measured components of a pose do not determine the travel of each actuator.
``known_in_mean``
    Errors at left-out poses are known as a mean square only.
``fitted_poses``
    The model was fitted to these poses.
``not_declared``
    The instrument's noise was not declared, so that the machine's scatter is not known by itself.
``not_stated``
    The user has not stated the instrument's uncertainty.
``no_effects``
    The model has no effects.
``frame_is_base``
    The instrument measures in the base frame.
"""


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
