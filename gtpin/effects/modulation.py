"""Sizes of the modulations of effects: how much real machines differ from the core of an effect, with the sources."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Modulation:
    """Typical sizes of the modulation columns of effects, relative to the core: prior standard deviations.

    They influence verdicts, as the numbers in ``gtpin/diagnosis/priors.py`` do. They are in a separate module because effects
    do not import the diagnosis.
    """

    # Drives.
    play: float = 0.2
    """Backlash along the track, and with the load. Assumed."""
    lag: float = 0.2
    """Lag along the track, and with the speed. Assumed."""
    scale: float = 0.1
    """Scale of a drive along the track: the mean over the whole length varies less than parts of it. Assumed."""
    period: float = 0.25
    """Change of the amplitude from the middle of the track to its ends, where both ends change alike and where they change in
    opposite ways, and amplitude of the second harmonic. Assumed."""
    line: float = 0.1
    """The same change of amplitude for one period of a turning joint. It is small because gears are round, and because a larger
    one could be confused with another period. Assumed."""
    slope: float = 0.3
    """Slope beyond a step, over the whole range: the second rack segment has its own scale. Assumed."""
    flank: float = 0.5
    """Share of each of two ramps in a step's flank: 1 for a flank that is this ramp, 0 for a sharp step. Assumed."""
    own_track: float = 0.3
    """Cross coupling along the actuator's own track. Assumed."""

    # Compliances and clearances.
    stiffening: float = 0.2
    """Change of a compliance at twice the usual load. Derived: in contacts of balls (Hertz) it falls to 2^(-1/3), 21 % less."""
    dead_zone: float = 0.5
    """Compliance of a cart that acts at small forces only, over that at all forces: -1 for a dead zone, positive for contacts.
    Assumed."""
    compression: float = 0.2
    """Difference of a link's compliance between tension and compression. Assumed."""
    friction: float = 0.05
    """Hysteresis: change of a deflection with the direction of approach, caused by friction in guides and joints. Assumed."""
    places: float = 0.1
    """Variation of a cart's compliance along its track. Assumed."""
    tipping: float = 0.5
    """Factor on ``places`` for the cart's rotational compliance. With a larger one the effect could be confused with a twist of
    the track. Assumed."""
    links: float = 0.2
    """Difference of compliance or expansion between the links of one arm. Assumed: the links are of the same type."""
    extension: float = 0.5
    """Variation of a leg's or a column's compliance over its range: an extended leg has a longer screw. Assumed."""
    pivot: float = 0.5
    """Tilt about the origin of the base frame over that about the first joint: the point about which a base rocks lies between
    the two. Assumed."""
    aside: float = 0.2
    """Distance, m, from a joint's axis of the point about which a base rocks. Assumed: bases have some 0.5 m."""
    settling: float = 0.5
    """Tilt by which a base settles over that which it has at once, as soft ground and wood creep under load. Assumed."""
    soft_clearance: float = 0.3
    """Smooth transition of a play where the force is small. Assumed."""
    yielding: float = 0.15
    """Increase of a play with the force. Assumed."""

    # Thermal expansion.
    warming: float = 0.1
    """Change of a link's expansion coefficient when it is 5 K warmer. Assumed."""
    late: float = 0.15
    """Change of an expansion coefficient over time: the sensor does not measure the part itself. Assumed."""
    uneven: float = 0.15
    """Change of an expansion coefficient along a track: one end may become warmer than the other. Assumed."""
    late_zero: float = 0.1
    """Change over time of the motion of a track's zero, in m times the expansion coefficient. Assumed."""

    # The instrument, and the tool.
    bending: float = 0.25
    """Shifts of a tool across its axis over those along it, where it drifts. Assumed: it grows along its axis, and bends where
    it warms up unevenly."""
    holder: float = 1.0
    """Change of a delay when the speed doubles, and difference of the delays of orientations and positions, over the delay.
    Derived for a target on a soft holder: 1 where its lag grows with the square of the speed, as drag does, or has no turn."""
    wander: float = 0.05
    """Shift of the measured positions where the instrument's scale varies, in m times the scale. Assumed: the instrument is
    some metres away, and only a part of its scale varies."""

    # What a recorded column moves.
    curvature: float = 0.2
    """Motion with a recorded column at the ends of its range, over that in proportion. Assumed."""


MODULATION = Modulation()
"""The sizes that the effects of the catalogue use."""
