"""Frames of joints that a file puts far from the machine, as factory Denavit-Hartenberg tables do for nearly parallel axes.

A joint's frame can stand anywhere on its axis. Where two axes are parallel to within a milliradian, the common normal of a
Denavit-Hartenberg table can be hundreds of metres from the machine. A tolerance of the frame's position and rotation would then
be one of a point that no part of the machine has. Such a frame is moved along its axis to the machine; motions, links and the
exported URDF stay what they are.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from gtpin.errors import warn
from gtpin.typing import Floats

FAR = 2.0
"""A frame is far out where its distance from the foot (:func:`feet`) is more than this multiple of the machine's size. Two
joints of one link are at most the machine's size apart; the factor keeps ordinary files as they are."""
FAR_MASS = 10.0
"""A centre of mass that is nearer than this, m, is left where it is, however small the machine. Assumed."""


@np.errstate(over="ignore", invalid="ignore")  # a robot of absurd size is refused later
def bring_near(model: Any, *, masses_alone: bool) -> None:
    """Move the frames of joints that are far from the machine along their axes to the foot; changes the model.

    A mass whose centre is as far out stays out of the model. ``masses_alone``: move no frame.

    Warns
    -----
    GtpinWarning
        Of each mass that is left out.
    """
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    pin.updateFramePlacements(model, data)
    foot = feet(model, data)
    lengths = [np.linalg.norm(foot[j] - foot[model.parents[j]]) for j in range(1, model.njoints)]
    ends = [
        np.linalg.norm(data.oMf[i].translation - foot[frame.parentJoint])
        for i, frame in enumerate(model.frames)
        if frame.parentJoint and frame.placement.translation.any()
    ]
    far = FAR * float(np.sum(lengths) + max(ends, default=0.0))
    for j in range(1, model.njoints):
        inertia = model.inertias[j]
        away = float(np.linalg.norm(data.oMi[j].act(inertia.lever) - foot[j]))
        if inertia.mass and away > max(far, FAR_MASS):
            warn(
                f"the centre of mass of what joint {model.names[j]} carries is {away:.3g} m away: the mass is left out"
            )
            model.inertias[j] = pin.Inertia.Zero()
        by = data.oMi[j].actInv(foot[j])
        if np.linalg.norm(by) > far and not masses_alone:
            _move(model, j, pin.SE3(np.eye(3), by))


def feet(model: Any, data: Any) -> Floats:
    """(J + 1, 3) of each joint the point of its axis that is nearest to the foot of the joint before it, base frame, m.

    Of the base, it is the origin of the link that carries the first joint; of a joint with several degrees of freedom, its
    frame. It depends on the axes alone, not on where a file puts the frames along them. ``data``: of a configuration, with the
    joints' Jacobians and the placements of frames.
    """
    found = np.zeros((model.njoints, 3))
    for j in range(1, model.njoints):
        at = found[j] = data.oMi[j].translation
        parent = int(model.parents[j])
        carrier = model.frames[model.getFrameId(model.names[j], pin.FrameType.JOINT)].parentFrame
        before = found[parent] if parent else data.oMf[carrier].translation
        if model.nvs[j] == 1:
            twist = np.reshape(pin.getJointJacobian(model, data, j, pin.LOCAL_WORLD_ALIGNED), (6, -1))[
                :, model.idx_vs[j]
            ]
            along = twist[3:] if twist[3:].any() else twist[:3]
            if along.any():  # a driven joint whose axis has no length is refused later
                found[j] = at + along * (along @ (before - at)) / (along @ along)
    return found


def _move(model: Any, joint: int, by: Any) -> None:
    """Move a joint's frame by a placement in its own axes; everything that it carries stays where it is."""
    back = by.inverse()
    model.jointPlacements[joint] = model.jointPlacements[joint] * by
    model.inertias[joint] = back.act(model.inertias[joint])
    for child in range(1, model.njoints):
        if model.parents[child] == joint:
            model.jointPlacements[child] = back * model.jointPlacements[child]
    for frame in model.frames:
        if frame.parentJoint == joint:
            frame.placement = back * frame.placement
