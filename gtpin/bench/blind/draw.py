"""Draws the cases of a check: the kinds in fixed shares, everything else at random; and leaves some touches out of them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gtpin.bench.blind.truth import Kind, Truth
from gtpin.bench.simulator.build import build, known_robot
from gtpin.bench.simulator.case import bulk_recipe, drawn_recipe
from gtpin.bench.simulator.causes.kinds import listed as listed_kinds
from gtpin.bench.simulator.causes.kinds import unlisted as unlisted_kinds
from gtpin.bench.simulator.instruments.build import build_measured
from gtpin.bench.simulator.instruments.gauge import Gauge
from gtpin.bench.simulator.instruments.touch import TOUCHED
from gtpin.bench.simulator.noncentrality import Past
from gtpin.bench.simulator.recipe import Recipe, SimulatedNoise
from gtpin.bench.simulator.truth import Case, InstrumentCase
from gtpin.data.files import write_table
from gtpin.data.table import Column
from gtpin.typing import Floats, Ints

ONE_IN = 6
"""One in this many of an instrument's touches is left out, at random."""


@dataclass(frozen=True, eq=False)
class LeftOutTouches:
    """M touches of an instrument that are not in its table."""

    name: str  # Name of the instrument
    columns: dict[str, Column]  # Ids, commands, covariates and what is touched, as in a table
    # (M, c) distance of the target from what it touches, of a machine that returns exactly to its commands (no model
    # predicts the scatter of its repeatability), and the noise of the touch, m
    values: Floats
    sigma: Floats

    def write(self, folder: Path) -> None:
        """Write ``commands-NAME.csv`` into a dataset's folder."""
        write_table(folder / f"commands-{self.name}.csv", self.columns)


