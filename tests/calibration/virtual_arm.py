"""A UR5 of the tests' own: joints and tool that are off, by Pinocchio's own forward kinematics, and its tracker."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from by_pinocchio import placed
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.data import InstrumentSection

Floats = np.ndarray
ROBOT = gtpin.load_robot("ur5")
AXES = ("x", "y", "z", "rx", "ry", "rz")
VIEW = Rotation.from_rotvec([0.3, -0.2, 1.0]), np.array([2.0, -1.0, 0.4])
"""The base frame in that of an instrument elsewhere."""


@dataclass(frozen=True)
class Arm:
    """A machine whose truth is known; ``off`` (6,) is added to commands (6,) before the joints move."""

    model: pin.Model
    deviations: dict[str, float]
    off: Callable[[Floats], Floats] = field(default=np.zeros_like)

    @staticmethod
    def drawn(
        rng: np.random.Generator, size: float, *, tool: bool = False, off: Callable[[Floats], Floats] = np.zeros_like
    ) -> Arm:
        """Joints, and with ``tool`` the tool, off by normal twists of a size, m and rad."""
        model, deviations = ROBOT.model.copy(), {}
        frame = model.frames[model.getFrameId(ROBOT.tcp_frame)]
        for joint in [*range(1, model.njoints), *([None] if tool else [])]:
            twist = size * rng.standard_normal(6)
            if joint is None:
                frame.placement = frame.placement * pin.exp6(twist)
            else:
                model.jointPlacements[joint] = model.jointPlacements[joint] * pin.exp6(twist)
            name = "platform" if joint is None else f"placement[{model.names[joint]}]"
            deviations |= {f"{name}.{axis}": value for axis, value in zip(AXES, twist, strict=True)}
        return Arm(model, deviations, off)

    def poses(self, q: Floats) -> tuple[Floats, Floats]:
        """Positions (N, 3), m, and rotations (N, 3, 3), base frame."""
        return placed(self.model, np.array([row + self.off(row) for row in q]), ROBOT.tcp_frame)

    def measured(
        self, q: Floats, rng: np.random.Generator, sigmas: tuple[float, float], *, free: bool = True
    ) -> gtpin.Dataset:
        """Poses as a tracker reads them with noise, m and rad; with ``free``, from elsewhere."""
        T, R = self.poses(q)
        turn, shift = VIEW if free else (Rotation.identity(), np.zeros(3))
        noise = Rotation.from_rotvec(sigmas[1] * rng.standard_normal(T.shape))
        frame = "free" if free else "robot"
        return gtpin.Dataset(
            robot="ur5",
            pose=np.arange(len(q)),
            q=q,
            position=turn.apply(T) + shift + sigmas[0] * rng.standard_normal(T.shape),
            orientation=(noise * turn * Rotation.from_matrix(R)).as_quat(scalar_first=True),
            instrument=InstrumentSection(position_sigma=sigmas[0], orientation_sigma=sigmas[1], frame=frame),
        )
