"""Random commands of a machine with loops: all over its ranges, where it is about as well conditioned as at home."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.looped.machine import LoopedMachine
from gtpin.errors import UnreachableError
from gtpin.typing import Floats

CONDITIONED = 1.5
"""Largest ratio of the TCP's motion by unit commands to that at home: commands with a larger one are not used."""
RESOLUTION = 1e-6
"""Step to which commands are rounded, rad or m."""
TRIES = 50


def well_led(machine: LoopedMachine, count: int, rng: np.random.Generator) -> Floats:
    """(count, n) commands within the ranges.

    Raises
    ------
    UnreachableError
        If the loops don't close at home, or hardly anywhere in the ranges.
    """
    home = _gain(machine, machine.robot.loops.home_q[None])[0]
    if not np.isfinite(home):
        raise UnreachableError(
            f"the loops of {machine.robot.name} don't close at home with joints that are off by their tolerances",
            hint="give a home inside the workspace, smaller tolerances, or loops that space leaves free to close",
        )
    middle, half = machine.region
    found = np.zeros((0, machine.n_carts))
    for _ in range(TRIES):
        q = middle + half * rng.uniform(-1.0, 1.0, (count, machine.n_carts))
        q = np.round(q / RESOLUTION) * RESOLUTION
        found = np.vstack([found, q[_gain(machine, q) <= CONDITIONED * home]])
        if len(found) >= count:
            return found[:count]
    raise UnreachableError(
        f"{machine.robot.name} reaches hardly any of the commands in its range", hint="narrow the range in the URDF"
    )


def _gain(machine: LoopedMachine, q: Floats) -> Floats:
    """(N,) motion of the TCP by unit commands: the norm of its derivative; infinite out of reach."""
    gain = np.linalg.norm(machine.command_jacobian(q), axis=(1, 2))
    return np.where(np.isfinite(gain), gain, np.inf)
