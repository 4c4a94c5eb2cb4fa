"""Readings that are late: the instrument or its time stamp, or the target, is behind a machine in motion."""

from __future__ import annotations

import numpy as np

from gtpin.effects.displacement import Displacement
from gtpin.effects.drive_errors import FAST
from gtpin.effects.effect import Effect, Parameters, unit
from gtpin.effects.modulation import MODULATION
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import number
from gtpin.effects.untestable import Untestable
from gtpin.robot.chain import Chain
from gtpin.typing import Floats


class MeasurementDelay(Effect):
    """dT = -tau V, dR = -tau_r W: a reading belongs to the pose that the machine had a time tau before its time stamp.

    V, m/s, and W, rad/s, are the velocity and the angular velocity of the TCP, from the speeds of the actuators and the
    Jacobian of the closed chain, base frame. dT is the deviation of the measured position, m, dR a rotation vector. Causes are
    an instrument, or its time stamp, that is late, and a target that lags behind on a soft holder. Drives that all lag by tau
    move the poses in the same way: data of the robot alone can't tell them apart. The modulation: tau depends on the speed, and
    orientations have a delay of their own (another sensor measures them, and a holder can shift the target without a turn).

    Parameters: ``delay`` tau, s, of positions at the speed 0.3 m/s, positive where the readings are behind the commands;
    ``turn_delay`` tau_r, s, of orientations; ``growth``: by how much tau increases, s, when the speed doubles from there.

    Typical size: tau 1 ms, half of the interval of a controller that states its joint positions 500 times per second (RTDE of
    Universal Robots, e-Series).
    """

    id = "measurement_delay"
    title = "late readings (or a target that lags)"
    clause = "the readings of {site} are late, or the target lags behind on a soft holder"
    remedy = (
        "Compare the delay with the drives' own following errors; measure at rest, or correct the time stamps by the delay; "
        "mount the target stiffly."
    )
    coefficient = ("delay", "s")
    acts_at = staticmethod(lambda _: ("frame",))
    between_visits = True
    core = (0,)

    def covariates(self, robot: Chain, site: str) -> tuple[str, ...]:
        return tuple(f"speed{number(robot, actuator)}" for actuator in robot.sites)

    def untestable(self, at: OperatingPoints, site: str) -> Untestable | None:
        names = self.covariates(at.robot, site)
        for name in names:
            if not at.has(name):
                return Untestable("unusable" if name in at.unusable else "missing", name)
        return None if any(at.varies(name) for name in names) else Untestable("constant", names[0])

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        speeds = np.stack([at.covariate(name) for name in self.covariates(at.robot, site)], axis=1)
        velocity = np.einsum("nij,nj->ni", at.command_jacobian, speeds)[:, : 6 + 3 * len(at.robot.measured_links)]
        turn, shift = velocity.copy(), velocity.copy()
        turn[:, :3], shift[:, 3:] = 0.0, 0.0
        faster = np.linalg.norm(velocity[:, :3], axis=1)[:, None] / FAST - 1.0
        sizes = unit([1.0, MODULATION.holder, MODULATION.holder], 1e-3)
        return Displacement(sizes, twist=-np.stack([velocity, turn, shift * faster], axis=2))

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        delay, turning, growth = (float(c) for c in coefficients)
        return {"delay": (delay, "s"), "turn_delay": (delay + turning, "s"), "growth": (growth, "s")}
