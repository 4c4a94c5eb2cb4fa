"""What the simulator asks of a machine of any kind, and how random commands of it are found."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from gtpin.bench.simulator.arm import Arm
from gtpin.bench.simulator.deviation import Deviation
from gtpin.bench.simulator.poses import Poses
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

MASS_SPREAD = 0.04
"""Standard deviation of each mass, relative to the nominal mass."""
REACH = 0.8
"""Errors of drives and guideways are functions of places from -REACH to REACH, for every length of range."""
CONDITIONED = 1.5
"""Largest ratio of the TCP's motion by unit commands to that at home, or in the middle of the ranges: commands with a larger
one are not used."""
RESOLUTION = 1e-6
"""Step to which commands are rounded, as by a controller, m or rad."""
TRIES = 50
"""Number of draws for each wanted command after which a robot counts as unable to reach its range."""


class Moved(Protocol):
    """A machine of any kind, without effects. Everything is in the base frame."""

    def predict(self, q: Floats) -> Poses:
        """Poses of the measured target at commands q (N, n); NaN out of reach."""

    def command_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6, n) derivative of the poses by the commands: position and rotation vector. Of a :class:`Machine` (N, 6 + k, n),
        followed by that of the k joints whose coordinates the poses have."""


class Machine(Moved, Protocol):
    """A machine with n drives as it was really built, with what its effects depend on.

    Whatever a drive moves is called a cart, on an arm too: a joint with its link.
    """

    @property
    def robot(self) -> Robot | Arm:
        """The nominal robot."""

    @property
    def n_carts(self) -> int:
        """Number of drives."""

    @property
    def per_metre(self) -> Floats | float:
        """() or (n,) repeatability of a drive, m or rad, over that of a cart on a track, m."""

    @property
    def gravity(self) -> Floats:
        """(3,) acceleration of gravity, base frame, m/s^2."""

    @property
    def readable(self) -> tuple[str, ...]:
        """Name of the passive joint that an encoder reads; empty where there is none."""

    @property
    def parameters(self) -> dict[str, float]:
        """Deviations of the geometry's parameters from nominal, by name, m and rad."""

    def nominal(self) -> Moved:
        """The nominal robot as a machine."""

    def by_tolerance(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6 + k, p) derivative of the poses, and of the k joints whose coordinates they have, by everything that a
        calibration identifies, in units of tolerances."""

    def places(self, q: Floats) -> Floats:
        """(N, n) places of commands (N, n) in their ranges: no unit, from about -REACH to REACH. Effects depend on them."""

    def reachable(self, count: int, rng: np.random.Generator) -> Floats:
        """(count, n) random commands all over the workspace, m or rad.

        Raises UnreachableError if hardly any commands can be reached.
        """

    def unbent(self, visits: int) -> Deviation:
        """Deviations of zero at a number of visits."""

    def jitter(self, sigmas: Floats, visits: int, rng: np.random.Generator) -> Deviation:
        """Random deviations at every visit, by the repeatabilities ``sigmas`` (n,), m or rad."""


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
