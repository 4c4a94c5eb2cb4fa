"""Effects at joints and links of robots without rods, in words: what the effects' classes say of carts and tracks."""

from __future__ import annotations

from typing import NamedTuple

from gtpin.effects.effect import Effect
from gtpin.robot.robot import Robot


class ChainWords(NamedTuple):
    """A clause with ``{site}`` for where, the same for all links together, and a remedy; empty: as the effect's class says."""

    clause: str = ""
    plural: str = ""
    remedy: str = ""


WORDS = {
    "backlash": ChainWords(
        remedy="Check the play of the gear and its preload; approach from one side, or set the drive's backlash compensation."
    ),
    "cross_coupling": ChainWords(
        "{site} departs from its command with where the other joints are",
        remedy="Look at what couples the joints: the gears of a wrist, belts, cables; or use the corrected model.",
    ),
    "encoder_scale": ChainWords(
        "the motion of {site} per count is off by a constant factor",
        remedy="Set the drive's scale factor to the value below, and check the gear ratio.",
    ),
    "joint_clearance": ChainWords(
        "{site} has play, which its load takes up", remedy="Replace the gear or bearing, or preload it."
    ),
    "linearity": ChainWords(
        "{site} departs smoothly from its command",
        remedy="Load the curve below as a compensation table of the joint, and check how its encoder is mounted.",
    ),
    "link_compliance": ChainWords(
        "{site} bends under load",
        "{site} bend under load",
        "Use the corrected model with the payload given; check the links' masses in the URDF.",
    ),
    "rack_periodic": ChainWords(
        "{site} departs periodically from its command",
        remedy="Look for what has this period: an eccentric encoder, a gear, a strain wave; or compensate by the curve below.",
    ),
    "rack_step": ChainWords(
        "the travel of {site} has a step", remedy="Check the scale or rack at the place below, and its joint."
    ),
    "thermal_track": ChainWords("the travel of {site} grows with the frame's temperature"),
}
"""By effect."""


def chain_words(effect: Effect, robot: Robot | None) -> ChainWords:
    """What is said of an effect at a robot without rods; nothing of robots with rods and of effects not in the table."""
    if robot is None or robot.rods:
        return ChainWords()
    return WORDS.get(effect.id, ChainWords())
