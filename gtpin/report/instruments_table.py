"""Tables of the instruments: errors of their readings, and their identified unknowns."""

from __future__ import annotations

import numpy as np

from gtpin.calibration.result import Calibration
from gtpin.diagnosis.linear.cross_validation import Gap
from gtpin.model.model import Model
from gtpin.report.page import Table
from gtpin.report.words import quantity, whole

NOTHING = Table((), [])


def fit_table(c: Calibration) -> Table:
    """Errors of each instrument's fitted readings; empty for a tracker without a name."""
    rows = [
        [b.name, b.kind, str(b.readings), *(quantity(v, b.unit) for v in (b.before, b.after, b.floor))]
        for b in c.by_instrument
        if b.name
    ]
    if not rows:
        return NOTHING
    return Table(("instrument", "kind", "readings", "error, nominal", "calibrated", "noise alone"), rows)


def gap_table(gap: Gap) -> Table:
    """Errors of each instrument's left-out readings; empty for one tracker."""
    rows = [[b.name, b.kind, *(quantity(v, b.unit) for v in (b.before, b.after, b.floor))] for b in gap.by_instrument]
    return Table(("instrument", "kind", "error, left-out readings", "with the causes", "noise alone"), rows)


def unknowns_table(model: Model, c: Calibration) -> Table:
    """The instruments' unknowns, identified together with a model; empty where there are none."""
    if not c.unknowns:
        return NOTHING
    values = {name: value for one in model.instruments for name, value in one.unknowns.items()}
    rows = []
    for one in c.unknowns:
        sigma = c.unknown(one.name).sigma
        value = one.nominal + values.get(one.name, 0.0)
        prior = quantity(one.sigma, one.unit) if np.isfinite(one.sigma) else "none"
        rows.append([one.name, whole(f"{value:.6f} {one.unit}"), quantity(sigma, one.unit), prior])
    return Table(("unknown", "value", "sigma, calibrated", "prior sigma"), rows)
