"""What every effect says of itself."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from gtpin.effects.basis import Basis
from gtpin.effects.situation import Situation
from gtpin.effects.untestable import Untestable
from gtpin.robot.robot import Robot

Floats = npt.NDArray[np.float64]


class Range(NamedTuple):
    """What a parameter is between, and why."""

    low: float
    high: float
    why: str


class Effect(ABC):
    """A cause of the gap between a geometry and a machine.

    A subclass names itself, its sites and covariates, and gives its displacements for unit coefficients; everything else
    follows: its signature, its evidence, its exact application in the closed-chain solve.
    """

    id: ClassVar[str]
    """As in reports: ``rack_periodic``."""
    title: ClassVar[str]
    """What it is, in a few words."""
    clause: ClassVar[str] = ""
    """What it does, as a clause, with ``{site}`` for where: ``{site} has backlash``. Left out, it is made from ``title``."""
    plural_clause: ClassVar[str] = ""
    """The same where the site is ``arm``, all links together."""
    remedy: ClassVar[str] = "Use the corrected model, or take the effect away at its source."
    """What an engineer can do about it, as a sentence."""
    between_visits: ClassVar[bool] = False
    """Whether it differs between visits of one pose, and so looks like a lack of repeatability."""
    exported_as: ClassVar[Literal["", "link_spring", "cart_springs", "drive_scale"]] = ""
    """What it becomes in an exported mechanism: a spring along the link, springs under the cart, a scale of the drive."""
    coefficient: ClassVar[tuple[str, str]]
    """Name and unit of what the first coefficient means."""
    form: ClassVar[tuple[int, ...]] = ()
    """Which of its columns are its textbook form, where the others only bend it: bends are believed no larger than the form's
    own coefficients allow. Left out, all are."""
    plausible: ClassVar[Mapping[str, Range]] = {}
    """By parameter, what physics allows: a cause outside it by more than its uncertainty is not believed."""
    usual: ClassVar[Mapping[str, Range]] = {}
    """By parameter, what machines have: a cause outside it is believed, and the user is asked about it."""

    @abstractmethod
    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Where it can act on a robot."""

    @abstractmethod
    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """Displacements for unit coefficients.

        Parameters
        ----------
        setting
            The value of what is not linear in it (a period, a place), for effects that have such.
        """

    @property
    def has_setting(self) -> bool:
        """Whether something in it is not linear: a period, a place."""
        return type(self).settings is not Effect.settings

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """Covariates that it needs at a site."""
        return ()

    def settings(self, at: Situation, site: str) -> Sequence[float]:
        """Values to try of what is not linear in it; none where everything is."""
        return ()

    def jumps(self, setting: float | None) -> tuple[float, ...]:
        """Commands, m or rad, at which its displacement along a track jumps; tables of corrections have points there."""
        return ()

    def untestable(self, at: Situation, site: str) -> Untestable | str | None:
        """Why these data can't show it, before it is tried; None where they may. Words of one's own are a reason too."""
        for name in self.covariates(at.robot, site):
            if not at.has(name):
                return Untestable("missing", name)
            if not at.varies(name):
                return Untestable("constant", name)
        if self.has_setting and not len(self.settings(at, site)):
            return Untestable("too_few_commands", f"q{number(at.robot, site)}" if site in at.robot.sites else "")
        return None

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """What it goes with, in the words of covariates and commands: its covariates, and a cart's own command."""
        own = (f"q{number(robot, site)}",) if site in robot.sites else ()
        return (*self.covariates(robot, site), *own)

    def parameters(self, coefficients: Floats, setting: float | None) -> dict[str, tuple[float, str]]:
        """What the coefficients say, by name: value and unit."""
        name, unit = self.coefficient
        return {name: (float(coefficients[0]), unit)}


def carts(robot: Robot) -> tuple[str, ...]:
    """Sites of the actuators."""
    return robot.sites


def sliding_carts(robot: Robot) -> tuple[str, ...]:
    """Sites of the actuators that slide a carrier along a track."""
    carried = {rod.carrier for rod in robot.rods if rod.carrier is not None}
    return tuple(s for i, s in enumerate(robot.sites) if i in carried and not robot.actuators[i].revolute)


def links(robot: Robot) -> tuple[str, ...]:
    """Sites of the rods."""
    return robot.rod_sites


def arm_and_links(robot: Robot) -> tuple[str, ...]:
    """All rods together, and each."""
    return ("arm", *robot.rod_sites)


def number(robot: Robot, site: str) -> int:
    """Number of an actuator, as covariates count them: 1, 2, ..."""
    return robot.sites.index(site) + 1


def unit(values: Sequence[float] | Floats, size: float) -> Floats:
    """Sizes of coefficients, in the effect's unit."""
    return np.asarray(values, dtype=float) * size
