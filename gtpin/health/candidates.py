"""Candidate poses of a plan, each with measurement conditions."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from gtpin.accuracy.workspace import default_commands
from gtpin.effects.situation import Column
from gtpin.errors import ModelError
from gtpin.model.model import Model
from gtpin.typing import Floats

COUNT = 300
"""Number of poses to choose from, where no commands are given."""
RESOLUTION = 1e-6
"""Commands are rounded to this, m or rad."""
SPEED, PAYLOAD = 0.2, 5.0
"""Speed, m/s or rad/s, and payload, kg, of a plan for discrimination. Assumed: most machines allow them."""


@dataclass(frozen=True)
class Candidates:
    """Commands q (N, n), m or rad, covariates by name, (N,) each, and the names of the covariates that a plan contains."""

    q: Floats
    covariates: dict[str, Column]
    set_by_plan: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.q)


def candidates(
    model: Model, q: Floats | None, rng: np.random.Generator, *, moving: bool = False, seed: int = 0
) -> Candidates:
    """Poses to choose from, each actuator approaching from a side drawn at random.

    Parameters
    ----------
    model
        The machine's model.
    q
        (N, n) commands, m or rad; None: about 300 that fill the workspace. Obstacles are not known.
    rng
        Source of the random draws.
    moving
        True: a half of the poses, drawn at random, is measured in motion, and a half with a payload. False: all at rest without
        payload.
    seed
        Seed of the default commands of a robot without rods.

    Raises
    ------
    ModelError
        If none of the commands can be reached.
    """
    robot = model.robot
    if q is None:
        q = default_commands(model, COUNT, seed)
    q = np.round(np.asarray(q, dtype=float), 6)
    q = q[model.kinematics.forward(q).reached]
    if not len(q):
        raise ModelError(f"{robot.name} reaches none of the candidates", hint="give commands that it can reach")
    n, count = robot.n_actuators, len(q)
    ways = rng.choice([-1.0, 1.0], (count, n))
    covariates: dict[str, Column] = {f"approach{i + 1}": ways[:, i] for i in range(n)}
    if moving:
        passed = rng.random(count) < 0.5
        covariates |= {f"speed{i + 1}": SPEED * passed * ways[:, i] for i in range(n)}
        covariates["payload"] = np.where(rng.random(count) < 0.5, PAYLOAD, 0.0)
    own = tuple(covariates)
    return Candidates(q, {**_usual(model, own, count), **covariates}, own)


def _usual(model: Model, given: Collection[str], count: int) -> dict[str, Column]:
    """Covariates that the model's effects need in addition to ``given``: at rest, without load, at the reference
    temperature."""
    found: dict[str, Column] = {}
    for active in model.effects:
        for name in active.references.covariates:
            if name not in given and name not in ("session", "time"):
                value = active.references.temperature if name.startswith("temp_") else 0.0
                found[name] = np.full(count, value)
    return found
