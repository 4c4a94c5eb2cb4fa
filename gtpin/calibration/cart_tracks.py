"""Measured tracks from cart poses that were measured separately along the guideways."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gtpin.data import CartMeasurements
from gtpin.errors import DatasetError
from gtpin.robot.chain import Chain
from gtpin.robot.geometry import MeasuredTrack
from gtpin.typing import Floats


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
