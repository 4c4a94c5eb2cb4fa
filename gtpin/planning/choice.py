"""Candidate poses of a plan, and the choice of those that determine some effects best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.accuracy.workspace import default_commands
from gtpin.effects.operating_points import Column
from gtpin.errors import ModelError
from gtpin.model.model import Model
from gtpin.typing import Floats

Rows = npt.NDArray[np.intp]

COUNT = 300
"""Number of poses to choose from, where no commands are given."""
SPEED, PAYLOAD = 0.2, 5.0
"""Speed, m/s or rad/s, and payload, kg, of a plan for discrimination. Assumed: most machines allow them."""

WORTH = 1e-6
"""Smallest increase of the score for which poses are exchanged."""
PASSES = 2
"""Largest number of rounds of exchanges."""


@dataclass(frozen=True)
class Candidates:
    """Commands q (N, n), m or rad, covariates by name, (N,) each, and the names of the covariates that a plan contains."""

    q: Floats
    covariates: dict[str, Column]
    set_by_plan: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.q)

    def take(self, rows: Rows) -> Candidates:
        """Some of the candidates."""
        return Candidates(self.q[rows], {n: v[rows] for n, v in self.covariates.items()}, self.set_by_plan)


def candidates(
    model: Model, q: Floats | None, rng: np.random.Generator, *, moving: bool = False, seed: int = 0
) -> Candidates:
    """Poses to choose from, each actuator approaching from a side drawn at random.

    ``q``: (N, n) commands, m or rad; None: about 300 that fill the workspace. ``moving``: True: a half of the poses, drawn at
    random, is measured in motion, and a half with a payload. False: all at rest without payload. ``seed``: that of the default
    commands of a robot without rods.

    Raises `ModelError` if none of the commands can be reached.
    """
    q = np.round(np.asarray(default_commands(model, COUNT, seed) if q is None else q, dtype=float), 6)
    q = q[model.kinematics.forward(q).reached]
    if not len(q):
        raise ModelError(f"{model.robot.name} reaches none of the candidates", hint="give commands that it can reach")
    count, n = q.shape
    ways = rng.choice([-1.0, 1.0], (count, n))
    covariates: dict[str, Column] = {f"approach{i + 1}": ways[:, i] for i in range(n)}
    if moving:
        passed = rng.random(count) < 0.5
        covariates |= {f"speed{i + 1}": SPEED * passed * ways[:, i] for i in range(n)}
        covariates["payload"] = np.where(rng.random(count) < 0.5, PAYLOAD, 0.0)
    usual: dict[
        str, Column
    ] = {}  # what the model's effects need too: at rest, without load, at the reference temperature
    for active in model.effects:
        for name in active.references.covariates:
            if name not in {*covariates, "session", "time"}:
                usual[name] = np.full(count, active.references.temperature if name.startswith("temp_") else 0.0)
    return Candidates(q, {**usual, **covariates}, tuple(covariates))


class PoseChoice:
    """Chooses the poses that best determine some unknowns, in groups; all other unknowns are nuisance parameters.

    The score of a set of poses is the sum over the groups of -log det(C_g) / size of g, where C_g is the group's block of the
    covariance (1 / prior + J'J)^-1 after these poses are measured (Ds-optimality). ``J``: (N, c, D) derivatives of the N poses'
    whitened components by D unknowns with prior variances ``prior`` (D,).
    """

    def __init__(self, J: Floats, prior: Floats, groups: Sequence[Sequence[int]]) -> None:
        self.J, self.prior = J, prior
        self.groups = [np.array(group, dtype=np.intp) for group in groups]

    def covariance(self, rows: Sequence[int] | Rows) -> Floats:
        """(D, D) covariance of all unknowns after the poses with the indices ``rows`` are measured."""
        J = self.J[np.asarray(rows, dtype=np.intp)].reshape(-1, self.J.shape[2])
        # By the matrix inversion lemma: there are fewer rows than unknowns.
        CJ = self.prior[:, None] * J.T
        return np.asarray(np.diag(self.prior) - CJ @ np.linalg.solve(np.eye(len(J)) + J @ CJ, CJ.T))

    def scores(self, rows: Sequence[int]) -> Floats:
        """(N,) score of ``rows`` together with each other pose; minus infinity for the poses in ``rows``."""
        C = self.covariance(rows)
        CJ = self.J @ C
        S = np.eye(self.J.shape[1]) + CJ @ self.J.swapaxes(1, 2)
        total = np.zeros(len(self.J))
        for group in self.groups:
            own = CJ[:, :, group]
            block = C[np.ix_(group, group)] - own.swapaxes(1, 2) @ np.linalg.solve(S, own)
            total -= np.linalg.slogdet(block)[1] / len(group)
        total[list(rows)] = -np.inf
        return total

    def best(self, count: int) -> Rows:
        """(count,) indices of the chosen poses, ascending: a greedy choice, then exchanges of one pose that improve it."""
        chosen: list[int] = []
        for _ in range(count):
            chosen.append(int(self.scores(chosen).argmax()))
        for _ in range(PASSES):
            before = list(chosen)
            for place, row in enumerate(chosen):
                others = chosen[:place] + chosen[place + 1 :]
                scores = self.scores(others)
                best = int(scores.argmax())
                if scores[best] > scores[row] + WORTH:
                    chosen[place] = best
            if chosen == before:
                break
        return np.array(sorted(chosen), dtype=np.intp)
