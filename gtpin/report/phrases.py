"""What each effect is as part of a sentence, and what an engineer can do about it."""

from __future__ import annotations

from dataclasses import dataclass

from gtpin.effects.catalogue import effects_by_id
from gtpin.report.words import site_words


@dataclass(frozen=True)
class Phrase:
    """An effect at a site: what it says (a clause), and what to do (a sentence)."""

    clause: str
    action: str


CLAUSES = {
    "encoder_scale": "travel per count of {site} is off by a constant factor",
    "linearity": "{site} departs smoothly from where it should be along its track",
    "rack_periodic": "{site} departs periodically along its track",
    "rack_step": "{site} steps where two rack segments meet",
    "zero_shift": "the zero of {site} moved between sessions",
    "backlash": "{site} has backlash",
    "servo_lag": "{site} lags behind in proportion to its speed",
    "cross_coupling": "{site} shifts along its track with where the other carts are",
    "straightness": "the track of {site} is not straight",
    "cart_rotation": "{site} rolls, pitches or yaws along its track",
    "cart_compliance": "{site} gives way under the forces of its links",
    "link_compliance": "{site} stretches under load",
    "joint_clearance": "a joint of {site} has play",
    "joint_runout": "a ball of {site} is out of round",
    "thermal_links": "{site} grows with its temperature",
    "thermal_track": "the guideway of {site} grows with the frame's temperature",
    "tracker_drift": "{site} drifts over time",
    "frame_shift": "{site} sits elsewhere in each session",
    "tracker_scale": "the instrument's length scale is off",
    "target_offset": "the target is not where the TCP is believed to be",
}
ACTIONS = {
    "encoder_scale": "Set the drive's scale factor to the value below, and check gear ratio or rack pitch.",
    "linearity": "Load the curve below as an axis compensation table, or have the rack aligned.",
    "rack_periodic": "Look for what has this period: tooth pitch, pinion run-out, mounting; or compensate by the curve below.",
    "rack_step": "Check the joint of the rack's segments at the place below, and its gap gauge.",
    "zero_shift": "Check homing and reference switch; home again before each session.",
    "backlash": "Check the preload of pinion and gear; approach from one side, or set the drive's backlash compensation.",
    "servo_lag": "Measure at rest or slower; check position gain and velocity feed-forward.",
    "cross_coupling": "Look at what loads or twists the track when the carts move apart: mounting, rack, cart stiffness.",
    "straightness": "Realign the guideway by the curve below, or use the corrected model.",
    "cart_rotation": "Check the guideway's parallelism and the carriage's preload, or use the corrected model.",
    "cart_compliance": "Check carriage preload and pinion stiffness; use the corrected model with the payload given.",
    "link_compliance": "Check links and their joints for stiffness; use the corrected model with the payload given.",
    "joint_clearance": "Replace or preload the joint.",
    "joint_runout": "Have the ball and its socket measured, or replaced.",
    "thermal_links": "Let the machine warm up, or use the corrected model with the links' temperature measured.",
    "thermal_track": "Let the machine warm up, or use the corrected model with the frame's temperature measured.",
    "tracker_drift": "A fault of the measurement: check the tracker's stand and warm-up; measure reference nests in between.",
    "frame_shift": "A fault of the measurement: tie the sessions together by reference nests.",
    "tracker_scale": "A fault of the measurement: check the tracker's weather station and its scale on a calibrated bar.",
    "target_offset": "Measure the target's place on the platform.",
}
PLURALS = {("arm", "stretches"): "stretch", ("arm", "grows"): "grow", ("arm", "its"): "their"}


def phrase(effect: str, site: str) -> Phrase:
    """An effect at a site in words; one of a user's own by its title."""
    if effect in CLAUSES:
        words = [PLURALS.get((site, word), word) for word in CLAUSES[effect].split(" ")]
        return Phrase(" ".join(words).format(site=site_words(site)), ACTIONS[effect])
    known = effects_by_id().get(effect)
    title = known.title if known else effect.replace("_", " ")
    return Phrase(f"{title} at {site_words(site)}", "Use the corrected model, or take the effect away at its source.")


def sentence(words: str) -> str:
    """Words as a sentence: a capital first letter, unless it is a machine's own name, and a full stop."""
    name = any(c.isdigit() or c == "_" for c in words.split(" ")[0])
    return f"{words if name else words[:1].upper() + words[1:]}."
