"""How far machines depart from the cores of effects: the size of each modulation, with its source."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Modulation:
    """Sizes of the columns that modulate an effect, relative to its core: prior standard deviations.

    They move verdicts, as the numbers of ``gtpin/diagnosis/priors.py`` do; effects use them, and import nothing of a diagnosis.
    """

    # Drives.
    play: float = 0.2
    """Backlash along the track, and with the load. Assumed."""
    lag: float = 0.2
    """Lag along the track, and with the speed. Assumed."""
    scale: float = 0.1
    """Scale of a drive along the track: a mean over its whole length varies less than its parts. Assumed."""
    period: float = 0.25
    """Period's change of amplitude from the middle of the track to its ends, and its first harmonic. Assumed."""
    line: float = 0.1
    """The same change of amplitude of a line of a turning joint: gears are round, and the drift would pass for another period.
    Assumed."""
    slope: float = 0.3
    """Slope beyond a step, over the whole range: the second rack has a scale of its own. Assumed."""
    own_track: float = 0.3
    """Cross coupling along the actuator's own track. Assumed."""

    # What gives way.
    stiffening: float = 0.2
    """Compliance at twice the usual load. Derived: in contacts of balls (Hertz) it falls to 2^(-1/3), 21 % less."""
    compression: float = 0.2
    """Compliance of a link in compression against tension. Assumed."""
    friction: float = 0.05
    """Share of a deflection that friction in guides and joints holds back, to either side. Assumed."""
    places: float = 0.1
    """Compliance of a cart along its track. Assumed."""
    tipping: float = 0.5
    """The same of its compliance in turning, relative to that: more would pass for the track's own twist. Assumed."""
    links: float = 0.2
    """Links of one arm: compliance, expansion. Assumed: they are of one make."""
    extension: float = 0.5
    """Compliance of a leg over its range: its screw is longer where it is extended. Assumed."""
    soft_clearance: float = 0.3
    """Play that floats where the force is small. Assumed."""
    yielding: float = 0.15
    """Play that grows with the force. Assumed."""

    # What grows with temperature.
    warming: float = 0.1
    """Expansion of a link, 5 K warmer. Assumed."""
    late: float = 0.15
    """Expansion over time: the thermometer is not the part. Assumed."""
    uneven: float = 0.15
    """Expansion along a track: one end may warm more. Assumed."""
    late_zero: float = 0.1
    """Motion of a track's zero over time, m times its expansion. Assumed."""

    # The instrument.
    wander: float = 0.05
    """Shift of what is seen where the instrument's scale varies, m times the scale. Assumed: a part of it, some metres away."""

    # What a recorded column moves.
    curvature: float = 0.2
    """Motion with a recorded column at the ends of its range, over that in proportion. Assumed."""


MODULATION = Modulation()
"""Those of the catalogue."""
