"""The quantities on which an effect may depend: commands, covariates, poses, and directions and forces of the rods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.effects.sites import joints
from gtpin.errors import ModelError
from gtpin.kinematics.dynamics import Loads
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.motion import FrameMotion
from gtpin.kinematics.poses import Poses
from gtpin.robot.chain import Chain
from gtpin.robot.placement_frames import frame_of_anchor
from gtpin.typing import Floats

Column = npt.NDArray[np.float64] | npt.NDArray[np.object_]

TURN = 2.0 * np.pi
"""One turn, rad."""
PARTS = 72
"""Number of parts of a turn for which it is stored whether a fit had poses there: 5 degrees each. Assumed: two thirds of the
wavelength of 48 periods a turn."""
FEW_OF = 2000
"""A part of a turn counts as measured if it has at least one of this many of a fit's poses. Assumed."""

_TOOL = ("fx", "fy", "fz", "payload")
"""Covariates of what acts on the tool."""
_OF_POSES = ("vectors", "length", "along", "command_jacobian", "bodies", "carrier_joints")
"""Cached members of operating points that no covariate changes."""
_OF_LOADS = ("loads",)
"""Cached members that no covariate changes but those of the tool."""


@dataclass(frozen=True)
class References:
    """Reference values that are subtracted from quantities, and spreads that divide them.

    They are computed when an effect is fitted, and stored with it. A spread is a standard deviation over the poses of the fit.

    - ``temperature``: temperature, degC, at which the geometry is valid.
    - ``time``: first value and range of the column ``time``, s.
    - ``sessions``: names of the sessions, in the order of their coefficients.
    - ``force``: (k,) mean and (k,) spread of each rod's axial force, N.
    - ``direction``: (k, 3) mean unit vector of each rod, from carrier to platform, base frame, and (k,) its spread, rad.
    - ``covariates``: names of the covariates of the fit. The fitted effects need those of them that they use.
    - ``commands``: robots without rods: (n,) smallest and (n,) largest commands, m or rad.
    - ``angles``: robots without rods: (n, ``PARTS``) whether each part of a joint's turn had commands, from angle 0; all
      False for sliding joints, and empty where it is not known.
    - ``joints``: robots without rods: (J + 1, 6) mean and (J + 1, 6) spread of the loads on J joints and the TCP, N and N
      m, as in :class:`~gtpin.kinematics.dynamics.Loads`.
    """

    temperature: float
    time: tuple[float, float]
    sessions: tuple[str, ...]
    force: tuple[Floats, Floats]
    direction: tuple[Floats, Floats]
    covariates: tuple[str, ...]
    commands: tuple[Floats, Floats] = (np.zeros(0), np.zeros(0))
    joints: tuple[Floats, Floats] = (np.zeros((0, 6)), np.zeros((0, 6)))
    angles: npt.NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, PARTS), dtype=bool))


