"""How often a check of ten planned poses raises an alarm, where nothing and where something has changed: docs/health.md.

Machines of the plant are calibrated at 140 poses. Then ten poses are planned, and measured again on the same machine:
unchanged, with the zero of a drive shifted by 30 um, and with a backlash of 50 um. The plant's kinematics shares no code
with gtpin's.
``python examples/pages/refresh.py --measure health`` measures the table of the page again.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.stats import beta

import gtpin
from gtpin.bench.simulator import Case, make_case, measure_at
from gtpin.bench.simulator.recipe import SimulatedNoise
from gtpin.diagnosis.against import ALARM_DRAWS, chance, changes, threshold
from gtpin.diagnosis.diagnose import FALSE_ALARM
from gtpin.diagnosis.earlier import Earlier, usable
from gtpin.diagnosis.hypothesis import Scope
from gtpin.diagnosis.priors import PRIORS
from gtpin.effects.catalogue import catalogue

Floats = npt.NDArray[np.float64]

POSES, CHECK = 140, 10
SHIFT, BACKLASH = 3e-5, 5e-5
"""Shift of a zero, and reversal error of a backlash, m."""
UNCHANGED = 60
"""Checks of each unchanged machine, each with new noise."""
SEEDS = 1795500989
"""The machines' first seed: the clock's seconds when the table was measured last, so that nothing was ever tuned on them."""
FEWER = 4
KINDS = ("unchanged", "zero_shift", "backlash")
PLACES = ("robot", "free")


def jobs(machines: int) -> list[dict[str, object]]:
    """Which machines are checked; where the instrument's place is unknown, fewer of them."""
    most = {"robot": machines, "free": max(machines // FEWER, 1)}
    return [
        {"frame": frame, "machine": i, "kind": kind} for frame in PLACES for i in range(most[frame]) for kind in KINDS
    ]


@cache
def machine_of(number: int, frame: str) -> tuple[Case, gtpin.Model]:
    """A machine without effects but weak ones, and the model of its calibration."""
    noise = SimulatedNoise(free=frame == "free")
    case = make_case(SEEDS + number, n_effects=0, poses=POSES, held_out=1, noise=noise, background=False)
    return case, gtpin.calibrate(case.dataset).model


@cache
def planned_for(number: int, frame: str) -> gtpin.Commands:
    """The ten poses that are planned for a machine, out of those at which it was calibrated."""
    case, model = machine_of(number, frame)
    return gtpin.plan(model, "health", CHECK, q=case.dataset.q).commands


def measured(frame: str, machine: int, kind: str) -> list[dict[str, object]]:
    """Checks of one machine: whether there was an alarm, and whether the change stands in a class."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        case, model = machine_of(machine, frame)
        planned = planned_for(machine, frame)
        if kind == "unchanged":
            alarms = alarms_of(model, [later(case, planned, kind, -1, number) for number in range(UNCHANGED)])
            return [{"site": "", "alarm": alarm, "in_class": False, "leads": False} for alarm in alarms]
        return [checked(case, model, planned, kind, i) for i in range(planned.n_actuators)]


def alarms_of(model: gtpin.Model, datasets: Sequence[gtpin.Dataset]) -> list[bool]:
    """Whether checks at the same commands raise an alarm: the threshold is computed once for all."""
    earlier, scope = Earlier(model), Scope.of(catalogue(), (), FALSE_ALARM, model.robot)
    level, alarms = None, []
    for dataset in datasets:
        data = usable(dataset, model)
        sampler, _ = changes(earlier, data.observed, scope)
        if level is None:
            level = threshold(sampler, PRIORS.named_alarms * FALSE_ALARM, ALARM_DRAWS, np.random.default_rng(0))
        power = sampler.hypotheses.groups.power
        by_chance = chance(sampler, power, ALARM_DRAWS, np.random.default_rng(1))
        left = by_chance < (1.0 - PRIORS.named_alarms) * FALSE_ALARM
        alarms.append(bool(left or sampler.largest(sampler.hypotheses.design.y[:, None])[0] >= level))
    return alarms


def checked(case: Case, model: gtpin.Model, planned: gtpin.Commands, kind: str, actuator: int) -> dict[str, object]:
    """One check of a machine with a change."""
    found = gtpin.diagnose(later(case, planned, kind, actuator, 100 + actuator), against=model)
    site = model.robot.sites[actuator]
    return {
        "site": site,
        "alarm": found.verdict != "none",
        "in_class": any((kind, site) == (m.effect, m.site) for cause in found.causes for m in cause.members),
        "leads": any((kind, site) == (cause.effect, cause.site) for cause in found.causes),
    }


def later(case: Case, planned: gtpin.Commands, kind: str, actuator: int, seed: int) -> gtpin.Dataset:
    """The machine measured again at planned commands, with a change that its controller does not know."""
    moved = np.zeros_like(planned.q)
    if kind == "zero_shift":
        moved[:, actuator] = SHIFT
    elif kind == "backlash":
        moved[:, actuator] = -BACKLASH / 2.0 * np.asarray(planned.covariates[f"approach{actuator + 1}"], dtype=float)
    there = gtpin.Commands(planned.pose, planned.q + moved, planned.covariates)
    return replace(measure_at(case, there, seed), q=planned.q)


def bounds(count: int, total: int) -> tuple[float, float]:
    """95 % interval of a rate (Clopper and Pearson)."""
    low = float(beta.ppf(0.025, count, total - count + 1)) if count else 0.0
    high = float(beta.ppf(0.975, count + 1, total - count)) if count < total else 1.0
    return low, high


def table(records: pd.DataFrame) -> str:
    """Rates by what had changed and by what was known of the instrument's place."""
    lines = [
        "| instrument's place | what had changed | checks | alarms | 95 % interval | the change is in the class | it leads |",
        "|---|---|---|---|---|---|---|",
    ]
    words = {"unchanged": "nothing", "zero_shift": "a zero, by 30 um", "backlash": "backlash of 50 um"}
    places = {"robot": "known (`robot`)", "free": "unknown (`free`)"}
    for frame in PLACES:
        for kind in KINDS:
            rows = records[(records["frame"] == frame) & (records["kind"] == kind)]
            if not len(rows):
                continue
            alarms = int((rows["alarm"].astype(str) == "True").sum())
            low, high = bounds(alarms, len(rows))
            named = ["", ""]
            if kind != "unchanged":
                named = [f"{(rows[c].astype(str) == 'True').mean():.0%}" for c in ("in_class", "leads")]
            lines.append(
                f"| {places[frame]} | {words[kind]} | {len(rows)} | {alarms / len(rows):.1%} | {low:.1%} to {high:.1%} | "
                f"{named[0]} | {named[1]} |"
            )
    return "\n".join(lines)


if __name__ == "__main__":
    print(table(pd.DataFrame([{**job, **row} for job in jobs(2) for row in measured(**job)])))  # type: ignore[arg-type]
