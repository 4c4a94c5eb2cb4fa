"""All effects that a diagnosis can name: the effects of gtpin, and the effects that other packages register."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from importlib.metadata import entry_points

from gtpin.effects.axis_motion import AxisMotion
from gtpin.effects.backlash import Backlash
from gtpin.effects.bearing_compliance import BearingCompliance
from gtpin.effects.cart_compliance import CartCompliance
from gtpin.effects.cart_rotation import CartRotation
from gtpin.effects.cross_coupling import CrossCoupling
from gtpin.effects.effect import Effect
from gtpin.effects.encoder_scale import EncoderScale
from gtpin.effects.frame_shift import FrameShift
from gtpin.effects.joint_clearance import JointClearance
from gtpin.effects.joint_compliance import JointCompliance
from gtpin.effects.joint_runout import JointRunout
from gtpin.effects.linearity import Linearity
from gtpin.effects.link_compliance import LinkCompliance
from gtpin.effects.rack_periodic import RackPeriodic
from gtpin.effects.rack_step import RackStep
from gtpin.effects.servo_lag import ServoLag
from gtpin.effects.straightness import Straightness
from gtpin.effects.target_offset import TargetOffset
from gtpin.effects.thermal_links import ThermalLinks
from gtpin.effects.thermal_track import ThermalTrack
from gtpin.effects.tracker_drift import TrackerDrift
from gtpin.effects.tracker_scale import TrackerScale
from gtpin.effects.zero_shift import ZeroShift
from gtpin.errors import ModelError

OWN: tuple[type[Effect], ...] = (
    EncoderScale,
    Linearity,
    RackPeriodic,
    RackStep,
    ZeroShift,
    Backlash,
    ServoLag,
    CrossCoupling,
    Straightness,
    CartRotation,
    CartCompliance,
    LinkCompliance,
    JointClearance,
    JointRunout,
    JointCompliance,
    BearingCompliance,
    AxisMotion,
    ThermalLinks,
    ThermalTrack,
    TrackerDrift,
    FrameShift,
    TrackerScale,
    TargetOffset,
)
GROUP = "gtpin.effects"
"""Entry-point group in which users register their own effects. Each entry point is a subclass of ``Effect``."""


def catalogue() -> tuple[Effect, ...]:
    """The effects that a diagnosis tests: the effects of gtpin, then the effects that installed packages register.

    Examples
    --------
    An effect of your own can be used without a package: ``gtpin.diagnose(data, effects=[*gtpin.catalogue(), MyEffect()])``.

    >>> import gtpin
    >>> [effect.id for effect in gtpin.catalogue()][:3]
    ['encoder_scale', 'linearity', 'rack_periodic']

    Raises
    ------
    ModelError
        If a registered effect can't be loaded, is not an ``Effect``, or has the id of another effect.
    """
    return tuple(effects_by_id().values())


@cache
def effects_by_id() -> dict[str, Effect]:
    """The effects of the catalogue, each under its ``id``.

    Raises `ModelError` if a registered effect can't be loaded, is not an ``Effect``, or has the id of another effect.
    """
    known = {kind.id: kind() for kind in OWN}
    for point in entry_points(group=GROUP):
        try:
            kind = point.load()
            made = kind()
        except Exception as error:  # a module of others may fail in any way
            raise ModelError(
                f"the effect {point.name} of {GROUP} can't be loaded ({type(error).__name__}: {error})",
                hint=f"mend or remove {point.value}",
            ) from error
        if not isinstance(made, Effect):
            raise ModelError(
                f"the entry point {point.name} of {GROUP} is no effect", hint="register a subclass of Effect"
            )
        if made.id in known:
            raise ModelError(f"the effect {made.id} is registered twice", hint="give one of them another id")
        known[made.id] = made
    return known


def effect_of(effects: Iterable[Effect], name: str) -> Effect:
    """The effect with the id ``name``; raises `ModelError` where there is none."""
    known = {effect.id: effect for effect in effects}
    if name not in known:
        raise ModelError(f"no effect is called {name!r}", hint=f"choose one of {', '.join(sorted(known))}")
    return known[name]
