"""All effects that a diagnosis can name: the effects of gtpin, and the effects that other packages register."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pkgutil import iter_modules

from gtpin import effects
from gtpin.effects.effect import Effect
from gtpin.errors import ModelError

ORDER = [
    "encoder_scale",
    "linearity",
    "rack_periodic",
    "rack_step",
    "zero_shift",
    "backlash",
    "servo_lag",
    "cross_coupling",
    "straightness",
    "cart_rotation",
    "cart_compliance",
    "link_compliance",
    "joint_clearance",
    "joint_runout",
    "joint_compliance",
    "bearing_compliance",
    "axis_motion",
    "thermal_links",
    "thermal_track",
    "tracker_drift",
    "frame_shift",
    "tracker_scale",
    "target_offset",
    "target_drift",
    "target_shift",
    "measurement_delay",
]
"""Order of effects in results: from the drives to the target and the readings. Effects that are not in it follow, by their
ids."""


def _of_this_folder() -> tuple[type[Effect], ...]:
    """The effects in the files of this folder; those made from a dataset have no id of their own."""
    files = [import_module(f"gtpin.effects.{file.name}") for file in iter_modules(effects.__path__)]
    kinds = {kind for file in files for kind in vars(file).values() if isinstance(kind, type) and "id" in vars(kind)}
    found = [kind for kind in kinds if issubclass(kind, Effect)]
    return tuple(sorted(found, key=lambda kind: (ORDER.index(kind.id) if kind.id in ORDER else len(ORDER), kind.id)))


OWN = _of_this_folder()
"""The effects of gtpin: one that is written in a new file of this folder is among them."""
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
