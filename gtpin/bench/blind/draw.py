"""Draws the cases of a check: the kinds in fixed shares, everything else at random."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gtpin.bench.blind.left_out_touches import ONE_IN, LeftOut, jitter
from gtpin.bench.blind.truth import Kind, TrueEffect, TrueNoise, TruePoses, TrueReadings, Truth
from gtpin.bench.simulator.build import build, known_robot
from gtpin.bench.simulator.case import bulk_recipe, drawn_recipe
from gtpin.bench.simulator.causes.kinds import listed as listed_kinds
from gtpin.bench.simulator.causes.kinds import unlisted as unlisted_kinds
from gtpin.bench.simulator.instruments.build import build_measured
from gtpin.bench.simulator.instruments.choice import TOUCHED
from gtpin.bench.simulator.recipe import Noise, Recipe
from gtpin.bench.simulator.truth import Case, InstrumentCase
from gtpin.typing import Floats

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
POWER_ENERGY = (2.0, 250.0)
"""Numbers of poses, and range of energies (uniform in the logarithm), of the cases of kind `power`."""
GOLDEN = (5**0.5 - 1) / 2
"""Golden ratio: multiples of it, modulo 1, are spread evenly over 0 to 1 for any number of multiples."""


@dataclass(frozen=True)
class Draft:
    """A case to be made: kind, seed of the plant, effects (sites are drawn), number of poses if fixed, robot, instruments."""

    name: str
    kind: Kind
    seed: int
    effects: tuple[str, ...] = ()
    poses: int | None = None
    robot: str = ROBOT
    instruments: tuple[str, ...] = ()


def drafts(cases: int, seed: int, robot: str = ROBOT, instruments: tuple[str, ...] = ()) -> Iterator[Draft]:
    """The cases of a check; a larger check of the same seed begins with the cases of a smaller one.

    Kinds have their shares in any sequence of cases. Single effects are used in turn, so that each has about as many cases.
    The plant draws sites, energies, poses, measurement conditions and the effects' shapes. Effects are those that the
    robot's parts can have.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 0]))
    parts = known_robot(robot)
    listed, unlisted = ([kind.name for kind in kinds(parts)] for kinds in (listed_kinds, unlisted_kinds))
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
        yield Draft(
            f"case{number:05d}", kind, int(own.integers(2**31)), tuple(map(str, effects)), poses, robot, instruments
        )


def made(draft: Draft) -> Case:
    """Make a case by the plant, measured by a tracker."""
    return build(recipe(draft))


def measured(draft: Draft) -> InstrumentCase:
    """Make a case by the plant, measured by the draft's instruments."""
    return build_measured(recipe(draft), draft.instruments)


def recipe(draft: Draft) -> Recipe:
    """The recipe from which the plant makes a case. Where only touching instruments measure, touches are added for those that
    :func:`~gtpin.bench.blind.left_out_touches.without_some_touches` leaves out.
    """
    found = _recipe(draft)
    if draft.instruments and set(draft.instruments) <= set(TOUCHED):
        return replace(found, poses=found.poses + found.poses // (ONE_IN - 1))
    return found


def _recipe(draft: Draft) -> Recipe:
    if draft.kind == "rough":
        return bulk_recipe(draft.seed, rough=True, robot=draft.robot)
    energy = POWER_ENERGY if draft.kind == "power" else None
    effects = [(name, None) for name in draft.effects]
    return drawn_recipe(draft.seed, effects=effects, poses=draft.poses, energy=energy, robot=draft.robot)


def truth_of(case: Case | InstrumentCase, kind: Kind, left_out: Sequence[LeftOut] = ()) -> Truth:
    """The truth of a case, to be sealed.

    Where other instruments than a tracker alone measured, it has true readings in place of true poses, because readings alone
    do not determine where the base is. ``left_out`` are the touches that are not in the case.
    """
    noise = Noise()
    alone = isinstance(case, Case) or [gauge.name for gauge in case.gauges] == ["tracker"]
    sigma = (noise.position_sigma,) * 3 + (noise.orientation_sigma,) * 3
    return Truth(
        kind=kind,
        effects=tuple(
            TrueEffect(
                effect=t.effect,
                site=t.site,
                energy=t.energy,
                amplitude=t.amplitude,
                displacement=tuple(map(tuple, t.displacement.tolist())),
            )
            for t in case.effects
        ),
        poses=TruePoses(
            pose=tuple(case.commands.pose.tolist()),
            position=tuple(map(tuple, case.truth.T.tolist())),
            orientation=tuple(map(tuple, case.truth.quaternions.tolist())),
        )
        if alone
        else None,
        readings=() if isinstance(case, Case) or alone else true_readings(case, left_out),
        sigma=sigma if isinstance(case, Case) else None,
        noise=() if isinstance(case, Case) or case.recipe is None else true_noise(case),
    )


def true_readings(case: InstrumentCase, left_out: Sequence[LeftOut]) -> tuple[TrueReadings, ...]:
    """Readings without noise: at the held-out commands; for touching instruments, at the touches that were left out."""
    touches = {one.name: (one.values, one.sigma) for one in left_out}
    return tuple(
        TrueReadings(name=name, values=_rows(values), sigma=_rows(sigma))
        for name, (values, sigma) in {**case.held, **touches}.items()
    )


def true_noise(case: InstrumentCase) -> tuple[TrueNoise, ...]:
    """The noise of every number in the instruments' tables: the instrument's own, and that of the machine's repeatability.

    E is computed with this noise.
    """
    moves, found = jitter(case), []
    for gauge in case.gauges:
        scattered = gauge.scattered(gauge.by_motion(case.true[gauge.stop]), moves[gauge.stop])
        found.append(TrueNoise(name=gauge.name, sigma=_rows(scattered)))
    return tuple(found)


def _rows(values: Floats) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, values.tolist()))
