"""The base class of all effects."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from gtpin.effects.basis import Basis, side_by_side
from gtpin.effects.sites import number, turns
from gtpin.effects.situation import Situation
from gtpin.effects.untestable import Untestable
from gtpin.robot.robot import Robot

Floats = npt.NDArray[np.float64]


class Range(NamedTuple):
    """The expected range of a parameter: lowest and highest value in its unit, and the reason, a clause that reports quote."""

    low: float
    high: float
    why: str


class ChainWords(NamedTuple):
    """What an effect is called at joints and links of robots without rods; what is empty is as for carts and rods.

    Parameters
    ----------
    clause, plural
        As ``clause`` and ``plural_clause`` of an :class:`Effect`.
    remedy
        As its ``remedy``.
    """

    clause: str = ""
    plural: str = ""
    remedy: str = ""


class Effect(ABC):
    """A cause of deviations that the geometry does not model: a field of displacements, linear in its coefficients.

    A measurement z at commands q is modelled as::

        z = h(X(q, geometry, effects)) + noise

    X are the poses of all bodies of the closed chain, h is what the instrument reads of them. An effect displaces one part of
    the chain, at the pose of row n by::

        u_n = B_n(covariates, nonlinear) c,        c ~ N(0, s^2 diag(sigma^2))

    u_n is what :class:`~gtpin.effects.basis.Basis` can hold: the travel of an actuator, the positions of rods' joints on
    their carriers, the lengths of rods, or the pose as the instrument sees it. :meth:`basis` gives B, the displacements for
    coefficients c of one, and sigma, the typical size of each coefficient. Diagnosis finds the scale s and the coefficients.

    An effect never says how the TCP moves. That follows from the chain: to first order from the Jacobians of its loop
    closures (``Basis.displacement``), for the evidence; exactly by solving the closures again with the displaced parts
    (``gtpin.effects.active.with_effects``), for predictions.

    A subclass sets ``id``, ``title`` and ``coefficient``, and defines :meth:`sites` and :meth:`basis`. Everything else has a
    default. The docstring of the subclass should give the equation, the signs and the parameters: reports show it.

    Examples
    --------
    A cable chain pulls a cart back in proportion to its position and to the payload, u = -(p + r q) payload / 20 kg:

    >>> import numpy as np
    >>> import gtpin
    >>> from gtpin.effects import Effect, Situation, along_track, carts
    >>> class CableChain(Effect):
    ...     id = "cable_chain"
    ...     title = "a cable chain pulls the cart back"
    ...     clause = "a cable chain pulls {site} back"
    ...     remedy = "Guide the chain, or use the corrected model."
    ...     coefficient = ("rate", "m/m")
    ...
    ...     def sites(self, robot):
    ...         return carts(robot)
    ...
    ...     def covariates(self, robot, site):
    ...         return ("payload",)
    ...
    ...     def basis(self, at, site, nonlinear=None):
    ...         q, full = at.q[:, at.robot.sites.index(site)], at.covariate("payload") / 20.0
    ...         B = np.stack([-q * full, -full], axis=1)  # (N, 2): m of travel for r = 1 m/m and p = 1 m
    ...         return along_track(at, site, B, np.array([5e-5, 2e-5]))  # typical sizes of r and p

    A diagnosis tries it with ``gtpin.diagnose(dataset, effects=[*gtpin.catalogue(), CableChain()])``. How far it moves the
    TCP, to first order, for r = 50 um/m and p = 20 um:

    >>> kinematics = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau"))).kinematics
    >>> q = np.array([[0.1, 0.2, 0.0], [-0.3, -0.1, -0.2]])
    >>> at = Situation(kinematics, q, kinematics.forward(q), {"payload": np.array([10.0, 20.0])})
    >>> moved = CableChain().basis(at, "cart2").displacement(at) @ [5e-5, 2e-5]
    >>> (1e6 * np.linalg.norm(moved[:, :3], axis=1)).round(1)
    array([19.5, 19.8])
    """

    id: str
    """Its name in files, on the command line and in reports: ``rack_periodic``."""
    title: str
    """What it is, in a few words."""
    coefficient: tuple[str, str]
    """Name and unit of the first coefficient as a parameter: the only one, unless :meth:`parameters` gives others."""
    clause: str = ""
    """What it does, as a clause, with ``{site}`` for where: ``{site} has backlash``. Left out, it is made from ``title``."""
    plural_clause: ClassVar[str] = ""
    """The same where the site is ``arm``, all links together."""
    remedy: str = "Use the corrected model, or take the effect away at its source."
    """What an engineer can do about it, as a sentence."""
    of_chains: ClassVar[ChainWords] = ChainWords()
    """Words for joints and links of robots without rods, where the others speak of carts, tracks and rods."""
    core: tuple[int, ...] = ()
    """Indices of the columns of B that are its core; the others modulate it (a backlash that varies along
    the track). Where the core's coefficients are much smaller than the scale s, the effect is not named: a modulation alone
    is not this effect. Left out, all columns are the core."""
    plausible: ClassVar[Mapping[str, Range]] = {}
    """By parameter, what physics allows: a cause with a parameter outside by more than three standard deviations is dropped."""
    usual: ClassVar[Mapping[str, Range]] = {}
    """By parameter, the expected range: a cause with a parameter outside is still named, with a warning to check it."""
    most_values: ClassVar[int] = 1
    """How often it may act at one site with another value of its nonlinear parameter each: lines of a gear."""
    between_visits: ClassVar[bool] = False
    """Whether it differs between visits of one pose, and so looks like a lack of repeatability."""
    of_travel: ClassVar[bool] = False
    """Whether its parameters in metres are of an actuator's travel, and so in radians where that turns."""
    stretches_frame: ClassVar[bool] = False
    """Whether it scales all measured positions in proportion; then no smooth nonparametric term does so as well."""
    exported_as: ClassVar[Literal["", "link_spring", "cart_springs", "drive_scale"]] = ""
    """What it becomes in an exported mechanism: a spring along the link, springs under the cart, a scale of the drive."""

    @abstractmethod
    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Where it can act: names of actuators or rods, ``arm`` for all rods together, ``platform`` or ``frame``."""

    @abstractmethod
    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        """Displacements B of N poses for coefficients of one, and the typical sizes sigma of the coefficients.

        A row of B may depend on the row's own pose and covariates and on ``at.references`` alone, so that a pose is predicted
        the same whichever poses are predicted with it.

        Parameters
        ----------
        at
            The N poses: commands, covariates, rods' directions and forces.
        site
            One of :meth:`sites`.
        nonlinear
            The value of its nonlinear parameter (a period, a place), for effects that have one.
        """

    @property
    def has_nonlinear(self) -> bool:
        """Whether the displacement has a nonlinear parameter, such as a period or the place of a step."""
        return type(self).nonlinear_values is not Effect.nonlinear_values

    def covariates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """Covariates without which it can't be tested or applied at a site."""
        return ()

    def nonlinear_values(self, at: Situation, site: str) -> Sequence[float]:
        """Values of its nonlinear parameter to try; none where it has no such parameter."""
        return ()

    def jumps(self, nonlinear: float | None) -> tuple[float, ...]:
        """Commands, m or rad, at which its displacement along a track jumps; tables of corrections have points there."""
        return ()

    def untestable(self, at: Situation, site: str) -> Untestable | str | None:
        """Why these data can't show it, as far as that is clear before it is fitted; None where they may.

        Left out: a covariate of :meth:`covariates` is missing or constant, or :meth:`nonlinear_values` has no values. An effect
        of your own may give its reason as a string, which reports show as it is.
        """
        for name in self.covariates(at.robot, site):
            if not at.has(name):
                return Untestable("missing", name)
            if not at.varies(name):
                return Untestable("constant", name)
        if self.has_nonlinear and not len(self.nonlinear_values(at, site)):
            return Untestable("too_few_commands", f"q{number(at.robot, site)}" if site in at.robot.sites else "")
        return None

    def coordinates(self, robot: Robot, site: str) -> tuple[str, ...]:
        """What its displacements depend on, first what a plot has on its axis: covariates, commands ``q1``, ``q2``, ...,
        ``load`` (the rods' forces), ``direction`` (of a rod) or ``position`` (of the TCP).

        Left out: its covariates, and the command of the actuator at its site.
        """
        own = (f"q{number(robot, site)}",) if site in robot.sites else ()
        return (*self.covariates(robot, site), *own)

    def parameters(self, coefficients: Floats, nonlinear: float | None) -> dict[str, tuple[float, str]]:
        """Physical parameters that the coefficients amount to, by name: value and unit.

        Left out: the first coefficient, as ``coefficient`` names it. Those that are nonlinear come first.
        """
        name, unit = self.coefficient
        return {name: (float(coefficients[0]), unit)}

    def parameters_at(
        self, robot: Robot, site: str, coefficients: Floats, nonlinear: float | None
    ) -> dict[str, tuple[float, str]]:
        """The same at a site, in its units."""
        found = self.parameters(coefficients, nonlinear)
        if not (self.of_travel and turns(robot, site)):
            return found
        return {name: (value, TURNING.get(unit, unit)) for name, (value, unit) in found.items()}

    def basis_of(self, at: Situation, site: str, values: Sequence[float]) -> Basis:
        """Displacements for several values of the nonlinear parameter, side by side; without values, :meth:`basis` itself."""
        if len(values) < 2:
            return self.basis(at, site, *values)
        return side_by_side([self.basis(at, site, value) for value in values])

    def parameters_of(
        self, robot: Robot, site: str, coefficients: Floats, values: Sequence[float]
    ) -> dict[str, tuple[float, str]]:
        """Physical parameters for several values: those of the second value are called ``NAME_2``, and so on."""
        if len(values) < 2:
            return self.parameters_at(robot, site, coefficients, values[0] if len(values) else None)
        found: dict[str, tuple[float, str]] = {}
        for i, (part, value) in enumerate(zip(np.split(coefficients, len(values)), values, strict=True)):
            own = self.parameters_at(robot, site, part, value)
            found |= {f"{name}_{i + 1}" if i else name: parameter for name, parameter in own.items()}
        return found


TURNING = {"m": "rad", "m/m": "rad/rad"}
"""Units of travel of an actuator that turns."""


def unit(values: Sequence[float] | Floats, size: float) -> Floats:
    """Sizes of coefficients, in the effect's unit."""
    return np.asarray(values, dtype=float) * size
