"""A decision held against what left-out poses and the rows of the data show."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from gtpin.data import Dataset
from gtpin.diagnosis.hypotheses.hypothesis_set import Pool
from gtpin.diagnosis.inference.decide import Decision
from gtpin.diagnosis.inference.noise import left_over
from gtpin.diagnosis.inference.two_groups import two_groups
from gtpin.diagnosis.inference.unexplained import marginal_chance
from gtpin.diagnosis.linear.cross_validation import Gap
from gtpin.diagnosis.result import Considered
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.situation import Situation
from gtpin.errors import warn

SILENT, NAMED = 1.25, 2.0
"""Held-out position error with the causes in over the noise floor, from which the verdict is ``unknown``, where no cause and
where some are named. A stated assumption, well above what right verdicts leave (docs/diagnosis.md, measured by
examples/diagnosis/noise_floor.py); causes that depart from their forms leave more as they get stronger."""
USUAL = (1.5e-5, 5e-5)
"""Noise of a laser tracker, m and rad, by which positions are weighed against orientations where none is declared."""
SCATTERS = 0.5
"""Repeatability over the instrument's sigma from which something may well hide in it: a stated assumption."""
SHOWN = 8
"""Lines of rows that a message lists."""
CHANCE = 1e-6
"""Chance of so large a chi-square from noise alone that must be undercut as well."""
_MOVES = re.compile(r"(approach|speed)[0-9]+")


def held_out(found: Decision, pool: Pool, whole: Gap, dataset: Dataset) -> Decision:
    """The decision; ``unknown`` where left-out poses are much farther off than noise, or rows are of two measurements.

    Parameters
    ----------
    whole
        The gap on left-out poses with all causes.
    dataset
        The rows that were searched.

    Warns
    -----
    GtpinWarning
        Of two groups of rows, with their lines.
    """
    most = SILENT if found.verdict == "none" else NAMED
    if found.verdict == "unknown":
        return found
    if whole.after > most * whole.floor and marginal_chance(pool, found.named) <= CHANCE:
        return replace(found, verdict="unknown", unknown=1.0)
    return _of_one_measurement(found, pool, dataset)


def scatter_may_hide(
    found: Decision, repeatability: float, sigma: float, untestable: Iterable[Considered], at: Situation
) -> tuple[tuple[str, str], ...]:
    """Effects and sites that differ between visits, and lack columns that were recorded but contradict the others.

    Where nothing was found and visits scatter by more than the instrument, that scatter is as likely theirs as the drives':
    ``none`` would say that somebody looked.
    """
    if found.verdict != "none" or repeatability <= SCATTERS * sigma:
        return ()
    effects = effects_by_id()
    return tuple(
        (row.effect, row.site)
        for row in untestable
        if any(_MOVES.fullmatch(n) and n in at.unusable for n in effects[row.effect].covariates(at.robot, row.site))
    )


def _of_one_measurement(found: Decision, pool: Pool, dataset: Dataset) -> Decision:
    """The verdict ``unknown`` where what passes for noise are two groups of rows, with a warning that names them."""
    instrument = dataset.instrument
    sigma = (instrument.position_sigma or USUAL[0], instrument.orientation_sigma or USUAL[1])
    groups = two_groups(pool.design, left_over(pool, found.named)[0], sigma)
    if groups is None:
        return found
    lines = np.sort(dataset.row[groups.smaller])
    shown = ", ".join(str(line) for line in lines[:SHOWN])
    warn(
        f"the rows fall into two groups that differ by one motion of {1e3 * groups.apart:.2g} mm: {len(lines)} rows "
        f"({shown}, ...) against {len(groups.smaller) - len(lines)}: two machines, two set-ups of the instrument, a zero that "
        "moved, or play whose direction of approach was not recorded; give each group its session"
    )
    return replace(found, verdict="unknown", unknown=1.0)
