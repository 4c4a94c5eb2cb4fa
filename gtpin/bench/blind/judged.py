"""A case after its seal was opened: the truth, the part of the diagnosis that is scored, and how both are compared."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel

from gtpin.bench.blind.difficulty import Difficulty, true_parameters
from gtpin.bench.blind.truth import Kind, SealError, TrueEffect, Truth, opened
from gtpin.bench.blind.worker import Outcome
from gtpin.calibration.calibrate import calibrate
from gtpin.calibration.result import Calibration
from gtpin.data import Commands, Dataset
from gtpin.data.instrument_tables import EncoderTable
from gtpin.effects.catalogue import effects_by_id
from gtpin.errors import GtpinError, GtpinWarning
from gtpin.model.measured_robot import robot_of
from gtpin.robot.chain import measured_joint
from gtpin.threads import in_one_thread
from gtpin.typing import Floats

CONFIDENT = 0.95
"""Smallest probability of a cause that is named with confidence."""


class Named(BaseModel, frozen=True):
    """A cause in the diagnosis: ``effect@site``, its probability, and the members of its class with their probabilities."""

    name: str
    probability: float
    members: dict[str, float]
    parameters: dict[str, tuple[float, float]] = {}


class Statement(BaseModel, frozen=True):
    """The scored part of a diagnosis."""

    # As in ``diagnosis.json``; names are ``effect@site``
    verdict: Literal["none", "explained", "ambiguous", "unknown"]
    causes: tuple[Named, ...] = ()  # The largest first
    site: str = ""  # Site with the largest share in ``where``; empty if all shares are zero
    explained_fraction: float | None = None
    interval: tuple[float, float] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Causes, ``effect@site``."""
        return tuple(cause.name for cause in self.causes)

    @property
    def members(self) -> frozenset[str]:
        """The classes of all causes together."""
        return frozenset(name for cause in self.causes for name in (cause.name, *cause.members))

    @staticmethod
    def of(diagnosis: Mapping[str, Any]) -> Statement:
        """Read the content of ``diagnosis.json``."""
        shares, gap = diagnosis["where"]["site"], diagnosis["gap"]
        leading = max(shares, key=lambda site: shares[site], default="")

        def name(record: Mapping[str, Any]) -> str:
            return f"{record['effect']}@{record['site']}"

        causes = [
            Named(
                name=name(cause),
                probability=cause["probability"],
                members={name(member): member["probability"] for member in cause["class"]},
                parameters={k: (p["value"], p["sigma"]) for k, p in cause["parameters"].items()},
            )
            for cause in diagnosis["causes"]
        ]
        return Statement(
            verdict=diagnosis["verdict"],
            causes=tuple(causes),
            site=leading if leading and shares[leading] > 0.0 else "",
            explained_fraction=gap["shrinkage"],
            interval=gap["interval"],
        )


VISIBLE = 63.0
"""Energy above which an effect must be detected (E) and named (D): 4 times the 15.8 of a matched filter (95 %, 1 % alarms)."""
LEFT = 250.0
"""Energy of an unlisted effect that known effects must leave unexplained, so that the verdict must be `unknown`."""


class Shrunk(BaseModel, frozen=True):
    """RMS length of the position error at held-out commands, against the true poses, m; where other instruments than a tracker
    alone measured, RMS error of their readings in units of the noise."""

    before: float  # Of the geometry alone
    after: float  # Of the model with the named causes

    @property
    def share(self) -> float:
        """Explained fraction of the gap: 1 - (after / before)^2."""
        return 1.0 - (self.after / self.before) ** 2 if self.before > 0.0 else 0.0


