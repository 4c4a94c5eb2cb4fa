"""Mistakes in the columns of commands: other orders, signs and units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from gtpin.data.names import command_names
from gtpin.data.readings import UNITS
from gtpin.robot.robot import Robot
from gtpin.typing import Floats


@dataclass(frozen=True)
class CommandReading:
    """A way to read the columns q1 .. qn.

    ``columns``: the columns that are read in another way. ``looks``, ``hint``: message texts: what these columns look like,
    and what the user should do. ``q``: (N, n) commands, read in this way, m or rad.
    """

    columns: str
    looks: str
    hint: str
    q: Floats


def command_readings(q: Floats, robot: Robot) -> Iterator[CommandReading]:
    """Ways to read commands (N, n), m or rad.

    One column or all with the other sign or in another unit; two columns swapped; all columns in reverse order, or shifted by
    one.
    """
    names = command_names(q.shape[1])
    everything = list(range(len(names)))
    for some in _one_or_all(everything):
        columns = _listed(names, some)
        look = "looks" if len(some) == 1 else "look"
        yield CommandReading(
            columns, f"{columns} {look} reversed", f"change the sign of {columns}", _scaled(q, some, -1.0)
        )
        for unit, factor in _units(robot, some):
            hint = f"multiply {columns} by {factor:.6g}"
            yield CommandReading(columns, f"{columns} {look} like {unit}", hint, _scaled(q, some, factor))
    for i, j in combinations(everything, 2):
        order = everything.copy()
        order[i], order[j] = j, i
        yield CommandReading(
            f"{names[i]} {names[j]}", f"{names[i]} and {names[j]} look swapped", "swap them", q[:, order]
        )
    if len(names) > 2:
        yield CommandReading(
            _listed(names, everything), "q1 .. qn look to be in reverse order", "reverse them", q[:, ::-1]
        )
        for by in (1, -1):
            order = list(np.roll(everything, by))
            assigned = ", ".join(f"{names[i]} = {names[j]}" for i, j in enumerate(order))
            columns = _listed(names, everything)
            yield CommandReading(columns, f"{columns} look shifted by one", f"write ({assigned})", q[:, order])


def _one_or_all(everything: list[int]) -> list[list[int]]:
    return [[i] for i in everything] + ([everything] if len(everything) > 1 else [])


def _units(robot: Robot, some: list[int]) -> list[tuple[str, float]]:
    turning = [robot.actuators[i].revolute for i in some]
    if all(turning):
        return [("degrees", float(np.pi / 180.0))]
    return [] if any(turning) else list(UNITS)


def _scaled(q: Floats, some: list[int], factor: float) -> Floats:
    scaled = q.copy()
    scaled[:, some] *= factor
    return scaled


def _listed(names: list[str], some: list[int]) -> str:
    return " ".join(names[i] for i in some)
