"""Kinds of error of the plant: the name, the sites, and how one machine's error of this kind is drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from gtpin.bench.simulator.arm import Arm
from gtpin.errors import GtpinError
from gtpin.robot.chain import Chain

Cause = Callable[[Any], Any]
"""The error of one machine at its typical size: a function from the machine's situation to its deviation."""
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
    draw: Callable[..., Cause]  # Draws the error of one machine, at its typical size
    # Conditions that must vary so that it can be detected: ``session``, ``speed``, ``payload``, ``force``, ``heat``
    needs: tuple[str, ...] = ()
    # Largest amplitude, in typical sizes: no machine has a larger error, even where the effect then has little energy
    largest: float = 20.0
    periodic: bool = False  # Whether ``draw`` also takes the numbers of periods a turn of its lines
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
        """Draw the error of one machine at a site, with given periods where it is :attr:`periodic`.

        Raises GtpinError if the error can't occur at the site.
        """
        if site not in self.sites(robot):
            raise GtpinError(f"{self.name} can't be at {site!r}", hint=f"use {', '.join(self.sites(robot))}")
        return self.draw(Site.of(robot, site), rng, *((periods,) if periods else ()))