class Judged(BaseModel, frozen=True):
    """A case, its truth and its diagnosis."""

    name: str
    kind: Kind | None = None  # Kind of case; None if its seal was broken
    poses: int = 0  # Rows of the dataset
    planned: int = 0  # Different commands among them
    truth: tuple[TrueEffect, ...] = ()  # Its true effects with E and D, without displacements
    rival: str = ""  # The wrong effect that leaves the least energy of a single true effect; empty where not known
    listed: bool = True  # Whether all its effects are in the catalogue
    instruments: tuple[str, ...] | None = None  # Kinds of the instruments that measured it; None for a tracker alone
    testable: bool = True  # Whether the dataset has the covariates that its known effects need
    error: str | None = None  # Message of the error if the case failed
    said: Statement | None = None  # The scored part of the diagnosis; None if the case failed
    # Energy of a single true effect that remains when another effect is fitted to it, by that effect: each member of
    # the named class, and the true effect in its textbook form
    left: dict[str, float] = {}
    without: Statement | None = None  # The diagnosis with the true effect removed from the catalogue
    without_error: str | None = None  # The error if that failed
    without_left: float | None = None  # The energy that the best of the other effects leaves
    shrunk: Shrunk | None = None  # None without true poses, or if the case failed
    # Name, value, sigma and true value of the parameters of causes that are named correctly
    parameters: tuple[tuple[str, float, float, float], ...] = ()

    @property
    def names(self) -> frozenset[str]:
        """The true effects, ``effect@site``."""
        return frozenset(effect.name for effect in self.truth)

    @property
    def single(self) -> TrueEffect:
        """The effect of a case that has one."""
        (effect,) = self.truth
        return effect

    @property
    def noncentrality(self) -> float:
        """E of a single effect, its whitened energy; NaN if not known."""
        return float("nan") if self.single.energy is None else self.single.energy

    @property
    def leaves(self) -> float:
        """D of a single effect, the energy that the best wrong effect leaves; NaN if not known."""
        return float("nan") if self.single.leaves is None else self.single.leaves

    @property
    def verdict(self) -> str:
        """As in ``diagnosis.json``; empty where the case failed."""
        return self.said.verdict if self.said else ""

    @property
    def named(self) -> frozenset[str]:
        """The named causes, ``effect@site``."""
        return frozenset(self.said.names) if self.said else frozenset()

    @property
    def detected(self) -> bool:
        """Whether the verdict is not `none`."""
        return self.verdict not in ("", "none")

    @property
    def where(self) -> bool:
        """Whether the site that leads is that of the single effect."""
        return self.said is not None and self.said.site == self.single.site

    @property
    def strict(self) -> bool:
        """Whether exactly the true effects are named, and the verdict is not `unknown`."""
        return self.verdict not in ("", "unknown") and self.named == self.names

    @property
    def in_class(self) -> bool:
        """Whether the classes contain all true effects."""
        return self.said is not None and bool(self.names) and self.names <= self.said.members

    @property
    def false_names(self) -> tuple[str, ...]:
        """Named causes that are not true."""
        return tuple(n for n in self.said.names if n not in self.names) if self.said else ()

    @property
    def false_confident(self) -> tuple[str, ...]:
        """Causes named with a probability of 0.95 or more that are not true."""
        named = ((cause.name, cause.probability) for cause in (self.said.causes if self.said else ()))
        return tuple(name for name, probability in named if probability >= CONFIDENT and name not in self.names)

    @property
    def overstated(self) -> float | None:
        """The explained fraction of the gap that is predicted, less the one realised; None where one is not known."""
        if self.said is None or self.said.explained_fraction is None or self.shrunk is None:
            return None
        return self.said.explained_fraction - self.shrunk.share

    @property
    def f1(self) -> float:
        """F1 of the set of causes."""
        return _f1(self.named, self.names)

    @property
    def not_visible(self) -> frozenset[str]:
        """True effects that need not be found: their E is known, and not more than `VISIBLE`."""
        return frozenset(e.name for e in self.truth if e.energy is not None and e.energy <= VISIBLE)

    @property
    def visible_f1(self) -> float:
        """F1 of the set of causes without the effects that are not visible, whether they are named or not."""
        return _f1(self.named - self.not_visible, self.names - self.not_visible)

    @property
    def class_f1(self) -> float:
        """F1 of the classes: a cause is correct if its class has a true effect, a true effect is found if a class has it."""
        if self.said is None:
            return 0.0
        right = sum(bool(self.names & cause.members.keys()) for cause in self.said.causes)
        found = len(self.names & self.said.members)
        precision, recall = right / max(len(self.said.causes), 1), found / max(len(self.names), 1)
        return 2.0 * precision * recall / (precision + recall) if right else 0.0


