"""Values of the named parameters of a robot's geometry."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np

from gtpin.errors import ModelError
from gtpin.robot.chain import Chain
from gtpin.robot.parameters import Kind, Parameter, all_tolerances, placement_parameters, rod_parameters
from gtpin.typing import Floats, Mask


@dataclass(frozen=True, repr=False)
class Geometry:
    """Values of a robot's geometric parameters.

    Parameters
    ----------
    robot
        The robot that has this geometry. Its URDF gives the nominal values.
    parameters
        The parameters that a calibration can identify. All others keep their nominal values.
    values
        (p,) their values, m, rad or m/m, in the order of ``parameters``.

    Examples
    --------
    >>> import gtpin
    >>> geometry = gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau"))
    >>> len(geometry.names)
    48
    >>> longer = geometry.with_values(geometry.values + 1e-4)
    >>> print(f"{longer['length[2a]'] - geometry['length[2a]']:.4f} m")
    0.0001 m
    """

    robot: Chain
    parameters: tuple[Parameter, ...]
    values: Floats

    def __post_init__(self) -> None:
        frozen = np.array(self.values, dtype=float)
        frozen.flags.writeable = False
        object.__setattr__(self, "values", frozen)

    def with_tolerances(self, factors: Floats) -> Self:
        """The same geometry with its tolerances multiplied by factors (p,)."""
        parameters = tuple(replace(p, tolerance=p.tolerance * f) for p, f in zip(self.parameters, factors, strict=True))
        return replace(self, parameters=parameters)

    def __repr__(self) -> str:
        return f"Geometry of {self.robot.name}: {len(self.parameters)} parameters"

    @staticmethod
    def nominal(
        robot: Chain,
        *,
        scale: Literal["actuator"] | None = None,
        tolerance: Mapping[str, float] | None = None,
        without: Iterable[str] = (),
    ) -> Geometry:
        """The nominal geometry, with the parameters that a calibration shall identify.

        Parameters
        ----------
        robot
            The robot.
        scale
            Which drive scales (travel per commanded unit) are parameters: one per ``actuator``, or (None) only those of
            actuators with ``scale="unknown"`` in the URDF.
        tolerance
            1-sigma tolerances, m, rad or m/m, by kind of parameter (as in the URDF's ``<tolerance>``). They override the
            robot's.
        without
            Names, or beginnings of names (``track_direction``, ``length[2a]``), of parameters that keep their nominal values.

        Raises
        ------
        ModelError
            If an option has another value, or a kind of tolerance or a name in ``without`` is not known.
        """
        if scale not in (None, "actuator"):
            raise ModelError(f"scale={scale!r}", hint="use None or actuator")
        tolerances = all_tolerances(robot, tolerance or {})
        if robot.rods:
            parameters = rod_parameters(robot, tolerances, scale=scale is not None)
        else:
            parameters = placement_parameters(robot, tolerances)
        kept = without_names(parameters, without)
        return Geometry(robot, kept, np.array([p.nominal for p in kept]))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the p parameters."""
        return tuple(p.name for p in self.parameters)

    @property
    def tolerance(self) -> Floats:
        """(p,) 1-sigma tolerances of the parameters, m, rad or m/m."""
        return np.array([p.tolerance for p in self.parameters])

    @property
    def deviation(self) -> Floats:
        """(p,) values less nominal values, m, rad or m/m."""
        return np.asarray(self.values - np.array([p.nominal for p in self.parameters]))

    @property
    def positions_only(self) -> bool:
        """Whether the geometry describes the TCP's position alone, so that measured orientations are left out."""
        return False

    def outside(self, q: Floats) -> Mask:
        """(N,) True for commands q (N, n) at which the geometry is not known."""
        return np.zeros(len(q), dtype=bool)

    def with_values(self, values: Floats) -> Self:
        """A geometry with the same parameters and other values (p,), m, rad or m/m."""
        return replace(self, values=values)

    def deviations(
        self, kind: Kind, per: Literal["actuator", "rod", "joint", "anchor"], shape: tuple[int, int]
    ) -> Floats:
        """A table (of ``shape``) of the deviations from nominal of one kind of parameter, m, rad or m/m.

        Row: index of the actuator, rod, Pinocchio joint or loop's anchor, as ``per`` says; column: component of the vector.
        Zero where there is no such parameter.
        """
        table = np.zeros(shape)
        for parameter, deviation in zip(self.parameters, self.deviation, strict=True):
            if parameter.kind == kind and parameter.per == per:
                table[parameter.owner, parameter.component] = deviation
        return table

    @property
    def platform(self) -> Floats:
        """(6,) twist, m and rad, by which the TCP is displaced on the body that carries it.

        These parameters exist where the place of the target is unknown (``target = "free"``); without them it is zero.
        """
        twist = np.zeros(6)
        for parameter, value in zip(self.parameters, self.values, strict=True):
            if parameter.kind == "platform":
                twist[parameter.component] = value
        return twist

    @property
    def scale(self) -> Floats:
        """(n,) travel of each actuator per commanded unit."""
        return 1.0 + self.deviations("scale", "actuator", (self.robot.n_actuators, 1))[:, 0]

    @property
    def anchors(self) -> Floats:
        """(2 L, 3) displacement, m, of the two anchors of each of L loops, in the frames of the anchors' links.

        Zero for a robot with rods, whose parameters are the lengths and joints of the rods.
        """
        leading = list(self.robot.leading_anchors)
        return self.deviations("anchor", "anchor", (len(leading), 3))[leading]

    def __getitem__(self, name: str) -> float:
        """One parameter's value, m, rad or m/m, by its name; `ModelError` where no parameter has this name."""
        if name not in self.names:
            raise ModelError(f"no parameter is called {name!r}", hint=f"names look like {self.names[0]}")
        return float(self.values[self.names.index(name)])


def without_names(parameters: Sequence[Parameter], without: Iterable[str]) -> tuple[Parameter, ...]:
    """The parameters less those whose names begin with one of ``without``; `ModelError` where none begins with it."""
    for start in (without,) if isinstance(without, str) else without:
        kept = [p for p in parameters if not p.name.startswith(start)]
        if len(kept) == len(parameters):
            raise ModelError(f"no parameter is called {start!r}", hint=f"names look like {parameters[0].name}")
        parameters = kept
    return tuple(parameters)
