"""Why an effect can't be tested, in words."""

from __future__ import annotations

from gtpin.effects.untestable import Untestable

WORDS = {
    "missing": "the covariate {covariate} is missing",
    "unusable": "the values of the covariate {covariate} can't be used: a warning says why",
    "constant": "the covariate {covariate} does not vary",
    "too_few_commands": "the commands of {site} are too few, or too close together",
    "one_sign": "the link's force does not change its sign",
    "no_load": "the joint carries nothing about its own axis",
    "no_masses": "the URDF has no masses, and no payload or force on the tool was recorded",
    "single_joint": "the cart carries a single joint, and a rotation about it does not move the platform",
    "absorbed": "geometric calibration absorbs it",
    "unrecorded_payload": "the payload may have varied without being recorded",
    "not_searched": "a check does not search for periods and steps: diagnose the poses of a calibration",
    "uncertain": "the uncertainty of the earlier model and of the instrument's pose hides it",
    "other": "{words}",
}


def reason_words(reason: Untestable | None, site: str) -> str:
    """Why an effect at a site can't be tested, as part of a sentence; empty if it can be tested."""
    return WORDS[reason.kind].format(covariate=reason.covariate, site=site, words=reason.words) if reason else ""
