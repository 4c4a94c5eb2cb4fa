"""Effects: causes of deviations that a geometry does not model, one family per file.

The docstring of each has its equation, its parameters, and the typical sizes of its coefficients with their sources.

This module exports the names that are needed to write an effect of your own.
"""

from gtpin.effects.displacement import Displacement, along_track, of_lengths, rods_of
from gtpin.effects.effect import Effect, ParameterRange
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import actuators, arm_and_links, links, sliding_actuators
from gtpin.effects.untestable import Untestable
from gtpin.errors import renamed_names

__all__ = [
    "Displacement",
    "Effect",
    "OperatingPoints",
    "ParameterRange",
    "Untestable",
    "actuators",
    "along_track",
    "arm_and_links",
    "links",
    "of_lengths",
    "rods_of",
    "sliding_actuators",
]

__getattr__ = renamed_names(
    __name__,
    {
        "Basis": "Displacement",
        "Range": "ParameterRange",
        "Situation": "OperatingPoints",
        "carts": "actuators",
        "sliding_carts": "sliding_actuators",
    },
)
