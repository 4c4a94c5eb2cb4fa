"""Opens a case's seal and compares the diagnosis with the truth."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from gtpin.bench.blind.baselines import fit_known_causes, fit_known_causes_to_readings, gaussian_process_positions
from gtpin.bench.blind.difficulty import Best, Difficulty
from gtpin.bench.blind.judged import Judged, Named, Shrunk, Statement
from gtpin.bench.blind.true_parameters import true_parameters
from gtpin.bench.blind.truth import SealError, TrueEffect, TruePoses, Truth, opened
from gtpin.bench.blind.worker import Outcome, readings_at
from gtpin.calibration.calibrate import calibrate
from gtpin.calibration.result import Calibration
from gtpin.data import Commands, Dataset
from gtpin.data.instrument_tables import EncoderTable
from gtpin.effects.catalogue import effects_by_id
from gtpin.errors import ConvergenceError, GtpinError, GtpinWarning
from gtpin.model.measured_robot import robot_of
from gtpin.robot.measured_joints import measured_joint
from gtpin.threads import in_one_thread
from gtpin.typing import Floats


def rms_of_readings(dataset: Dataset, truth: Truth, predicted: Mapping[str, list[list[float]]]) -> float:
    """RMS error of predicted readings (H, c), by instrument, in units of the noise; of joints that turn, modulo full turns."""
    turning = _turning(dataset)
    errors = []
    for true in truth.readings:
        error = np.array(predicted[true.name]) - np.array(true.values)
        if true.name in turning:
            error -= 2.0 * np.pi * np.round(error / (2.0 * np.pi))
        errors.append((error / np.array(true.sigma)).ravel())
    return float(np.sqrt((np.concatenate(errors) ** 2).mean()))


def _turning(dataset: Dataset) -> frozenset[str]:
    """Names of the encoders at joints that turn."""
    encoders = [table for table in dataset.readings.tables if isinstance(table, EncoderTable)]
    return frozenset(table.name for table in encoders if measured_joint(robot_of(dataset), table.joint).turns)


Left = Mapping[str, Best]
"""Energy of a true effect that every effect of the catalogue leaves, by ``effect@site``."""

CAUSES_GIVEN = frozenset({"one", "two"})
SMOOTHED = frozenset({"one"})
"""Kinds of cases on which the baselines (a fit to which the causes are given, a Gaussian process) are computed."""


@in_one_thread
def judge(folder: Path, sealed: Path, digest: str, outcome: Outcome | None, without: Outcome | None = None) -> Judged:
    """Judge a case; ``without`` is the outcome with its effect removed from the catalogue.

    A case with a broken seal, or one that can't be judged, is a failed case.
    """
    try:
        truth = opened(sealed, digest)
    except SealError as error:
        return Judged(name=folder.name, error=str(error))
    try:
        return _judged(folder, truth, outcome or Outcome(error="it was not diagnosed"), without)
    except Exception as error:  # an error in one case must not stop the others
        plain = tuple(effect.model_copy(update={"displacement": None}) for effect in truth.effects)
        what = f"it could not be judged: {type(error).__name__}: {error}"
        return Judged(name=folder.name, kind=truth.kind, truth=plain, error=what)


def _judged(folder: Path, truth: Truth, outcome: Outcome, without: Outcome | None) -> Judged:
    statement, other = _statement(outcome), _statement(without)
    plain = tuple(effect.model_copy(update={"displacement": None}) for effect in truth.effects)
    found = Judged(
        name=folder.name,
        kind=truth.kind,
        truth=plain,
        listed=all(effect.effect in effects_by_id() for effect in plain),
        error=outcome.error,
        said=statement,
        without=other,
        without_error=without.error if without else None,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        try:
            dataset = Dataset.read(folder)
            found = found.model_copy(update={"instruments": _instruments(dataset)})
            return _measured(found, truth, dataset, folder, outcome)
        except GtpinError as error:  # the diagnosis failed for the same reason, or E and D can't be computed
            return found if found.error or statement else found.model_copy(update={"error": str(error)})


def _statement(outcome: Outcome | None) -> Statement | None:
    return None if outcome is None or outcome.diagnosis is None else Statement.of(outcome.diagnosis)


def _measured(found: Judged, truth: Truth, dataset: Dataset, folder: Path, outcome: Outcome) -> Judged:
    """The case with those of E, D and the explained fraction of the gap that can be computed."""
    changes: dict[str, object] = {
        "poses": len(dataset),
        "planned": len(np.unique(dataset.visits)),
        "testable": _testable(dataset, truth),
    }
    lefts: list[Left] = []
    baseline: Calibration | None = None
    if gradable(dataset, truth):
        baseline = calibrate(dataset)
        difficulty = difficulty_of(dataset, truth, baseline)
        lefts = [difficulty.left(np.array(effect.displacement)) for effect in truth.effects]
        graded = [_with_leaves(effect, left) for effect, left in zip(found.truth, lefts, strict=True)]
        changes |= {"truth": tuple(effect for effect, _ in graded)}
        if len(graded) == 1:
            changes |= {"rival": graded[0][1]} | _single(found, lefts[0], graded[0][0])
        if found.said is not None:
            pairs = zip(truth.effects, lefts, strict=True)
            rows = (_parameters(difficulty, found.said, effect, left) for effect, left in pairs)
            changes["parameters"] = tuple(row for some in rows for row in some)
    if outcome.baseline is not None and outcome.model is not None and truth.poses is not None:
        changes["shrunk"] = _shrunk(folder, dataset, truth, outcome, lefts, baseline)
    elif truth.readings and outcome.model_readings:
        changes["shrunk"] = _shrunk_readings(folder, dataset, truth, outcome, lefts, baseline)
    return found.model_copy(update=changes)


def _instruments(dataset: Dataset) -> tuple[str, ...] | None:
    """Kinds of the instruments of a dataset of schema 2; None for a tracker alone."""
    return tuple(sorted({table.kind for table in dataset.readings.tables if table.name})) or None


def _testable(dataset: Dataset, truth: Truth) -> bool:
    """Whether the covariates that the known effects need are recorded and vary."""
    robot, known = robot_of(dataset), effects_by_id()
    needs = {n for e in truth.effects if e.effect in known for n in known[e.effect].covariates(robot, e.site)}
    return all(n in dataset.covariates and len(np.unique(dataset.covariates[n])) > 1 for n in needs)


def _with_leaves(effect: TrueEffect, left: Left) -> tuple[TrueEffect, str]:
    """The effect with its D, and the wrong effect that leaves the least energy."""
    wrong = {name: best.left for name, best in left.items() if name != effect.name}
    alternative = min(wrong, key=lambda name: wrong[name])
    return effect.model_copy(update={"leaves": max(wrong[alternative], 0.0)}), alternative


def _single(found: Judged, left: Left, effect: TrueEffect) -> dict[str, object]:
    """Energy of a single effect that each member of the class leaves, and the smallest that another effect leaves."""
    members = (found.said.members if found.said else frozenset()) | {effect.name}
    others = [best.left for best in left.values() if best.effect.id != effect.effect]
    return {"left": {n: left[n].left for n in sorted(members) if n in left}, "without_left": max(min(others), 0.0)}


def _parameters(
    difficulty: Difficulty, statement: Statement, effect: TrueEffect, left: Left
) -> Iterator[tuple[str, float, float, float]]:
    """Parameters of a correctly named cause, and those of the textbook form that is nearest to the truth."""
    cause: Named | None = next((c for c in statement.causes if c.name == effect.name), None)
    if cause is None or effect.name not in left:
        return
    true = true_parameters(difficulty, left[effect.name], np.array(effect.displacement))
    for name, (value, sigma) in cause.parameters.items():
        if name in true:
            yield name, value, sigma, true[name]


def _shrunk(
    folder: Path, dataset: Dataset, truth: Truth, outcome: Outcome, lefts: list[Left], baseline: Calibration | None
) -> Shrunk:
    commands = Commands.read(folder / "commands.csv", dataset.n_actuators)
    assert truth.poses is not None
    T = _true_positions(commands, truth.poses)
    found = Shrunk(before=_rms(np.array(outcome.baseline) - T), after=_rms(np.array(outcome.model) - T))
    if baseline is None or truth.kind not in CAUSES_GIVEN or dataset.instrument.frame == "free":
        return found
    if dataset.readings.names:  # both baselines are fitted to poses
        return found
    changes = {}
    if causes := _causes(truth, lefts):
        model = fit_known_causes(dataset, baseline, causes)
        changes["knowing"] = _rms(model.predict(commands.q, commands.covariates).T - T)
    if truth.kind in SMOOTHED:
        changes["smoothed"] = _rms(gaussian_process_positions(dataset, baseline.model, commands) - T)
    return found.model_copy(update=changes)


def _shrunk_readings(
    folder: Path, dataset: Dataset, truth: Truth, outcome: Outcome, lefts: list[Left], baseline: Calibration | None
) -> Shrunk:
    """Errors of all instruments' readings in units of their noise, as :func:`_shrunk` of positions."""
    both = (outcome.baseline_readings, outcome.model_readings)
    before, after = (rms_of_readings(dataset, truth, predicted) for predicted in both)
    found, causes = Shrunk(before=before, after=after), _causes(truth, lefts)
    if baseline is None or truth.kind not in CAUSES_GIVEN or not causes:
        return found
    noise = {one.name: np.array(one.sigma) for one in truth.noise}
    try:
        model = fit_known_causes_to_readings(dataset, noise, baseline, causes)
    except ConvergenceError:
        return found
    commands = Commands.read(folder / "commands.csv", dataset.n_actuators)
    knowing = rms_of_readings(dataset, truth, readings_at(model, folder, commands))
    return found.model_copy(update={"knowing": knowing})


