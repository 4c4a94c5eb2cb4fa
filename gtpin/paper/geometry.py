"""The paper's geometries: parameters that each rod has for itself, or that the rods of a cart share, and measured tracks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gtpin.errors import ModelError
from gtpin.paper.tracks import MeasuredTrack
from gtpin.robot.chain import Chain
from gtpin.robot.geometry import Geometry, without_names
from gtpin.robot.parameters import DIRECTIONS, JOINTS, Parameter, all_tolerances, rod_parameters
from gtpin.typing import Floats, Mask

Arm = Literal["full", "reduced"]
Per = Literal["actuator", "rod"]


@dataclass(frozen=True, repr=False)
class PaperGeometry(Geometry):
    """A geometry whose rods may each have a path of their own.

    ``tracks``: one entry for each rod: the measured track of its cart, or None where the track is straight. Empty where all
    are straight.
    """

    tracks: tuple[MeasuredTrack | None, ...] = ()

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
        zeros: bool = False,
    ) -> PaperGeometry:
        """The nominal geometry of a robot with rods, with the parameters that a calibration shall identify.

        ``directions``: one track direction for each ``actuator``, or for each ``rod`` as in models 3 to 5. ``scale``: one drive
        scale for each ``actuator`` or ``rod``; None: only those that the URDF declares unknown. ``arm``: ``full``: each rod has
        its own length and joints; ``reduced``: the rods of a cart share one length, and their joints on the cart move
        together. ``tolerance``, ``without``: see :meth:`~gtpin.robot.geometry.Geometry.nominal`.

        Raises `ModelError` if an option has another value, or a kind of tolerance or a name is not known.
        """
        _check(directions, scale, arm)
        if zeros:
            raise ModelError("zeros of joints beside parameters of single rods", hint="leave one of them out")
        core = rod_parameters(robot, all_tolerances(robot, tolerance or {}), scale=True)
        measured = [bool(tracks) and tracks[i] is not None for i in range(len(robot.rods))]
        found = list(
            _reduced(robot, core) if arm == "reduced" else [p for p in core if p.kind not in (*DIRECTIONS, "scale")]
        )
        found += _of_drives(robot, core, measured, "actuator" if arm == "reduced" else directions, DIRECTIONS)
        roll = all_tolerances(robot, tolerance or {})["track_roll"]
        for p in core:
            if p.kind in DIRECTIONS and any(measured[i] for i in robot.rods_on(robot.sites.index(p.part))):
                # A measured track is rotated as a whole by three angles: a, b, and c about its own direction.
                found += [p] if p.component == 0 else [p, replace(p, name=p.name[:-1] + "c", tolerance=roll, moves=())]
        found += _of_drives(robot, core, measured, "actuator" if arm == "reduced" and scale else scale, ("scale",))
        parameters = without_names(found, without)
        return PaperGeometry(robot, parameters, np.array([p.nominal for p in parameters]), tracks=tracks)

    @property
    def positions_only(self) -> bool:
        """Whether the arm is reduced: the rods of a cart share one length, and the plate never turns."""
        return any(p.kind == "length" and p.part in self.robot.sites for p in self.parameters)

    def outside(self, q: Floats) -> Mask:
        """(N,) True where commands q (N, n) are outside the range of a measured track."""
        found = np.zeros(len(q), dtype=bool)
        for rod, track in zip(self.robot.rods, self.tracks, strict=False):
            if track is not None and rod.carrier is not None:
                found |= (q[:, rod.carrier] < track.q[0]) | (q[:, rod.carrier] > track.q[-1])
        return found

    def by_rod(self, kinds: Iterable[str], components: str = "") -> Floats:
        """(k, c) deviations of each rod from nominal: its own, and those that all rods of its actuator share.

        ``kinds``: of the parameters, of which a rod has one. ``components``: ``xyz``, ``abc``, or none for a single number.
        """
        ends = [f".{c}" for c in components] or [""]
        sites = self.robot.sites
        # A set: a rod whose length an actuator changes can have the actuator's name.
        owners = [{rod.name} if rod.driver is None else {rod.name, sites[rod.driver]} for rod in self.robot.rods]
        return np.array([[sum(self.off(f"{k}[{o}]{e}") for k in kinds for o in own) for e in ends] for own in owners])

    def moved_by(self, parameter: Parameter) -> list[int]:
        """Indices of the rods that a parameter moves."""
        rods = list(enumerate(self.robot.rods))
        if parameter.part not in self.robot.sites:
            return [i for i, rod in rods if rod.name == parameter.part]
        actuator = self.robot.sites.index(parameter.part)
        return [i for i, r in rods if (r.carrier if parameter.kind in DIRECTIONS else r.driver) == actuator]


def nominal_geometry(
    robot: Chain,
    *,
    directions: Per = "actuator",
    scale: Per | None = None,
    arm: Arm = "full",
    tracks: tuple[MeasuredTrack | None, ...] = (),
    tolerance: Mapping[str, float] | None = None,
    without: Iterable[str] = (),
    zeros: bool = False,
) -> Geometry:
    """The nominal geometry with these parameters: the robot's own where it has them, else the paper's; see `PaperGeometry`."""
    _check(directions, scale, arm)
    if robot.rods and (directions == "rod" or scale == "rod" or arm == "reduced" or tracks):
        options = {"directions": directions, "scale": scale, "arm": arm, "tracks": tracks, "zeros": zeros}
        return PaperGeometry.nominal(robot, **options, tolerance=tolerance, without=without)  # type: ignore[arg-type]
    per: Literal["actuator"] | None = "actuator" if scale else None
    return Geometry.nominal(robot, scale=per, tolerance=tolerance, without=without, zeros=zeros)


def _check(directions: str, scale: str | None, arm: str) -> None:
    for option, value, allowed in (
        ("directions", directions, ("actuator", "rod")),
        ("scale", scale, (None, "actuator", "rod")),
        ("arm", arm, ("full", "reduced")),
    ):
        if value not in allowed:
            raise ModelError(f"{option}={value!r}", hint=f"use one of {', '.join(map(str, allowed))}")


def _reduced(robot: Chain, core: list[Parameter]) -> Iterator[Parameter]:
    """Lengths and joints on the carts that all rods of a cart share; their nominal values are those of its first rod."""
    first = {rod.carrier: i for i, rod in reversed(list(enumerate(robot.rods))) if rod.carrier is not None}
    for p in core:
        if p.kind in ("length", *JOINTS) and p.kind != "platform_joint":
            rod = next(rod for rod in robot.rods if rod.name == p.part)
            if rod.carrier is not None and robot.rods[first[rod.carrier]] is rod:
                yield replace(p, name=p.name.replace(f"[{rod.name}]", f"[{robot.sites[rod.carrier]}]"), moves=())


def _of_drives(
    robot: Chain, core: list[Parameter], measured: list[bool], per: Per | None, kinds: tuple[str, ...]
) -> list[Parameter]:
    """Directions or scales of each rod or actuator, where no track was measured; None: only unknown scales."""
    unknown = {actuator.site for actuator in robot.actuators if actuator.scale_unknown}
    own = [p for p in core if p.kind in kinds and (per or p.part in unknown)]
    straight = [rod for rod, track in zip(robot.rods, measured, strict=True) if rod.driver is not None and not track]
    if per == "rod":
        named = [(rod.name, robot.sites[rod.driver], p) for rod in straight for p in own if rod.driver is not None]
        return [
            replace(p, name=p.name.replace(f"[{s}]", f"[{name}]"), moves=(), drive=None)
            for name, s, p in named
            if p.part == s
        ]
    return [p for p in own if p.part in {robot.sites[rod.driver] for rod in straight if rod.driver is not None}]
