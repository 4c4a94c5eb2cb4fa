"""All kinds of error of the simulator: those of the catalogue, and unlisted ones."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np

from gtpin.bench.simulator.arm import Arm
from gtpin.bench.simulator.causes import instrument, with_rods, without_rods
from gtpin.bench.simulator.causes import unlisted as outside
from gtpin.bench.simulator.machine import Deviation
from gtpin.bench.simulator.situation import Site
from gtpin.errors import GtpinError
from gtpin.robot.chain import Chain

Where = Literal["carts", "guides", "turning", "joints", "coupled", "links", "arm", "pins", "frame", "platform"]


@dataclass(frozen=True)
class CauseKind:
    """A kind of error."""

    name: str  # Its id: that of the catalogue's effect, or of an unlisted one
    # Sites at which it occurs. ``carts``: everything that a drive moves. ``guides``: carts on tracks. ``turning``: the
    # same, where one of them carries more than one joint. ``joints``: the commanded joints of an arm. ``coupled``: the
    # same, where there are several. ``links``: single links. ``arm``: all links at once, or one of them. ``pins``:
    # passive joints of loops.
    where: Where
    # The deviation by one machine's error at its typical size: from the machine's situation, the site, and a source of the
    # random numbers that distinguish the machines
    error: Callable[..., Deviation]
    # Conditions that must vary so that it can be detected: ``session``, ``speed``, ``payload``, ``force``, ``heat``
    needs: tuple[str, ...] = ()
    # Largest amplitude, in typical sizes: no machine has a larger error, even where the effect then has little energy
    largest: float = 20.0
    periodic: bool = False  # Whether ``error`` also takes the numbers of periods a turn of its lines
    # Newer than the published cases: a seed draws it into no case and not beside one; made if asked for
    newer: bool = False

    def sites(self, robot: Chain | Arm) -> tuple[str, ...]:
        """Names of the sites of a robot at which it can occur: parts that move the TCP; empty where there are none."""
        if isinstance(robot, Arm):
            joints, links = (
                tuple(robot.sites[c] for c in robot.acting),
                tuple(robot.link_sites[c] for c in robot.linked),
            )
            alone: dict[str, tuple[str, ...]] = {"joints": joints, "coupled": joints if len(joints) > 1 else ()}
            found = {**alone, "links": links, "arm": ("arm", *links) if links else (), "pins": robot.pin_sites}
        else:
            carriers = [
                rod.carrier for rod in robot.rods if rod.carrier is not None and not robot.revolute[rod.carrier]
            ]
            guides = tuple(site for i, site in enumerate(robot.sites) if i in carriers)
            turning = guides if len(set(carriers)) < len(carriers) else ()
            carts = {"carts": robot.sites, "guides": guides, "turning": turning}
            found = {**carts, "links": robot.rod_sites, "arm": ("arm", *robot.rod_sites)}
        return found.get(self.where, (self.where,))

    def at(
        self, robot: Chain | Arm, site: str, rng: np.random.Generator, periods: tuple[float, ...] = ()
    ) -> PlantedCause:
        """The error of one machine at a site, with given periods where it is :attr:`periodic`.

        Raises GtpinError if the error can't occur at the site.
        """
        if site not in self.sites(robot):
            raise GtpinError(f"{self.name} can't be at {site!r}", hint=f"use {', '.join(self.sites(robot))}")
        error = partial(self.error, periods=periods) if periods else self.error
        return PlantedCause(error, Site.of(robot, site), deepcopy(rng))


@dataclass(frozen=True, eq=False)
class PlantedCause:
    """The error of one machine at its typical size: takes the same random numbers at every call."""

    error: Callable[..., Deviation]
    site: Site
    rng: np.random.Generator  # In the state before the random numbers

    def __call__(self, now: Any, rng: np.random.Generator | None = None) -> Deviation:
        """The deviation in a situation of the machine. ``rng``: takes the random numbers from here instead."""
        return self.error(now, self.site, rng or deepcopy(self.rng))


CATALOGUE = (
    CauseKind("encoder_scale", "carts", with_rods.encoder_scale, largest=10.0),
    CauseKind("linearity", "carts", with_rods.linearity),
    CauseKind("rack_periodic", "carts", with_rods.rack_periodic),
    CauseKind("rack_step", "carts", with_rods.rack_step),
    CauseKind("zero_shift", "carts", with_rods.zero_shift, ("session",)),
    CauseKind("backlash", "carts", with_rods.backlash),
    CauseKind("servo_lag", "carts", with_rods.servo_lag, ("speed",)),
    CauseKind("cross_coupling", "carts", with_rods.cross_coupling),
    CauseKind("straightness", "guides", with_rods.straightness),
    CauseKind("cart_rotation", "turning", with_rods.cart_rotation),
    CauseKind("cart_compliance", "guides", with_rods.cart_compliance, ("payload",)),
    CauseKind("link_compliance", "arm", with_rods.link_compliance, ("payload",)),
    CauseKind("joint_clearance", "links", with_rods.joint_clearance, ("force",), largest=6.0),
    CauseKind("joint_runout", "links", with_rods.joint_runout),
    CauseKind("thermal_links", "arm", with_rods.thermal_links, ("heat",)),
    CauseKind("thermal_track", "carts", with_rods.thermal_track, ("heat",)),
    CauseKind("tracker_drift", "frame", instrument.tracker_drift),
    CauseKind("frame_shift", "frame", instrument.frame_shift, ("session",)),
    CauseKind("target_drift", "platform", instrument.target_drift, newer=True),
    CauseKind("target_shift", "platform", instrument.target_shift, ("session",), newer=True),
    CauseKind("measurement_delay", "frame", instrument.measurement_delay, ("speed",), newer=True),
    CauseKind("tracker_scale", "frame", instrument.tracker_scale, largest=10.0),
    CauseKind("target_offset", "platform", instrument.target_offset, largest=5.0),
)
"""The effects of the catalogue, on robots with rods."""
UNLISTED = (
    CauseKind("hose_drag", "platform", outside.hose_drag),
    CauseKind("cable_chain", "guides", outside.cable_chain),
    CauseKind("plate_bending", "platform", outside.plate_bending, ("payload",)),
    CauseKind("foot_settling", "carts", outside.foot_settling),
    CauseKind("joint_stick", "links", outside.joint_stick),
    CauseKind("frame_bending", "frame", outside.frame_bending),
    CauseKind("thermal_twist", "frame", outside.thermal_twist, ("heat",)),
    CauseKind("nest_tilt", "platform", partial(outside.nest_tilt, level=True)),
    CauseKind("encoder_slip", "carts", with_rods.encoder_slip),
    CauseKind("guide_whip", "guides", outside.guide_whip, ("speed",)),
)
"""Unlisted effects of robots with rods."""
ARM_CATALOGUE = (
    CauseKind("encoder_scale", "joints", without_rods.encoder_scale, largest=10.0),
    CauseKind("linearity", "joints", partial(with_rods.linearity, size=1e-4), largest=10.0),
    CauseKind("rack_periodic", "joints", without_rods.rack_periodic, largest=5.0, periodic=True),
    CauseKind("zero_shift", "joints", partial(with_rods.zero_shift, size=1e-4), ("session",)),
    CauseKind("backlash", "joints", without_rods.backlash, largest=15.0),
    CauseKind("servo_lag", "joints", without_rods.servo_lag, ("speed",)),
    CauseKind("cross_coupling", "coupled", without_rods.cross_coupling, largest=10.0),
    CauseKind("joint_compliance", "joints", without_rods.joint_compliance, ("payload",), largest=10.0),
    CauseKind("bearing_compliance", "joints", without_rods.bearing_compliance, ("payload",), largest=6.0),
    CauseKind("axis_motion", "joints", without_rods.axis_motion, largest=5.0),
    CauseKind("joint_clearance", "joints", without_rods.joint_clearance, ("force",), largest=6.0),
    CauseKind("link_compliance", "arm", without_rods.link_compliance, ("payload",), largest=10.0),
    CauseKind("thermal_links", "arm", with_rods.thermal_links, ("heat",), largest=4.0),
    CauseKind("tracker_drift", "frame", instrument.tracker_drift),
    CauseKind("frame_shift", "frame", instrument.frame_shift, ("session",)),
    CauseKind("target_drift", "platform", instrument.target_drift, newer=True),
    CauseKind("target_shift", "platform", instrument.target_shift, ("session",), newer=True),
    CauseKind("measurement_delay", "frame", instrument.measurement_delay, ("speed",), newer=True),
    CauseKind("tracker_scale", "frame", instrument.tracker_scale, largest=6.0),
    CauseKind("target_offset", "platform", instrument.target_offset, largest=5.0),
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
    CauseKind("creep", "joints", outside.creep, ("payload",)),
    CauseKind("dress_pack", "coupled", outside.dress_pack),
    CauseKind("loose_foot", "frame", outside.loose_foot, ("payload",)),
    CauseKind("sunny_side", "links", outside.sunny_side, ("heat",)),
    CauseKind("loose_gripper", "platform", outside.loose_gripper, ("payload",)),
    CauseKind("slipping_disc", "joints", partial(with_rods.encoder_slip, size=1e-4)),
    CauseKind("whip", "links", outside.whip, ("speed",)),
    CauseKind("nest_tilt", "platform", outside.nest_tilt),
)
"""Unlisted effects."""


def pushed(kinds: tuple[CauseKind, ...]) -> tuple[CauseKind, ...]:
    """The same kinds for robots with loops: effects of a load also need forces on the tool.

    Gravity does not load the drives of a loop in a horizontal plane, nor the bearings of a loop in a vertical plane across it.
    """
    return tuple(replace(kind, needs=(*kind.needs, "force")) if "payload" in kind.needs else kind for kind in kinds)


LOOPED_CATALOGUE = pushed(ARM_CATALOGUE)
LOOPED_UNLISTED = pushed((*ARM_UNLISTED, CauseKind("worn_pin", "pins", outside.worn_pin, ("payload",))))
"""Unlisted effects of robots whose loops are not rods."""


def _known(robot: Chain | Arm) -> tuple[tuple[CauseKind, ...], tuple[CauseKind, ...]]:
    if not isinstance(robot, Arm):
        return CATALOGUE, UNLISTED
    return (LOOPED_CATALOGUE, LOOPED_UNLISTED) if robot.pairs else (ARM_CATALOGUE, ARM_UNLISTED)


def listed(robot: Chain | Arm) -> tuple[CauseKind, ...]:
    """Kinds of error of the catalogue that can occur on a robot."""
    return tuple(kind for kind in _known(robot)[0] if kind.sites(robot))


def unlisted(robot: Chain | Arm) -> tuple[CauseKind, ...]:
    """Unlisted kinds of error that can occur on a robot."""
    return tuple(kind for kind in _known(robot)[1] if kind.sites(robot))


def kind(name: str, robot: Chain | Arm) -> CauseKind:
    """The kind of error with a name, on a robot. Raises GtpinError if it can't occur on the robot, or none has this name."""
    known = {one.name: one for kinds in _known(robot) for one in kinds}
    if name in known and known[name].sites(robot):
        return known[name]
    if name in {k.name for k in (*CATALOGUE, *UNLISTED, *LOOPED_CATALOGUE, *LOOPED_UNLISTED)}:
        raise GtpinError(f"{name} can't be on {robot.name}", hint="choose what the robot's parts can have")
    raise GtpinError(f"no effect is called {name!r}", hint=f"known here: {', '.join(known)}")
