"""A joint of a robot without rods: its drive and bearing deflect under load, and its axis moves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np

from gtpin.effects.chain_motions import joint_frame, of_body, of_joint
from gtpin.effects.displacement import Displacement, along_track
from gtpin.effects.effect import Effect, ParameterRange, Parameters, unit
from gtpin.effects.modulation import MODULATION
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import joints, turns
from gtpin.effects.smooth import approach, cosines, loads_of
from gtpin.effects.untestable import Untestable
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

GIVE = {True: 3e-5, False: 5e-8}
"""Typical size of the compliance of a joint that turns, rad/(N m), and of a joint that slides, m/N."""


class JointCompliance(Effect):
    """dq = c M; dq is the deviation of the joint from its command, rad (m where it slides), and M the load on the joint.

    M is the moment about the joint's axis, N m. For a sliding joint it is the force along the axis, N. It comes from gravity of
    the links beyond the joint and of the payload, and from the force on the tool. M is positive where it acts towards larger
    commands. The modulation: c depends on the load, and friction causes a small hysteresis.

    Parameters: ``compliance`` c, positive where the joint moves in the direction of the load; ``stiffening``: by how much c
    increases when the load becomes twice the usual one, negative where the drive becomes stiffer; ``hysteresis``: c less its
    mean, where the joint moved towards larger commands before it stopped. All are in rad/(N m), or in m/N where the joint
    slides. The usual load is the absolute mean over the poses of the fit plus one standard deviation.

    Typical size: c 3e-5 rad/(N m), that of a strain wave gear of medium size, about 3e4 N m/rad (catalogue values);
    5e-8 m/N where the joint slides.
    """

    id = "joint_compliance"
    title = "drive deflection under load"
    clause = "the drive of {site} deflects under its load"
    remedy = "Use the corrected model with the payload given; check the gear and its preload."
    coefficient = ("compliance", "rad/(N m)")
    acts_at = staticmethod(joints)
    depends_on = ("load", "payload")
    exported_as = "joint_spring"
    load = "moment about the axis"
    core = (0,)
    plausible: ClassVar[Mapping[str, ParameterRange]] = {
        "compliance": ParameterRange(0.0, np.inf, "no drive moves against the load that it carries")
    }

    def untestable(self, at: OperatingPoints, site: str) -> Untestable | None:
        return None if loaded(at, site) else no_load(at)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        j = at.robot.sites.index(site)
        load, mean, spread = (values[..., 0] for values in loads_of(at, site))
        usual = max(abs(mean) + spread, 1e-9)
        columns = np.stack([load, load * (np.abs(load) / usual - 1.0), np.abs(load) * approach(at, j)], axis=1)
        sizes = [1.0, MODULATION.stiffening, MODULATION.friction]
        return along_track(at, site, columns, unit(sizes, GIVE[turns(at.robot, site)]))

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        names = ("compliance", "stiffening", "hysteresis")
        return {name: (float(c), "rad/(N m)") for name, c in zip(names, coefficients, strict=True)}

    def parameters_at(self, robot: Chain, site: str, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        unit = "rad/(N m)" if turns(robot, site) else "m/N"
        return {name: (value, unit) for name, (value, _) in self.parameters(coefficients, shape_parameter).items()}


LEAST_LOAD = 1e-6
"""Smallest load on a joint's own axis, relative to the largest load on any joint. Smaller loads are rounding errors."""
OPEN_TILT = 2e-3
"""Smallest load on a joint's own axis, relative to its load in all directions. Derived: four times the usual tolerance of a
joint's orientation, 0.5 mrad. A smaller load comes from a tilt that the geometry does not know, and even its sign is open."""


def loaded(at: OperatingPoints, site: str) -> bool:
    """Whether a rod has a force, or a joint a force along its axis or a moment about it, at any pose."""
    least = LEAST_LOAD * max(float(np.abs(at.joint_loads).max()), 1e-3)
    if site in joints(at.robot):
        part = slice(3, 6) if turns(at.robot, site) else slice(0, 3)
        whole = at.joint_loads[:, joint_frame(at, site).index, part]
        least = max(least, OPEN_TILT * float(np.linalg.norm(whole, axis=1).max()))
    return bool(np.abs(loads_of(at, site)[0]).max() > least)


