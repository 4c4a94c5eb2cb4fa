"""Drives of a mechanism: scales, the travel as a curve of the command, and play."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gtpin.compensation.machine import correctable, geometric_scales
from gtpin.effects.active import ActiveEffect
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.smooth import loads_of
from gtpin.export.loss import by_effect, conditions, rms
from gtpin.extras.simulators.curves import NOTHING, SAME, WORTH, DriveCurve, fitted
from gtpin.extras.simulators.mechanism import Coupling, Drive, Guide, Joint, Mechanism, Play, shaft
from gtpin.model.model import Model
from gtpin.typing import Floats

BEYOND = 0.02
"""Weight of commands over the actuator's whole range in the fit of a curve; those within the model's fit have weight 1. It is
so small that the curve changes little within the commands of the model's fit."""
STRAIGHT = 1e-9
"""Largest deviation, m or rad, of the travel from a proportional one that is exported as a gear ratio."""
SPREADS = 3.0
"""Standard deviations above the mean load up to which the friction of a guide must hold."""
NEWTON = 10
"""Number of Newton steps to invert a curve whose slope is about 1."""
LEAST_PLAY = 1e-8
"""Smallest play that is exported, m or rad."""
WIDTHS = 4
"""Number of half waves over the range in the width of a play: ``backlash`` has two."""


@dataclass(frozen=True, eq=False)
class Law:
    """Deviation of a drive's travel from its command, m or rad: along(q) - half_width(q) * direction of approach.

    ``half_width``: half the play, negative where the drive overshoots. ``load``: bound of the load on the drive in the model's
    fit, N or N m.
    """

    along: DriveCurve
    half_width: DriveCurve
    load: float

    def at(self, q: Floats, approach: Floats | float) -> Floats:
        """(N,) deviation, m or rad, at commands and directions of approach (N,)."""
        return np.asarray(self.along(q) - self.half_width(q) * approach)


def with_drives(mechanism: Mechanism, model: Model, session: str | None) -> tuple[Mechanism, dict[str, Floats]]:
    """Drives with a model's scales, and its effects along actuators.

    A travel in proportion to the command is written as a gear ratio. Otherwise the command moves a motor ``SITE_motor``, and
    the actuator's joint follows it by a curve. Play is a joint ``SITE_play`` in series with the actuator's. Friction holds what
    is behind the play, so that the deviation depends on the direction of approach, as in the effect. Where a drive overshoots,
    friction moves the part behind the play twice as far as the actuator's joint moves, until the play is taken up.

    Returns ``mechanism``: the mechanism with an additional body for each motor. ``shown``: by name, for each effect in it:
    the (N, 6) motion of the TCP, m and rad, at :func:`~gtpin.export.loss.conditions`.
    """
    robot = model.robot
    effects = correctable(model, session)
    shown: dict[str, Floats] = {}
    scales = geometric_scales(model)
    for index, site in enumerate(robot.sites):
        laws = []
        for active in effects:
            if active.site == site:
                law, moved = _law(model, index, active, session)
                if moved is not None:
                    laws.append(law)
                    shown[active.name] = moved
        mechanism = _driven(mechanism, mechanism.drives[index], scales[site], laws)
    return mechanism, shown


def _law(model: Model, index: int, active: ActiveEffect, session: str | None) -> tuple[Law, Floats | None]:
    """The part of an effect that a drive can represent, and its motion of the TCP; None where that part is too small."""
    at = conditions(model, active, session)
    # The same conditions with the actuator's commands over its whole range.
    lower, upper = model.robot.ends
    over = at.q.copy()
    over[:, index] = np.linspace(lower[index], upper[index], len(over))
    poses = model.kinematics.forward(over)
    rows = np.flatnonzero(poses.reached)
    known = {name: values[rows] for name, values in at.covariates.items()}
    far = replace(
        OperatingPoints(model.kinematics, over[rows], poses[rows], known, at.fixed), temperature=at.temperature
    )
    q = np.concatenate([at.q[:, index], far.q[:, index]])
    up, down = (np.concatenate([_travel(active, s, index, side) for s in (at, far)]) for side in (1.0, -1.0))
    weight = np.repeat([1.0, BEYOND], [len(at), len(far)])
    slope, middle = np.polyfit(at.q[:, index], at.travel[:, index], 1)  # the travel is -1 and 1 at its ends
    ends = float((-1.0 - middle) / slope), float((1.0 - middle) / slope)
    half = (down - up) / 2.0
    width, mean = fitted(q, half, ends, weight, slope=False, count=WIDTHS), float(np.average(half, weights=weight**2))
    if not (np.sign(mean) * width(np.linspace(*ends, 101))).min() > LEAST_PLAY:  # too small somewhere
        width = DriveCurve(mean, 0.0)
    _, load, spread = loads_of(at, active.site)
    most = float((np.abs(load) + SPREADS * spread).sum())
    law = Law(fitted(q, (up + down) / 2.0, ends, weight), width, most)
    came = f"approach{index + 1}"
    held = law.at(at.q[:, index], at.covariate(came) if came in at.covariates else 0.0)
    moved = at.command_jacobian[:, :6, index] * held[:, None]
    whole = by_effect(active, at)
    return law, moved if rms(whole - moved) <= WORTH * rms(whole) else None


