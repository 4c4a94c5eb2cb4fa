"""What an effect may depend on: commands, covariates, poses, directions and forces of the rods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.errors import ModelError
from gtpin.kinematics.closures import pose_jacobian, rod_vectors
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.kinematics.statics import rod_forces
from gtpin.robot.robot import Robot

Floats = npt.NDArray[np.float64]
Column = npt.NDArray[np.float64] | npt.NDArray[np.object_]


@dataclass(frozen=True)
class References:
    """What covariates are counted from, and what they are divided by: fixed when an effect is fitted, kept with it.

    Parameters
    ----------
    temperature
        degC at which the geometry holds.
    time
        Start and span, s.
    sessions
        In the order of their effects' coefficients.
    force
        (k,) mean and (k,) spread of each rod's axial force, N.
    direction
        (k, 3) mean unit vector of each rod, from carrier to platform, base frame, and (k,) its spread, rad.
    covariates
        Names of those that the fit knew: its coefficients count on them.
    """

    temperature: float
    time: tuple[float, float]
    sessions: tuple[str, ...]
    force: tuple[Floats, Floats]
    direction: tuple[Floats, Floats]
    covariates: tuple[str, ...]


@dataclass(frozen=True)
class Situation:
    """N poses of a robot with rods, and the measurement conditions of each.

    Parameters
    ----------
    kinematics
        Kinematics of the geometry at which the displacements are computed.
    q
        (N, n) commands, m or rad.
    poses
        The N poses of this geometry at q, base frame, m.
    covariates
        By name, (N,) each.
    fixed
        Reference values of covariates from an earlier fit. Left out, they are computed from these data.
    temperature
        Reference temperature, degC, at which the geometry is valid.
    unusable
        Names of covariates that were recorded but can't be right. They are not in ``covariates``.
    """

    kinematics: RodKinematics
    q: Floats
    poses: Poses
    covariates: Mapping[str, Column]
    fixed: References | None = None
    temperature: float = 20.0
    unusable: frozenset[str] = frozenset()

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.kinematics.geometry.robot

    def __len__(self) -> int:
        return len(self.q)

    def covariate(self, name: str) -> Floats:
        """(N,) a numeric covariate.

        Raises
        ------
        ModelError
            If it is not there.
        """
        if name not in self.covariates:
            raise ModelError(f"the covariate {name} is missing", column=name, hint=f"give a column {name}")
        return np.asarray(self.covariates[name], dtype=float)

    def has(self, name: str) -> bool:
        """Whether a covariate is there or, where the references are those of an earlier fit, was there.

        An effect that was fitted with a covariate keeps its form, and asks for it, wherever it is applied.
        """
        return name in (self.covariates if self.fixed is None else self.fixed.covariates)

    def varies(self, name: str) -> bool:
        """Whether a covariate is there and takes more than one value."""
        return name in self.covariates and bool((self.covariates[name] != self.covariates[name][0]).any())

    @cached_property
    def vectors(self) -> tuple[Floats, Floats]:
        """d = T + R P - C and R P, both (N, k, 3), base frame, m."""
        return rod_vectors(self.poses, self.kinematics.ends(self.q))

    @cached_property
    def length(self) -> Floats:
        """(N, k) lengths of the rods, m."""
        return np.asarray(np.linalg.norm(self.vectors[0], axis=2))

    @cached_property
    def along(self) -> Floats:
        """(N, k, 3) unit vectors of the rods, from carrier to platform, base frame."""
        return np.asarray(self.vectors[0] / self.length[..., None])

    @cached_property
    def response(self) -> Floats:
        """(N, 6, k) motion of the TCP, base frame, by lengthening each rod: m and rad per m."""
        return np.asarray(np.linalg.inv(pose_jacobian(*self.vectors)) * self.length[:, None, :])

    @cached_property
    def command_jacobian(self) -> Floats:
        """(N, 6, n) motion of the TCP, base frame, by the commands."""
        return self.kinematics.command_jacobian(self.q, self.poses)

    @cached_property
    def carrier_joints(self) -> Floats:
        """(N, k, 3) the rods' joints on their carriers, base frame, m."""
        return self.kinematics.ends(self.q).C

    @cached_property
    def force(self) -> Floats:
        """(N, k) axial force of each rod, N, tension positive: gravity of plate, rods and payload, and the tool's force."""
        # Loads that the fit knew must be given; one that it did not know counts where it is given.
        given = {
            name: self.covariate(name)
            for name in ("fx", "fy", "fz", "payload")
            if self.has(name) or name in self.covariates
        }
        payload = given.pop("payload", None)
        none = np.zeros(len(self))
        tool = np.stack([given.get(name, none) for name in ("fx", "fy", "fz")], axis=1) if given else None
        return rod_forces(self.kinematics, self.q, self.poses, tool, payload)

    @cached_property
    def references(self) -> References:
        """The references of an earlier fit, or else of this data."""
        if self.fixed is not None:
            return self.fixed
        time = self.covariate("time") if self.has("time") else np.zeros(1)
        sessions = tuple(sorted({str(s) for s in self.covariates["session"]})) if self.has("session") else ()
        mean = self.along.mean(axis=0)
        mean /= np.linalg.norm(mean, axis=1)[:, None]
        spread = np.sqrt(((self.along - mean) ** 2).sum(axis=2).mean(axis=0))
        return References(
            temperature=self.temperature,
            time=(float(time.min()), max(float(np.ptp(time)), 1e-9)),
            sessions=sessions,
            force=(self.force.mean(axis=0), np.maximum(self.force.std(axis=0), 1e-9)),
            direction=(mean, np.maximum(spread, 1e-9)),
            covariates=tuple(sorted(self.covariates)),
        )

    @cached_property
    def time(self) -> Floats:
        """(N,) time from -1 at the first to 1 at the last pose of the fit."""
        start, span = self.references.time
        return np.asarray(2.0 * (self.covariate("time") - start) / span - 1.0)

    @cached_property
    def travel(self) -> Floats:
        """(N, n) commands from -1 to 1 over the actuators' ranges; over one turn where there is no end to them."""
        lower, upper = self.robot.lower, self.robot.upper
        lower = np.where(np.isfinite(lower), lower, -np.pi)
        upper = np.where(np.isfinite(upper), upper, np.pi)
        return np.asarray(2.0 * (self.q - lower) / (upper - lower) - 1.0)

    @cached_property
    def load(self) -> Floats:
        """(N, k) rods' forces, less their mean and over their spread in the fit."""
        mean, spread = self.references.force
        return np.asarray((self.force - mean) / spread)

    @cached_property
    def tilt(self) -> Floats:
        """(N, k, 2) directions of the rods about their mean in the fit, in spreads."""
        mean, spread = self.references.direction
        tilts = np.empty((*self.along.shape[:2], 2))
        for i, axis in enumerate(mean):
            first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
            first /= np.linalg.norm(first)
            tilts[:, i] = self.along[:, i] @ np.stack([first, np.cross(axis, first)], axis=1) / spread[i]
        return tilts
