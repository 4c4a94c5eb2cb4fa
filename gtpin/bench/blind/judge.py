"""Opens a case's seal and compares the diagnosis with the truth."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from gtpin.bench.blind.difficulty import Difficulty, true_parameters
from gtpin.bench.blind.judged import Judged, Shrunk, Statement
from gtpin.bench.blind.truth import SealError, Truth, opened
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
