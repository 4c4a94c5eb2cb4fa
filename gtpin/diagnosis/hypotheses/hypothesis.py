"""What may explain a gap: effects of the catalogue at their sites, and free motions that belong to no effect."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from gtpin.effects.basis import Basis
from gtpin.effects.effect import Effect
from gtpin.robot.robot import Robot

CLOCK = ("time", "session", "temp_frame", "temp_link")
"""Coordinates that go by the clock: any of them may pass for another."""
LOAD = ("load", "payload", "fx", "fy", "fz")
"""Coordinates that go with forces."""


class Explanation(Protocol):
    """Something that may explain a gap."""

    @property
    def name(self) -> str:
        """Of its group."""

    @property
    def site(self) -> str:
        """Where it acts."""

    def drivers(self, robot: Robot) -> frozenset[str]:
        """What it goes with first of all, in the words of covariates and commands."""


@dataclass(frozen=True)
class Candidate:
    """An effect at a site, with the setting of what is not linear in it, and the setting's sigma."""

    effect: Effect
    site: str
    setting: float | None = None
    setting_sigma: float = 0.0

    @property
    def name(self) -> str:
        """``effect@site``."""
        return f"{self.effect.id}@{self.site}"

    def coordinates(self, robot: Robot) -> frozenset[str]:
        """What it goes with, in the words of covariates and commands."""
        return frozenset(self.effect.coordinates(robot, self.site))

    def drivers(self, robot: Robot) -> frozenset[str]:
        """Its covariates, where it needs any; else its coordinates."""
        return frozenset(self.effect.covariates(robot, self.site)) or self.coordinates(robot)


@dataclass(frozen=True)
class Free:
    """A smooth motion at a site over some coordinates, which no effect has to account for.

    Parameters
    ----------
    motion
        Which way it goes: ``along``, ``across``, ``length``, ``twist``.
    """

    site: str
    over: tuple[str, ...]
    motion: str

    @property
    def name(self) -> str:
        """Unlike every effect's."""
        return f"{self.site}|{self.words}|{self.motion}"

    @property
    def words(self) -> str:
        """Its coordinates, as reports name them."""
        return ",".join(self.over)

    def drivers(self, robot: Robot) -> frozenset[str]:
        """Its coordinates."""
        return frozenset(self.over)


def related(robot: Robot, a: Explanation, b: Explanation) -> bool:
    """Whether a departure of one from its form could pass for the other.

    At the same place, where both go with commands and load, or with moves, or by the clock; elsewhere, where both go by the
    same clock or load.
    """
    mine, others = a.drivers(robot), b.drivers(robot)
    if same_place(robot, a, b):
        return bool({_kind(word) for word in mine} & {_kind(word) for word in others})
    return any(mine & set(kind) and others & set(kind) for kind in (CLOCK, LOAD))


def same_place(robot: Robot, a: Explanation, b: Explanation) -> bool:
    """Whether two act at one site, or one at a part of the other's."""
    return a.site == b.site or b.site in _within(robot, a.site) or a.site in _within(robot, b.site)


def _kind(word: str) -> str:
    """Of a coordinate: what is known of one tells of others of its kind."""
    if word in CLOCK:
        return "clock"
    return "moves" if word.startswith(("approach", "speed")) else "place"


def same_motion(robot: Robot, free: Free, candidate: Candidate, basis: Basis) -> bool:
    """Whether a free motion only says that a cause bends: at its site, the same way, over its own coordinates.

    Parameters
    ----------
    basis
        The cause's.
    """
    ways = {
        "along": basis.command,
        "aside": basis.carrier_joints,
        "length": basis.length,
        "twist": basis.twist,
        "shift": basis.twist,
    }
    same_way = ways.get(free.motion) is not None
    return same_way and free.site == candidate.site and set(free.over) <= candidate.coordinates(robot)


def _within(robot: Robot, site: str) -> tuple[str, ...]:
    """Sites that are part of another: a cart's or the arm's links."""
    if site == "arm":
        return robot.rod_sites
    if site in robot.sites:
        actuator = robot.sites.index(site)
        return tuple(rod.site for rod in robot.rods if actuator in (rod.carrier, rod.extension))
    return ()
