"""Measured data with its bare diagnosis: the models with and without the named causes, and what geometry can absorb."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import gtpin
from gtpin.data import Dataset
from gtpin.instruments.predicted import instrument_of
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp, from_quaternions, log, skew, to_quaternions
from gtpin.model.model import Model
from gtpin.model.model_folder import write_model

sys.path.append(str(Path(__file__).parents[1] / "real"))

import panda_sockets

Array = NDArray[np.float64]
ROWS = 220
"""Most rows of a series, drawn at random."""
STEP = 1e-6
"""Step of the derivatives, m and rad."""


def series(real: Path, work: Path) -> Iterator[tuple[str, Dataset]]:
    """Every series below a folder, at most ROWS rows: datasets, and ball.csv of the Panda, which is converted in ``work``."""
    for file in sorted([*real.glob("**/dataset.toml"), *real.glob("**/ball.csv")]):
        name, folder = "-".join(file.parent.relative_to(real).parts), file.parent
        if file.name == "ball.csv":
            folder = work / name
            panda_sockets.write(file.parent, folder)
        dataset = Dataset.read(folder)
        if len(dataset) > ROWS:
            dataset = dataset.take(np.sort(np.random.default_rng(0).permutation(len(dataset))[:ROWS]))
        if dataset.instrument.frame == "free":  # nobody measured where the target sits
            dataset = replace(dataset, instrument=dataset.instrument.model_copy(update={"target": "free"}))
        yield name, dataset


def answer(dataset: Dataset, place: Path) -> dict[str, Any]:
    """What gtpin says of a dataset: kept in PLACE.json, and the model with the causes in PLACE, for the next call."""
    file = place.with_name(f"{place.name}.json")
    if not file.exists():
        diagnosis = gtpin.diagnose(dataset)
        said = diagnosis.to_json()
        said["reasons"] = {
            f"{c.effect}@{c.site}": (c.reason.kind, c.reason.covariate)
            for c in diagnosis.candidates
            if c.reason is not None and not c.testable
        }
        place.parent.mkdir(parents=True, exist_ok=True)
        write_model(diagnosis.model, place, force=True)
        write_model(diagnosis.baseline.model, place.with_name(f"{place.name}.geometry"), force=True)
        file.write_text(json.dumps(said) + "\n")
    return dict(json.loads(file.read_text()))


@dataclass(frozen=True)
class Background:
    """A series with its bare diagnosis: ``model`` with the named causes, ``plain`` with the geometry alone."""

    name: str
    dataset: Dataset
    said: dict[str, Any]
    model: Model
    plain: Model

    @staticmethod
    def of(name: str, dataset: Dataset, place: Path) -> Background:
        said = answer(dataset, place)
        models = [gtpin.read_model(place.with_name(f"{place.name}{end}")) for end in ("", ".geometry")]
        return Background(name, dataset, said, *models)

    @property
    def sockets(self) -> bool:
        return not self.dataset.readings.tracked

    def lever(self, poses: Poses, model: Model) -> Array:
        """(N, 3) from the predicted frame to the target: of a tracker the frame itself, of sockets the ball."""
        if not self.sockets:
            return np.zeros_like(poses.T)
        one = instrument_of(model, self.dataset.readings.tables[0].name)
        moved = [one.unknowns.get(f"{one.name}.target.{axis}", 0.0) for axis in "xyz"]
        return np.asarray(poses.R @ (np.array(one.table.target) + moved))

    def shift(self, one: Poses, other: Poses, model: Model) -> Array:
        """(N, 3 or 6) motion of the reading from one to the other: position, m, and rotation, rad, where it was measured."""
        parts = [other.T + self.lever(other, model) - one.T - self.lever(one, model)]
        if self.dataset.orientation is not None:
            parts.append(log(other.R @ one.R.transpose(0, 2, 1)))
        return np.concatenate(parts, axis=1)

    def residual(self, model: Model) -> Array:
        """(N, 3 or 6) measured less predicted; of a ball, the mean of its socket less its place."""
        predicted = model.predict(self.dataset.q, self.dataset.covariates)
        if self.sockets:
            at = predicted.T + self.lever(predicted, model)
            ids = self.dataset.readings.columns["socket"]
            return np.asarray(np.stack([at[ids == one].mean(axis=0) for one in ids]) - at)
        turned = self.dataset.orientation
        R = predicted.R if turned is None else from_quaternions(turned)
        return self.shift(predicted, Poses(self.dataset.position, R), model)

    def sigma(self, model: Model) -> Array:
        """(3 or 6,) robust standard deviation of the residuals: of positions, m, and of rotations, rad."""
        residual = self.residual(model)
        blocks = [residual[:, k : k + 3] for k in range(0, residual.shape[1], 3)]
        return np.repeat([1.4826 * np.median(np.abs(b - np.median(b, axis=0))) for b in blocks], 3)

    def absorbed(self, sigma: Array) -> Array:
        """(components, unknowns) whitened change of all readings by geometry, in tolerances, and by frame, target, sockets."""
        q, model = self.dataset.q, self.plain
        start = model.predict(q)
        columns = []
        for k, tolerance in enumerate(model.geometry.tolerance):
            values = model.geometry.values.copy()
            values[k] += STEP
            moved = replace(model, geometry=model.geometry.with_values(values)).predict(q)
            columns.append(self.shift(start, moved, model) * tolerance / STEP)
        turned = self.dataset.orientation is not None
        zero, eye = np.zeros((len(q), 3)), np.eye(3)
        for axis in eye:
            along, about = np.tile(axis, (len(q), 1)), np.cross(axis, start.T + self.lever(start, model))
            if self.sockets:
                columns.append(start.R @ axis)
                ids = self.dataset.readings.columns["socket"]
                columns += [along * (ids == one)[:, None] for one in np.unique(ids.astype(str))]
            elif self.dataset.instrument.frame == "free":
                parts = [(along, zero), (about, along), (start.R @ axis, zero), (zero, start.R @ axis)]
                columns += [np.concatenate(p, axis=1) if turned else p[0] for p in parts]
        return np.stack([(c / sigma).ravel() for c in columns], axis=1)

    def planted(self, active: Model, covariates: dict[str, Any], sigma: Array) -> tuple[Dataset, Array]:
        """The dataset with what ``active`` does beyond ``model`` added to its readings, and this displacement, whitened."""
        data, model = replace(self.dataset, covariates=covariates), self.model
        before, after = (m.predict(data.q, covariates) for m in (model, active))
        moved = self.shift(before, after, model)
        if self.sockets:  # the ball sits where it sat: the angles at which it does are others
            q = data.q.copy()
            for _ in range(6):
                now = active.predict(q, covariates)
                J = model.kinematics.command_jacobian(q, now)
                J = J[:, :3] - skew(self.lever(now, model)) @ J[:, 3:6]
                q -= (np.linalg.pinv(J) @ self.shift(before, now, model)[:, :3, None])[..., 0]
            return replace(data, q=q), (moved / sigma).ravel()
        turned = data.orientation
        if turned is not None:
            turned = to_quaternions(exp(moved[:, 3:]) @ from_quaternions(turned))
        return replace(data, position=data.position + moved[:, :3], orientation=turned), (moved / sigma).ravel()


class Projection:
    """M = (1 + J J')^-1: what is left where every unknown may move within its tolerance, frame and target freely."""

    def __init__(self, J: Array) -> None:
        self.J, self.inverse = J, np.linalg.inv(J.T @ J + np.eye(J.shape[1]))

    def __call__(self, r: Array) -> Array:
        return np.asarray(r - self.J @ (self.inverse @ (self.J.T @ r)))
