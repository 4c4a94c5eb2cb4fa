"""Errors of the measurement: its frame moves over time or between sessions, its scale is off, its target is elsewhere, or its
readings are late: the instrument or its time stamp, or the target, is behind a machine in motion."""

from __future__ import annotations

import numpy as np

from gtpin.effects.displacement import Displacement
from gtpin.effects.drive_errors import FAST
from gtpin.effects.effect import Effect, Parameters, unit
from gtpin.effects.modulation import MODULATION
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import number
from gtpin.effects.smooth import (
    FREEDOMS,
    GRID,
    SHIFT,
    TURN,
    cosines,
    frame_twist,
    session_columns,
    target_twist,
    wave,
)
from gtpin.effects.untestable import Untestable
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

DRIFT_ORDERS, DRIFT_DECAY = 8, 1.3
"""Number of cosines over the time of the fit for each degree of freedom of the frame, and the power p: the size of order k is
proportional to k^-p."""


def over_time(x: Floats) -> tuple[Floats, Floats]:
    """(N, m) cosines over time x (N,), -1 to 1, then a straight line, to whose ends few cosines do not reach; (m,) sizes."""
    waves, size = cosines(x, 1, DRIFT_ORDERS, DRIFT_DECAY)
    return np.column_stack([waves, x]), np.append(size, 1.0)


class TrackerDrift(Effect):
    """dT = s(t) + w(t) x (T - T_home), dR = w(t): all measured poses shift and rotate smoothly with time.

    T is the TCP position, m, T_home that at home; dR is a rotation vector. The shift s, m, and the rotation vector w, rad, are
    in the base frame; s is positive where the measured positions move towards the positive axis, w is right-handed. Outside
    the time range of the fit the drift is constant. The data do not show at what time the frame was right: s and w have a
    constant part as large as their changes. Where the frame is not free, only geometry can be in its place, and the sigmas of
    its parameters contain it.
    A robot's base that warms up or settles moves the poses in the same way: data of the robot alone can't tell the two apart.

    Parameters: ``shift_x``, ``_y``, ``_z``, m, and ``turn_x``, ``_y``, ``_z``, rad: s and w at the end of the fit's time
    range less at its beginning; ``largest_shift``, m, and ``largest_turn``, rad: the largest difference between two times,
    over the three axes.

    Typical size: 40 um of each component of s, 15 urad of w. A laser tracker may be off by 15 um + 6 um per metre
    across its line of sight (Leica Absolute Tracker, user's manual, after ISO 10360-10); that a tripod moves by as much
    is a guess.
    """

    id = "tracker_drift"
    title = "drift over time (or of the base)"
    clause = "{site}, or the robot's base, drifts over time"
    remedy = (
        "Measure reference nests on the floor in between: if they drift too, check the tracker's stand and warm-up; if they do "
        "not, the robot's base warms up or settles."
    )
    coefficient = ("shift_x", "m")
    acts_at = staticmethod(lambda _: ("frame",))
    needs = ("time",)

    def __init__(self, *, since_right: bool = False, line: bool = True) -> None:
        """``since_right``: whether the frame was right without the drift, so that there is no constant part. ``line``: whether
        there is a straight line besides the cosines; models of earlier releases have none."""
        self.since_right, self.line = since_right, line

    def as_change(self) -> TrackerDrift:
        return type(self)(since_right=True)

    def as_stored(self, coefficients: int) -> TrackerDrift:
        return type(self)(since_right=self.since_right, line=coefficients > 6 * (1 + DRIFT_ORDERS))

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        return _moved(*frame_twist(at), *self.over_time(at))

    def over_time(self, at: OperatingPoints) -> tuple[Floats, Floats]:
        """(N, k) a constant, cosines over the time of the fit and a straight line, and (k,) their sizes: the constant is as
        large as the others together are at the beginning, where most frames are set up."""
        x = np.clip(at.time, -1.0, 1.0)
        waves, size = over_time(x) if self.line else cosines(x, 1, DRIFT_ORDERS, DRIFT_DECAY)
        constant = 0.0 if self.since_right else np.linalg.norm(size)
        return np.hstack([np.ones((len(at), 1)), waves]), np.append(constant, size)

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        by_order = coefficients.reshape(-1, 6)[1:]  # without the constant part
        waves = over_time(GRID)[0] if self.line else cosines(GRID, 1, DRIFT_ORDERS)[0]
        moved = waves @ by_order
        drift, spans = moved[-1] - moved[0], np.ptp(moved, axis=0)
        return {
            **{name: (float(d), unit) for (name, unit), d in zip(FREEDOMS, drift, strict=True)},
            "largest_shift": (float(spans[:3].max()), "m"),
            "largest_turn": (float(spans[3:].max()), "rad"),
        }


