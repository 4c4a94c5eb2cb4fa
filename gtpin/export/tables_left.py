"""The errors that remain with a controller's tables, at points other than their nodes, with both directions of approach."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gtpin.compensation.machine import Machine
from gtpin.errors import ModelError
from gtpin.typing import Floats

POINTS = 512
"""Number of points at which errors are computed."""
LEAST = 1e-8
"""Motion of the TCP, m, below which an effect counts as absent under the conditions of the tables."""


@dataclass(frozen=True, eq=False)
class Left:
    """(N, 3) errors of the TCP without and with tables, base frame, m."""

    before: Floats
    after: Floats

    @property
    def is_nothing(self) -> bool:
        """Whether there is no error to correct."""
        return _rms(self.before) < LEAST

    def words(self, where: str, temperatures: Mapping[str, float]) -> str:
        """Text with the root mean squares of both errors, um."""
        warm = "".join(f", {name} {value:g} degC" for name, value in temperatures.items())
        return (
            f"leaves {_um(self.after)} of {_um(self.before)} um of the TCP's error in {where}{warm}"
            f" (z: {_um(self.after[:, 2:])} of {_um(self.before[:, 2:])} um)"
        )


def check_any(left: Sequence[Left]) -> None:
    """Raise `ModelError` if there is no error to correct at any temperature."""
    if all(some.is_nothing for some in left):
        hint = "give a calibrated or diagnosed model, and --temperature for effects of temperatures"
        raise ModelError("there is nothing to correct: the model is what the controller has", hint=hint)


def both_approaches(count: int) -> Floats:
    """(count,) alternating directions of approach, +1 and -1."""
    return np.where(np.arange(count) % 2, 1.0, -1.0)


def by_parts(
    machines: Mapping[str, Machine], left: Callable[[Machine], Left]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The remaining error of each part of the model if tables are made for it alone, as texts, and the names of effects that
    move nothing under the conditions of the tables."""
    words, absent = [], []
    for name, machine in machines.items():
        found = left(machine)
        if not found.is_nothing:
            words.append(f"{name} {_um(found.after)} of {_um(found.before)} um")
        elif name != "geometry":
            absent.append(name)
    return ((f"leaves of each part alone: {', '.join(words)}",) if words else ()), tuple(absent)


def _rms(errors: Floats) -> float:
    return float(np.sqrt((errors**2).sum(axis=1).mean()))


def _um(errors: Floats) -> str:
    size = 1e6 * _rms(errors)
    if size < 0.01:
        return "under 0.01"
    return f"{size:.3g}" if size < 1000.0 else f"{size:.0f}"