def _f1(named: frozenset[str], true: frozenset[str]) -> float:
    """2 right / (named + true)."""
    return 2.0 * len(named & true) / max(len(named) + len(true), 1)


def rms_of_readings(dataset: Dataset, truth: Truth, predicted: Mapping[str, list[list[float]]]) -> float:
    """RMS error of predicted readings (H, c), by instrument, in units of the noise; of joints that turn, modulo full turns."""
    encoders = [table for table in dataset.readings.tables if isinstance(table, EncoderTable)]
    turning = {table.name for table in encoders if measured_joint(robot_of(dataset), table.joint).turns}
    errors = []
    for true in truth.readings:
        error = np.array(predicted[true.name]) - np.array(true.values)
        if true.name in turning:
            error -= 2.0 * np.pi * np.round(error / (2.0 * np.pi))
        errors.append((error / np.array(true.sigma)).ravel())
    return float(np.sqrt((np.concatenate(errors) ** 2).mean()))


@in_one_thread
def judge(folder: Path, sealed: Path, digest: str, outcome: Outcome | None, without: Outcome | None = None) -> Judged:
    """Judge a case; ``without`` is the outcome with its effect removed from the catalogue.

    A case with a broken seal, or one that can't be judged, is a failed case.
    """
    try:
        truth = opened(sealed, digest)
    except SealError as error:
        return Judged(name=folder.name, error=str(error))
    plain = tuple(effect.model_copy(update={"displacement": None}) for effect in truth.effects)
    try:
        return _judged(Judged(name=folder.name, kind=truth.kind, truth=plain), folder, truth, outcome, without)
    except Exception as error:  # an error in one case must not stop the others
        what = f"it could not be judged: {type(error).__name__}: {error}"
        return Judged(name=folder.name, kind=truth.kind, truth=plain, error=what)


def _judged(found: Judged, folder: Path, truth: Truth, outcome: Outcome | None, without: Outcome | None) -> Judged:
    outcome = outcome or Outcome(error="it was not diagnosed")
    changes: dict[str, object] = {
        "listed": all(effect.effect in effects_by_id() for effect in truth.effects),
        "error": outcome.error,
        "said": _statement(outcome),
        "without": _statement(without),
        "without_error": without.error if without else None,
    }
    found = found.model_copy(update=changes)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        try:
            dataset = Dataset.read(folder)
            # Kinds of the instruments of schema 2; None for a tracker alone.
            kinds = tuple(sorted({table.kind for table in dataset.readings.tables if table.name})) or None
            found = found.model_copy(update={"instruments": kinds})
            return _measured(found, truth, dataset, folder, outcome)
        except GtpinError as error:  # the diagnosis failed for the same reason, or E and D can't be computed
            return found if found.error or found.said else found.model_copy(update={"error": str(error)})


def _statement(outcome: Outcome | None) -> Statement | None:
    return Statement.of(outcome.diagnosis) if outcome and outcome.diagnosis is not None else None


