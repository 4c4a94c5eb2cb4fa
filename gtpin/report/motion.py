"""One quantity that an effect displaces."""

from __future__ import annotations

from dataclasses import dataclass

from gtpin.typing import Floats


@dataclass(frozen=True)
class Carried:
    """The load that does work along a displaced quantity of a robot without rods.

    Parameters
    ----------
    what
        The part on which it acts, and its direction, in words.
    index, way
        Index of the placement frame, as in :class:`~gtpin.kinematics.bodies.Bodies`, and (6,) the direction as a twist in this
        frame.
    """

    what: str
    index: int
    way: Floats

    @property
    def words(self) -> str:
        """Its name: ``force on ...`` or ``moment on ...``."""
        return f"{'moment' if self.way[3:].any() else 'force'} on {self.what}"

    @property
    def unit(self) -> str:
        """``N`` or ``N m``."""
        return "N m" if self.way[3:].any() else "N"


@dataclass(frozen=True)
class Motion:
    """One quantity that an effect displaces, at N poses.

    Parameters
    ----------
    name, unit
        Its name, such as ``travel of cart1``, and ``m`` or ``rad``.
    columns
        (N, m) displacement of the quantity for a value of 1 of each of the effect's m coefficients.
    tcp
        (N, 6 + k) displacement of the TCP, base frame, m and rad, and of k measured joints, by one unit of the quantity.
    rod
        Index of the rod whose length it is; None for other quantities.
    straightened
        Whether geometry absorbs a straight line of the quantity along the track, not only its mean.
    carried
        For a robot without rods, the load along the quantity; None where there is none.
    """

    name: str
    unit: str
    columns: Floats
    tcp: Floats
    rod: int | None = None
    straightened: bool = False
    carried: Carried | None = None
