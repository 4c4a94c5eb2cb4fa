"""All kinds of error of open chains: those of the contract's tables, and those that are in no catalogue."""

from __future__ import annotations

from gtpin.plant.causes import instrument
from gtpin.plant.causes.arms import bearings, drives, heat, loads, unlisted
from gtpin.plant.causes.cause import Kind

ARM_CATALOGUE = (
    Kind("encoder_scale", "joints", drives.encoder_scale, largest=10.0),
    Kind("linearity", "joints", drives.linearity),
    Kind("rack_periodic", "joints", drives.rack_periodic, periodic=True),
    Kind("zero_shift", "joints", drives.zero_shift, ("session",)),
    Kind("backlash", "joints", drives.backlash),
    Kind("servo_lag", "joints", drives.servo_lag, ("speed",)),
    Kind("cross_coupling", "coupled", drives.cross_coupling),
    Kind("joint_compliance", "joints", loads.joint_compliance, ("payload",)),
    Kind("bearing_compliance", "joints", bearings.bearing_compliance, ("payload",)),
    Kind("axis_motion", "joints", bearings.axis_motion),
    Kind("joint_clearance", "joints", loads.joint_clearance, ("force",), largest=6.0),
    Kind("link_compliance", "arm", loads.link_compliance, ("payload",)),
    Kind("thermal_links", "arm", heat.thermal_links, ("heat",)),
    Kind("tracker_drift", "frame", instrument.tracker_drift),
    Kind("frame_shift", "frame", instrument.frame_shift, ("session",)),
    Kind("tracker_scale", "frame", instrument.tracker_scale, largest=10.0),
    Kind("target_offset", "platform", instrument.target_offset, largest=5.0),
)
"""The contract's tables."""
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
"""What is in no catalogue."""
