"""All effects that a diagnosis can name: the effects of gtpin, and the effects that other packages register."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from importlib.metadata import entry_points

from gtpin.effects.ball_joints import JointClearance, JointRunout
from gtpin.effects.cart_compliance import CartCompliance
from gtpin.effects.cross_coupling import CrossCoupling
from gtpin.effects.drive_errors import Backlash, EncoderScale, Linearity, ServoLag, ZeroShift
from gtpin.effects.effect import Effect
from gtpin.effects.joints import AxisMotion, BearingCompliance, JointCompliance
from gtpin.effects.links import LinkCompliance, ThermalLinks
from gtpin.effects.measurement import FrameShift, TargetOffset, TrackerDrift, TrackerScale
from gtpin.effects.rack import RackPeriodic, RackStep
from gtpin.effects.tracks import CartRotation, Straightness, ThermalTrack
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