def _causes(truth: Truth, lefts: Sequence[Left]) -> list[Best]:
    """The true effects in the forms that fit them best; empty where one is not in the catalogue or D can't be computed."""
    if not lefts:
        return []
    found = [left[effect.name] for effect, left in zip(truth.effects, lefts, strict=True) if effect.name in left]
    return found if len(found) == len(lefts) else []


def _true_positions(commands: Commands, poses: TruePoses) -> Floats:
    """(H, 3) true positions in the order of the commands. Raises GtpinError if the poses are not the same."""
    place = {pose: i for i, pose in enumerate(poses.pose)}
    if len(place) != len(commands) or not all(pose in place for pose in commands.pose):
        raise GtpinError(
            "true poses and commands are not of the same poses", file=commands.file, hint="correct the truth"
        )
    return poses.T[[place[pose] for pose in commands.pose]]


def _rms(errors: Floats) -> float:
    return float(np.sqrt((errors**2).sum(axis=1).mean()))


def gradable(dataset: Dataset, truth: Truth) -> bool:
    """Whether the truth has all that D needs: displacements, and the noise of what was measured.

    An encoder reads joints, whose displacements are in no truth.
    """
    if not truth.effects or any(effect.displacement is None for effect in truth.effects):
        return False
    if dataset.readings.tracked:
        return truth.sigma is not None or bool(truth.noise)
    tables = dataset.readings.tables
    return {one.name for one in truth.noise} == {t.name for t in tables} and not any(t.measured_joints for t in tables)


def difficulty_of(dataset: Dataset, truth: Truth, baseline: Calibration) -> Difficulty:
    """The :class:`Difficulty` of a gradable case, from its calibration."""
    noise = {one.name: np.array(one.sigma) for one in truth.noise}
    if dataset.readings.names:
        return Difficulty.of_readings(dataset, noise, baseline)
    sigma = np.array(truth.sigma) if truth.sigma is not None else _six(*noise.values())
    return Difficulty.of(dataset, sigma, baseline.model.geometry)


def _six(sigma: Floats) -> Floats:
    """(M, 6) noise of a tracker's rows, from (M, 3) or (M, 6); infinite where orientations are not measured."""
    return np.hstack([sigma, np.full((len(sigma), 6 - sigma.shape[1]), np.inf)])
