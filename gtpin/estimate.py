"""A value with its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

WIDE = 1.96
"""Half the width of a 95 % interval of a Gaussian, in standard deviations."""


@dataclass(frozen=True)
class Estimate:
    """An estimated value and its standard deviation.

    Parameters
    ----------
    value, sigma
        The value and its standard deviation, both in ``unit``.
    unit
        ``m``, ``rad``, ``N/m``, ...; empty for a number without a unit.

    Examples
    --------
    >>> from gtpin import Estimate
    >>> estimate = Estimate(5.0e-5, 2.0e-6, "m")
    >>> estimate
    Estimate(5e-05 ± 2e-06 m)
    >>> low, high = estimate.interval
    >>> print(f"{low:.3g} to {high:.3g} m")
    4.61e-05 to 5.39e-05 m
    """

    value: float
    sigma: float
    unit: str = ""

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the 95 % interval: 1.96 sigma below and above the value."""
        return self.value - WIDE * self.sigma, self.value + WIDE * self.sigma

    def __repr__(self) -> str:
        return f"Estimate({f'{self.value:.6g} ± {self.sigma:.2g} {self.unit}'.rstrip()})"