def no_load(at: OperatingPoints) -> Untestable:
    """Why a part carries nothing: ``no_masses`` where no joint carries anything at any pose, else ``no_load``."""
    return Untestable("no_load" if at.joint_loads.any() else "no_masses")


SETTLES = 0.2
"""Time constant with which a base settles, over the duration of a fit. Assumed; of constants of 0.1 to 0.5 it leaves less than
a tenth of the squares."""


class BearingCompliance(Effect):
    """dtheta = K M; dtheta is the tilt of the joint's placement frame about its origin, rad, and K a symmetric matrix:

    K M = k_a (M . a) a + k_b (M . b) b + k_ab ((M . b) a + (M . a) b).

    M, N m, is the moment on the joint. It is computed from statics: gravity of the links beyond the joint and of the payload,
    and the force on the tool. The unit vectors a and b are perpendicular to the joint's axis. The vectors are in the placement
    frame. Feet and bolts give way about axes of their own, which k_ab turns from a and b. The modulation: k_a and k_b depend on
    the magnitude of the moment. At a joint that the base carries, the base may rock in place of the bearing, about a point
    between the joint and the origin of the base frame, or aside from the axis: then the force along the axis tilts it, and the
    moment shifts it along the axis, with the same two coefficients (Maxwell).

    It settles about the origin of the base frame: by a tilt in proportion to the mean moment and to 1 - exp(-t/T), with the
    time t since the first pose of the fit and T a fifth of its duration. This is a standard linear solid whose load changes
    faster than it settles (Findley, Lai and Onaran 1976, ch. 5). A prediction for an earlier time has the tilt of the first
    pose; one for a later time, or without ``time``, that of the last.

    Parameters: ``tilt``, the mean of k_a and k_b, positive where the bearing tilts in the direction of the moment;
    ``difference``, k_a less k_b; ``skew``, k_ab; ``stiffening``: by how much ``tilt`` increases when the moment becomes twice
    the usual one, negative where the bearing becomes stiffer; where the base carries the joint and ``time`` is recorded,
    ``settling``: the tilt in which it ends, over the mean moment. All are in rad/(N m).

    Typical size: 5e-6 rad/(N m): crossed roller bearings of medium gear units have some 2e5 N m/rad (catalogue values).
    """

    id = "bearing_compliance"
    title = "bearing/support deflection under load"
    clause = "the bearing of {site}, or what carries it, tilts under load"
    remedy = (
        "Use the corrected model with the payload given; check the bearing's preload, the bolts of its flange, and at a first "
        "joint the base's feet."
    )
    coefficient = ("tilt", "rad/(N m)")
    acts_at = staticmethod(joints)
    depends_on = ("load", "payload")
    exported_as = "bearing_springs"
    load = "moment across the axis"
    core = (0, 2, 4)
    plausible: ClassVar[Mapping[str, ParameterRange]] = {
        "tilt": ParameterRange(0.0, np.inf, "no bearing tilts against the moment that it carries")
    }

    def untestable(self, at: OperatingPoints, site: str) -> Untestable | None:
        return None if np.abs(at.joint_loads[:, joint_frame(at, site).index]).max() > 1e-9 else no_load(at)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        frame = joint_frame(at, site)
        moment = at.joint_loads[:, frame.index, 3:] @ frame.across.T
        mean, spread = (values[frame.index, 3:] for values in at.references.joints)
        usual = max(float(np.linalg.norm(mean) + np.linalg.norm(spread)), 1e-9)
        harder = np.linalg.norm(moment, axis=1)[:, None, None] / usual - 1.0
        tilts = symmetric(moment) @ frame.across  # (N, 3 coefficients, 3 axes)
        columns = np.stack(
            [tilts[:, 0], harder[:, 0] * tilts[:, 0], tilts[:, 1], harder[:, 0] * tilts[:, 1], tilts[:, 2]], axis=2
        )
        sizes = [1.0, MODULATION.stiffening, 1.0, MODULATION.stiffening, 1.0]
        twist = np.concatenate([np.zeros_like(columns), columns], axis=1)
        model, joint_id = at.robot.model, at.robot.actuators[at.robot.sites.index(site)].joint_id
        rocking = None
        if not model.parents[joint_id]:
            turns = np.swapaxes(tilts, 1, 2)
            base = np.asarray(model.jointPlacements[joint_id].actInv(np.zeros(3)))  # its origin, in the frame
            rocks = np.concatenate([np.cross(turns, -base, axisa=1, axisb=0, axisc=1), np.zeros_like(turns)], axis=1)
            rocking = at.bodies.frame(frame.index)[0] @ turns
            force = at.joint_loads[:, frame.index, :3] @ frame.axis
            aside = force[:, None, None] * frame.across.T  # (N, 3 axes, 2 coefficients)
            heaves = np.cross(aside, -base, axisa=1, axisb=0, axisc=1) + moment[:, None] * frame.axis[:, None]
            twist = np.concatenate([twist, rocks, np.concatenate([heaves, aside], axis=1)], axis=2)
            rocking = np.concatenate([rocking, at.bodies.frame(frame.index)[0] @ aside], axis=2)
            sizes += [MODULATION.pivot] * 3 + [MODULATION.aside] * 2
            if at.has("time"):
                late = (at.lateness + 1.0) / 2.0
                grown = float(np.linalg.norm(frame.across @ mean)) * (1.0 - np.exp(-late / SETTLES))
                turns = grown[:, None, None] * frame.across.T  # (N, 3 axes, 2 coefficients)
                settles = np.concatenate([np.cross(turns, -base, axisa=1, axisb=0, axisc=1), turns], axis=1)
                twist = np.concatenate([twist, settles], axis=2)
                rocking = np.concatenate([rocking, at.bodies.frame(frame.index)[0] @ turns], axis=2)
                sizes += [MODULATION.settling] * 2
        found = of_body(at, site, twist, unit(sizes, 5e-6))
        on_base = [3 * i for i, link in enumerate(at.robot.measured_links, 2) if not link.joint_id]
        if rocking is None or not on_base:
            return found
        seen = np.zeros((len(at), at.robot.motion_size, len(found)))
        for first in on_base:  # a link of the base turns with it, as far as the base rocks
            seen[:, first : first + 3, 5:] = rocking
        return replace(found, twist=seen)

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        a, harder_a, b, harder_b, skew = (float(c) for c in coefficients[:5])
        found = {"tilt": (a + b) / 2.0, "difference": a - b, "skew": skew, "stiffening": (harder_a + harder_b) / 2.0}
        if len(late := coefficients[10:]):
            found["settling"] = float(np.hypot(*late))
        return {name: (value, "rad/(N m)") for name, value in found.items()}