class FrameShift(Effect):
    """dT = s + w x (T - T_home), dR = w: the measured poses shift and rotate by a constant amount in each session.

    T is the measured TCP position, T_home that at home, m; dR is a rotation vector. The shift s, m, and the rotation vector
    w, rad, are in the base frame. s is positive where the measured positions move towards the positive axis, w is
    right-handed. Causes are an instrument that was set up again, and a robot's base that moved: data of the robot alone can't
    tell the two apart. Geometry absorbs the mean over the sessions. In a prediction, a session that was not in the fit has the
    mean shift.

    Parameters: ``shift_x[k]``, ``shift_y[k]``, ``shift_z[k]``, m, and ``turn_x[k]``, ``turn_y[k]``, ``turn_z[k]``, rad: s and w
    of session k less their means over the sessions. Sessions are sorted by name. As a change since an earlier model:
    ``shift_x`` and so on, of all poses.

    Typical size: 40 um of each component of s, 15 urad of w, for a frame that is found from a few reference marks
    (source as for ``tracker_drift``).
    """

    id = "frame_shift"
    title = "shift between sessions (or of the base)"
    clause = "{site}, or the robot's base, has another pose in each session"
    since_a_model = True
    remedy = (
        "Tie the sessions together by reference nests on the floor: if they shift too, the instrument was set up elsewhere; if "
        "they do not, the robot's base moved."
    )
    coefficient = ("shift_x[1]", "m")
    acts_at = staticmethod(lambda _: ("frame",))
    needs = ("session",)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        sessions = session_columns(at)
        return _moved(*frame_twist(at), sessions, np.ones(sessions.shape[1]))

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        by_session = coefficients.reshape(-1, 6)
        if len(by_session) == 1:
            return {name: (float(value), unit) for (name, unit), value in zip(FREEDOMS, by_session[0], strict=True)}
        return {
            f"{name}[{k + 1}]": (float(value), unit)
            for k, values in enumerate(by_session - by_session.mean(axis=0))
            for (name, unit), value in zip(FREEDOMS, values, strict=True)
        }


class TargetDrift(TrackerDrift):
    """dT = R s(t), dR = R w(t): the tool, or the target on it, shifts and turns smoothly with time.

    The shift s, m, and the rotation vector w, rad, are in the TCP frame; R rotates from the TCP frame to the base frame. dT is
    the deviation of the measured position, m, dR a rotation vector. Causes are a tool that warms up and grows, and a holder
    that settles. A tool grows along its axis, the z axis of the TCP (ISO 9787); the shifts along x and y are smaller.

    Parameters: ``shift_x``, ``_y``, ``_z``, m, and ``turn_x``, ``_y``, ``_z``, rad: s and w at the end of the fit's time
    range less at its beginning; ``largest_shift``, m, and ``largest_turn``, rad: the largest difference between two times,
    over the three axes.

    Typical size: 40 um of s along z: a steel tool of 0.3 m that warms up by 10 K grows by 36 um. A quarter of it along
    x and y, a guess for a tool that bends; 15 urad of w, as of ``tracker_drift``.
    """

    id = "target_drift"
    title = "drift of the tool or target"
    clause = "the tool, or the target on {site}, drifts over time"
    remedy = "Measure the tool's length when it is cold and warm; check the holders of tool and target."
    acts_at = staticmethod(lambda _: ("platform",))

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        sizes = np.array([SHIFT * MODULATION.bending, SHIFT * MODULATION.bending, SHIFT, *[TURN] * 3])
        return _moved(target_twist(at), sizes, *self.over_time(at))


