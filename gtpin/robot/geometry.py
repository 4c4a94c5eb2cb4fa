"""Values of the named parameters of a robot's geometry, and tracks that were measured along its guideways."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from gtpin.errors import ModelError
from gtpin.robot.chain import Chain
from gtpin.robot.parameters import Kind, Parameter, Per, all_tolerances, placement_parameters, rod_parameters
from gtpin.typing import Floats


@dataclass(frozen=True, eq=False)
class MeasuredTrack:
    """The path of a cart, interpolated between measured points (Dressler et al. 2010, eq. 4).

    - ``q``: (K,) ascending commands, m, of the measured points.
    - ``path``: (K, 3) displacement of the cart's measured point from its position at the command 0, m. Its frame is
      parallel to the base frame as far as the measurement of the track determines that; a calibration identifies the
      remaining rotation.
    - ``turns``: (K, 3) rotation vectors of the cart from its orientation at the command 0, rad, in the same frame; None
      where only positions are used.
    - ``origin``: (3,) approximate position of the measured point at the command 0, base frame, m. The cart rotates about
      this point.
    """

    q: Floats
    path: Floats
    turns: Floats | None
    origin: Floats

    def __post_init__(self) -> None:
        for name in ("q", "path", "turns", "origin"):
            value = getattr(self, name)
            if value is not None:
                frozen = np.array(value, dtype=float)
                frozen.flags.writeable = False
                object.__setattr__(self, name, frozen)
        if len(self.q) < 2 or not (np.diff(self.q) > 0.0).all():
            raise ModelError("a measured track needs two or more different commands", hint="measure more points")

    def displacement(self, q: Floats) -> Floats:
        """(N, 3) path at commands (N,), m; NaN outside the measured range."""
        return self._interpolated(self.path, q)

    def slope(self, q: Floats) -> Floats:
        """(N, 3) derivative of the path by the command; at a measured point, that of the piece towards larger commands."""
        return self._slope(self.path, q)

    def turn(self, q: Floats) -> Floats:
        """(N, 3) rotation vectors of the cart, rad; zero where orientations are not used."""
        return np.zeros((len(q), 3)) if self.turns is None else self._interpolated(self.turns, q)

    def turn_slope(self, q: Floats) -> Floats:
        """(N, 3) derivative of the rotation vectors by the command, rad/m."""
        return np.zeros((len(q), 3)) if self.turns is None else self._slope(self.turns, q)

    def _interpolated(self, values: Floats, q: Floats) -> Floats:
        columns = [np.interp(q, self.q, column, left=np.nan, right=np.nan) for column in values.T]
        return np.stack(columns, axis=1)

    def _slope(self, values: Floats, q: Floats) -> Floats:
        piece = np.clip(np.searchsorted(self.q, q, side="right") - 1, 0, len(self.q) - 2)
        return np.asarray((np.diff(values, axis=0) / np.diff(self.q)[:, None])[piece])


Arm = Literal["full", "reduced"]


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
    tracks
        One entry per rod: the measured track of its cart, or None where the track is straight. Empty where all are straight.

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
    tracks: tuple[MeasuredTrack | None, ...] = ()

    def __post_init__(self) -> None:
        frozen = np.array(self.values, dtype=float)
        frozen.flags.writeable = False
        object.__setattr__(self, "values", frozen)

    def with_tolerances(self, factors: Floats) -> Geometry:
        """The same geometry with its tolerances multiplied by factors (p,)."""
        parameters = tuple(replace(p, tolerance=p.tolerance * f) for p, f in zip(self.parameters, factors, strict=True))
        return replace(self, parameters=parameters)

    def __repr__(self) -> str:
        return f"Geometry of {self.robot.name}: {len(self.parameters)} parameters"

    @staticmethod
    def nominal(
        robot: Chain,
        *,
        directions: Per = "actuator",
        scale: Per | None = None,
        arm: Arm = "full",
        tracks: tuple[MeasuredTrack | None, ...] = (),
        tolerance: Mapping[str, float] | None = None,
        without: Iterable[str] = (),
    ) -> Geometry:
        """The nominal geometry, with the parameters that a calibration shall identify.

        Parameters
        ----------
        robot
            The robot.
        directions
            Parameters of the track direction: one set per ``actuator``, or one per ``rod`` as in models 3 to 5 of
            Dressler et al. 2010.
        scale
            Which drive scales (travel per commanded unit) are parameters: one per ``actuator``, one per ``rod``, or (None) only
            those of actuators with ``scale="unknown"`` in the URDF.
        arm
            ``full``: each rod has its own length and joints. ``reduced``: the rods of a cart share one length, and their joints
            on the cart move together; for robots whose rods are parallel.
        tracks
            One entry per rod: the measured track of its cart, or None where the track is straight.
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
        for option, value, allowed in (
            ("directions", directions, ("actuator", "rod")),
            ("scale", scale, (None, "actuator", "rod")),
            ("arm", arm, ("full", "reduced")),
        ):
            if value not in allowed:
                raise ModelError(f"{option}={value!r}", hint=f"use one of {', '.join(map(str, allowed))}")
        without = (without,) if isinstance(without, str) else without
        tolerances = all_tolerances(robot, tolerance or {})
        measured = [bool(tracks) and tracks[i] is not None for i in range(len(robot.rods))]
        if not robot.rods:
            parameters = placement_parameters(robot, tolerances)
        else:
            parameters = rod_parameters(robot, tolerances, directions, scale, measured, arm == "reduced")
        for start in without:
            kept = [p for p in parameters if not p.name.startswith(start)]
            if len(kept) == len(parameters):
                raise ModelError(f"no parameter is called {start!r}", hint=f"names look like {parameters[0].name}")
            parameters = kept
        return Geometry(robot, tuple(parameters), np.array([p.nominal for p in parameters]), tracks)

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

    def track(self, rod: int) -> MeasuredTrack | None:
        """The measured track of the rod with the index ``rod``, or None where its track is straight."""
        return self.tracks[rod] if self.tracks else None

    @property
    def reduced(self) -> bool:
        """Whether the rods of a cart share one length: ``arm="reduced"`` of :meth:`nominal`."""
        return any(p.kind == "length" and p.per == "actuator" for p in self.parameters)

    def outside_tracks(self, q: Floats) -> npt.NDArray[np.bool_]:
        """(N,) True where commands q (N, n) are outside the range of a measured track."""
        outside = np.zeros(len(q), dtype=bool)
        for rod, track in zip(self.robot.rods, self.tracks, strict=False):
            if track is not None and rod.carrier is not None:
                outside |= (q[:, rod.carrier] < track.q[0]) | (q[:, rod.carrier] > track.q[-1])
        return outside

    def with_values(self, values: Floats) -> Geometry:
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
    def anchors(self) -> Floats:
        """(2 L, 3) displacement, m, of the two anchors of each of L loops, in the frames of the anchors' links.

        Zero for a robot with rods, whose parameters are the lengths and joints of the rods.
        """
        return self.deviations("anchor", "anchor", (2 * len(self.robot.constraints), 3))

    def __getitem__(self, name: str) -> float:
        """One parameter's value, m, rad or m/m, by its name; `ModelError` where no parameter has this name."""
        if name not in self.names:
            raise ModelError(f"no parameter is called {name!r}", hint=f"names look like {self.names[0]}")
        return float(self.values[self.names.index(name)])
