"""What a model left unexplained of the data that it was fitted to."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Unexplained:
    """Errors of a fitted model that differ from pose to pose and are not noise, per axis, as standard deviations.

    They are a part of the uncertainty of every prediction of the model.

    Parameters
    ----------
    position, orientation
        Of the position, m, and of the orientation, rad; 0 where chi-square shows no such errors.
    noise_known
        True: the noise was declared, or repeated visits of poses showed it. False: what was left of the fit can't be divided
        into noise and errors of the model, and all of it counts as unexplained.
    """

    position: float
    orientation: float
    noise_known: bool = True

    @property
    def none(self) -> bool:
        """Whether nothing is unexplained."""
        return self.position == 0.0 and self.orientation == 0.0


EXPLAINED = Unexplained(0.0, 0.0)
"""Nothing is unexplained."""