class TargetShift(FrameShift):
    """dT = R s, dR = R w: the tool, or the target on it, sits elsewhere in each session.

    The shift s, m, and the rotation vector w, rad, are constant in each session, in the TCP frame; R rotates from the TCP frame
    to the base frame. dT is the deviation of the measured position, m, dR a rotation vector. Geometry absorbs the mean over the
    sessions. In a prediction, a session that was not in the fit has the mean shift.

    Parameters: ``shift_x[k]``, ``shift_y[k]``, ``shift_z[k]``, m, and ``turn_x[k]``, ``turn_y[k]``, ``turn_z[k]``, rad: s and w
    of session k less their means over the sessions. Sessions are sorted by name.

    Typical size: 40 um of each component of s, 15 urad of w, as of ``frame_shift``: a guess for a magnetic nest that is put
    back.
    """

    id = "target_shift"
    title = "shift of the tool or target between sessions"
    clause = "the tool, or the target on {site}, sits elsewhere in each session"
    since_a_model = False
    remedy = "Measure the target's place on the platform in each session; use a holder with a stop."
    acts_at = staticmethod(lambda _: ("platform",))

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        sessions = session_columns(at)
        return _moved(target_twist(at), np.array([SHIFT] * 3 + [TURN] * 3), sessions, np.ones(sessions.shape[1]))


def _moved(twist: Floats, freedom: Floats, over: Floats, size: Floats) -> Displacement:
    """Motions ``twist`` (N, 6 + 3 l, 6) in six degrees of freedom, each times the columns ``over`` (N, k).

    ``freedom``, ``size``: sizes of the degrees of freedom (6,) and of the columns (k,).
    """
    columns = (twist[:, :, None] * over[:, None, :, None]).reshape(*twist.shape[:2], -1)
    return Displacement(np.outer(size, freedom).ravel(), twist=columns)


SCALE = 3e-5
"""Typical size of the scale error, m/m."""


class TrackerScale(Effect):
    """dT = s (T - T_home): measured lengths are too long where s > 0. T is the TCP position, T_home that at home, m.

    Another centre of the scaling only adds a constant shift, which geometry absorbs. Where the scale varies with time or with
    the temperature of the air, all measured positions also shift along the line of sight. The instrument's position is not
    used, so the shift can have any direction.

    Parameters: ``scale`` s, m/m.

    Typical size: s 3e-5. Air that is 1 K warmer than assumed causes 1e-6 (its refractive index: Ciddor, Applied Optics
    35, 1996); a wrong scale bar, or a wrong temperature of the part, more.
    """

    id = "tracker_scale"
    title = "wrong length scale"
    clause = "the instrument's length scale is off"
    remedy = "A fault of the measurement: check the tracker's weather station and its scale on a calibrated bar."
    coefficient = ("scale", "m/m")
    acts_at = staticmethod(lambda _: ("frame",))
    depends_on = ("position",)
    stretches_frame = True
    core = (0,)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        waves = []
        if at.has("time"):
            t = np.clip(at.time, -1.0, 1.0)
            waves += [wave(t, k) / k for k in (1, 2, 3)]
        if at.has("temp_frame"):
            waves.append((at.covariate("temp_frame") - at.references.temperature) / 3.0)
        twist = np.zeros((len(at), 6, 1 + 3 * len(waves)))
        twist[:, :3, 0] = at.poses.T - at.kinematics.home.T[0]
        for k, over in enumerate(waves):
            twist[:, :3, 1 + 3 * k : 4 + 3 * k] = np.eye(3) * over[:, None, None]
        return Displacement(np.concatenate([[SCALE], np.full(3 * len(waves), SCALE * MODULATION.wander)]), twist=twist)


class TargetOffset(Effect):
    """dT = R p: the target is at p in the TCP frame, not at the TCP; R rotates from the TCP frame to the base frame.

    dT is the deviation of the measured position, m, base frame.

    A geometry in which all joints on the platform are moved by -p predicts the same poses. Geometry therefore absorbs the
    offset as far as the tolerances of these joints allow.

    Parameters: ``offset_x``, ``offset_y``, ``offset_z``: p, m.

    Typical size: 1 mm of each component, the tolerance of a target holder that was not measured.
    """

    id = "target_offset"
    title = "target offset"
    clause = "the target is not where the TCP is assumed to be"
    remedy = "Measure the target's place on the platform."
    coefficient = ("offset_x", "m")
    acts_at = staticmethod(lambda _: ("platform",))
    depends_on = ("position",)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        twist = np.zeros((len(at), 6, 3))
        twist[:, :3] = at.poses.R
        return Displacement(unit(np.ones(3), 1e-3), twist=twist)

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        return {f"offset_{axis}": (float(c), "m") for axis, c in zip("xyz", coefficients, strict=True)}


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
