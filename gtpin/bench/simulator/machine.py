"""What the simulator asks of a machine of any kind: its deviations, and how random commands of it are found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gtpin.bench.simulator.poses import VirtualPoses
from gtpin.errors import UnreachableError
from gtpin.typing import Floats


@dataclass(frozen=True)
class Deviation:
    """Changes at N visits of a machine with n drives, and k rods or J joints. Arrays for what it does not have are empty."""

    travel: Floats  # (N, n) motions of carts along tracks, m, of arms and joints, rad, or of legs' lengths, m
    shift: Floats  # (N, n, 3) on rods: shifts of the carts, base frame, m
    turn: Floats  # (N, n, 3) on rods: rotation vectors of the carts about the mean of their joints, base frame, rad
    length: Floats  # (N, k) changes of the rods' lengths, m
    joint: Floats  # (N, k, 3) shifts of the joints on the platform, TCP frame, m
    # The next three: shift, m, and rotation vector, rad
    axis: Floats  # (N, n, 6) of the commanded joints' axes, joint's frame
    tip: Floats  # (N, n, 6) of the ends of the links that these joints move, link's frame
    seat: Floats  # (N, J, 6) as ``axis``, of all joints, including passive ones
    target: Floats  # (N, 3) shift of the target from its place on the tool, TCP frame (without rods: target's frame), m
    # (N, 6) motion of everything that the instrument measures, about its station: as above, base frame
    frame: Floats
    scale: Floats  # (N,) relative change of the distances that the instrument reads from its station

    @staticmethod
    def none(visits: int, drives: int, rods: int = 0, joints: int = 0) -> Deviation:
        """Zeros."""
        carts, links = (drives, 0) if rods else (0, drives)
        return Deviation(
            travel=np.zeros((visits, drives)),
            shift=np.zeros((visits, carts, 3)),
            turn=np.zeros((visits, carts, 3)),
            length=np.zeros((visits, rods)),
            joint=np.zeros((visits, rods, 3)),
            axis=np.zeros((visits, links, 6)),
            tip=np.zeros((visits, links, 6)),
            seat=np.zeros((visits, joints, 6)),
            target=np.zeros((visits, 3)),
            frame=np.zeros((visits, 6)),
            scale=np.zeros(visits),
        )

    def __add__(self, other: Deviation) -> Deviation:
        return Deviation(**{name: value + getattr(other, name) for name, value in vars(self).items()})

    def __mul__(self, factor: float) -> Deviation:
        return Deviation(**{name: value * factor for name, value in vars(self).items()})


MASS_SPREAD = 0.04
"""Standard deviation of each mass, relative to the nominal mass."""
REACH = 0.8
"""Errors of drives and guideways are functions of places from -REACH to REACH, for every length of range."""
CONDITIONED = 1.5
"""Largest motion of the TCP by unit commands that is used, over that at home, or in the middle of the ranges."""
RESOLUTION = 1e-6
"""Step to which commands are rounded, as by a controller, m or rad."""
TRIES = 50
"""Number of draws for each wanted command after which a robot counts as unable to reach its range."""


class Moved(Protocol):
    """A machine of any kind, without effects. Everything is in the base frame."""

    def predict(self, q: Floats) -> VirtualPoses:
        """Poses of the measured target at commands q (N, n); NaN out of reach."""

    def command_jacobian(self, q: Floats, poses: VirtualPoses) -> Floats:
        """(N, 6, n) derivative of the poses by the commands: position and rotation vector. Of a machine with what its effects
        depend on (N, 6 + k, n), followed by that of the k joints whose coordinates the poses have."""


def gain(machine: Moved, q: Floats) -> Floats:
    """(N,) motion of the TCP by unit commands: the norm of its derivative; infinite out of reach."""
    poses = machine.predict(q)
    found, there = np.full(len(q), np.inf), poses.reached
    found[there] = np.linalg.norm(machine.command_jacobian(q[there], poses[there]), axis=(1, 2))
    return found


def rounded(q: Floats) -> Floats:
    """Commands as a controller takes them."""
    return np.asarray(np.round(q / RESOLUTION) * RESOLUTION)


def collected(draw: Callable[[], Floats], count: int, tries: int = TRIES) -> Floats | None:
    """(count, n) commands, of those that ``draw`` gives each time, (m, n); None where they are too few."""
    found: list[Floats] = []
    for _ in range(tries):
        found.append(draw())
        if sum(map(len, found)) >= count:
            return np.vstack(found)[:count]
    return None


def well_conditioned(
    machine: Moved,
    name: str,
    home_q: Floats,
    draw: Callable[[], Floats],
    count: int,
    hint: str = "give a home inside the workspace, smaller tolerances, or loops that space leaves free to close",
) -> Floats:
    """(count, n) commands of those that ``draw`` gives, where the machine is as well conditioned as around home (n,).

    Raises UnreachableError if its loops don't close at home, with the ``hint``, or it reaches hardly any commands.
    """
    at_home = gain(machine, home_q[None])[0]
    if not np.isfinite(at_home):
        what = f"the loops of {name} don't close at home with joints that are off by their tolerances"
        raise UnreachableError(what, hint=hint)

    def conditioned() -> Floats:
        q = rounded(draw())
        return np.asarray(q[gain(machine, q) <= CONDITIONED * at_home])

    found = collected(conditioned, count)
    if found is None:
        what = f"{name} reaches hardly any of the commands in its range"
        raise UnreachableError(what, hint="narrow the range in the URDF")
    return found
