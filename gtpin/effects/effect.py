"""The base class of all effects."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from gtpin.effects.displacement import Displacement, side_by_side
from gtpin.effects.operating_points import OperatingPoints, References
from gtpin.effects.sites import actuators, number, turns
from gtpin.effects.untestable import Untestable
from gtpin.errors import warn
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

Nature = Literal["mechanism", "profile", "description"]
"""What an effect says about a machine: a mechanism with few parameters and a physical size; a profile, the own error of a
drive, a track or a ball over its own travel or direction; or a description, a family that fits any smooth function of several
coordinates or motions."""


Parameters = dict[str, tuple[float, str]]
"""Physical parameters by name: value and unit."""


class ParameterRange(NamedTuple):
    """A range of a parameter: lowest and highest value in the parameter's unit, and ``why``, a clause that reports quote."""

    low: float
    high: float
    why: str


class ChainWords(NamedTuple):
    """Texts of an effect at joints and links of robots without rods. Where a text is empty, the effect's own text is used.

    ``clause``, ``plural``: used in place of ``clause`` and ``plural_clause`` of the :class:`Effect`. ``remedy``: used in
    place of its ``remedy``.
    """

    clause: str = ""
    plural: str = ""
    remedy: str = ""


class Effect(ABC):
    """A cause of deviations that the geometry does not model. Its displacements are linear in its coefficients.

    A measurement z at commands q is modelled as::

        z = h(X(q, geometry, effects)) + noise

    X are the poses of all bodies of the closed chain. h is the measurement function: what the instrument measures of X. An
    effect displaces one part of the chain. At the pose of row n the displacement is::

        u_n = B_n(covariates, nonlinear) c,        c ~ N(0, s^2 diag(sigma^2))

    u_n is one of the quantities of :class:`~gtpin.effects.displacement.Displacement`: the travel of an actuator, the
    positions of the rods' joints on their carriers, the lengths of rods, the placement frames of joints, or the measured
    pose. :meth:`basis` returns B, the displacements for unit coefficients c, and sigma, the typical size of each
    coefficient. The diagnosis estimates the scale s and the coefficients.

    An effect does not define the motion of the TCP. The chain determines it. The evidence uses the first-order motion, from
    the Jacobians of the loop closures (``Displacement.displacement``). Predictions use the exact motion: the closures are
    solved again with the displaced parts (``gtpin.effects.active.with_effects``).

    A subclass sets ``id``, ``title`` and ``coefficient``, and defines :meth:`basis`. Everything else has a default; without
    :meth:`sites` it acts at each actuator. The docstring of the subclass should give the equation, the signs and the
    parameters: reports show it.

    Examples
    --------
    A cable chain pulls a cart back by an amount that is linear in its command q and proportional to the payload:
    u = -(p + r q) payload / 20 kg, with the parameters p, m, and r, m/m:

    >>> import numpy as np
    >>> import gtpin
    >>> from gtpin.effects import Effect, OperatingPoints, along_track, actuators
    >>> class CableChain(Effect):
    ...     id = "cable_chain"
    ...     title = "pull of a cable chain"
    ...     clause = "a cable chain pulls {site} back"
    ...     remedy = "Guide the chain, or use the corrected model."
    ...     coefficient = ("rate", "m/m")
    ...
    ...     def sites(self, robot):
    ...         return actuators(robot)
    ...
    ...     def covariates(self, robot, site):
    ...         return ("payload",)
    ...
    ...     def basis(self, at, site, shape_parameter=None):
    ...         q, full = at.q[:, at.robot.sites.index(site)], at.covariate("payload") / 20.0
    ...         B = np.stack([-q * full, -full], axis=1)  # (N, 2): m of travel for r = 1 m/m and p = 1 m
    ...         return along_track(at, site, B, np.array([5e-5, 2e-5]))  # typical sizes of r and p

    A diagnosis with this effect: ``gtpin.diagnose(dataset, effects=[*gtpin.catalogue(), CableChain()])``. The first-order
    displacement of the TCP, um, for r = 50 um/m and p = 20 um:

    >>> kinematics = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau"))).kinematics
    >>> q = np.array([[0.1, 0.2, 0.0], [-0.3, -0.1, -0.2]])
    >>> at = OperatingPoints(kinematics, q, kinematics.forward(q), {"payload": np.array([10.0, 20.0])})
    >>> moved = CableChain().basis(at, "cart2").displacement(at) @ [5e-5, 2e-5]
    >>> (1e6 * np.linalg.norm(moved[:, :3], axis=1)).round(1)
    array([19.5, 19.8])
    """

    id: str
    """Its name in files and on the command line: ``rack_periodic``."""
    title: str
    """Its name in reports, without its site: ``periodic drive error``."""
    coefficient: tuple[str, str]
    """Name and unit of the first coefficient as a parameter: the only one, unless :meth:`parameters` gives others."""
    nature: ClassVar[Nature] = "mechanism"
    """Its nature. A description is a cause only where one of its :meth:`forms` explains as much."""
    clause: str = ""
    """What it does, as a clause in which ``{site}`` stands for the site: ``{site} has backlash``. If empty, it is made
    from ``title``."""
    first_checked: ClassVar[bool] = False
    """Whether a health check looks for it first, because crashes and wear cause it: the poses of a check are chosen for it, and
    reports name the smallest change of it that they show. True for shifted zeros and backlash (assumed)."""
    plural_clause: ClassVar[str] = ""
    """The clause that reports use where the site is ``arm``, all links together; if empty, ``clause``."""
    remedy: str = "Use the corrected model, or take the effect away at its source."
    """What an engineer can do against it, as a sentence."""
    of_chains: ClassVar[ChainWords] = ChainWords()
    """Texts for robots without rods, where ``clause``, ``plural_clause`` and ``remedy`` speak of carts, tracks and rods."""
    core: tuple[int, ...] = ()
    """Indices of the columns of B that are its core. The other columns are its modulation (a backlash that varies along the
    track). Where the core's coefficients are much smaller than the scale s, the effect is not named: a modulation alone is not
    this effect. If empty, all columns are the core. Indices that a site's columns do not reach are not there."""
    plausible: ClassVar[Mapping[str, ParameterRange]] = {}
    """By parameter, the range that physics allows. A cause with a parameter outside its range by more than three standard
    deviations is dropped."""
    expected_range: ClassVar[Mapping[str, ParameterRange]] = {}
    """By parameter, the expected range. A cause with a parameter outside its range is still named, with a warning to check
    it."""
    most_values: ClassVar[int] = 1
    """Largest number of values of the nonlinear parameter that the effect can have at one site: several periods of a gear."""
    between_visits: ClassVar[bool] = False
    """Whether the displacement differs between visits of one pose. The effect then looks like a lack of repeatability."""
    since_a_model: ClassVar[bool] = False
    """Whether a health check tests it also without its covariates, as a change since the earlier model that is the same at all
    poses."""
    of_travel: ClassVar[bool] = False
    """Whether the parameters in metres are of an actuator's travel. They are in radians where the actuator turns."""
    of_own_command: ClassVar[bool] = False
    """Whether its displacement is a curve: a deviation of an actuator's travel that depends on its own command alone."""
    load: ClassVar[str] = ""
    """The load at its site under which what is there gives way. Mechanisms of one load at one site can share it: a base that
    rocks, and the column on it that bends. Empty where nothing gives way under a load."""
    alike: ClassVar[bool] = False
    """Whether all actuators of a machine often have it alike. Together they can then look like an effect of the frame."""
    stretches_frame: ClassVar[bool] = False
    """Whether it scales all measured positions by one factor. If so, the smooth nonparametric terms contain no such scaling."""
    exported_as: ClassVar[
        Literal["", "link_spring", "cart_springs", "drive_scale", "joint_spring", "bearing_springs"]
    ] = ""
    """What represents it in an exported mechanism: a spring of the link, springs under the cart, a scale of the drive, a spring
    of the joint, or springs of its bearing. Empty: none of these. Effects along an actuator that depend only on its position,
    direction of approach and session need no name here."""

    acts_at: ClassVar[staticmethod[[Chain], tuple[str, ...]]] = staticmethod(actuators)
    """The sites of a robot at which it can act, where they are those of a function of :mod:`gtpin.effects.sites`."""
    needs: tuple[str, ...] = ()
    """The covariates that it needs at each site."""
    uses: tuple[str, ...] = ()
    """The covariates that it uses where its fit had them, and does not need: a drift of a coefficient with ``time``."""
    depends_on: tuple[str, ...] = ()
    """The names that :meth:`coordinates` gives, where they are the same at each site and not the usual ones."""

    def __init_subclass__(cls) -> None:
        if "usual" in vars(cls):
            warn("usual is now called expected_range; the old name goes with version 0.4", DeprecationWarning)
            cls.expected_range = vars(cls)["usual"]

    def sites(self, robot: Chain) -> tuple[str, ...]:
        """Sites at which it can act: names of actuators or rods, ``arm`` for all rods together, ``platform`` or ``frame``.

        By default: those of ``acts_at``, which are all actuators.
        """
        return self.acts_at(robot)

    @abstractmethod
    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        """Displacements B at N poses for unit coefficients, and the typical sizes sigma of the coefficients.

        A row of B may depend only on the row's own pose and covariates and on ``at.references``. The prediction of a pose then
        does not depend on the other poses of the same call.

        Parameters
        ----------
        at
            The N poses, with their commands, covariates, and directions and forces of the rods.
        site
            One of :meth:`sites`.
        shape_parameter
            The value of the nonlinear parameter (a period, the place of a step), for effects that have one.
        """

    def bases(self, at: OperatingPoints, site: str, values: Sequence[float] | Floats) -> list[Displacement]:
        """:meth:`basis` for each of some values of the nonlinear parameter, as a scan needs them.

        An effect whose displacements NumPy computes for all values at once overrides it.
        """
        return [self.basis(at, site, float(value)) for value in values]

    @property
    def has_nonlinear(self) -> bool:
        """Whether the displacement has a nonlinear parameter, such as a period or the place of a step."""
        return type(self).nonlinear_values is not Effect.nonlinear_values

    def covariates(self, robot: Chain, site: str) -> tuple[str, ...]:
        """Covariates that the effect needs at a site; without them it can't be tested or applied there. Default: ``needs``."""
        return self.needs

    def nonlinear_values(self, at: OperatingPoints, site: str) -> Sequence[float]:
        """Values of the nonlinear parameter to try; empty where the effect has no such parameter."""
        return ()

    def resolved(
        self, at: OperatingPoints, site: str, values: Floats, others: Sequence[float]
    ) -> npt.NDArray[np.bool_]:
        """(S,) whether these poses distinguish a value of the nonlinear parameter from a smooth function and from other values.

        ``others`` are values of the same cause that are in a model already. By default all values are distinguished.
        """
        return np.ones(len(values), dtype=bool)

    def ends(self, robot: Chain, site: str, references: References, value: float, sigma: float) -> tuple[float, float]:
        """Values of the nonlinear parameter one standard deviation below and above one with the sigma of a scan."""
        return value - sigma, value + sigma

    def nature_of(self, lines: Sequence[tuple[float, float]]) -> Nature:
        """Its nature with some values of the nonlinear parameter, each with its standard deviation."""
        return self.nature

    def forms(self, robot: Chain, site: str) -> Sequence[Sequence[int]]:
        """Of a description: the columns of B of each form that a mechanism with few parameters has."""
        return ()

    def jumps(self, shape_parameter: float | None) -> tuple[float, ...]:
        """Commands, m or rad, at which the displacement along a track is discontinuous; correction tables have points there."""
        return ()

    def untestable(self, at: OperatingPoints, site: str) -> Untestable | str | None:
        """The reason why these data can't show the effect, if it is known before a fit; otherwise None.

        By default the reasons are: a covariate of :meth:`covariates` is missing, unusable or constant, or
        :meth:`nonlinear_values` is empty. An effect of your own may return its reason as a string. Reports show this string
        unchanged.
        """
        for name in self.covariates(at.robot, site):
            if not at.has(name):
                return Untestable("unusable" if name in at.unusable else "missing", name)
            if not at.varies(name):
                return Untestable("constant", name)
        if self.has_nonlinear and not len(self.nonlinear_values(at, site)):
            return Untestable("too_few_commands", f"q{number(at.robot, site)}" if site in at.robot.sites else "")
        return None

    def coordinates(self, robot: Chain, site: str) -> tuple[str, ...]:
        """Names of the quantities on which the displacements depend. The first is the horizontal axis of a plot.

        They are covariates, commands ``q1``, ``q2``, ..., ``load`` (the rods' forces), ``direction`` (of a rod) or
        ``position`` (of the TCP). By default ``depends_on``, or its covariates and the command of the actuator at its site.
        """
        if self.depends_on:
            return self.depends_on
        own = (f"q{number(robot, site)}",) if site in robot.sites else ()
        return (*self.covariates(robot, site), *own)

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        """Physical parameters computed from the coefficients, by name: value and unit. Nonlinear parameters come first.

        By default there is one parameter: the first coefficient, with the name and unit in ``coefficient``.
        """
        name, unit = self.coefficient
        return {name: (float(coefficients[0]), unit)}

    def parameters_at(self, robot: Chain, site: str, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        """The physical parameters at a site, in the units of that site: m where its actuator slides, rad where it turns."""
        found = self.parameters(coefficients, shape_parameter)
        if not (self.of_travel and turns(robot, site)):
            return found
        return {name: (value, TURNING.get(unit, unit)) for name, (value, unit) in found.items()}

    def as_change(self) -> Effect:
        """The effect as a change since an earlier model, whose frame and geometry are known."""
        return self

    def as_stored(self, coefficients: int) -> Effect:
        """The effect of a stored model with so many coefficients: an earlier release may have had fewer."""
        return self

    def basis_of(self, at: OperatingPoints, site: str, values: Sequence[float]) -> Displacement:
        """Displacements for several values of the nonlinear parameter: the columns of :meth:`basis` for each, side by side."""
        if len(values) < 2:
            return self.basis(at, site, *values)
        return side_by_side([self.basis(at, site, value) for value in values])

    def parameters_of(self, robot: Chain, site: str, coefficients: Floats, values: Sequence[float]) -> Parameters:
        """Physical parameters for several values of the nonlinear parameter; for the second value ``NAME_2``, and so on."""
        if len(values) < 2:
            return self.parameters_at(robot, site, coefficients, values[0] if len(values) else None)
        found: Parameters = {}
        for i, (part, value) in enumerate(zip(np.split(coefficients, len(values)), values, strict=True)):
            own = self.parameters_at(robot, site, part, value)
            found |= {f"{name}_{i + 1}" if i else name: parameter for name, parameter in own.items()}
        return found


TURNING = {"m": "rad", "m/m": "rad/rad", "m/K": "rad/K"}
"""Units of travel of an actuator that slides, and the units that replace them where it turns."""


def unit(values: Sequence[float] | Floats, size: float) -> Floats:
    """Sizes of coefficients: relative values times one size, in the unit of that size."""
    return np.asarray(values, dtype=float) * size
