"""Kinds of error of the plant: the name, the sites, and how one machine's error of this kind is drawn."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np

from gtpin.bench.simulator.arm import Arm
from gtpin.bench.simulator.machine import Deviation
from gtpin.errors import GtpinError
from gtpin.robot.chain import Chain

Where = Literal["carts", "guides", "turning", "joints", "coupled", "links", "arm", "pins", "frame", "platform"]


@dataclass(frozen=True)
class Site:
    """A site: its name, the index of its cart or commanded joint (-1: none), the indices of its rods or links, and the index of
    its passive joint (-1: none).
    """

    name: str
    cart: int
    rods: tuple[int, ...]
    pin: int = -1

    @staticmethod
    def of(robot: Chain | Arm, name: str) -> Site:
        """The site with a name. The index of an arm's link is that of the commanded joint that moves it."""
        if isinstance(robot, Arm):
            if name in robot.sites:
                return Site(name, robot.sites.index(name), ())
            if name in robot.link_sites:
                return Site(name, -1, (robot.link_sites.index(name),))
            if name in robot.pin_sites:
                return Site(name, -1, (), robot.pins[robot.pin_sites.index(name)])
            return Site(name, -1, tuple(range(robot.n_actuators)))
        if name in robot.sites:
            cart = robot.sites.index(name)
            return Site(name, cart, tuple(i for i, r in enumerate(robot.rods) if cart in (r.carrier, r.extension)))
        if name in robot.rod_sites:
            return Site(name, -1, (robot.rod_sites.index(name),))
        return Site(name, -1, tuple(range(len(robot.rods))))


@dataclass(frozen=True)
class CauseKind:
    """A kind of error."""

    name: str  # Its id: that of the catalogue's effect, or of an unlisted one
    # Sites at which it occurs. ``carts``: everything that a drive moves. ``guides``: carts on tracks. ``turning``: the
    # same, where one of them carries more than one joint. ``joints``: the commanded joints of an arm. ``coupled``: the
    # same, where there are several. ``links``: single links. ``arm``: all links at once, or one of them. ``pins``:
    # passive joints of loops.
    where: Where
    # The deviation by one machine's error at its typical size: from the machine's situation, the site, and a source of the
    # random numbers that distinguish the machines
    error: Callable[..., Deviation]
    # Conditions that must vary so that it can be detected: ``session``, ``speed``, ``payload``, ``force``, ``heat``
    needs: tuple[str, ...] = ()
    # Largest amplitude, in typical sizes: no machine has a larger error, even where the effect then has little energy
    largest: float = 20.0
    periodic: bool = False  # Whether ``error`` also takes the numbers of periods a turn of its lines
    # Newer than the published cases: a seed draws it into no case and not beside one; made if asked for
    newer: bool = False

    def sites(self, robot: Chain | Arm) -> tuple[str, ...]:
        """Names of the sites of a robot at which it can occur: parts that move the TCP; empty where there are none."""
        if isinstance(robot, Arm):
            joints, links = (
                tuple(robot.sites[c] for c in robot.acting),
                tuple(robot.link_sites[c] for c in robot.linked),
            )
            alone: dict[str, tuple[str, ...]] = {"joints": joints, "coupled": joints if len(joints) > 1 else ()}
            found = {**alone, "links": links, "arm": ("arm", *links) if links else (), "pins": robot.pin_sites}
        else:
            carriers = [
                rod.carrier for rod in robot.rods if rod.carrier is not None and not robot.revolute[rod.carrier]
            ]
            guides = tuple(site for i, site in enumerate(robot.sites) if i in carriers)
            turning = guides if len(set(carriers)) < len(carriers) else ()
            carts = {"carts": robot.sites, "guides": guides, "turning": turning}
            found = {**carts, "links": robot.rod_sites, "arm": ("arm", *robot.rod_sites)}
        return found.get(self.where, (self.where,))

    def at(self, robot: Chain | Arm, site: str, rng: np.random.Generator, periods: tuple[float, ...] = ()) -> Cause:
        """The error of one machine at a site, with given periods where it is :attr:`periodic`.

        Raises GtpinError if the error can't occur at the site.
        """
        if site not in self.sites(robot):
            raise GtpinError(f"{self.name} can't be at {site!r}", hint=f"use {', '.join(self.sites(robot))}")
        error = partial(self.error, periods=periods) if periods else self.error
        return Cause(error, Site.of(robot, site), deepcopy(rng))


@dataclass(frozen=True, eq=False)
class Cause:
    """The error of one machine at its typical size: takes the same random numbers at every call."""

    error: Callable[..., Deviation]
    site: Site
    rng: np.random.Generator  # In the state before the random numbers

    def __call__(self, now: Any, rng: np.random.Generator | None = None) -> Deviation:
        """The deviation in a situation of the machine. ``rng``: takes the random numbers from here instead."""
        return self.error(now, self.site, rng or deepcopy(self.rng))
