"""Draws the cases of a check: the kinds in fixed shares, everything else at random."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

import numpy as np

from gtpin.bench.blind.truth import Kind, Truth
from gtpin.bench.simulator.build import build, known_robot
from gtpin.bench.simulator.case import bulk_recipe, drawn_recipe
from gtpin.bench.simulator.causes.kinds import listed as listed_kinds
from gtpin.bench.simulator.causes.kinds import unlisted as unlisted_kinds
from gtpin.bench.simulator.instruments.build import ONE_IN, build_measured
from gtpin.bench.simulator.instruments.touch import TOUCHED
from gtpin.bench.simulator.recipe import Recipe, SimulatedNoise
from gtpin.bench.simulator.truth import Case, InstrumentCase

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
    """The recipe of a case. Where only touching instruments measure, touches are added for those that are left out."""
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
    """Make a case by the simulator, measured by the draft's instruments with some touches left out, or by a tracker."""
    if draft.instruments:
        return build_measured(recipe(draft), draft.instruments, leave_out=True)
    return build(recipe(draft))


def truth_of(case: Case | InstrumentCase, kind: Kind) -> Truth:
    """The truth of a case, to be sealed.

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
        held = case.held.items()
        truth["readings"] = [{"name": name, "values": z.tolist(), "sigma": s.tolist()} for name, (z, s) in held]
    if case.recipe is not None:
        moves, noise = case.machine.command_jacobian(case.dataset.q, case.true) * case.repeatability, []
        for gauge in case.gauges:
            sigma = gauge.scattered(gauge.by_motion(case.true[gauge.stop]), moves[gauge.stop])
            noise.append({"name": gauge.name, "sigma": sigma.tolist()})
        truth["noise"] = noise
    return Truth.model_validate(truth)
