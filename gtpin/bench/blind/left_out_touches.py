"""Touches that are left out of a case's dataset, to compare predictions of models with the truth.

Held-out commands all over the workspace can't be used: no instrument touches there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gtpin.bench.simulator.energy import Past
from gtpin.bench.simulator.instruments.gauge import Gauge
from gtpin.bench.simulator.truth import InstrumentCase, Read, Truth
from gtpin.data.files import write_table
from gtpin.data.ids import Ids
from gtpin.data.table import Column
from gtpin.typing import Floats

Rows = npt.NDArray[np.bool_]

ONE_IN = 6
"""One in this many of an instrument's touches is left out, at random."""


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Touches of an instrument that are not in its table."""

    name: str  # Name of the instrument
    # `pose`, `q`, `columns`: (M,) ids, (M, n) commands, m or rad, and by name the (M,) covariates and ids of what is
    # touched, as in a table
    pose: Ids
    q: Floats
    columns: dict[str, Column]
    # `values`, `sigma`: (M, c) distance of the target from what it touches, without the noise of the touch, and this
    # noise, m. ``values`` are those of a machine that returns exactly to its commands: no model predicts the scatter
    # of its repeatability.
    values: Floats
    sigma: Floats

    def write(self, folder: Path) -> None:
        """Write ``commands-NAME.csv`` into a dataset's folder."""
        commands: dict[str, Column] = {f"q{i + 1}": values for i, values in enumerate(self.q.T)}
        write_table(folder / f"commands-{self.name}.csv", {"pose": self.pose, **commands, **self.columns})


def without_some_touches(case: InstrumentCase) -> tuple[InstrumentCase, tuple[LeftOut, ...]]:
    """A case without some touches, and these touches. E is computed again for the remaining rows.

    No touch is left out where an encoder measures too: the displacements of its joint are not known here, so E can't be
    computed again.
    """
    if case.recipe is None or case.true.joints or not any(gauge.touches for gauge in case.gauges):
        return case, ()
    kept = [_kept(gauge, case.recipe.seed) for gauge in case.gauges]
    found = tuple(
        _left_out(case, gauge, read, ~rows)
        for gauge, read, rows in zip(case.gauges, case.dataset.read, kept, strict=True)
        if gauge.touches
    )
    gauges = tuple(gauge.kept(rows) for gauge, rows in zip(case.gauges, kept, strict=True))
    tables = tuple(
        Read(read.described, read.stop[rows], {name: values[rows] for name, values in read.columns.items()})
        for read, rows in zip(case.dataset.read, kept, strict=True)
    )
    effects = tuple(replace(effect, displacement=effect.displacement[np.concatenate(kept)]) for effect in case.effects)
    fewer = replace(case, gauges=gauges, dataset=replace(case.dataset, read=tables), effects=effects)
    return replace(fewer, effects=_measured_again(fewer)), found


def _kept(gauge: Gauge, seed: int) -> Rows:
    kept = np.ones(len(gauge.stop), dtype=bool)
    if gauge.touches:
        rng = np.random.default_rng(np.random.SeedSequence([seed, 9, *gauge.name.encode()]))
        kept[rng.permutation(len(kept))[: len(kept) // ONE_IN]] = False
    return kept


def _left_out(case: InstrumentCase, gauge: Gauge, read: Read, rows: Rows) -> LeftOut:
    own, data = gauge.kept(rows), case.dataset
    columns = {name: values[rows] for name, values in read.columns.items()}
    columns |= {name: values[own.stop] for name, values in data.covariates.items()}
    values = own.readings(case.steady[own.stop], own.truth)
    return LeftOut(gauge.name, data.pose[own.stop], data.q[own.stop], columns, values, own.sigma)


def _measured_again(case: InstrumentCase) -> tuple[Truth, ...]:
    """The effects of a case with E computed as by the simulator, for the rows that the case has; the largest E first."""
    used, rows = stops(case), np.concatenate([gauge.stop for gauge in case.gauges])
    gauges = [replace(gauge, stop=np.searchsorted(used, gauge.stop)) for gauge in case.gauges]
    poses = case.true[used]
    by_tolerance = case.machine.by_tolerance(case.dataset.q[used], poses)
    past = Past.of_readings(gauges, poses, by_tolerance, jitter(case)[used])
    found = []
    for effect in case.effects:
        at_stops = np.zeros((len(case.dataset.q), 6))
        at_stops[rows] = effect.displacement
        found.append(replace(effect, energy=past.energy(at_stops[used])))
    return tuple(sorted(found, key=lambda effect: -effect.energy))


def jitter(case: InstrumentCase) -> Floats:
    """(N, 6 + k, n) motions of the poses at stops, and of k joints, by 1 sigma of each actuator's repeatability, m and rad.

    NaN at stops at which no instrument measures.
    """
    used = stops(case)
    by_command = case.machine.command_jacobian(case.dataset.q[used], case.true[used])
    found = np.full((len(case.dataset.q), *by_command.shape[1:]), np.nan)
    found[used] = by_command * case.repeatability
    return found


def stops(case: InstrumentCase) -> npt.NDArray[np.int_]:
    """Indices of the stops at which an instrument measures."""
    return np.unique(np.concatenate([gauge.stop for gauge in case.gauges]))
