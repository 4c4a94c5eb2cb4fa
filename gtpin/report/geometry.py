"""The geometry's departures from nominal in words and as tables: which parameters make the error of the nominal geometry."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.model.departures import Departure, Difference, departures, size_of, track_differences
from gtpin.model.model import Model
from gtpin.report.page import Table
from gtpin.report.words import counted, joined, length, quantity
from gtpin.typing import Floats

IN_DOUBT = "The geometry is in doubt: the target does not look to be where it is declared."
CLEAR = 3.0
"""Number of sigmas from which a departure is shown by name on a first screen: one of 50 parameters, as those of the Gantry-Tau,
is beyond 3 sigmas by chance in 13 % of machines, beyond 2 in 90 %."""
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
    """The departures that the data determine, for a first screen: at most five, none of less than 2 % of the largest."""
    known = [one for one in found if one.determined and abs(one.value) > CLEAR * one.sigma]
    return [one for one in known if one.position_rms > 0.02 * known[0].position_rms][:5]


def point_of(model: Model) -> str:
    """What the displacements of a model's departures are of: the TCP, or a target whose place on the platform is free."""
    return "target" if model.free_target else "TCP"


def geometry_words(model: Model, q: Floats) -> tuple[str, list[Table]]:
    """A model's departures over commands q (N, n) as a sentence and a table; of a geometry in doubt, that it is."""
    if model.doubt:
        return IN_DOUBT, []
    found, point = departures(model, q), point_of(model)
    return geometry_line(found, track_differences(model), point), geometry_table(found, point)


def geometry_table(found: Sequence[Departure], point: str) -> list[Table]:
    """The largest departures, and all others together; empty of a nominal geometry. ``point``: as :func:`point_of` has it."""
    named = clear(found)
    rows = [[departure_words(one), change_words(one), length(one.position_rms)] for one in named]
    others = [one for one in found if one not in named]
    if others:
        together = size_of(np.sum([one.displacement for one in others], axis=0))
        whole = size_of(np.sum([one.displacement for one in found], axis=0))
        rows += [["all others together", "", length(together)]] if named else []
        rows.append(["all parameters together", "", length(whole)])
    return [_table(rows, point)] if rows else []


def all_departures(found: Sequence[Departure], point: str) -> Table:
    """All departures, with what the data do not determine marked."""
    changes = [change_words(one) if one.determined else "not determined" for one in found]
    rows = zip(map(departure_words, found), changes, (length(one.position_rms) for one in found), strict=True)
    return _table([[*row] for row in rows], point)


def _table(rows: list[list[str]], point: str) -> Table:
    return Table(("parameter", "change from nominal", f"at the {point}, RMS"), rows, (1, 2))


def geometry_line(found: Sequence[Departure], apart: Sequence[Difference], point: str) -> str:
    """Which parameters make the error of the nominal geometry, in a sentence, and of which only differences are known; empty of
    a nominal geometry. ``apart``: such differences, of which those that are determined are named. ``point``: as
    :func:`point_of` has it."""
    if not found:
        return ""
    words, named = _largest(found, point), clear(found)
    if common := dict.fromkeys(COMMON[one.what] for one in named if one.relative and one.what in COMMON):
        words += f" A common {joined(list(common))} is not determined: only differences between them are."
    names = {one.name for one in named}
    apart = [one for one in apart if abs(one.value) > CLEAR * one.sigma and not {one.first, one.second} <= names]
    if said := [f"{d.first} less {d.second} {quantity(d.value, d.unit, d.sigma)}" for d in apart[:2]]:
        words += f" Determined between tracks, and of none alone: {joined(said)}."
    return words


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
