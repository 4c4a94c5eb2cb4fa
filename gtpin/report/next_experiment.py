"""Proposed measurements: in one or two sentences, on the page, and as tables of commands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gtpin.data import Commands
from gtpin.data.ids import normal_ids
from gtpin.diagnosis.discrimination import MOST_ROUNDS
from gtpin.diagnosis.result import Diagnosis, Experiment, HealthCheck, Lacking, Visits
from gtpin.diagnosis.trials import as_usual, kind, with_nights
from gtpin.effects.operating_points import Column
from gtpin.report.page import Block, Fold, Note, Table
from gtpin.report.phrases import known_as, reason_words
from gtpin.report.words import chance, coordinate_words, covariate_unit, joined, site_words, typeset, whole, with_unit
from gtpin.robot.chain import Chain

FOLDER = "next_experiment"
LIKELY = 0.5
"""Probability of settling a question from which one experiment alone is proposed. Assumed: more likely than not."""
NEARLY = 0.9
"""Fraction of a plan's gain from which random poses count as equally good."""


@dataclass(frozen=True)
class ExperimentPresentation:
    """A proposed experiment."""

    experiment: Experiment

    def short(self) -> str:
        """What to measure, and for what purpose, in a sentence or two."""
        e = self.experiment
        if e.visits is not None:
            again = _visits(e, e.visits)
            if not e.visits.site:
                return f"{again}: they show whether the unknown error repeats."
            depends = f"{site_words(e.visits.site)} depends on {coordinate_words(e.visits.coordinates)}"
            return f"{again}: the unknown effect at {depends}."
        return _apart(e) if e.lacking is None else _testable(e, e.lacking)


def write_experiments(d: Diagnosis | HealthCheck, folder: Path) -> None:
    """Write the commands of each experiment as a table, with the conditions to set and usual values of all other covariates.

    ``gtpin predict`` can read the tables. The folder is made even if it is empty, so that it replaces an older one.
    """
    (folder / FOLDER).mkdir()
    for i, experiment in enumerate(d.next_experiment):
        if count := len(experiment.poses):
            ids = normal_ids([f"next{i + 1}-{k + 1}" for k in range(count)])
            covariates = as_usual(d.dataset.covariates, count) | dict(experiment.covariates)
            if "time" not in experiment.covariates:
                covariates = with_nights(covariates, d.dataset.conditions.reference_temperature)
            Commands(ids, experiment.poses, covariates).write(folder / FOLDER / f"{i + 1}.csv")


def experiment_notes(d: Diagnosis) -> Iterator[Note]:
    """Proposed measurements, the most informative first: what to do, its expected gain, and the commands."""
    for i, e in enumerate(d.next_experiment):
        content: list[Block] = [typeset(e.measure)]
        if (expected := e.expected_gain) is not None:
            words, other = f"Expected gain in log evidence: {expected:.1f}", e.random_gain
            if other is not None and other >= NEARLY * expected:
                words += f". Other poses are as good ({other:.1f}): the conditions that are set matter, not the poses"
            elif other is not None:
                words += f", compared with {other:.1f} for as many random poses"
            content.append(f"{words}.")
        head = [f"q{j + 1}" for j in range(e.robot.n_actuators)]
        head += [with_unit(name, covariate_unit(name, e.robot)) for name in e.covariates]
        rows = []
        for k, q in enumerate(e.poses):
            conditions = [values[k] for values in e.covariates.values()]
            rows.append([whole(f"{value:.4f}") for value in q])
            rows[-1] += [v if isinstance(v, str) else whole(f"{v:.4g}") for v in conditions]
        if rows:
            title = f"{len(rows)} commands, also in {FOLDER}/{i + 1}.csv"
            content.append(Fold(title, [Table(head, rows, range(len(head)))]))
        yield Note(content)


def _apart(e: Experiment) -> str:
    first, *others = (known_as(*name.split("@")) if "@" in name else name for name in e.separates)
    pair = f"{first} from {joined(others or ['no effect'])}"
    if not len(e.poses):
        return f"No reachable poses distinguish {pair}: {_watch(e.watch, e.robot)}."
    measure = f"Measure these {len(e.poses)} poses to distinguish {pair}{_settings(e)}"
    if e.settles is None:
        return f"{measure}."
    if e.settles < LIKELY and e.rounds is None and e.watch:
        return f"Poses do not distinguish {pair}. Instead, {_watch(e.watch, e.robot)}."
    count = f"More than {MOST_ROUNDS}" if e.rounds is None else f"About {e.rounds}"
    more = "" if e.rounds == 1 else f" {count} such measurements are needed."
    if e.settles < LIKELY:
        return f"{measure}.{more}"
    return f"{measure}: this settles the question with a probability of {chance(e.settles)}.{more}"