def without_some_touches(case: InstrumentCase) -> tuple[InstrumentCase, tuple[LeftOutTouches, ...]]:
    """A case without some touches, and these touches. E is computed again for the remaining rows.

    No touch is left out where an encoder measures too: the displacements of its joint are not known here, so E can't be
    computed again.
    """
    if case.recipe is None or case.true.joints or not any(gauge.touches for gauge in case.gauges):
        return case, ()
    data = case.dataset
    found, gauges, every = [], list[Gauge](), []
    for gauge in case.gauges:
        kept = np.ones(len(gauge.stop), dtype=bool)
        if gauge.touches:
            rng = np.random.default_rng(np.random.SeedSequence([case.recipe.seed, 9, *gauge.name.encode()]))
            kept[rng.permutation(len(kept))[: len(kept) // ONE_IN]] = False
            out = gauge.take(~kept)
            values = out.readings(case.steady[out.stop], out.truth)
            found.append(LeftOutTouches(gauge.name, data.table(out), values, out.sigma))
        gauges.append(gauge.take(kept))
        every.append(kept)
    effects = tuple(replace(effect, displacement=effect.displacement[np.concatenate(every)]) for effect in case.effects)
    fewer = replace(case, dataset=replace(data, read=tuple(gauges)), effects=effects)
    used, rows = stops(fewer), np.concatenate([gauge.stop for gauge in gauges])
    here = [replace(gauge, stop=np.searchsorted(used, gauge.stop)) for gauge in gauges]
    by_tolerance = case.machine.by_tolerance(data.q[used], case.true[used])
    past, again = Past.of_readings(here, case.true[used], by_tolerance, jitter(fewer)[used]), []
    for effect in effects:
        at_stops = np.zeros((len(data.q), 6))
        at_stops[rows] = effect.displacement
        again.append(replace(effect, noncentrality=past.noncentrality(at_stops[used])))
    return replace(fewer, effects=tuple(sorted(again, key=lambda effect: -effect.noncentrality))), tuple(found)


def jitter(case: InstrumentCase) -> Floats:
    """(N, 6 + k, n) motions of the poses at stops, and of k joints, by 1 sigma of each actuator's repeatability, m and rad.

    NaN at stops at which no instrument measures.
    """
    used = stops(case)
    by_command = case.machine.command_jacobian(case.dataset.q[used], case.true[used])
    found = np.full((len(case.dataset.q), *by_command.shape[1:]), np.nan)
    found[used] = by_command * case.repeatability
    return found


def stops(case: InstrumentCase) -> Ints:
    """Indices of the stops at which an instrument measures."""
    return np.unique(np.concatenate([gauge.stop for gauge in case.gauges]))


ROBOT = "gantry_tau"
SHARES: dict[Kind, float] = {
    "one": 0.46,
    "none": 0.11,
    "unlisted": 0.09,
    "two": 0.10,
    "three": 0.03,
    "known_and_unlisted": 0.04,
    "rough": 0.08,
    "power": 0.09,
}
"""Share of each kind of case."""
POWER_POSES = (60, 120, 240)
POWER_NONCENTRALITY = (2.0, 250.0)
"""Numbers of poses, and range of energies (uniform in the logarithm), of the cases of kind `power`."""
GOLDEN = (5**0.5 - 1) / 2
"""Golden ratio: multiples of it, modulo 1, are spread evenly over 0 to 1 for any number of multiples."""


@dataclass(frozen=True)
class Draft:
    """A case to be made: kind, seed, effects (sites are drawn), number of poses if fixed, robot, instruments."""

    name: str
    kind: Kind
    seed: int
    effects: tuple[str, ...] = ()
    poses: int | None = None
    robot: str = ROBOT
    instruments: tuple[str, ...] = ()


def drafts(
    cases: int, seed: int, robot: str = ROBOT, instruments: tuple[str, ...] = (), *, without: Collection[str] = ()
) -> Iterator[Draft]:
    """The cases of a check; a larger check of the same seed begins with the cases of a smaller one.

    Kinds have their shares in any sequence of cases. Single effects are used in turn, so that each has about as many cases.
    The simulator draws sites, energies, poses, measurement conditions and the effects' shapes. Effects are those that the
    robot's parts can have, less those named in ``without``: effects that are newer than a published set.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 0]))
    parts = known_robot(robot)
    listed, unlisted = (
        [kind.name for kind in kinds(parts) if kind.name not in without] for kinds in (listed_kinds, unlisted_kinds)
    )
    edges = np.cumsum(list(SHARES.values()))
    start = rng.random()
    turns: dict[Kind, list[str]] = {
        "one": list(rng.permutation(listed)),
        "power": list(rng.permutation(listed)),
        "unlisted": list(rng.permutation(unlisted)),
    }
    count = dict.fromkeys(SHARES, 0)
    for number in range(cases):
        at = (start + number * GOLDEN) % 1.0 * edges[-1]
        kind = list(SHARES)[int(np.searchsorted(edges, at, side="right"))]
        own = np.random.default_rng(np.random.SeedSequence([seed, 1, number]))
        effects: tuple[str, ...] = ()
        if kind in turns:
            effects = (turns[kind][count[kind] % len(turns[kind])],)
        elif kind in ("two", "three"):
            effects = tuple(own.choice(listed, 2 if kind == "two" else 3, replace=False))
        elif kind == "known_and_unlisted":
            effects = (str(own.choice(listed)), str(own.choice(unlisted)))
        poses = POWER_POSES[count[kind] % len(POWER_POSES)] if kind == "power" else None
        count[kind] += 1
        named = tuple(map(str, effects))
        yield Draft(f"case{number:05d}", kind, int(own.integers(2**31)), named, poses, robot, instruments)


def recipe(draft: Draft) -> Recipe:
    """The recipe of a case. Where only touching instruments measure, touches are added for those that
    :func:`~gtpin.bench.blind.draw.without_some_touches` leaves out.
    """
    if draft.kind == "rough":
        found = bulk_recipe(draft.seed, rough=True, robot=draft.robot)
    else:
        effects = [(name, None) for name in draft.effects]
        energy = POWER_NONCENTRALITY if draft.kind == "power" else None
        found = drawn_recipe(draft.seed, effects=effects, poses=draft.poses, noncentrality=energy, robot=draft.robot)
    if draft.instruments and set(draft.instruments) <= set(TOUCHED):
        return replace(found, poses=found.poses + found.poses // (ONE_IN - 1))
    return found


def made(draft: Draft) -> Case | InstrumentCase:
    """Make a case by the simulator, measured by the draft's instruments, or by a tracker."""
    return build_measured(recipe(draft), draft.instruments) if draft.instruments else build(recipe(draft))


def written(draft: Draft, place: Path) -> tuple[Case | InstrumentCase, Truth]:
    """Make a case and write its dataset, its commands and the touches that are left out to a folder."""
    case, left_out = made(draft), tuple[LeftOutTouches, ...]()
    if isinstance(case, InstrumentCase):
        case, left_out = without_some_touches(case)
    case.write_dataset(place)
    for touches in left_out:
        touches.write(place)
    return case, truth_of(case, draft.kind, left_out)


def truth_of(case: Case | InstrumentCase, kind: Kind, left_out: Sequence[LeftOutTouches] = ()) -> Truth:
    """The truth of a case, to be sealed; ``left_out`` are the touches that are not in the case.

    Where other instruments than a tracker alone measured, it has true readings in place of true poses, because readings alone
    do not determine where the base is: at the held-out commands, for touching instruments at the touches that were left out. It
    also has the noise of every number in the instruments' tables, their own and that of the machine's repeatability, with which
    E is computed.
    """
    effects = [vars(e) | {"energy": e.noncentrality, "displacement": e.displacement.tolist()} for e in case.effects]
    truth: dict[str, object] = {"kind": kind, "effects": effects}
    if isinstance(case, Case) or [gauge.name for gauge in case.gauges] == ["tracker"]:
        poses = {"position": case.truth.T.tolist(), "orientation": case.truth.quaternions.tolist()}
        truth["poses"] = {"pose": case.commands.pose.tolist(), **poses}
    if isinstance(case, Case):
        usual = SimulatedNoise()
        truth["sigma"] = (usual.position_sigma,) * 3 + (usual.orientation_sigma,) * 3
        return Truth.model_validate(truth)
    if "poses" not in truth:
        held = case.held | {one.name: (one.values, one.sigma) for one in left_out}
        truth["readings"] = [{"name": name, "values": z.tolist(), "sigma": s.tolist()} for name, (z, s) in held.items()]
    if case.recipe is not None:
        moves, noise = jitter(case), []
        for gauge in case.gauges:
            sigma = gauge.scattered(gauge.by_motion(case.true[gauge.stop]), moves[gauge.stop])
            noise.append({"name": gauge.name, "sigma": sigma.tolist()})
        truth["noise"] = noise
    return Truth.model_validate(truth)
