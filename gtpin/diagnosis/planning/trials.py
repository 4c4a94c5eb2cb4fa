"""Rows that could be measured next: reachable commands, each with measurement conditions."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gtpin.diagnosis.linear.design import Design, Observed
from gtpin.diagnosis.planning.measurement_conditions import MeasurementConditions, draw
from gtpin.effects.displacement import Displacement
from gtpin.effects.operating_points import OperatingPoints, References
from gtpin.effects.smooth import frame_twist
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

ZERO = 4e-5
"""Prior sigma of the change of a drive's zero since the last measurement, m or rad. Assumed."""
RESOLUTION = 1e-6
"""Step to which commands are rounded, m or rad."""


@dataclass(frozen=True, eq=False)
class Known:
    """The N measured poses, the calibrated geometry about which the problem is linear, and the diagnosis's references."""

    observed: Observed
    model: Model
    references: References

    @property
    def robot(self) -> Chain:
        """The robot."""
        return self.model.geometry.robot

    @cached_property
    def operating_points(self) -> OperatingPoints:
        """The N measured poses, computed with this geometry."""
        return self.observed.operating_points(self.model, self.references)


@dataclass(frozen=True, eq=False)
class Trials:
    """M rows that could be measured, with commands q (M, n), together with the N measured rows.

    ``design``: the linear problem of all N + M rows, the measured rows first. ``measured``: N.
    """

    design: Design
    measured: int
    q: Floats
    conditions: MeasurementConditions

    def __len__(self) -> int:
        return len(self.q)

    @property
    def old(self) -> slice:
        """Indices of the measured rows' numbers among all whitened numbers."""
        return slice(self.measured * self.design.components)

    @cached_property
    def since(self) -> Floats:
        """((N + M) c, 6 + n) whitened displacements by changes after the measured rows: instrument's pose, drives' zeros."""
        twist, size = frame_twist(self.design.operating_points)
        frame = self.design.columns(Displacement(size, twist=twist))
        zeros = ZERO * self.design.by_command.reshape(len(frame), -1)
        changed = np.hstack([frame, zeros])
        changed[self.old] = 0.0
        return changed


def possible(known: Known, words: Collection[str], count: int, rng: np.random.Generator, effort: float = 1.0) -> Trials:
    """Random rows, over the measured workspace and over the values to which some covariates can be set.

    Half of the commands are measured ones, the others are between two measured ones.

    ``words``, ``effort``: covariates to vary; see :func:`~gtpin.diagnosis.planning.measurement_conditions.draw`. ``count``:
    number of rows before those that can't be reached are left out.
    """
    from scipy.spatial import cKDTree

    observed, model, before = known.observed, known.model, known.operating_points
    measured = observed.measured
    again = rng.choice(len(measured.q), min(count // 2, len(measured.q)), replace=False)
    a, b = rng.integers(0, len(measured.q), (2, count - len(again)))
    between = measured.q[a] + rng.random((len(a), 1)) * (measured.q[b] - measured.q[a])
    q = np.vstack([measured.q[again], np.round(between / RESOLUTION) * RESOLUTION])
    poses = model.kinematics.forward(q)
    q, poses = q[poses.reached], poses[poses.reached]
    ways = _against(known, q, poses)
    drawn = draw(observed.covariates, len(before), known.references, words, rng, ways=ways, effort=effort)
    # A further pose is read by the same instrument and with the same noise as the nearest measured one.
    rows = np.concatenate([np.arange(len(before)), cKDTree(before.poses.T).query(poses.T)[1]])
    operating_points = OperatingPoints(
        before.kinematics,
        np.vstack([measured.q, q]),
        before.poses.followed_by(poses),
        {name: np.concatenate([drawn.known[name], drawn.new[name]]) for name in drawn.new},
        drawn.references,
        observed.temperature,
    )
    design = Design.of(
        operating_points,
        model,
        measured.at_trials(rows, operating_points.q),
        observed.noise.take(rows),
        np.concatenate([observed.weight, np.ones(len(q))]),
        observed.free_frame,
    )
    return Trials(design, len(before), q, drawn)


def _against(known: Known, q: Floats, poses: Poses) -> Floats:
    """(M, k, 3) unit vectors along which a force on the tool reduces the force of each rod most; the base frame's axes where
    there is no rod.
    """
    at = OperatingPoints(known.operating_points.kinematics, q, poses, {})
    if not at.force.shape[1]:
        return np.tile(np.eye(3), (len(q), 1, 1))
    ways = -np.sign(at.force)[:, :, None] * np.swapaxes(at.response[:, :3], 1, 2)
    return np.asarray(ways / np.linalg.norm(ways, axis=2, keepdims=True))
