"""Positioning of single actuators (ISO 230-2): targets on a line, approached several times from both sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.extras.certificate.quantity import Missing, Quantity, blank
from gtpin.typing import Floats

TARGETS, APPROACHES = 5, 5
"""Smallest numbers of targets on a line, and of approaches to each target from either side, that ISO 230-2 requires."""
DIGITS = 9
"""Commands that agree to this number of decimals, in m or rad, count as the same."""
SYMBOLS = ("B", "E", "R", "A")


@dataclass(frozen=True)
class MeasuredLine:
    """Targets (commanded positions) of one actuator, while the other actuators stand still.

    ``deviations``: for each target: deviations of the travel from the command, m or rad, of visits approached towards
    larger commands, and of visits approached towards smaller commands.
    """

    deviations: tuple[tuple[Floats, Floats], ...]

    def evaluated(self) -> dict[str, float]:
        """Reversal B, systematic deviation E, repeatability R and accuracy A, m or rad, bidirectional, coverage factor 2."""
        mean = np.array([[d.mean() for d in both] for both in self.deviations])
        s = np.array([[d.std(ddof=1) for d in both] for both in self.deviations])
        reversal = np.abs(mean[:, 0] - mean[:, 1])
        repeat = np.max(np.column_stack([2.0 * s.sum(axis=1) + reversal, 4.0 * s[:, 0], 4.0 * s[:, 1]]), axis=1)
        return {
            "B": float(reversal.max()),
            "E": float(mean.max() - mean.min()),
            "R": float(repeat.max()),
            "A": float((mean + 2.0 * s).max() - (mean - 2.0 * s).min()),
        }

    @property
    def rows(self) -> int:
        """Number of measurements."""
        return sum(len(d) for both in self.deviations for d in both)

    def doubt(self) -> float:
        """Standard uncertainty of the difference of two means, m or rad: that of B at one target, and nearly that of E."""
        power = [d.var(ddof=1) / len(d) for both in self.deviations for d in both]
        return float(np.sqrt(2.0 * np.mean(power)))


def positioning(
    q: Floats, deviations: Floats | None, approach: Floats | None, sites: tuple[str, ...], units: tuple[str, ...]
) -> list[Quantity]:
    """B, E, R and A of each actuator; blank where it has no line with enough targets.

    ``q``: (N, n) commands, m or rad. ``deviations``: (N, n) deviations of each actuator's travel, m or rad, computed from
    the measured TCP; None where not determined. ``approach``: (N, n) directions of approach (+1 or -1); None where not
    recorded. ``sites``, ``units``: names and units of the n actuators.
    """
    found = []
    for i, (site, unit) in enumerate(zip(sites, units, strict=True)):
        lacking: Missing | None = None
        if deviations is None:
            lacking = "too_many_drives"
        elif approach is None or len(np.unique(approach[:, i])) < 2:
            lacking = "no_approach"
        line, have = (None, 0) if deviations is None or approach is None else longest_line(q, deviations, approach, i)
        if line is None:
            found += [blank(symbol, unit, lacking or "few_targets", site=site, have=have) for symbol in SYMBOLS]
            continue
        sigma = line.doubt()
        found += [
            Quantity(symbol, value, unit, sigma if symbol in "BE" else None, len(line.deviations), line.rows, site=site)
            for symbol, value in line.evaluated().items()
        ]
    return found


def longest_line(q: Floats, deviations: Floats, approach: Floats, i: int) -> tuple[MeasuredLine | None, int]:
    """The line of actuator i with the most targets that have enough visits, and the largest number of targets on one line, with
    any number of visits. The line is None where it has fewer than ``TARGETS`` targets."""
    others = np.round(np.delete(q, i, axis=1), DIGITS)
    _, line_of = np.unique(others, axis=0, return_inverse=True)
    best: tuple[tuple[Floats, Floats], ...] = ()
    have = 0
    for line in np.unique(line_of):
        rows = np.flatnonzero(line_of == line)
        at = np.round(q[rows, i], DIGITS)
        targets = np.unique(at)
        have = max(have, len(targets))
        sides = [
            (deviations[own[approach[own, i] > 0], i], deviations[own[approach[own, i] < 0], i])
            for own in (rows[at == target] for target in targets)
        ]
        enough = tuple(both for both in sides if min(map(len, both)) >= APPROACHES)
        best = max(best, enough, key=len)
    return (MeasuredLine(best) if len(best) >= TARGETS else None), have


def mean_reversal(
    deviations: Floats | None, approach: Floats | None, sites: tuple[str, ...], units: tuple[str, ...]
) -> list[Quantity]:
    """Mean reversal of each actuator over all poses: least squares of its deviations on the directions of approach of all
    actuators.

    ``deviations``: (N, n) deviations of each actuator's travel, m or rad, from a model without backlash; None where not
    determined. The others: as for :func:`positioning`.
    """
    symbol = "B_mean"
    if deviations is None or approach is None:
        reason: Missing = "too_many_drives" if deviations is None else "no_approach"
        return [blank(symbol, unit, reason, site=site) for site, unit in zip(sites, units, strict=True)]
    varied = [i for i in range(len(sites)) if min((approach[:, i] > 0).sum(), (approach[:, i] < 0).sum()) >= APPROACHES]
    X = np.column_stack([np.ones(len(approach)), approach[:, varied]])
    inverse = np.linalg.pinv(X.T @ X)
    found = []
    for i, (site, unit) in enumerate(zip(sites, units, strict=True)):
        if i not in varied or len(X) <= X.shape[1]:
            found.append(blank(symbol, unit, "no_approach", site=site))
            continue
        y, place = deviations[:, i], 1 + varied.index(i)
        beta = inverse @ (X.T @ y)
        power = float(((y - X @ beta) ** 2).sum()) / (len(X) - X.shape[1])
        sigma = 2.0 * float(np.sqrt(power * inverse[place, place]))
        found.append(Quantity(symbol, 2.0 * float(beta[place]), unit, sigma, len(X), len(X), site=site))
    return found
