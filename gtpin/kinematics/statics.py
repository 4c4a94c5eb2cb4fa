"""Static forces of a posture: in loops, rods and actuators, under gravity and a load on the tool."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gtpin.errors import SingularityError
from gtpin.kinematics.dynamics import Forces, loads
from gtpin.kinematics.kinematics import Kinematics, nominal
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.posture import ClosedPosture
from gtpin.real import real
from gtpin.typing import Floats


def static_forces(
    posture: ClosedPosture,
    force: npt.ArrayLike = (0.0, 0.0, 0.0),
    moment: npt.ArrayLike = (0.0, 0.0, 0.0),
    payload: float = 0.0,
) -> Forces:
    """Static forces by Pinocchio: gravity of all bodies, a force and moment on the tool, and a payload.

    The case v = a = 0 of the inverse dynamics: see :mod:`~gtpin.kinematics.dynamics`. A planar loop transmits no force across
    its plane.

    Parameters
    ----------
    posture
        The posture at which the robot is at rest.
    force, moment
        (3,) force, N, and moment, N m, on the tool at the TCP, base frame; zero by default.
    payload
        Mass held at the TCP, kg; zero by default.

    Raises
    ------
    ModelError
        If the robot's loops are redundant, so that statics alone does not give their forces.

    Examples
    --------
    >>> import gtpin
    >>> forces = gtpin.static_forces(gtpin.home(gtpin.load_robot("gantry_tau")), payload=10.0)
    >>> forces.rods.shape, forces.actuators.shape
    ((6,), (3,))
    """
    own = nominal(posture.robot)
    here = own.loops.at(posture.configuration[None], own.placed)
    on_tool = (real(x, "loads on the tool")[None] for x in (force, payload, moment))
    found = loads(own.loops, here, own.placed, *on_tool)
    return Forces(found.actuators[0], -found.loops[0], found.rod_forces[0])


def rod_forces(
    kinematics: Kinematics,
    q: Floats,
    poses: Poses,
    force: Floats | None = None,
    payload: Floats | None = None,
) -> Floats:
    """Axial forces at the middle of the k rods for many poses: the constraint forces of the rods' loops, along the rods.

    Parameters
    ----------
    kinematics
        ``model.kinematics`` of a robot with rods.
    q, poses
        (N, n) commands, m or rad, and the (N) poses at them, base frame.
    force
        (N, 3) force on the tool at the TCP, base frame, N; None: zero.
    payload
        (N,) mass held at the TCP, kg; None: zero.

    Returns
    -------
    forces
        (N, k) axial forces, N, tension positive.

    Raises
    ------
    SingularityError
        If the rods can't hold the platform at some pose.

    Examples
    --------
    >>> import gtpin
    >>> model = gtpin.read_model("gantry_tau")
    >>> q = model.robot.home_q[None]
    >>> gtpin.rod_forces(model.kinematics, q, model.kinematics.forward(q)).shape
    (1, 6)
    """
    found = kinematics.loads(q, poses, force, payload).rod_forces
    if not np.isfinite(found).all():
        raise SingularityError("the rods can't hold the platform at one of the poses", hint="leave it out")
    return found
