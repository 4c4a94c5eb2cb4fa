"""An arm with causes that Pinocchio alone moves: nothing of gtpin's effects, kinematics or virtual machines is used."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

import gtpin

Floats = np.ndarray
URDF = Path(__file__).parents[2] / "examples" / "effects" / "arm.urdf"
MIDDLE, HALF = np.array([0.1, 0.4, 1.2, 0.3, 0.5, 0.2]), np.array([1.5, 0.7, 0.7, 1.0, 1.0, 2.0])
JOINTS = ("waist", "shoulder", "elbow", "wrist1", "wrist2", "wrist3")
SHIFT, TURN = 1.5e-5, 5e-5
"""Noise of the instrument, m and rad."""
OFF = 2e-4
"""Standard deviation of the placements, m and rad: gtpin's tolerances for a file without any are 5e-4."""


@dataclass(frozen=True)
class Campaign:
    """Commands (N, 6), moments of gravity about the joints (N, 6), N m, and what was recorded of each pose."""

    q: Floats
    moment: Floats
    approach: Floats
    time: Floats
    session: Floats
    payload: Floats
    speed: Floats
    """(N, 6) of the joints, rad/s."""


Deviation = Callable[[Campaign], Floats]
"""Deviations (N, 6) of the joints, rad, or displacements (N, 3) of the tool in its own axes, or of the frame, m."""


def measured(
    seed: int,
    joints: Deviation | None = None,
    tool: Deviation | None = None,
    frame: Deviation | None = None,
    poses: int = 100,
    ranges: tuple[Floats, Floats] = (MIDDLE, HALF),
    payloads: Sequence[float] = (0.0, 2.0, 4.0),
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
    fastest: float = 0.0,
) -> gtpin.Dataset:
    """Poses of the arm as a tracker measures them, with causes beside wrong placements. The arm hangs where ``gravity`` says.

    ``joints``, ``tool``, ``frame``: the causes. ``ranges``: middle and half of the ranges of the commands. ``payloads``: what
    is carried, kg. ``fastest``: largest speed of a joint, rad/s; recorded where it is not 0.
    """
    rng = np.random.default_rng(seed)
    model = pin.buildModelFromUrdf(str(URDF))
    model.gravity.linear = np.array(gravity)
    tcp = model.nframes - 1
    q = np.round(ranges[0] + ranges[1] * rng.uniform(-1.0, 1.0, (poses, 6)), 6)
    payload = rng.choice(payloads, poses)
    bare = model.inertias[6].copy()
    moment = np.empty((poses, 6))
    for n in range(poses):
        # What is carried is a point mass at the TCP; what gravity does to a joint is minus what holds it.
        model.inertias[6] = bare + pin.Inertia(payload[n], model.frames[tcp].placement.translation, np.zeros((3, 3)))
        moment[n] = -pin.computeGeneralizedGravity(model, model.createData(), q[n])
    model.inertias[6] = bare
    time = np.sort(rng.uniform(0.0, 5000.0, poses))
    approach = rng.choice([-1.0, 1.0], (poses, 6))
    session = (4.0 * np.arange(poses) / poses).astype(int)
    speed = fastest * approach * np.random.default_rng([seed, 1]).uniform(0.1, 1.0, (poses, 6))
    campaign = Campaign(q, moment, approach, time, session, payload, speed)
    for i in range(1, 7):
        model.jointPlacements[i] = model.jointPlacements[i] * pin.exp6(OFF * rng.standard_normal(6))
    moved = q + (0.0 if joints is None else joints(campaign))
    shifts, drift = (np.zeros((poses, 3)) if one is None else one(campaign) for one in (tool, frame))
    data, position, orientation = model.createData(), np.empty((poses, 3)), np.empty((poses, 4))
    for n in range(poses):
        pin.framesForwardKinematics(model, data, moved[n])
        seen = data.oMf[tcp] * pin.SE3(np.eye(3), shifts[n])
        position[n] = seen.translation + drift[n] + SHIFT * rng.standard_normal(3)
        turned = pin.exp3(TURN * rng.standard_normal(3)) @ seen.rotation
        orientation[n] = pin.Quaternion(turned).coeffs()[[3, 0, 1, 2]]
    return gtpin.Dataset(
        str(URDF),
        np.array([f"p{n}" for n in range(poses)]),
        q,
        position,
        orientation,
        {
            "time": time,
            "session": np.array([f"day{k}" for k in campaign.session], dtype=object),
            "payload": payload,
            **{f"approach{i + 1}": approach[:, i] for i in range(6)},
            **{f"speed{i + 1}": speed[:, i] for i in range(6) if fastest},
        },
        {"position_sigma": SHIFT, "orientation_sigma": TURN},
    )


def of_joint(name: str, deviation: Callable[[Campaign], Floats]) -> Deviation:
    """A deviation (N,) of one joint alone."""
    return lambda campaign: deviation(campaign)[:, None] * np.eye(6)[JOINTS.index(name)]
