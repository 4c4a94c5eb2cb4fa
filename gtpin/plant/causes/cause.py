"""What a cause of error is to the plant: a name, its sites, and how one machine's own case of it is drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gtpin.errors import GtpinError
from gtpin.plant.deviation import Deviation
from gtpin.plant.situation import Situation
from gtpin.robot.robot import Robot

Cause = Callable[[Situation], Deviation]
"""One machine's own error at its typical size: what it does in a situation."""
Where = Literal["carts", "guides", "turning", "links", "arm", "frame", "platform"]


@dataclass(frozen=True)
class Site:
    """A place in the machine: its name, the cart where it is one, and the rods that belong to it."""

    name: str
    cart: int
    rods: tuple[int, ...]

    @staticmethod
    def of(robot: Robot, name: str) -> Site:
        """The site of a name."""
        if name in robot.sites:
            cart = robot.sites.index(name)
            return Site(name, cart, tuple(i for i, r in enumerate(robot.rods) if cart in (r.carrier, r.extension)))
        if name in robot.rod_sites:
            return Site(name, -1, (robot.rod_sites.index(name),))
        return Site(name, -1, tuple(range(len(robot.rods))))


@dataclass(frozen=True)
class Kind:
    """A kind of error.

    Parameters
    ----------
    name
        Its id: the contract's, or one that no catalogue has.
    where
        At which sites it occurs: ``carts`` are all that drives move, ``guides`` those of them that slide along a track,
        ``turning`` the same where any of them carries more than one joint; ``arm`` means all links at once, or one of them.
    draw
        Draws one machine's own case of it, at its typical size.
    needs
        What must vary for it to show: ``session``, ``speed``, ``payload``, ``force``, ``heat``.
    largest
        Times its typical size, beyond which no machine errs however little it shows.
    """

    name: str
    where: Where
    draw: Callable[[Site, np.random.Generator], Cause]
    needs: tuple[str, ...] = ()
    largest: float = 20.0

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Names of the sites at which it can occur; none where the robot has no such."""
        if self.where == "carts":
            return robot.sites
        if self.where in ("guides", "turning"):
            carriers = [
                rod.carrier for rod in robot.rods if rod.carrier is not None and not robot.revolute[rod.carrier]
            ]
            if self.where == "turning" and len(set(carriers)) == len(carriers):
                return ()
            return tuple(site for i, site in enumerate(robot.sites) if i in carriers)
        if self.where in ("links", "arm"):
            return robot.rod_sites if self.where == "links" else ("arm", *robot.rod_sites)
        return (self.where,)

    def at(self, robot: Robot, site: str, rng: np.random.Generator) -> Cause:
        """One machine's own case of it.

        Raises
        ------
        GtpinError
            If it can't occur at the site.
        """
        if site not in self.sites(robot):
            raise GtpinError(f"{self.name} can't be at {site!r}", hint=f"use {', '.join(self.sites(robot))}")
        return self.draw(Site.of(robot, site), rng)
