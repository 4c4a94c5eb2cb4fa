"""What a cause of error is to the plant: a name, its sites, and how one machine's own case of it is drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from gtpin.errors import GtpinError
from gtpin.plant.arms.robot import Arm
from gtpin.plant.looped.robot import LoopedArm
from gtpin.robot.robot import Robot

Cause = Callable[[Any], Any]
"""One machine's own error at its typical size: the deviation of that machine in a situation of its."""
Where = Literal["carts", "guides", "turning", "joints", "coupled", "links", "arm", "pins", "frame", "platform"]


@dataclass(frozen=True)
class Site:
    """A place in the machine: its name, the cart or commanded joint where it is one, the rods or links that belong to it,
    and the joint that follows where it is one.
    """

    name: str
    cart: int
    rods: tuple[int, ...]
    pin: int = -1

    @staticmethod
    def of(robot: Robot | Arm, name: str) -> Site:
        """The site of a name; links of an arm are counted by the joints that move them."""
        if isinstance(robot, Arm):
            if name in robot.sites:
                return Site(name, robot.sites.index(name), ())
            if name in robot.link_sites:
                return Site(name, -1, (robot.link_sites.index(name),))
            if isinstance(robot, LoopedArm) and name in robot.pin_sites:
                return Site(name, -1, (), robot.pins[robot.pin_sites.index(name)])
            return Site(name, -1, tuple(range(robot.n_actuators)))
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
        ``turning`` the same where any of them carries more than one joint; ``joints`` are those of an arm, ``coupled`` the
        same where there are several; ``arm`` means all links at once, or one of them; ``pins`` are joints that follow because
        loops close.
    draw
        Draws one machine's own case of it, at its typical size.
    needs
        What must vary for it to show: ``session``, ``speed``, ``payload``, ``force``, ``heat``.
    largest
        Times its typical size, beyond which no machine errs however little it shows.
    periodic
        Whether ``draw`` also takes the periods a turn of its lines.
    """

    name: str
    where: Where
    draw: Callable[..., Cause]
    needs: tuple[str, ...] = ()
    largest: float = 20.0
    periodic: bool = False

    def sites(self, robot: Robot | Arm) -> tuple[str, ...]:
        """Names of the sites at which it can occur; none where the robot has no such."""
        if isinstance(robot, Arm):
            return self._on_arm(robot)
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

    def _on_arm(self, robot: Arm) -> tuple[str, ...]:
        """Only what moves the TCP."""
        if self.where == "pins":
            return robot.pin_sites if isinstance(robot, LoopedArm) else ()
        if self.where in ("joints", "coupled"):
            return (
                tuple(robot.sites[c] for c in robot.acting) if self.where == "joints" or len(robot.acting) > 1 else ()
            )
        if self.where in ("links", "arm"):
            links = tuple(robot.link_sites[c] for c in robot.linked)
            return links if self.where == "links" else ("arm", *links) if links else ()
        return (self.where,)

    def at(self, robot: Robot | Arm, site: str, rng: np.random.Generator, periods: tuple[float, ...] = ()) -> Cause:
        """One machine's own case of it.

        Raises
        ------
        GtpinError
            If it can't occur at the site, or periods are given for what has none.
        """
        if site not in self.sites(robot):
            raise GtpinError(f"{self.name} can't be at {site!r}", hint=f"use {', '.join(self.sites(robot))}")
        if not periods:
            return self.draw(Site.of(robot, site), rng)
        if not self.periodic:
            raise GtpinError(f"{self.name} has no periods that can be given", hint="leave them out")
        return self.draw(Site.of(robot, site), rng, periods)
