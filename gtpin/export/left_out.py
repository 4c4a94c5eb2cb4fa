"""The parts of a model that a file can't represent."""

from __future__ import annotations

from collections.abc import Collection

from gtpin.model.model import Model


def left_out(model: Model, carried: Collection[str] = ()) -> tuple[str, ...]:
    """Names of parts of a model, beyond straight tracks, rods and joints, that a file can't represent.

    Parameters
    ----------
    carried
        Parts that the file represents, of these names: ``effect@site``, ``drive scales``, ``directions of single rods``,
        ``measured tracks``, ``instrument's frame``.
    """
    geometry = model.geometry
    moved = {(p.kind, p.per) for p, d in zip(geometry.parameters, geometry.deviation, strict=True) if d != 0.0}
    has = {
        "drive scales": bool({("scale", "actuator"), ("scale", "rod")} & moved),
        "directions of single rods": ("direction", "rod") in moved,
        "measured tracks": any(track is not None for track in geometry.tracks),
        "instrument's frame": not model.frame.is_base,
    }
    names = [name for name, there in has.items() if there] + [active.name for active in model.effects]
    return tuple(name for name in names if name not in carried)