def _testable(e: Experiment, lacking: Lacking) -> str:
    sites: dict[str, list[str]] = {}
    for effect, site in e.effects:
        name, where = known_as(effect, site).rsplit(" at ", 1)
        sites.setdefault(name, []).append(where)
    effects = joined([f"{name} at {joined(places)}" for name, places in sites.items()], "and also")
    if not len(e.poses):
        reason = reason_words(lacking.reason, e.effects[0][1])
        return f"No reachable poses make {effects} testable, because {reason}: {_watch(e.watch, e.robot)}."
    poses = f"{len(e.poses)} poses make {effects} testable{_settings(e)}."
    if not lacking.covariates:
        return f"These {poses}"
    change = f"{'Record and vary' if lacking.missing else 'Vary'} {joined(list(lacking.covariates))}"
    if lacking.covariates == ("session",):
        column = "Add a column session, with one name for all measurements so far and others for these"
        change = column if lacking.missing else "Begin further sessions"
    return f"{change}: these {poses}"


def _watch(sites: Sequence[str], robot: Chain) -> str:
    """Another measurement than poses, which shows the motion of some sites. No table of a dataset holds that of a drive."""
    drives = [site for site in dict.fromkeys(sites) if site in robot.sites]
    turning = [site for site in drives if robot.actuators[robot.sites.index(site)].revolute]
    sliding = [site for site in drives if site not in turning]
    links = [site_words(site) for site in dict.fromkeys(sites) if site not in (*drives, "frame", "platform")]
    words = {
        f"measure the angle of {joined(turning)} directly: an encoder at the joint, or targets on both of its links": turning,
        f"measure {joined(sliding)} directly: a scale along the axis, or a target on what it moves": sliding,
        f"measure {joined(links)} by targets at both ends": links,
        "measure fixed targets beside the robot": "frame" in sites,
        "measure separately where the target is on the platform": "platform" in sites,
    }
    chosen = [said for said, wanted in words.items() if wanted]
    by_hand = ", and compare with the commands (gtpin does not read this)" if drives or links else ""
    return "; or ".join(chosen) + by_hand


def _visits(e: Experiment, visits: Visits) -> str:
    if visits.pattern == "spread":
        return f"Visit {len(e.poses)} poses all over the workspace, at rest, with all other conditions unchanged"
    if visits.pattern == "net":
        return f"Move {joined(list(visits.actuators))} alone, over a grid of {len(e.poses)} poses"
    if visits.pattern == "line":
        (site,), there = visits.actuators, e.poses[: len(e.poses) // 2]
        first, last = there[[0, -1], e.robot.sites.index(site)]
        return f"Move {site} alone, in {len(there)} equal steps from {first:.3f} to {last:.3f}, and back"
    if visits.pattern == "again":
        return f"Visit {visits.stations} of the measured poses twice more each, with all other conditions unchanged"
    return f"Visit the same {visits.stations} poses {_repeated(visits, e.robot)}"


def _repeated(visits: Visits, robot: Chain) -> str:
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


def _settings(e: Experiment) -> str:
    """Conditions to set in addition to the commands, as the end of a sentence; can be empty."""
    kinds: dict[str, dict[str, Column]] = {}
    for name, values in e.covariates.items():
        kinds.setdefault(kind(name), {})[name] = values
    return "".join(f"; {_setting(what, values, e.robot, e.reference_temperature)}" for what, values in kinds.items())


def _setting(what: str, covariates: Mapping[str, Column], robot: Chain, reference: float) -> str:
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
        return f"with {joined([f'{v:.3g} kg at {n}' for v, n in zip(levels, counts, strict=True)])} of them"
    return f"{what} from {levels[0]:g} to {levels[-1]:g}"


def _moved(names: Mapping[str, Column] | Sequence[str], robot: Chain) -> str:
    """The actuators that covariates such as ``approach2`` belong to."""
    return joined([robot.sites[int(name.removeprefix(kind(name))) - 1] for name in names])