@dataclass(frozen=True)
class OperatingPoints:
    """N poses of a robot, and the measurement conditions of each.

    The number of rods is k (0 for a robot without rods), of actuators n, of measured joints j, and of the chain's frames F.

    Parameters
    ----------
    kinematics
        Kinematics of the geometry at which the displacements are computed.
    q
        (N, n) commands, m or rad.
    poses
        The N poses of this geometry at q, base frame; positions in m.
    covariates
        By name, (N,) each.
    fixed
        Reference values of covariates from an earlier fit. Left out, they are computed from these data.
    temperature
        Reference temperature, degC, at which the geometry is valid.
    unusable
        Names of covariates that were recorded but can't be right. They are not in ``covariates``.
    """

    kinematics: Kinematics
    q: Floats
    poses: Poses
    covariates: Mapping[str, Column]
    fixed: References | None = None
    temperature: float = 20.0
    unusable: frozenset[str] = frozenset()

    @property
    def robot(self) -> Chain:
        """The robot."""
        return self.kinematics.geometry.robot

    def __len__(self) -> int:
        return len(self.q)

    def covariate(self, name: str) -> Floats:
        """(N,) a numeric covariate.

        Raises
        ------
        ModelError
            If the covariate is missing.
        """
        if name not in self.covariates:
            raise ModelError(f"the covariate {name} is missing", column=name, hint=f"give a column {name}")
        return np.asarray(self.covariates[name], dtype=float)

    def has(self, name: str) -> bool:
        """Whether a covariate is in these data or, where ``fixed`` is given, was in the data of the earlier fit.

        An effect that was fitted with a covariate needs this covariate wherever it is applied.
        """
        return name in (self.covariates if self.fixed is None else self.fixed.covariates)

    def with_covariate(self, name: str, values: Column) -> OperatingPoints:
        """The same poses with one more covariate; what the poses alone determine is not computed again."""
        changed = replace(self, covariates={**self.covariates, name: values})
        known = [*_OF_POSES, *(() if name in _TOOL else _OF_LOADS)]
        changed.__dict__.update({key: self.__dict__[key] for key in known if key in self.__dict__})
        return changed

    def varies(self, name: str) -> bool:
        """Whether a covariate is in these data and has more than one value."""
        return name in self.covariates and bool((self.covariates[name] != self.covariates[name][0]).any())

    @cached_property
    def vectors(self) -> tuple[Floats, Floats]:
        """d = T + R P - C and R P, both (N, k, 3), base frame, m, with T, R the pose and P, C the rod's two joints.

        P is in the TCP frame: the joint on the platform. C is in the base frame: the joint on the carrier.
        """
        on_platform, on_carriers = self.kinematics.rod_ends(self.q, self.poses)
        return on_platform - on_carriers, on_platform - self.poses.T[:, None]

    @cached_property
    def length(self) -> Floats:
        """(N, k) lengths of the rods, m."""
        return np.asarray(np.linalg.norm(self.vectors[0], axis=2))

    @cached_property
    def along(self) -> Floats:
        """(N, k, 3) unit vectors of the rods, from carrier to platform, base frame."""
        return np.asarray(self.vectors[0] / self.length[..., None])

    @property
    def response(self) -> Floats:
        """(N, 6 + j, k) motion of the TCP and j measured joints per change of each rod's length, base frame, m/m and rad/m."""
        return self.bodies.by_rod_lengths

    def lengthened(self, length: Floats) -> dict[int, Floats]:
        """By index of a frame, the twists (N, 6) that change the rods' lengths by ``length`` (N, k), m."""
        ways = enumerate(self.robot.longer_rods)
        return {frame: length[:, i, None] * way for i, (frame, way) in ways if length[:, i].any()}

    def on_carriers(self, moved: Floats) -> dict[int, Floats]:
        """By index of a frame, the twists (N, 6, m) that move the rods' joints on carriers by (N, k, 3, m), base frame, m."""
        found = {}
        for i, seat in enumerate(self.robot.rod_seats):
            if moved[:, i].any():
                frame = frame_of_anchor(self.robot, seat)
                own = np.swapaxes(self.bodies.frame(frame)[0], 1, 2) @ moved[:, i]
                found[frame] = np.concatenate([own, np.zeros_like(own)], axis=1)
        return found

    @cached_property
    def command_jacobian(self) -> Floats:
        """(N, 6 + j, n) motion of the TCP, base frame, and of the j measured joints, per change of each command."""
        return self.kinematics.command_jacobian(self.q, self.poses, self.bodies)

    @cached_property
    def bodies(self) -> FrameMotion:
        """First-order motion of the TCP for displacements of the chain's frames: joints, tool, loops' anchors."""
        return self.kinematics.motion(self.q, self.poses)

    @cached_property
    def loads(self) -> Loads:
        """The static loads on joints, loops, rods and actuators."""
        return self.kinematics.loads(self.q, self.poses, *self._tool)

    @property
    def joint_loads(self) -> Floats:
        """(N, J + 1, 6) loads on the joints' placement frames and the TCP, N and N m: see ``Loads.joints``."""
        return self.loads.joints

    @cached_property
    def carrier_joints(self) -> Floats:
        """(N, k, 3) positions of the carrier joints, base frame, m."""
        d, RP = self.vectors
        return np.asarray(self.poses.T[:, None] + RP - d)

    @property
    def force(self) -> Floats:
        """(N, k) axial force of each rod, N, tension positive, from gravity of plate, rods and payload and the tool's force."""
        return self.loads.rods

    def rod_shares(self, error: Floats, noise: Floats) -> dict[str, float]:
        """Each rod's share of errors of the TCP's pose: of the mean squares beyond noise that they are in the rods' lengths.

        The shares sum to 1, or are all zero where noise explains the errors; there are none without rods. ``error``: (N, c) the
        first c components, base frame, m and rad; others count as zero. ``noise``: (c, c) or (N, c, c) root of its covariance.
        """
        if not self.robot.rod_sites:
            return {}
        to_rods = np.linalg.inv(self.response[:, :6])[:, :, : error.shape[1]]
        power = (np.einsum("nkc,nc->nk", to_rods, error) ** 2).mean(axis=0)
        left = np.maximum(power - ((to_rods @ noise) ** 2).sum(axis=2).mean(axis=0), 0.0)
        return dict(zip(self.robot.rod_sites, (left / (left.sum() or 1.0)).tolist(), strict=True))

    @cached_property
    def _tool(self) -> tuple[Floats | None, Floats | None]:
        """(N, 3) force on the tool, base frame, N, and (N,) payload, kg, where they are given."""
        # Loads that were recorded for the fit must be given. Other loads count where they are given.
        given = {name: self.covariate(name) for name in _TOOL if self.has(name) or name in self.covariates}
        payload = given.pop("payload", None)
        none = np.zeros(len(self))
        tool = np.stack([given.get(name, none) for name in ("fx", "fy", "fz")], axis=1) if given else None
        return tool, payload

    @cached_property
    def references(self) -> References:
        """``fixed``, the references of an earlier fit, where given; otherwise computed from these data."""
        if self.fixed is not None:
            return self.fixed
        time = self.covariate("time") if self.has("time") else np.zeros(1)
        sessions = tuple(sorted({str(s) for s in self.covariates["session"]})) if self.has("session") else ()
        start, span = float(time.min()), max(float(np.ptp(time)), 1e-9)
        mean = self.along.mean(axis=0)
        mean /= np.linalg.norm(mean, axis=1)[:, None]
        spread = np.sqrt(((self.along - mean) ** 2).sum(axis=2).mean(axis=0))
        found = References(
            temperature=self.temperature,
            time=(start, span),
            sessions=sessions,
            force=(self.force.mean(axis=0), np.maximum(self.force.std(axis=0), 1e-9)),
            direction=(mean, np.maximum(spread, 1e-9)),
            covariates=tuple(sorted(self.covariates)),
        )
        if not joints(self.robot):
            return found
        loads = self.joint_loads
        largest = np.abs(loads).max(axis=(0, 1))
        least = np.maximum(LEAST_SPREAD * np.repeat([largest[:3].max(), largest[3:].max()], 3), LIGHT)
        count = np.stack([np.bincount(column, minlength=PARTS) for column in part_of_turn(self.q).T])
        return replace(
            found,
            commands=(self.q.min(axis=0), np.maximum(self.q.max(axis=0), self.q.min(axis=0) + 1e-9)),
            joints=(loads.mean(axis=0), np.maximum(loads.std(axis=0), least)),
            angles=(count >= max(1.0, len(self.q) / FEW_OF)) & np.asarray(self.robot.revolute)[:, None],
        )

    @cached_property
    def time(self) -> Floats:
        """(N,) time without unit, from -1 at the first pose of the fit to 1 at the last."""
        start, span = self.references.time
        return np.asarray(2.0 * (self.covariate("time") - start) / span - 1.0)

    @property
    def lateness(self) -> Floats:
        """(N,) ``time`` within the fit's range, -1 to 1: outside, nothing is known of a change. Poses without a time are of its
        end; where the fit had none, 0."""
        if self.has("time") and "time" in self.covariates:
            return np.clip(self.time, -1.0, 1.0)
        return np.full(len(self), float(self.has("time")))

    @cached_property
    def travel(self) -> Floats:
        """(N, n) commands without unit, from -1 at the lower to 1 at the upper end of the actuator's range.

        For a range without limits: from -pi to pi. For a robot without rods, whose joints often use a small part of their
        range: from the smallest to the largest command of the fit.
        """
        lower, upper = self.references.commands if joints(self.robot) else self.robot.ends
        return np.asarray(2.0 * (self.q - lower) / (upper - lower) - 1.0)

    @cached_property
    def load(self) -> Floats:
        """(N, k) (F - mean) / spread of the rods' forces F, without unit; mean and spread are over the poses of the fit."""
        mean, spread = self.references.force
        return np.asarray((self.force - mean) / spread)

    @cached_property
    def tilt(self) -> Floats:
        """(N, k, 2) the two components of each rod's direction across its mean direction, divided by the spread in the fit."""
        mean, spread = self.references.direction
        tilts = np.empty((*self.along.shape[:2], 2))
        for i, axis in enumerate(mean):
            first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
            first /= np.linalg.norm(first)
            tilts[:, i] = self.along[:, i] @ np.stack([first, np.cross(axis, first)], axis=1) / spread[i]
        return tilts


def part_of_turn(angle: Floats) -> npt.NDArray[np.intp]:
    """Index of the part of a turn that has each angle, rad; whole turns make no difference."""
    return np.asarray(np.floor(angle / TURN * PARTS).astype(int) % PARTS)


LIGHT = np.repeat([1.0, 0.1], 3)
"""Smallest spread of a load: of forces, N, and of moments, N m. It is used for robots whose URDF has no masses. Assumed."""
LEAST_SPREAD = 0.02
"""Smallest spread of a load, relative to the largest load of its kind (force or moment) on any joint. A joint without a load
in the fit may have a load in a later prediction. Assumed."""
