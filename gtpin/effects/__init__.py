"""Effects: causes of deviations that a geometry does not model, one family per file.

This module exports the names that are needed to write an effect of your own.
"""

from gtpin.effects.basis import Basis, along_track, of_lengths, rods_of
from gtpin.effects.effect import Effect, Range
from gtpin.effects.sites import arm_and_links, carts, links, sliding_carts
from gtpin.effects.situation import Situation
from gtpin.effects.untestable import Untestable

__all__ = [
    "Basis",
    "Effect",
    "Range",
    "Situation",
    "Untestable",
    "along_track",
    "arm_and_links",
    "carts",
    "links",
    "of_lengths",
    "rods_of",
    "sliding_carts",
]
