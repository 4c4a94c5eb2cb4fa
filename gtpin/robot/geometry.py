"""Values of the named parameters of a robot's geometry."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cached_property
from typing import Literal, Self

import numpy as np

from gtpin.errors import ModelError
from gtpin.real import real
from gtpin.robot.chain import Chain
from gtpin.robot.parameters import FREE, Parameter, all_tolerances, placement_parameters, rod_parameters
from gtpin.typing import Floats, Mask

ASKED_FOR = {"zero": "zeros=True (--zeros)", "scale": 'scale="actuator", or with scale="unknown" in the URDF'}
"""Kinds of parameters that a geometry has only where they are asked for, and how."""
UNITS = 100.0
"""Times a parameter's nominal value, or times 1 m, 1 rad or 1 m/m, from which a value is one in another unit. Assumed."""


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
    held
        Parameters that a calibration does not identify, each with the value that it has.

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
    held: tuple[tuple[Parameter, float], ...] = ()

    def __post_init__(self) -> None:
        frozen = np.array(self.values, dtype=float)
        frozen.flags.writeable = False
        object.__setattr__(self, "values", frozen)

    def with_tolerances(self, factors: Floats) -> Self:
        """The same geometry with its tolerances multiplied by factors (p,)."""
        wider = zip(self.parameters, factors.tolist(), strict=True)
        parameters = (replace(p, tolerance=p.tolerance * f, widened=p.widened * f) for p, f in wider)
        return replace(self, parameters=tuple(parameters))

    def __repr__(self) -> str:
        return f"Geometry of {self.robot.name}: {len(self.parameters)} parameters"

    @staticmethod
    def nominal(
        robot: Chain,
        *,
        scale: Literal["actuator"] | None = None,
        tolerance: Mapping[str, float] | None = None,
        without: Iterable[str] = (),
        zeros: bool = False,
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
        zeros
            Whether the zeros of the commanded joints are parameters, ``zero[JOINT]``; of a robot without rods each is in the
            place of the rotation (of a sliding joint: shift) about its axis.

        Raises
        ------
        ModelError
            If an option has another value, or a kind of tolerance or a name in ``without`` is not known.
        """
        if scale not in (None, "actuator"):
            raise ModelError(f"scale={scale!r}", hint="use None or actuator")
        tolerances = all_tolerances(robot, tolerance or {})
        if robot.rods:
            parameters = rod_parameters(robot, tolerances, scale=scale is not None, zeros=zeros)
        else:
            parameters = placement_parameters(robot, tolerances, zeros=zeros)
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
    def declared_tolerance(self) -> Floats:
        """(p,) the tolerances before a calibration widened those that its data contradict, m, rad or m/m."""
        return np.array([p.tolerance / p.widened for p in self.parameters])

    @property
    def is_widened(self) -> bool:
        """Whether a calibration widened tolerances."""
        return any(p.widened > 1.0 for p in self.parameters)

    @property
    def deviation(self) -> Floats:
        """(p,) values less nominal values, m, rad or m/m."""
        return np.asarray(self.values - np.array([p.nominal for p in self.parameters]))

    @property
    def all_deviations(self) -> tuple[tuple[Parameter, float], ...]:
        """All parameters, also those that are held, each with its deviation from nominal, m, rad or m/m."""
        own = zip(self.parameters, self.deviation.tolist(), strict=True)
        return (*own, *((p, value - p.nominal) for p, value in self.held))

    @property
    def is_nominal(self) -> bool:
        """Whether no parameter deviates from nominal."""
        return not any(deviation for _, deviation in self.all_deviations)

    def holding(self, fixed: Mapping[str, float]) -> Self:
        """The geometry with some parameters held at values, m, rad or m/m, so that a calibration does not identify them.

        Raises `ModelError` where a name is no parameter's, or a value is no finite number, or a hundred times its nominal
        value, which is one in another unit.
        """
        check_names(fixed, self.names)
        for p in (p for p in self.parameters if p.name in fixed):
            value = fixed[p.name]
            if real(value, p.name).ndim or not np.isfinite(value):
                raise ModelError(f"{p.name} is held at {value!r}", hint="give a finite number, m, rad or m/m")
            if abs(value) > UNITS * max(abs(p.nominal), FREE):
                times = f", {abs(value / p.nominal):.3g} times less" if p.nominal else ""
                what = f"{p.name} is held at {value:g} {p.unit}, but its nominal value is {p.nominal:g} {p.unit}{times}"
                raise ModelError(what, hint="give values in m, rad or m/m: this looks like mm")
        kept = [i for i, p in enumerate(self.parameters) if p.name not in fixed]
        held = ((p, float(fixed[p.name])) for p in self.parameters if p.name in fixed)
        parameters = tuple(self.parameters[i] for i in kept)
        return replace(self, parameters=parameters, values=self.values[kept], held=(*self.held, *held))

    def freed(self, names: Iterable[str]) -> Self:
        """The geometry with the tolerance `FREE` of some parameters; `ModelError` where a name is no parameter's."""
        chosen = {names} if isinstance(names, str) else set(names)
        check_names(chosen, self.names)
        parameters = (replace(p, tolerance=FREE) if p.name in chosen else p for p in self.parameters)
        return replace(self, parameters=tuple(parameters))

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

    def off(self, name: str) -> float:
        """The deviation of a parameter from nominal, m, rad or m/m; 0 where there is no such parameter."""
        return self._off.get(name, 0.0)

    @cached_property
    def _off(self) -> dict[str, float]:
        return {parameter.name: deviation for parameter, deviation in self.all_deviations}

    @property
    def platform(self) -> Floats:
        """(6,) twist, m and rad, by which what is measured, the TCP or the :attr:`target`, is displaced from the TCP of the
        robot's file; zero where these are no parameters."""
        twist = np.zeros(6)
        for parameter, value in (*zip(self.parameters, self.values, strict=True), *self.held):
            if parameter.kind == "platform":
                twist[parameter.component] = value
        return twist

    @property
    def target(self) -> Floats | None:
        """(6,) twist, m and rad, from the TCP of the robot's file to the measured target, where the place of the target was
        unknown (``target = "free"``). None where the TCP itself is measured: :attr:`platform` then corrects the TCP."""
        return self.platform if any(p.kind == "platform" and p.nominal for p in self.parameters) else None

    def at_tool(self) -> Self:
        """The geometry with the TCP where the robot's file has it, within the robot's tolerances, in the place of a free
        target; the same where there is none. Data of a free target do not show where the tool sits on its link: its
        tolerances are wider than the robot's by the factor that a calibration found for all others."""
        if self.target is None:
            return self
        wider = min((p.widened for p in self.parameters if p.kind != "platform"), default=1.0)
        nominal = placement_parameters(self.robot, all_tolerances(self.robot, {}))
        own = {p.name: replace(p, tolerance=wider * p.tolerance, widened=wider) for p in nominal}
        parameters = tuple(own[p.name] if p.kind == "platform" else p for p in self.parameters)
        values = [0.0 if p.kind == "platform" else value for p, value in zip(self.parameters, self.values, strict=True)]
        return replace(self, parameters=parameters, values=np.array(values))

    @property
    def scale(self) -> Floats:
        """(n,) travel of each actuator per commanded unit."""
        found = np.ones(self.robot.n_actuators)
        for parameter, deviation in self.all_deviations:
            if parameter.drive is not None:
                found[parameter.drive] += deviation
        return found

    def __getitem__(self, name: str) -> float:
        """One parameter's value, m, rad or m/m, by its name; `ModelError` where no parameter has this name."""
        held = {p.name: value for p, value in self.held}
        check_names([name], (*self.names, *held))
        return held[name] if name in held else float(self.values[self.names.index(name)])


def check_names(chosen: Iterable[str], names: Sequence[str]) -> None:
    """Raise `ModelError`, with the names that are most alike, where one that was chosen is not among ``names``."""
    for name in chosen:
        kind = str(name).partition("[")[0]
        if name not in names and kind in ASKED_FOR:
            hint = f"{kind}s are parameters where they are asked for: calibrate with {ASKED_FOR[kind]}"
            raise ModelError(f"no parameter is called {name!r}", hint=hint)
        if name not in names:
            near = get_close_matches(str(name), names, n=3, cutoff=0.4) or names[:1]
            raise ModelError(f"no parameter is called {name!r}", hint=f"did you mean {', '.join(near)}?")


def without_names(parameters: Sequence[Parameter], without: Iterable[str]) -> tuple[Parameter, ...]:
    """The parameters less those whose names begin with one of ``without``; `ModelError` where none begins with it."""
    for start in (without,) if isinstance(without, str) else without:
        kept = [p for p in parameters if not p.name.startswith(start)]
        if len(kept) == len(parameters):
            raise ModelError(f"no parameter is called {start!r}", hint=f"names look like {parameters[0].name}")
        parameters = kept
    return tuple(parameters)
