"""Measured tracks: the path of a cart from poses of it that were measured separately along its guideway."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gtpin.data import CartMeasurements
from gtpin.errors import DatasetError, ModelError
from gtpin.robot.chain import Chain
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
        for name, value in list(vars(self).items()):
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
        return np.stack([np.interp(q, self.q, column, left=np.nan, right=np.nan) for column in values.T], axis=1)

    def _slope(self, values: Floats, q: Floats) -> Floats:
        piece = np.clip(np.searchsorted(self.q, q, side="right") - 1, 0, len(self.q) - 2)
        return np.asarray((np.diff(values, axis=0) / np.diff(self.q)[:, None])[piece])


@dataclass(frozen=True)
class _Path:
    """One cart's measured points, ascending: commands (K,), positions (K, 3), m, rotations or None; instrument's frame."""

    q: Floats
    position: Floats
    rotation: Rotation | None

    def at_zero(self) -> Floats:
        """(3,) position at zero, interpolated."""
        return np.array([np.interp(0.0, self.q, column) for column in self.position.T])


def measured_tracks(robot: Chain, carts: CartMeasurements, *, orientations: bool = False) -> tuple[MeasuredTrack, ...]:
    """The measured track of every actuator, rotated to the base frame's axes.

    The instrument may have stood elsewhere than for the TCP's poses. The carts' paths are rotated so that their mean direction
    is that of the nominal tracks, and about this direction so that their positions fit best. A calibration identifies the
    remaining rotation.

    ``robot``: the nominal robot. ``carts``: the measured cart poses. ``orientations``: whether the tracks also have the
    measured orientations of the carts.

    Raises `DatasetError` if a cart was not measured at two or more commands around zero, or if orientations are wanted but
    not measured.
    """
    paths = [_path(robot, carts, i, orientations) for i in range(robot.n_actuators)]
    nominal = robot.carrier_joints
    R = _towards_base(robot, paths, nominal)
    middle = np.mean([path.at_zero() for path in paths], axis=0)
    tracks = []
    for path in paths:
        zero = path.at_zero()
        turns = None
        if path.rotation is not None:
            nearest = int(np.argmin(np.abs(path.q)))
            turns = (path.rotation * path.rotation[nearest].inv()).as_rotvec() @ R.T
        origin = nominal.mean(axis=0) + R @ (zero - middle)
        tracks.append(MeasuredTrack(path.q, (path.position - zero) @ R.T, turns, origin))
    return tuple(tracks)


def _path(robot: Chain, carts: CartMeasurements, actuator: int, orientations: bool) -> _Path:
    rows = np.flatnonzero(carts.cart == actuator + 1)
    q, place = np.unique(np.round(carts.q[rows], 9), return_inverse=True)
    site = robot.sites[actuator]
    if len(q) < 2 or q[0] > 0.0 or q[-1] < 0.0:
        raise DatasetError(
            f"{site} was measured at {len(q)} commands, which do not reach from below to above zero",
            file=carts.file,
            hint="measure every cart along its track",
        )
    if orientations and carts.orientation is None:
        raise DatasetError("no cart orientations", file=carts.file, hint="give qw qx qy qz, or do without them")
    position = np.array([carts.position[rows[place == k]].mean(axis=0) for k in range(len(q))])
    rotation = None
    if orientations and carts.orientation is not None:
        each = Rotation.from_quat(carts.orientation[rows].copy(), scalar_first=True)
        rotation = Rotation.concatenate([each[place == k].mean() for k in range(len(q))])
    return _Path(q, position, rotation)


def _towards_base(robot: Chain, paths: list[_Path], nominal: Floats) -> Floats:
    """(3, 3) rotation from the instrument's frame to a frame that is approximately parallel to the base frame."""
    slopes = [np.polyfit(path.q, path.position, 1)[0] for path in paths]
    measured = _unit(np.sum([_unit(slope) for slope in slopes], axis=0))
    wanted = _unit(np.sum([actuator.axis for actuator in robot.actuators], axis=0))
    first = Rotation.align_vectors(wanted[None], measured[None])[0]
    # The rotation about that direction is found from the positions of the tracks: the unknown positions of the targets on the
    # carts are small compared with the distances of the tracks.
    zero = np.array([path.at_zero() for path in paths])
    a, b = first.apply(zero - zero.mean(axis=0)), nominal - nominal.mean(axis=0)
    sine = np.einsum("i,ni->", wanted, np.cross(a, b))
    cosine = np.einsum("ni,ni->", a, b) - (a @ wanted) @ (b @ wanted)
    return np.asarray((Rotation.from_rotvec(np.arctan2(sine, cosine) * wanted) * first).as_matrix())


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))
