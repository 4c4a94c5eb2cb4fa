"""Models 1 to 5 of Dressler, Brogårdh and Robertsson 2010: straight or measured tracks, reduced or full arm."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gtpin.data import Dataset
from gtpin.errors import DatasetError, ModelError
from gtpin.paper.geometry import PaperGeometry
from gtpin.paper.kinematics import RodEnds, places
from gtpin.paper.tracks import MeasuredTrack, measured_tracks
from gtpin.robot.chain import Chain
from gtpin.robot.description import RobotDescription
from gtpin.robot.export import to_urdf
from gtpin.robot.geometry import Geometry
from gtpin.robot.parameters import all_tolerances
from gtpin.typing import Floats

MODELS = (1, 2, 3, 4, 5)
MEASURED = (2, 4, 5)
"""Models that need the carts' measured tracks."""
REDUCED = (1, 2)
"""Models with the reduced arm."""
PAPERS_CHOICE = (False, True, True, False, False, False)
"""Rods whose track model 5 takes as measured: 2a and 2b."""


def model_geometry(number: int, robot: Chain, dataset: Dataset, *, orientations: bool = False) -> PaperGeometry:
    """Nominal geometry and parameters of one of the paper's models.

    ``number``: 1: reduced arm, straight tracks. 2: reduced arm, measured tracks. 3: full arm, a straight path for each rod,
    with a direction and a scale of its own. 4: full arm, measured tracks. 5: for each rod model 3 or model 4, as in the
    paper. ``robot``: the nominal robot. ``dataset``: the dataset, with the tolerances, the carts' measured tracks, and the
    reduced arm's constant orientation. ``orientations``: whether measured tracks also have the measured rotations of the
    carts.

    Raises `ModelError` if there is no such model, or the robot does not have the structure that it needs. `DatasetError` if
    the carts were not measured.
    """
    if number not in MODELS:
        raise ModelError(f"there is no model {number}", hint="use 1 to 5")
    if not robot.rod_carriers or None in robot.rod_carriers or robot.revolute.any():
        raise ModelError(f"models 1 to 5 are for carts on tracks, which {robot.name} has not", hint="leave --model out")
    tracks = _tracks(number, robot, dataset, orientations)
    if number in REDUCED:
        tolerances = dict(all_tolerances(robot, dataset.tolerance))
        for kind in (
            "link_length",
            "cart_joint",
        ):  # one joint replaces several, whose deviations differ: five is assumed
            tolerances[kind] *= 5.0
        ideal = parallelogram(robot, _mean_orientation(robot, dataset))
        return PaperGeometry.nominal(ideal, arm="reduced", scale="actuator", tracks=tracks, tolerance=tolerances)
    return PaperGeometry.nominal(robot, directions="rod", scale="rod", tracks=tracks, tolerance=dataset.tolerance)


def _mean_orientation(robot: Chain, dataset: Dataset) -> Floats:
    """(3, 3) the plate's mean measured rotation in the base frame; home's where it was not measured in that frame."""
    if dataset.orientation is not None and dataset.instrument.frame == "robot":
        return np.asarray(Rotation.from_quat(dataset.orientation.copy(), scalar_first=True).mean().as_matrix())
    home = robot.description.home
    return np.eye(3) if home is None else np.asarray(Rotation.from_rotvec(home.tcp_rotvec).as_matrix())


def _tracks(number: int, robot: Chain, dataset: Dataset, orientations: bool) -> tuple[MeasuredTrack | None, ...]:
    """For each rod, its measured track or None; empty where the model has none."""
    if number not in MEASURED:
        return ()
    if dataset.carts is None:
        raise DatasetError(
            f"model {number} needs the carts' measured tracks",
            file=dataset.path,
            hint="add carts.csv, or use model 1 or 3",
        )
    by_cart = measured_tracks(robot, dataset.carts, orientations=orientations)
    carriers = [carrier for carrier in robot.rod_carriers if carrier is not None]
    chosen = (True,) * len(carriers) if number != 5 else PAPERS_CHOICE
    if len(chosen) != len(carriers):
        raise ModelError(f"model 5 is for six rods, and {robot.name} has {len(carriers)}", hint="use model 3 or 4")
    return tuple(by_cart[carrier] if wanted else None for carrier, wanted in zip(carriers, chosen, strict=True))


def parallelogram(robot: Chain, R: Floats) -> Chain:
    """The robot with a plate of constant orientation: the rods of a cart are equal and parallel (Dressler et al. 2010, eqs. 1
    to 3).

    ``R``: (3, 3) the plate's constant rotation, base frame.
    """
    P = np.array([rod.P for rod in robot.rods])
    carrier = np.array(robot.rod_carriers)
    # Each rod is moved in parallel so that its joint on the platform is the TCP.
    joints = np.array([rod.C for rod in robot.rods]) - P @ R.T
    C = np.array([joints[carrier == i].mean(axis=0) for i in range(robot.n_actuators)])
    L = np.array([np.mean([rod.L for rod in robot.rods if rod.carrier == i]) for i in range(robot.n_actuators)])
    ends = RodEnds(P, (C[carrier] + P @ R.T)[None], L[carrier])
    placed = places(robot, np.zeros((1, robot.n_actuators)), ends)
    xml = to_urdf(Geometry(robot, (), np.zeros(0)), placed.placements, placed.anchors[0], (_meet(robot, C, L), R), {})
    return Chain(RobotDescription.parse(xml, source=f"{robot.name} with a reduced arm"), robot.tcp_frame)


def _meet(robot: Chain, C: Floats, L: Floats) -> Floats:
    """(3,) TCP of the reduced arm at commands 0, base frame, m: the point near the nominal home at which its rods meet."""
    home = robot.description.home
    T = np.zeros(3) if home is None else np.array(home.tcp_xyz)
    for _ in range(50):
        d = T - C
        step = np.linalg.lstsq(d, (L**2 - (d**2).sum(axis=1)) / 2.0, rcond=None)[0]
        T = T + step
        if np.abs(step).max() < 1e-14:
            break
    return np.asarray(T)
