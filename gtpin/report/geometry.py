"""The geometry's departures from nominal in words and as tables: which parameters make the error of the nominal geometry."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.model.departures import Departure, Difference, size_of
from gtpin.model.model import Model
from gtpin.report.page import Table
from gtpin.report.words import counted, joined, length, quantity

SHOWN = 5
"""Number of parameters on a first screen."""
CLEAR = 3.0
"""Number of sigmas from which a departure is shown by name on a first screen: one of 50 parameters, as those of the Gantry-Tau,
is beyond 3 sigmas by chance in 13 % of machines, beyond 2 in 90 %."""
APART = 2
"""Number of differences between tracks on a first screen."""
SMALL = 0.02
"""Smallest displacement, over the largest, of a departure on a first screen."""
MOST = 0.5
"""Largest share of the squared displacement that all others may leave where it is ascribed to one parameter. Parameters can
compensate each other, so that one of them may displace the TCP by more than all together."""
WORDS = {
    "zero": "zero of {site}",
    "a": "length a of {site}",
    "d": "offset d of {site}",
    "alpha": "twist alpha of {site}",
    "beta": "twist beta of {site}",
    "base.a": "first axis, shift along a",
    "base.b": "first axis, shift along b",
    "base.ra": "first axis, tilt about a",
    "base.rb": "first axis, tilt about b",
}
"""Zeros, and parameters of Denavit and Hartenberg, in words, by name or quantity."""
PLACED = {"placement": "joint {site}", "platform": "tool", "tool": "tool", "anchor": "anchor {site}"}
"""What has a place in a frame of its own, in words."""
AXES = {axis: f"shift along {axis}" for axis in "xyz"} | {f"r{axis}": f"tilt about {axis}" for axis in "xyz"}
"""How it changed along or about an axis of that frame, in words."""
COMMON = {
    "track_direction": "tilt of all tracks",
    "arm_axis": "tilt of all axes of the arms",
    "cart_joint": "shift of all joints on the carts",
    "arm_joint": "shift of all joints on the arms",
    "base_joint": "shift of all joints on the base",
}
"""Common motions of parameters of several parts, in words."""


def departure_words(one: Departure) -> str:
    """A parameter in words, else its name."""
    if one.reversed:
        return f"length |a| of {one.site}"
    part, _, axis = one.name.rpartition(".")
    if axis in AXES and part.partition("[")[0] in PLACED:
        return f"{PLACED[part.partition('[')[0]].format(site=one.site)}, {AXES[axis]}"
    return WORDS.get(one.name if one.site in ("base", "tool") else one.what, one.name).format(site=one.site)


def change_words(one: Departure) -> str:
    """The change of a parameter with its sigma, or that it was held; of the zero of a turning joint in degrees, of a link its
    length."""
    value, sigma, unit = -one.value if one.reversed else one.value, one.sigma, one.unit
    held = "" if sigma else " (held)"
    return f"{'+' if value > 0.0 else ''}{(zero_size if one.what == 'zero' else quantity)(value, unit, sigma)}{held}"


def zero_size(value: float, unit: str, sigma: float) -> str:
    """The zero of a joint with its sigma: of a turning joint in degrees."""
    if unit == "rad":
        value, sigma, unit = float(np.rad2deg(value)), float(np.rad2deg(sigma)), "°"
    return quantity(value, unit, sigma)


def clear(found: Sequence[Departure]) -> list[Departure]:
    """The largest departures that the data determine, for a first screen."""
    known = [one for one in found if one.determined and abs(one.value) > CLEAR * one.sigma]
    return [one for one in known if one.position_rms > SMALL * known[0].position_rms][:SHOWN]


def point_of(model: Model) -> str:
    """What the displacements of a model's departures are of: the TCP, or a target whose place on the platform is free."""
    return "target" if model.free_target else "TCP"


def _head(point: str) -> tuple[str, str, str]:
    return "parameter", "change from nominal", f"at the {point}, RMS"


def geometry_table(found: Sequence[Departure], point: str = "TCP") -> list[Table]:
    """The largest departures, and all others together; empty of a nominal geometry. ``point``: as :func:`point_of` has it."""
    named = clear(found)
    rows = [[departure_words(one), change_words(one), length(one.position_rms)] for one in named]
    others = [one for one in found if one not in named]
    if others:
        together = size_of(np.sum([one.displacement for one in others], axis=0))
        whole = size_of(np.sum([one.displacement for one in found], axis=0))
        rows += [["all others together", "", length(together)]] if named else []
        rows.append(["all parameters together", "", length(whole)])
    return [Table(_head(point), rows, (1, 2))] if rows else []


def geometry_line(found: Sequence[Departure], apart: Sequence[Difference] = (), point: str = "TCP") -> str:
    """Which parameters make the error of the nominal geometry, in a sentence, and of which only differences are known; empty of
    a nominal geometry. ``apart``: such differences, of which those that are determined are named. ``point``: as
    :func:`point_of` has it."""
    common = dict.fromkeys(COMMON[one.what] for one in clear(found) if one.relative and one.what in COMMON)
    relative = (
        f" A common {joined(list(common))} is not determined: only differences between them are." if common else ""
    )
    named = {one.name for one in clear(found)}
    apart = [one for one in apart if abs(one.value) > CLEAR * one.sigma and not {one.first, one.second} <= named]
    said = [f"{d.first} less {d.second} {quantity(d.value, d.unit, d.sigma)}" for d in apart[:APART]]
    known = f" Determined between tracks, and of none alone: {joined(said)}." if said else ""
    return _largest(found, point) + relative + known if found else ""


def _largest(found: Sequence[Departure], point: str) -> str:
    """Which parameters make the error of the nominal geometry, in a sentence."""
    named, whole = clear(found), size_of(np.sum([one.displacement for one in found], axis=0))
    if not named:
        return (
            f"Geometry: {length(whole)} at the {point} by {counted(len(found), 'parameter')}; these data determine none of "
            "them alone."
        )
    first = named[0]
    what, size = f"{departure_words(first)}, {change_words(first)}", length(first.position_rms)
    left = size_of(np.sum([one.displacement for one in found if one is not first], axis=0)) if found[1:] else 0.0
    if left**2 < MOST * whole**2:
        return f"Geometry: {what}: {size} at the {point}."
    return (
        f"Geometry: its parameters move the {point} by {length(whole)} together. The largest that these data determine: {what} "
        f"({size} alone)."
    )


def all_departures(found: Sequence[Departure], point: str = "TCP") -> Table:
    """All departures, with what the data do not determine marked."""
    rows = [
        [departure_words(one), change_words(one) if one.determined else "not determined", length(one.position_rms)]
        for one in found
    ]
    return Table(_head(point), rows, (1, 2))
