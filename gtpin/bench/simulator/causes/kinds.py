"""All kinds of error of the plant: those of the catalogue, and unlisted ones."""

from __future__ import annotations

from gtpin.bench.simulator.arms.robot import Arm
from gtpin.bench.simulator.causes import (
    drives,
    guides,
    heat,
    instrument,
    joints,
    stiffness,
    unlisted_loads,
    unlisted_structure,
)
from gtpin.bench.simulator.causes.arms.catalogue import ARM_CATALOGUE, ARM_UNLISTED, LOOPED_CATALOGUE, LOOPED_UNLISTED
from gtpin.bench.simulator.causes.cause import Kind
from gtpin.bench.simulator.looped.robot import LoopedArm
from gtpin.errors import GtpinError
from gtpin.robot.robot import Robot

CATALOGUE = (
    Kind("encoder_scale", "carts", drives.encoder_scale, largest=10.0),
    Kind("linearity", "carts", drives.linearity),
    Kind("rack_periodic", "carts", drives.rack_periodic),
    Kind("rack_step", "carts", drives.rack_step),
    Kind("zero_shift", "carts", drives.zero_shift, ("session",)),
    Kind("backlash", "carts", drives.backlash),
    Kind("servo_lag", "carts", drives.servo_lag, ("speed",)),
    Kind("cross_coupling", "carts", drives.cross_coupling),
    Kind("straightness", "guides", guides.straightness),
    Kind("cart_rotation", "turning", guides.cart_rotation),
    Kind("cart_compliance", "guides", stiffness.cart_compliance, ("payload",)),
    Kind("link_compliance", "arm", stiffness.link_compliance, ("payload",)),
    Kind("joint_clearance", "links", joints.joint_clearance, ("force",), largest=6.0),
    Kind("joint_runout", "links", joints.joint_runout),
    Kind("thermal_links", "arm", heat.thermal_links, ("heat",)),
    Kind("thermal_track", "carts", heat.thermal_track, ("heat",)),
    Kind("tracker_drift", "frame", instrument.tracker_drift),
    Kind("frame_shift", "frame", instrument.frame_shift, ("session",)),
    Kind("tracker_scale", "frame", instrument.tracker_scale, largest=10.0),
    Kind("target_offset", "platform", instrument.target_offset, largest=5.0),
)
"""The effects of the catalogue, on robots with rods."""
UNLISTED = (
    Kind("hose_drag", "platform", unlisted_loads.hose_drag),
    Kind("cable_chain", "guides", unlisted_loads.cable_chain),
    Kind("plate_bending", "platform", unlisted_loads.plate_bending, ("payload",)),
    Kind("foot_settling", "carts", unlisted_structure.foot_settling),
    Kind("joint_stick", "links", unlisted_structure.joint_stick),
    Kind("frame_bending", "frame", unlisted_structure.frame_bending),
    Kind("thermal_twist", "frame", unlisted_structure.thermal_twist, ("heat",)),
    Kind("nest_tilt", "platform", unlisted_structure.nest_tilt),
    Kind("encoder_slip", "carts", unlisted_structure.encoder_slip),
    Kind("guide_whip", "guides", unlisted_structure.guide_whip, ("speed",)),
)
"""Unlisted effects of robots with rods."""


def possible(kinds: tuple[Kind, ...], robot: Robot | Arm) -> tuple[Kind, ...]:
    """Those of some kinds that can occur on a robot."""
    return tuple(kind for kind in kinds if kind.sites(robot))


def _known(robot: Robot | Arm) -> tuple[tuple[Kind, ...], tuple[Kind, ...]]:
    if isinstance(robot, LoopedArm):
        return LOOPED_CATALOGUE, LOOPED_UNLISTED
    return (ARM_CATALOGUE, ARM_UNLISTED) if isinstance(robot, Arm) else (CATALOGUE, UNLISTED)


def listed(robot: Robot | Arm) -> tuple[Kind, ...]:
    """Kinds of error of the catalogue that can occur on a robot."""
    return possible(_known(robot)[0], robot)


def unlisted(robot: Robot | Arm) -> tuple[Kind, ...]:
    """Unlisted kinds of error that can occur on a robot."""
    return possible(_known(robot)[1], robot)


def kind(name: str, robot: Robot | Arm) -> Kind:
    """The kind of error with a name, on a robot.

    Raises
    ------
    GtpinError
        If the robot has no such kind.
    """
    known = [one for kinds in _known(robot) for one in kinds]
    for one in known:
        if one.name == name:
            return one
    others = {k.name for k in (*CATALOGUE, *UNLISTED, *LOOPED_CATALOGUE, *LOOPED_UNLISTED)}
    if name in others:
        raise GtpinError(f"{name} can't be on {robot.name}", hint="choose what the robot's parts can have")
    raise GtpinError(f"no effect is called {name!r}", hint=f"known here: {', '.join(k.name for k in known)}")