def _measured(found: Judged, truth: Truth, dataset: Dataset, folder: Path, outcome: Outcome) -> Judged:
    """The case with those of E, D and the explained fraction of the gap that can be computed."""
    robot, known, covariates = robot_of(dataset), effects_by_id(), dataset.covariates
    needs = {n for e in truth.effects if e.effect in known for n in known[e.effect].covariates(robot, e.site)}
    changes: dict[str, object] = {
        "poses": len(dataset),
        "planned": len(np.unique(dataset.visits)),
        "testable": all(n in covariates and len(np.unique(covariates[n])) > 1 for n in needs),
    }
    if gradable(dataset, truth):
        difficulty = difficulty_of(dataset, truth, calibrate(dataset))
        # Energy of each true effect that every effect of the catalogue leaves, by ``effect@site``.
        lefts = [difficulty.left(np.array(effect.displacement)) for effect in truth.effects]
        # The wrong effect that leaves the least energy of each effect, and its D.
        pairs = list(zip(found.truth, lefts, strict=True))
        rivals = [min((n for n in left if n != effect.name), key=lambda n: left[n].left) for effect, left in pairs]
        leaves = [max(left[rival].left, 0.0) for left, rival in zip(lefts, rivals, strict=True)]
        changes["truth"] = tuple(e.model_copy(update={"leaves": d}) for (e, _), d in zip(pairs, leaves, strict=True))
        if len(lefts) == 1:
            ((single, left),) = pairs
            members = (found.said.members if found.said else frozenset()) | {single.name}
            others = [best.left for best in left.values() if best.effect.id != single.effect]
            changes["rival"] = rivals[0]
            changes["left"] = {name: left[name].left for name in sorted(members) if name in left}
            changes["without_left"] = max(min(others), 0.0)
        # Parameters of the correctly named causes, and those of the textbook form that is nearest to the truth.
        rows = []
        named = {cause.name: cause for cause in found.said.causes} if found.said else {}
        for effect, left in zip(truth.effects, lefts, strict=True):
            if effect.name in named and effect.name in left:
                true = true_parameters(difficulty, left[effect.name], np.array(effect.displacement))
                own = named[effect.name].parameters.items()
                rows += [(name, value, sigma, true[name]) for name, (value, sigma) in own if name in true]
        changes["parameters"] = tuple(rows)
    if outcome.model is not None or outcome.model_readings:
        changes["shrunk"] = _shrunk(folder, dataset, truth, outcome)
    return found.model_copy(update=changes)


def _shrunk(folder: Path, dataset: Dataset, truth: Truth, outcome: Outcome) -> Shrunk | None:
    """Errors of positions, or of all readings in units of their noise, at held-out commands, where known and predicted."""
    before, after, true = outcome.baseline, outcome.model, truth.poses
    if before is not None and after is not None and true is not None:
        commands = Commands.read(folder / "commands.csv", dataset.n_actuators)
        place = {pose: i for i, pose in enumerate(true.pose)}
        if len(place) != len(commands) or not all(pose in place for pose in commands.pose):
            what = "true poses and commands are not of the same poses"
            raise GtpinError(what, file=commands.file, hint="correct the truth")
        T = true.T[[place[pose] for pose in commands.pose]]
        return Shrunk(before=_rms(np.array(before) - T), after=_rms(np.array(after) - T))
    if truth.readings and outcome.model_readings:
        both = (outcome.baseline_readings, outcome.model_readings)
        before_rms, after_rms = (rms_of_readings(dataset, truth, predicted) for predicted in both)
        return Shrunk(before=before_rms, after=after_rms)
    return None


def _rms(errors: Floats) -> float:
    return float(np.sqrt((errors**2).sum(axis=1).mean()))


def gradable(dataset: Dataset, truth: Truth) -> bool:
    """Whether the truth has all that D needs: displacements, and the noise of what was measured.

    An encoder reads joints, whose displacements are in no truth.
    """
    if not truth.effects or any(effect.displacement is None for effect in truth.effects):
        return False
    if not dataset.readings.names:
        return truth.sigma is not None or bool(truth.noise)
    tables = dataset.readings.tables
    return {one.name for one in truth.noise} == {t.name for t in tables} and not any(t.measured_joints for t in tables)


def difficulty_of(dataset: Dataset, truth: Truth, baseline: Calibration) -> Difficulty:
    """The :class:`Difficulty` of a gradable case, from its calibration."""
    noise = {one.name: np.array(one.sigma) for one in truth.noise}  # (M, c) of each instrument's readings
    if dataset.readings.names:
        return Difficulty.of_readings(dataset, noise, baseline)
    if truth.sigma is not None:
        sigma = np.array(truth.sigma)
    else:
        (rows,) = noise.values()  # (M, 3) where orientations are not measured
        sigma = np.hstack([rows, np.full((len(rows), 6 - rows.shape[1]), np.inf)])
    return Difficulty.of(dataset, sigma, baseline.model.geometry)
