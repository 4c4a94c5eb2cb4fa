"""A first guess of a target's place on the platform, by a fit of nominal and measured poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from gtpin.calibration.problem import Measured, measured_poses
from gtpin.data import Dataset
from gtpin.data.files import warn_of
from gtpin.data.plausible import check_actuators, sane_rows
from gtpin.errors import DatasetError
from gtpin.instruments.frame_and_target import Placement, frame_and_target
from gtpin.kinematics.kinematics import Kinematics
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats


def with_free_target(geometry: Geometry, dataset: Dataset) -> Geometry:
    """The geometry with the TCP moved to a first guess of the target and with wide tolerances, if the dataset's target is free.

    Raises `DatasetError` where the TCP's place is no parameter, as of a robot with rods, or for another number of actuators.
    Warns: says what the poses can't determine, and what is assumed.
    """
    if dataset.instrument.target != "free":
        return geometry
    if sum(p.kind == "platform" for p in geometry.parameters) < 6:
        what = "a free target, but the TCP's place is no parameter"
        hint = "hold no part of its place"
        if geometry.robot.rod_sites:
            hint = (
                "measure where the target sits, m, TCP frame, and write target = [x, y, z] under [instrument]: of a robot with "
                "rods it can't be identified"
            )
        raise DatasetError(what, file=dataset.toml or dataset.file, column="instrument.target", hint=hint)
    check_actuators(geometry.robot, dataset)
    measured = measured_poses(dataset.take(sane_rows(dataset)))
    free = dataset.instrument.frame == "free"
    found, place = with_target(geometry, measured, free_frame=free)
    if place is not None and (text := unseen_words(place.unseen)):
        warn_of(dataset.file, text)
    return found


def with_target(geometry: Geometry, measured: Measured, *, free_frame: bool) -> tuple[Geometry, Placement | None]:
    """The geometry with the TCP at a first guess of the target, and the guess; unchanged where no pose can be reached."""
    poses = Kinematics(without_target(geometry)).forward(measured.q)
    good = poses.reached
    if not good.any():
        return geometry, None
    seen = measured.take(good)
    place = frame_and_target(poses[good], seen.T, seen.R, free_frame=free_frame)
    guess = pin.log6(pin.SE3(place.mount, place.at)).vector
    values, parameters = geometry.values.copy(), []
    for i, p in enumerate(geometry.parameters):
        if p.kind == "platform":
            # At least 50 mm and 0.1 rad: the error of the guess is that of the robot, where the poses determine the target.
            values[i] = guess[p.component]
            # A target without orientations is a point: its axes are the TCP's. Any rotation would only couple with its place.
            at, turn = (0.05, p.tolerance) if seen.R is None else (place.at_sigma, max(0.1, place.mount_sigma))
            own = max(0.05, at) if p.component < 3 else turn
            p = replace(p, nominal=float(values[i]), tolerance=own)
        parameters.append(p)
    return replace(geometry, parameters=tuple(parameters), values=values), place


def unseen_words(unseen: Floats) -> str:
    """What poses do not determine of a target's place, as a sentence; empty where they determine all of it.

    ``unseen``: (k, 3) unit vectors, TCP frame.
    """
    fixed = "it is left where the TCP is, and the instrument's frame takes up the difference"
    if len(unseen) == 3:
        return f"these poses do not determine where the target sits on the platform, for the robot does not turn it: {fixed}"
    named = " and ".join(f"({', '.join(f'{v + 0.0:.3g}' for v in np.round(axis, 3))})" for axis in unseen)
    if not named:
        return ""
    return f"these poses do not determine where the target sits along {named} of the TCP's frame: along this, {fixed}"


def without_target(geometry: Geometry) -> Geometry:
    """The geometry with the TCP where the robot's description has it, and its place no parameter."""
    kept = [i for i, p in enumerate(geometry.parameters) if p.kind != "platform"]
    return replace(geometry, parameters=tuple(geometry.parameters[i] for i in kept), values=geometry.values[kept])
