"""Changes of the geometry itself since an earlier model, as a check names them.

A link was bent, set anew or exchanged; a track was moved or turned.

In a diagnosis these are parameters of the geometry, which is fitted. A check holds the earlier geometry within its uncertainty,
so that they are hypotheses there; the model that it returns has them in its geometry, and not as effects.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from gtpin.effects.active import ActiveEffect
from gtpin.effects.displacement import Displacement
from gtpin.effects.drive_errors import ZeroShift
from gtpin.effects.effect import Effect, Parameters
from gtpin.effects.operating_points import OperatingPoints
from gtpin.model.model import Model
from gtpin.robot.chain import Chain
from gtpin.robot.constrained_model import joint_axis
from gtpin.robot.geometry import Geometry
from gtpin.robot.parameters import Column, tracks_by_parameters
from gtpin.typing import Floats

LENGTH, TURN = 2e-4, 2e-4
"""Typical change of a length or position, m, and of a direction, rad. Assumed: a fifth of a tolerance, as a turn of a fine
thread, a slight bend or a loosened screw makes."""


class GeometryChange(Effect):
    """A change of some parameters of the geometry since the earlier model, the same at all poses."""

    since_a_model = True
    sizes: ClassVar[tuple[float, ...]]
    """Typical size of each coefficient, m or rad."""

    def __init__(self, model: Model) -> None:
        """For the parts of a machine whose parameters a model has."""
        known = set(model.geometry.names)
        self.columns_by_site = {
            site: columns
            for site, columns in self.columns(model.robot).items()
            if all(column.keys() <= known for column in columns)
        }

    @abstractmethod
    def columns(self, robot: Chain) -> Mapping[str, Sequence[Column]]:
        """What each coefficient changes, by site."""

    def sites(self, robot: Chain) -> tuple[str, ...]:
        """The parts whose parameters can change."""
        return tuple(self.columns_by_site)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        """The motions of the frames that the parameters move, one column for each coefficient."""
        columns, moves = self.columns_by_site[site], at.kinematics.moves
        factors = np.array([[column.get(name, 0.0) for column in columns] for name in at.kinematics.geometry.names])
        placements = [
            (frame, np.broadcast_to(twists @ factors[own], (len(at), 6, len(columns))))
            for frame, own, twists in moves.frames
            if factors[own].any()
        ]
        return Displacement(np.array(self.sizes[: len(columns)]), placements=tuple(placements))


class LengthChange(GeometryChange):
    """dL = l; dL is the change of a rod's length, m, the same at all poses since the earlier model.

    Parameters: ``length`` l, m, positive where the rod is longer than before.
    """

    id = "length_change"
    title = "changed length"
    clause = "{site} has another length than before"
    remedy = "Inspect the link and its joints: it was bent, set anew, exchanged, or has slipped; use the updated model."
    coefficient = ("length", "m")
    depends_on = ("direction",)
    sizes = (LENGTH,)

    def columns(self, robot: Chain) -> Mapping[str, Sequence[Column]]:
        """The length of each rod."""
        return {site: ({f"length[{site.removeprefix('link')}]": 1.0},) for site in robot.rod_sites}


class TrackChange(GeometryChange):
    """dC = o_a a + o_b b + q t x v + r x (C - M); dC is the displacement of a cart's joints, m, since the earlier model.

    q is the command, v the direction of the track, which turned by t = t_a a + t_b b; C are the cart's joints and M their mean
    at command 0, base frame; the cart turned by r. a and b are the unit vectors about which the parameters
    ``track_direction[cart].a`` and ``.b`` turn the track. What moves along the track is ``zero_shift``.

    Parameters: ``turn_a`` t_a and ``turn_b`` t_b, rad; ``offset_a`` o_a and ``offset_b`` o_b, m, at command 0; ``pitch``,
    ``yaw`` and ``roll``: r along a, b and v, rad, of carts with several joints.
    """

    id = "track_change"
    title = "track that was moved or turned"
    clause = "the track of {site} was moved or turned"
    remedy = "Inspect the fixings of the track: a screw is loose or a support has moved; use the updated model."
    coefficient = ("turn_a", "rad")
    sizes = (TURN, TURN, LENGTH, LENGTH, TURN, TURN, TURN)

    def columns(self, robot: Chain) -> Mapping[str, Sequence[Column]]:
        """The direction of each track that carries rods, and the places of their joints."""
        return tracks_by_parameters(robot)

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        """The angles and the displacements."""
        names = ("turn_a", "turn_b", "offset_a", "offset_b", "pitch", "yaw", "roll")
        values = zip(names, coefficients, strict=False)
        return {name: (float(value), "m" if name.startswith("offset") else "rad") for name, value in values}


def in_geometry(model: Model) -> Model:
    """The model with its changes of geometry as values of the geometry, with their part of the uncertainty.

    A zero of a drive that shifted since the earlier model is one of them where the geometry has the placement of its joint.
    """
    names, joint, p = list(model.geometry.names), model.joint_covariance, len(model.geometry.names)
    if joint is None:
        return model
    moved, values, kept, place = np.eye(len(joint)), model.geometry.values.copy(), np.ones(len(joint), dtype=bool), p
    effects = []
    for active in model.effects:
        columns = _columns(active, model.geometry)
        for own, column in enumerate(columns, start=place):
            kept[own] = False
            for name, factor in column.items():
                values[names.index(name)] += factor * active.coefficients[own - place]
                moved[names.index(name), own] = factor
        effects += [] if columns else [active]
        place += len(active.coefficients)
    covariance = (moved @ joint @ moved.T)[np.ix_(kept, kept)]
    return replace(
        model,
        geometry=model.geometry.with_values(values),
        effects=tuple(effects),
        covariance=covariance[:p, :p],
        joint_covariance=covariance if effects else None,
    )


def _columns(active: ActiveEffect, geometry: Geometry) -> Sequence[Column]:
    """What each coefficient of an effect changes of the parameters of the geometry; empty for other effects."""
    if isinstance(active.effect, GeometryChange):
        return active.effect.columns_by_site[active.site]
    if not isinstance(active.effect, ZeroShift) or active.references.sessions:
        return ()
    if f"zero[{active.site}]" in geometry.names:
        return ({f"zero[{active.site}]": 1.0},)
    model, actuator = geometry.robot.model, geometry.robot.actuators[geometry.robot.sites.index(active.site)]
    joint, axis = model.names[actuator.joint_id], joint_axis(model, actuator.joint_id)
    placed = {p.component: p.name for p in geometry.parameters if p.kind == "placement" and p.part == joint}
    turned = np.flatnonzero(np.abs(axis) > 0.0).tolist()
    return ({placed[k]: float(axis[k]) for k in turned},) if placed.keys() >= {*turned} else ()