def symmetric(v: Floats) -> Floats:
    """(N, 3, 2) products of the three symmetric unit matrices, (a, a), (b, b) and (a, b), with vectors (N, 2)."""
    a, b = v.T
    none = np.zeros_like(a)
    return np.stack([np.stack(pair, axis=1) for pair in ((a, none), (none, b), (b, a))], axis=1)


HARMONICS, FALLING = 4, 1.0
"""Number of harmonics of a turning joint's angle, and the power p: the size of harmonic k is proportional to k^-p."""
ORDERS = 6
"""Number of cosines along the travel of a sliding joint."""
LOWEST = 3
"""Number of lowest cosines along a sliding joint's travel that are a bent guide's form. Assumed."""
SHIFT, TILT = 2e-5, 8e-5
"""Typical sizes of shifts, m, and tilts, rad."""


class AxisMotion(Effect):
    """Error motions of a joint's axis (ISO 230-7): shift or tilt = sum_k c_k cos(k q) + s_k sin(k q), k = 1 to 4.

    q is the angle of the joint, rad; c_k and s_k are coefficients, m or rad. A turning joint has five error motions: radial
    along a and along b, axial, and tilts about a and about b. The unit vectors a and b are perpendicular to the axis, and
    fixed to the part that carries the joint. A sliding joint has straightness along a and b, and roll, pitch and yaw, smooth
    along its travel (ISO 230-1).

    Parameters: ``radial``, m, root mean square over a turn of both radial motions together; ``axial``, m, root mean square
    over a turn; ``tilt``, rad, root mean square over a turn of both tilts together. Of a sliding joint: ``straightness``, m,
    and ``rotation``, rad, root mean squares over its travel. Geometry absorbs a part of the first harmonic (k = 1), which an
    eccentric part causes.

    Typical size: 20 um or 80 urad of each error motion, a guess; catalogues give 10 to 20 um at a radius of 0.1 m.
    """

    id = "axis_motion"
    nature = "description"
    title = "error motion of the axis"
    clause = "the axis of {site} moves as the joint moves"
    remedy = "Check the bearing and its seat for run-out; or use the corrected model."
    coefficient = ("radial", "m")
    acts_at = staticmethod(joints)
    plausible: ClassVar[Mapping[str, ParameterRange]] = {
        # Assumed: bearings tilt by 0.1 mrad, loose ones by a few.
        "tilt": ParameterRange(0.0, 0.01, "an axis that tilts by more as it turns is seen to wobble: 10 mm at 1 m")
    }

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        j = at.robot.sites.index(site)
        frame = joint_frame(at, site)
        ways = np.zeros((6, 5))
        ways[:3, :2] = ways[3:, 3:] = frame.across.T
        if turns(at.robot, site):
            ways[:3, 2] = frame.axis
            k = np.arange(1, HARMONICS + 1)
            waves = np.hstack([np.cos(k * at.q[:, [j]]), np.sin(k * at.q[:, [j]])])
            relative = np.tile(k**-FALLING / np.sqrt((k ** (-2.0 * FALLING)).sum()), 2)
        else:
            ways[3:, 2] = frame.axis
            waves, relative = cosines(at.travel[:, j], 1, ORDERS, FALLING)
        sizes = [SHIFT, SHIFT, SHIFT if turns(at.robot, site) else TILT, TILT, TILT]
        columns = np.broadcast_to(waves[:, None, :], (len(at), 5, waves.shape[1]))
        return of_joint(at, site, ways, columns, unit(np.outer(sizes, relative).ravel(), 1.0))

    def forms(self, robot: Chain, site: str) -> list[list[int]]:
        """One harmonic, or the lowest cosines along a sliding joint's travel, of one kind of error motion."""
        motions = ((0, 1), (2,), (3, 4))
        if turns(robot, site):
            waves = [(k, k + HARMONICS) for k in range(HARMONICS)]
            return [[2 * HARMONICS * m + w for m in ms for w in wave] for ms in motions for wave in waves]
        return [[ORDERS * m + w for m in ms for w in range(LOWEST)] for ms in motions]

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        a, b, c, tilt_a, tilt_b = (float(v) for v in np.sqrt((coefficients.reshape(5, -1) ** 2).sum(axis=1) / 2.0))
        return {
            "radial": (float(np.hypot(a, b)), "m"),
            "axial": (c, "m"),
            "tilt": (float(np.hypot(tilt_a, tilt_b)), "rad"),
        }

    def parameters_at(self, robot: Chain, site: str, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        if turns(robot, site):
            return self.parameters(coefficients, shape_parameter)
        squares = (coefficients.reshape(5, -1) ** 2).sum(axis=1) / 2.0
        return {
            "straightness": (float(np.sqrt(squares[:2].sum())), "m"),
            "rotation": (float(np.sqrt(squares[2:].sum())), "rad"),
        }
