"""All kinds of error of robots without rods: those of the catalogue, and unlisted ones."""

from __future__ import annotations

from dataclasses import replace

from gtpin.bench.simulator.causes import instrument
from gtpin.bench.simulator.causes.arms import bearings, drives, heat, loads, pins, unlisted
from gtpin.bench.simulator.causes.cause import Kind

ARM_CATALOGUE = (
    Kind("encoder_scale", "joints", drives.encoder_scale, largest=10.0),
    Kind("linearity", "joints", drives.linearity, largest=10.0),
    Kind("rack_periodic", "joints", drives.rack_periodic, largest=5.0, periodic=True),
    Kind("zero_shift", "joints", drives.zero_shift, ("session",)),
    Kind("backlash", "joints", drives.backlash, largest=15.0),
    Kind("servo_lag", "joints", drives.servo_lag, ("speed",)),
    Kind("cross_coupling", "coupled", drives.cross_coupling, largest=10.0),
    Kind("joint_compliance", "joints", loads.joint_compliance, ("payload",), largest=10.0),
    Kind("bearing_compliance", "joints", bearings.bearing_compliance, ("payload",), largest=6.0),
    Kind("axis_motion", "joints", bearings.axis_motion, largest=5.0),
    Kind("joint_clearance", "joints", loads.joint_clearance, ("force",), largest=6.0),
    Kind("link_compliance", "arm", loads.link_compliance, ("payload",), largest=10.0),
    Kind("thermal_links", "arm", heat.thermal_links, ("heat",), largest=4.0),
    Kind("tracker_drift", "frame", instrument.tracker_drift),
    Kind("frame_shift", "frame", instrument.frame_shift, ("session",)),
    Kind("tracker_scale", "frame", instrument.tracker_scale, largest=6.0),
    Kind("target_offset", "platform", instrument.target_offset, largest=5.0),
)
"""The effects of the catalogue. At ``largest`` times the typical size, an error is as large as on the worst machines:

- ``encoder_scale`` 1e-3: the pitch error of a belt is smaller; a wrong gear ratio causes much more.
- ``linearity`` 1 mrad rms: badly mounted magnetic ring encoders are stated with 0.1 degrees.
- ``rack_periodic`` 0.5 mrad: kinematic error of strain-wave gears, as its docstring says.
- ``backlash`` 1 mrad to either side, 7 arc minutes in all: ordinary planetary gears; gears of robots have less.
- ``cross_coupling`` 1 mrad: cables and belts with 10 N m on a joint of 1e4 N m/rad.
- ``joint_compliance`` 1.5 mrad at the usual load: wind-up of a strain-wave gear at its rated torque.
- ``bearing_compliance`` 0.36 mrad at the usual moment: cross-roller units tilt by about 1 mrad at the permitted moment, and the
  usual moment is 0.4 of it.
- ``axis_motion`` 0.1 mm and 0.25 mrad: a badly machined bearing seat, or a bent flange.
- ``joint_clearance`` 0.4 mrad to either side.
- ``link_compliance`` 1 mrad over a link at half of the usual moment.
- ``thermal_links`` 9.2e-5/K: unfilled ABS and polyamide have 0.7e-4 to 1.0e-4/K, aluminium 2.3e-5/K; no material of links
  expands more than plastics (handbook tables of linear expansion).
- ``tracker_scale`` 120 ppm: a steel part whose temperature is entered with an error of 10 K. The part that varies with the
  temperature of the air is then 0.9 ppm/K: the refractive index of air changes by 1 ppm/K (Ciddor 1996).
"""
ARM_UNLISTED = (
    Kind("creep", "joints", unlisted.creep, ("payload",)),
    Kind("dress_pack", "coupled", unlisted.dress_pack),
    Kind("loose_foot", "frame", unlisted.loose_foot, ("payload",)),
    Kind("sunny_side", "links", unlisted.sunny_side, ("heat",)),
    Kind("loose_gripper", "platform", unlisted.loose_gripper, ("payload",)),
    Kind("slipping_disc", "joints", unlisted.slipping_disc),
    Kind("whip", "links", unlisted.whip, ("speed",)),
    Kind("nest_tilt", "platform", unlisted.nest_tilt),
)
"""Unlisted effects."""


def pushed(kinds: tuple[Kind, ...]) -> tuple[Kind, ...]:
    """The same kinds for robots with loops: effects of a load also need forces on the tool.

    Gravity does not load the drives of a loop in a horizontal plane, nor the bearings of a loop in a vertical plane across it.
    """
    return tuple(replace(kind, needs=(*kind.needs, "force")) if "payload" in kind.needs else kind for kind in kinds)


LOOPED_CATALOGUE = pushed(ARM_CATALOGUE)
LOOPED_UNLISTED = pushed((*ARM_UNLISTED, Kind("worn_pin", "pins", pins.worn_pin, ("payload",))))
"""Unlisted effects of robots whose loops are not rods."""