def _travel(active: ActiveEffect, at: OperatingPoints, index: int, approach: float) -> Floats:
    """(N,) deviation of the actuator's travel, m or rad, if it comes from the direction ``approach``, +1 or -1."""
    name = f"approach{index + 1}"
    if name in at.covariates:
        at = at.with_covariate(name, np.full(len(at), approach))
    command = active.basis(at).command
    assert command is not None
    return np.asarray(command[1] @ active.coefficients)


def _driven(mechanism: Mechanism, drive: Drive, scale: float, laws: Sequence[Law]) -> Mechanism:
    """The mechanism with the scale of one drive and the sum of its laws."""
    joint = mechanism.joint(drive.joint)
    travel, half = SAME, NOTHING
    for law in laws:
        travel, half = travel.plus(law.along), half.plus(law.half_width)
    travel, half = travel.times(scale), half.times(scale)
    ends = np.array([drive.lower, drive.upper])
    ends = np.where(np.isfinite(ends), ends, [-np.pi, np.pi])
    gear = float(travel(ends[1]) - travel(ends[0])) / float(ends[1] - ends[0])
    there = np.linspace(ends[0], ends[1], 101)
    if np.abs(travel(there) - gear * there).max() <= STRAIGHT and not half.harmonics:
        driven = [replace(joint, lower=joint.lower * gear, upper=joint.upper * gear)]
        mechanism = _with_drive(mechanism, drive, replace(drive, scale=gear))
    else:
        mechanism = _with_motor(mechanism, drive, joint, travel)
        limits = [float(travel(x)) if np.isfinite(x) else x for x in (joint.lower, joint.upper)]
        driven = [replace(joint, lower=limits[0], upper=limits[1])]
    ahead = half.offset < 0.0  # the play is then taken up in the direction of the motion
    if ahead:
        half = half.times(-1.0)
    if half.offset > LEAST_PLAY:
        most = float(half(there).max())
        play = replace(joint, name=f"{drive.site}_play", home=0.0, lower=-most, upper=most, play=True)
        if half.harmonics:
            motor = next(moved for moved in mechanism.drives if moved.site == drive.site)
            mechanism = replace(
                mechanism, plays=(*mechanism.plays, Play(play.name, motor.joint, half.about(motor.home)))
            )
        guide = Guide(drive.site, (joint.name, play.name), max(law.load for law in laws), ahead)
        mechanism = replace(mechanism, guides=(*mechanism.guides, guide))
        driven.append(play)
    return mechanism.with_joints(joint.name, driven)


def _with_motor(mechanism: Mechanism, drive: Drive, joint: Joint, travel: DriveCurve) -> Mechanism:
    """The mechanism with a motor whose coordinate is the command, and the actuator's joint coupled to it by the curve
    ``travel``.

    The motor is a hinge also if the actuator slides, with 1 rad per m of the command: of a slide joint in a coupling, MuJoCo
    4.0 would ignore the reflected inertia in the stiffness of the coupling (``dof_invweight0``).
    """
    home = joint.home
    for _ in range(NEWTON):
        home -= float(travel(home) - joint.home) / float(travel.slope(home))
    motor = Joint(f"{drive.site}_motor", "hinge", np.array([0.0, 0.0, 1.0]), np.zeros(3), home)
    about_home = travel.about(home).plus(DriveCurve(-joint.home, 0.0))
    mechanism = replace(mechanism, bodies=(*mechanism.bodies, shaft(mechanism.bodies[0], motor)))
    mechanism = mechanism.with_couplings([Coupling(joint.name, motor.name, about_home)])
    return _with_drive(mechanism, drive, replace(drive, joint=motor.name, home=home))


def _with_drive(mechanism: Mechanism, old: Drive, new: Drive) -> Mechanism:
    return replace(mechanism, drives=tuple(new if drive is old else drive for drive in mechanism.drives))
