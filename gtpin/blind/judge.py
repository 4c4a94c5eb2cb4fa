"""Opens a case's seal and holds what was said against it."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gtpin.blind.difficulty import Best, Yardstick
from gtpin.blind.judged import Judged, Shrunk
from gtpin.blind.oracle import knowing
from gtpin.blind.seal import SealError, opened
from gtpin.blind.smooth import smoothed
from gtpin.blind.statement import Named, Statement
from gtpin.blind.truth import Hidden, TruePoses, Truth
from gtpin.blind.worker import Said
from gtpin.calibration.calibrate import calibrate
from gtpin.calibration.result import Calibration
from gtpin.data import Commands, Dataset
from gtpin.effects.catalogue import effects_by_id
from gtpin.errors import GtpinError, GtpinWarning
from gtpin.robot.library import load_robot
from gtpin.threads import in_one_thread

Floats = npt.NDArray[np.float64]
Left = Mapping[str, Best]
"""What every effect of the catalogue leaves of a true one, by ``effect@site``."""

KNOWING = frozenset({"one", "two"})
SMOOTHED = frozenset({"one"})
"""Sorts of cases on which the rivals are tried."""


@in_one_thread
def judge(folder: Path, sealed: Path, digest: str, said: Said | None, without: Said | None = None) -> Judged:
    """Judge a case; ``without`` is what was said with its effect taken out of the catalogue.

    A broken seal makes it a failed case, and so does what can't be judged.
    """
    try:
        truth = opened(sealed, digest)
    except SealError as error:
        return Judged(name=folder.name, error=str(error))
    try:
        return _judged(folder, truth, said or Said(error="it was not diagnosed"), without)
    except Exception as error:  # one case's fault is not the others'
        plain = tuple(effect.model_copy(update={"displacement": None}) for effect in truth.effects)
        what = f"it could not be judged: {type(error).__name__}: {error}"
        return Judged(name=folder.name, kind=truth.kind, truth=plain, error=what)


def _judged(folder: Path, truth: Truth, said: Said, without: Said | None) -> Judged:
    statement, other = _statement(said), _statement(without)
    plain = tuple(effect.model_copy(update={"displacement": None}) for effect in truth.effects)
    found = Judged(
        name=folder.name,
        kind=truth.kind,
        truth=plain,
        listed=all(effect.effect in effects_by_id() for effect in plain),
        error=said.error,
        said=statement,
        without=other,
        without_error=without.error if without else None,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        try:
            return _measured(found, truth, Dataset.read(folder), folder, said)
        except GtpinError as error:  # it has failed for the same reason, or there is no telling how hard it is
            return found if found.error or statement else found.model_copy(update={"error": str(error)})


def _statement(said: Said | None) -> Statement | None:
    return None if said is None or said.diagnosis is None else Statement.of(said.diagnosis)


def _measured(found: Judged, truth: Truth, dataset: Dataset, folder: Path, said: Said) -> Judged:
    """The case with what can be computed of its difficulty, and of how far the gap shrank."""
    changes: dict[str, object] = {
        "poses": len(dataset),
        "planned": len(np.unique(dataset.visits)),
        "testable": _testable(dataset, truth),
    }
    lefts: list[Left] = []
    baseline: Calibration | None = None
    if truth.sigma is not None and truth.effects and all(e.displacement is not None for e in truth.effects):
        baseline = calibrate(dataset)
        yardstick = Yardstick.of(dataset, np.array(truth.sigma), baseline.model.geometry)
        lefts = [yardstick.left(np.array(effect.displacement)) for effect in truth.effects]
        told = [_with_leaves(effect, left) for effect, left in zip(found.truth, lefts, strict=True)]
        changes |= {"truth": tuple(effect for effect, _ in told)}
        if len(told) == 1:
            changes |= {"rival": told[0][1]} | _single(found, lefts[0], told[0][0])
        if found.said is not None:
            pairs = zip(truth.effects, lefts, strict=True)
            rows = (_parameters(yardstick, found.said, effect, left) for effect, left in pairs)
            changes["parameters"] = tuple(row for some in rows for row in some)
    if said.baseline is not None and said.model is not None and truth.poses is not None:
        changes["shrunk"] = _shrunk(folder, dataset, truth, said, lefts, baseline)
    return found.model_copy(update=changes)


def _testable(dataset: Dataset, truth: Truth) -> bool:
    """Whether the covariates that the known effects need are there and vary."""
    robot, known = load_robot(dataset.robot_reference), effects_by_id()
    needs = {n for e in truth.effects if e.effect in known for n in known[e.effect].covariates(robot, e.site)}
    return all(n in dataset.covariates and len(np.unique(dataset.covariates[n])) > 1 for n in needs)


def _with_leaves(effect: Hidden, left: Left) -> tuple[Hidden, str]:
    """The effect with its D, and the wrong effect that leaves least."""
    wrong = {name: best.left for name, best in left.items() if name != effect.name}
    rival = min(wrong, key=lambda name: wrong[name])
    return effect.model_copy(update={"leaves": max(wrong[rival], 0.0)}), rival


def _single(found: Judged, left: Left, effect: Hidden) -> dict[str, object]:
    """What the members of the class leave of a single effect, and what the others do once it is taken out."""
    asked = (found.said.members if found.said else frozenset()) | {effect.name}
    others = [best.left for best in left.values() if best.effect.id != effect.effect]
    return {"left": {n: left[n].left for n in sorted(asked) if n in left}, "without_left": max(min(others), 0.0)}


def _parameters(
    yardstick: Yardstick, said: Statement, effect: Hidden, left: Left
) -> Iterator[tuple[str, float, float, float]]:
    """Parameters of a cause that was rightly named, beside those of the textbook form that is nearest to the truth."""
    cause: Named | None = next((c for c in said.causes if c.name == effect.name), None)
    if cause is None or effect.name not in left:
        return
    true = yardstick.parameters(left[effect.name], np.array(effect.displacement))
    for name, (value, sigma) in cause.parameters.items():
        if name in true:
            yield name, value, sigma, true[name]


def _shrunk(
    folder: Path, dataset: Dataset, truth: Truth, said: Said, lefts: list[Left], baseline: Calibration | None
) -> Shrunk:
    commands = Commands.read(folder / "commands.csv", dataset.n_actuators)
    assert truth.poses is not None
    T = _true_positions(commands, truth.poses)
    found = Shrunk(before=_rms(np.array(said.baseline) - T), after=_rms(np.array(said.model) - T))
    if baseline is None or truth.kind not in KNOWING or dataset.instrument.frame == "free":
        return found
    changes = {}
    causes = [left[effect.name] for effect, left in zip(truth.effects, lefts, strict=True) if effect.name in left]
    if len(causes) == len(lefts):
        model = knowing(dataset, baseline, causes)
        changes["knowing"] = _rms(model.predict(commands.q, commands.covariates).T - T)
    if truth.kind in SMOOTHED:
        changes["smoothed"] = _rms(smoothed(dataset, baseline.model, commands) - T)
    return found.model_copy(update=changes)


def _true_positions(commands: Commands, poses: TruePoses) -> Floats:
    """(H, 3) true positions in the order of the commands.

    Raises
    ------
    GtpinError
        If they are of other poses.
    """
    place = {pose: i for i, pose in enumerate(poses.pose)}
    if len(place) != len(commands) or not all(pose in place for pose in commands.pose):
        raise GtpinError(
            "true poses and commands are not of the same poses", file=commands.file, hint="correct the truth"
        )
    return poses.T[[place[pose] for pose in commands.pose]]


def _rms(errors: Floats) -> float:
    return float(np.sqrt((errors**2).sum(axis=1).mean()))
