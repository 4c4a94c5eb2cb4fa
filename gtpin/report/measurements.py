"""A proposed measurement in one or two sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gtpin.diagnosis.planning.expected_bayes_factor import MOST_ROUNDS
from gtpin.diagnosis.planning.experiment import Experiment, Lacking, Visits
from gtpin.diagnosis.planning.measurement_conditions import kind
from gtpin.effects.situation import Column
from gtpin.report.reasons import reason_words
from gtpin.report.words import joined
from gtpin.robot.robot import Robot


def measure_words(e: Experiment) -> str:
    """What to measure, and for what purpose."""
    robot = e.robot
    if e.visits is not None:
        where = f"the unknown effect at {e.visits.site} depends on {e.visits.coordinates}"
        return f"{_visits(e, e.visits, robot)}: {where}."
    if e.lacking is not None:
        return _testable(e, e.lacking, robot)
    return _apart(e, robot)


def _apart(e: Experiment, robot: Robot) -> str:
    """How to distinguish effects."""
    first, *others = e.separates
    pair = f"{first} from {joined(others or ['no effect'])}"
    if not len(e.poses):
        return f"No reachable poses distinguish {pair}: {_watch(e.watch, robot)}."
    words = f"Measure these {len(e.poses)} poses to distinguish {pair}{_settings(e, robot)}."
    if e.settles is not None and e.rounds != 1:
        instead = f"; or {_watch(e.watch, robot)}" if e.watch else ""
        count = f"More than {MOST_ROUNDS}" if e.rounds is None else f"About {e.rounds}"
        words += f" {count} such measurements are needed{instead}."
    return words


def _testable(e: Experiment, lacking: Lacking, robot: Robot) -> str:
    """How effects can be tested."""
    sites: dict[str, list[str]] = {}
    for effect, site in e.effects:
        sites.setdefault(effect, []).append(site)
    effects = joined([f"{effect} ({', '.join(names)})" for effect, names in sites.items()])
    if not len(e.poses):
        reason = reason_words(lacking.reason, e.effects[0][1])
        return f"No reachable poses make {effects} testable, because {reason}: {_watch(e.watch, robot)}."
    return f"{_remedy(lacking)}{len(e.poses)} poses make {effects} testable{_settings(e, robot)}."


def _remedy(lacking: Lacking) -> str:
    """What must differ from the measurements so far, as the beginning of a sentence."""
    if not lacking.covariates:
        return "These "
    if lacking.covariates == ("session",):
        if lacking.missing:
            return "Add a column session, with one name for all measurements so far and others for these: these "
        return "Begin further sessions: these "
    what = "Record and vary" if lacking.missing else "Vary"
    return f"{what} {joined(list(lacking.covariates))}: these "


def _watch(sites: Sequence[str], robot: Robot) -> str:
    """How some sites are measured separately."""
    carts = [site for site in dict.fromkeys(sites) if site in robot.sites]
    links = [site for site in sites if site == "arm" or site in set(robot.rod_sites) - set(robot.sites)]
    words = []
    if carts:
        words.append(
            f"measure {joined(carts)} directly by {'separate targets' if len(carts) > 1 else 'a separate target'}"
        )
    if links:
        words.append("measure the length of the links by targets at both ends")
    if "frame" in sites:
        words.append("measure fixed targets next to the robot")
    if "platform" in sites:
        words.append("measure separately where the target is on the platform")
    return joined(words)


def _visits(e: Experiment, visits: Visits, robot: Robot) -> str:
    """Visits that show how an unknown effect depends on its coordinates."""
    if visits.pattern == "spread":
        return f"Visit {len(e.poses)} poses all over the workspace, at rest, with all other conditions unchanged"
    if visits.pattern == "net":
        return f"Move {joined(list(visits.actuators))} alone, over a grid of {len(e.poses)} poses"
    if visits.pattern == "line":
        (site,), there = visits.actuators, e.poses[: len(e.poses) // 2]
        first, last = there[[0, -1], robot.sites.index(site)]
        return f"Move {site} alone, in {len(there)} equal steps from {first:.3f} to {last:.3f}, and back"
    if visits.pattern == "again":
        return f"Visit {visits.stations} of the measured poses twice more each, with all other conditions unchanged"
    return f"Visit the same {visits.stations} poses {_repeated(visits, robot)}"


def _repeated(visits: Visits, robot: Robot) -> str:
    """The conditions under which the same poses are visited repeatedly."""
    what, times = kind(visits.varied[0]), len(visits.levels)
    if what == "session":
        return f"in {times} sessions"
    levels = np.asarray(visits.levels, dtype=float)
    if what == "time":
        return f"{times} times, every {np.ptp(levels) / 60.0 / (times - 1):.0f} minutes"
    if what == "temperature":
        return f"{times} times while the machine warms up"
    if what == "approach":
        return f"{times} times, {_moved(visits.varied, robot)} moving up and down alternately"
    if what == "speed":
        moved, fastest = _moved(visits.varied, robot), np.abs(levels).max()
        return f"{times} times, {moved} passing both ways at half and at all of {fastest:.2g} per second"
    named = "a payload" if what == "payload" else visits.varied[0]
    return f"{times} times with {named} of {joined([f'{level:.3g}' for level in levels])}"


def _settings(e: Experiment, robot: Robot) -> str:
    """Conditions to set in addition to the commands, as the end of a sentence; can be empty."""
    kinds: dict[str, dict[str, Column]] = {}
    for name, values in e.covariates.items():
        kinds.setdefault(kind(name), {})[name] = values
    return "".join(f"; {_setting(what, values, robot, e.reference_temperature)}" for what, values in kinds.items())


def _setting(what: str, covariates: Mapping[str, Column], robot: Robot, reference: float) -> str:
    """Covariates of one kind."""
    if what == "session":
        count = len(set(map(str, covariates["session"])))
        return "in a separate session" if count == 1 else f"in {count} separate sessions, as listed"
    values = np.stack([np.asarray(v, dtype=float) for v in covariates.values()], axis=1)
    if what == "time":
        return f"spread over {np.ptp(values) / 3600.0:.1g} hours"
    if what == "approach":
        moved = _moved(covariates, robot)
        return f"come to about half of them with {moved} moving up, to the others moving down, as listed"
    if what == "speed":
        moved, passed = _moved(covariates, robot), np.count_nonzero(values.any(axis=1))
        return f"pass {passed} of them with {moved} at up to {np.abs(values).max():.2g} per second, as listed"
    if what == "force":
        size = np.linalg.norm(values, axis=1)
        return (
            f"push on the tool with up to {size.max():.0f} N at {np.count_nonzero(size)} of them, along the base frame's axes "
            "as listed, and never with more force than the machine's rated load"
        )
    if what == "temperature":
        cold = int((values[:, 0] == reference).sum())
        return f"{cold} with the machine cold, {len(values) - cold} with it warm"
    levels, counts = np.unique(values, return_counts=True)
    if what == "payload":
        return f"with {joined([f'{v:g} kg at {n}' for v, n in zip(levels, counts, strict=True)])} of them"
    return f"{what} from {levels[0]:g} to {levels[-1]:g}"


def _moved(names: Mapping[str, Column] | Sequence[str], robot: Robot) -> str:
    """The actuators that covariates such as ``approach2`` belong to."""
    return joined([robot.sites[int(name.removeprefix(kind(name))) - 1] for name in names])
