"""A closed posture: one command's configuration with Pinocchio's own data, Jacobians, constraint Jacobian and static forces."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from gtpin.errors import ModelError, SingularityError, UnreachableError, check_kind
from gtpin.kinematics.closing import Here
from gtpin.kinematics.dynamics import Forces
from gtpin.kinematics.frames import Moving, frame_of
from gtpin.kinematics.kinematics import Kinematics, nominal
from gtpin.kinematics.poses import Poses
from gtpin.real import real
from gtpin.robot.chain import Chain
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats

NEARLY_SINGULAR = 10.0
"""Ratio of a posture's amplification to that of home, above which a path that ends there counts as near a singularity."""


class ClosedPosture:
    """A posture of a robot: commands and a Pinocchio configuration at which all loops are closed. It can't be changed.

    :func:`home` gives the first one, :meth:`moved_to` others.

    Parameters
    ----------
    robot
        The robot.
    q
        (n,) commands, m or rad. Of a continuous joint, q may be more than one turn; the configuration does not count turns.
    configuration
        (nq,) Pinocchio configuration at which the loops are closed.
    frame
        The name of the link, or of another frame of Pinocchio's model, that takes the place of the TCP in what this posture
        gives; None: the TCP.

    Examples
    --------
    >>> import gtpin
    >>> robot = gtpin.load_robot("gantry_tau")
    >>> posture = gtpin.home(robot).moved_to(robot.home_q + [0.05, 0.0, 0.0])
    >>> posture.jacobian.shape
    (6, 3)
    """

    def __init__(self, robot: Chain, q: Floats, configuration: Floats, frame: str | None = None) -> None:
        self.robot, self.frame = robot, frame
        self._carrier, self._placement = frame_of(robot, frame)
        self._q, self._configuration = _frozen(q.copy()), _frozen(configuration.copy())

    @property
    def configuration(self) -> Floats:
        """(nq,) Pinocchio configuration, read-only."""
        return self._configuration

    @property
    def q(self) -> Floats:
        """(n,) commands, m or rad, read-only."""
        return self._q

    @cached_property
    def data(self) -> Any:
        """``pinocchio.Data`` of this posture alone, with the joints' placements and Jacobians, and the frames' placements.

        It belongs to ``robot.model``. What a caller computes with it stays in it.
        """
        data = self.robot.model.createData()
        pin.computeJointJacobians(self.robot.model, data, self._configuration)
        pin.updateFramePlacements(self.robot.model, data)
        return data

    @cached_property
    def constraint_data(self) -> Any:
        """``pinocchio.StdVec_ConstraintData`` for ``robot.constraint_models`` at this posture, as Pinocchio takes it."""
        return self.robot.constraint_data(self.data)

    def of(self, frame: str | None) -> ClosedPosture:
        """The same posture, with ``T``, ``R``, ``tcp`` and the derivatives of another frame; see ``frame`` above."""
        return ClosedPosture(self.robot, self.q, self.configuration, frame)

    @property
    def tcp(self) -> Any:
        """The TCP frame in the base frame, a ``pinocchio.SE3`` (m). A copy: changing it does not change the posture."""
        return self._tcp.copy()

    @cached_property
    def _tcp(self) -> Any:
        return self.placement(self._carrier) * self._placement

    @property
    def T(self) -> Floats:
        """(3,) TCP position in the base frame, m."""
        return _frozen(np.array(self._tcp.translation))

    @property
    def R(self) -> Floats:
        """(3, 3) rotation from the TCP frame to the base frame."""
        return _frozen(np.array(self._tcp.rotation))

    def placement(self, joint_id: int) -> Any:
        """Placement (``pinocchio.SE3``, m) of a Pinocchio joint in the base frame at this posture."""
        return self.data.oMi[joint_id].copy()

    @cached_property
    def constraint_jacobian(self) -> Floats:
        """(m, nv) derivative of the m loop equations by Pinocchio velocities.

        A loop equation is a component of the gap between a loop's two anchors, in metres, in the frame of the first anchor.
        It is ``pinocchio.getConstraintsJacobian`` for ``robot.constraint_models``; of a planar loop, two components in its
        plane. The column of a joint that other joints follow (``<mimic>``) includes the motion of these joints.
        """
        return _frozen(self.robot.closing(self.robot.gaps_jacobian(self.data)))

    @cached_property
    def tcp_jacobian(self) -> Floats:
        """(6, nv) derivative of the TCP by Pinocchio velocities: position (m) and rotation vector (rad), base frame.

        The column of a joint that other joints follow (``<mimic>``) includes the motion of these joints.
        """
        robot = self.robot
        frame = pin.getFrameJacobian(robot.model, self.data, self._carrier, self._placement, pin.LOCAL_WORLD_ALIGNED)
        return _frozen(robot.folded(np.reshape(np.array(frame), (6, robot.model.nv))))

    @cached_property
    def passive_response(self) -> Floats:
        """(6, m) motion of the TCP, m and rad, base frame, that closes a gap of 1 m in each loop equation, commands fixed."""
        return _frozen(-self.tcp_jacobian[:, self.robot.passive] @ self.passive_inverse)

    @cached_property
    def jacobian(self) -> Floats:
        """(6, n) derivative of the TCP's pose by the commands: position (m) and rotation vector (rad), base frame."""
        driven = self.robot.driven
        return _frozen(self.tcp_jacobian[:, driven] + self.passive_response @ self.constraint_jacobian[:, driven])

    @cached_property
    def passive_inverse(self) -> Floats:
        """(n_passive, m) inverse of the constraint Jacobian's passive columns; the pseudoinverse of its rank."""
        left, sizes, rows = np.linalg.svd(self.constraint_jacobian[:, self.robot.passive], full_matrices=False)
        rank = self.robot.rank
        with np.errstate(divide="ignore", invalid="ignore"):
            return _frozen(np.asarray((rows[:rank].T / sizes[:rank]) @ left[:, :rank].T))

    def moved_to(self, q: npt.ArrayLike) -> ClosedPosture:
        """Move the actuators to ``q`` along the straight line of commands, and close the loops there.

        The line is divided into steps so short that Newton's method converges from each step to the next and the closures'
        derivative changes little in comparison with its distance from a singularity: the posture stays in its assembly mode.

        From home, where the straight line is blocked, other ways are tried: the actuators one after the other, in their order
        or in the reverse order, and for an actuator without limits also the same angle within half a turn of home.

        Parameters
        ----------
        q
            (n,) commands, m or rad.

        Raises
        ------
        UnreachableError
            If the loops can't be closed at some point of the line; the message gives the last commands at which they close.
        SingularityError
            If the line comes too near a singularity.
        """
        target, kinematics = _commands(self.robot, q), nominal(self.robot)
        loops, placed = kinematics.loops, kinematics.placed
        if not loops.count:
            return ClosedPosture(self.robot, target, self.robot.with_commands(self._configuration, target), self.frame)
        if np.array_equal(self._configuration, kinematics.at_home.X[0]) and np.array_equal(self.q, self.robot.home_q):
            X = kinematics.forward(target[None]).configuration
            if X is not None and np.isfinite(X).all():
                return ClosedPosture(self.robot, target, X[0], self.frame)
        start = loops.at(self._configuration[None], placed)
        last, reached, done = kinematics.follow(start, np.stack([self.q, target])[None], placed)
        if not reached.all():
            self._give_up(kinematics, target, last, float(done[0]))
        return ClosedPosture(self.robot, target, last.X[0], self.frame)

    def _give_up(self, kinematics: Kinematics, target: Floats, last: Here, done: float) -> None:
        loops = kinematics.loops
        here, home = (float(loops.amplification(loops.equations(x).D)[0]) for x in (last, kinematics.at_home))
        stopped = self.q + done * (target - self.q)
        where = (
            f"commands {_text(target)} can't be reached by {self.robot.name}: on the way to them, at {_text(stopped)},"
        )
        if here > NEARLY_SINGULAR * home:
            raise SingularityError(f"{where} it comes too near a singularity", hint="stay on this side of it")
        raise UnreachableError(f"{where} the loops open", hint="stay inside the workspace")

    def __repr__(self) -> str:
        return f"ClosedPosture({self.robot.name!r}, q={_text(self.q)}, T={_text(self.T)})"


def home(robot: Chain) -> ClosedPosture:
    """The home posture: the loops closed at the home commands. It selects the assembly mode.

    Raises
    ------
    UnreachableError
        If the loops don't close at these commands.
    AssemblyModeError
        If the TCP's pose is more than 0.1 m or 0.2 rad from the one that the URDF's ``<home>`` gives.

    Examples
    --------
    >>> import gtpin
    >>> posture = gtpin.home(gtpin.load_robot("gantry_tau"))
    >>> posture.T.shape, posture.R.shape
    ((3,), (3, 3))
    """
    check_kind(robot, Chain)
    return ClosedPosture(robot, robot.home_q, nominal(robot).at_home.X[0])


def geometry_jacobian(posture: ClosedPosture, geometry: Geometry) -> Floats:
    """(6, p) derivative of the TCP's pose by geometric parameters: position (m) and rotation vector (rad), base frame.

    Parameters
    ----------
    posture
        A posture of the robot whose URDF has this geometry.
    geometry
        Its p parameters, at their nominal values.

    Raises
    ------
    ModelError
        If the geometry is not that of the posture's robot.

    Examples
    --------
    >>> import gtpin
    >>> robot = gtpin.load_robot("gantry_tau")
    >>> gtpin.geometry_jacobian(gtpin.home(robot), gtpin.Geometry.nominal(robot)).shape
    (6, 48)
    """
    robot = posture.robot
    if robot.description.xml != geometry.robot.description.xml or robot.tcp_frame != geometry.robot.tcp_frame:
        raise ModelError("the geometry is another robot's", hint="load both from one URDF")
    if type(geometry) is not Geometry:
        raise ModelError("shared rods and measured tracks are not in the URDF", hint="use the model's kinematics")
    if not geometry.is_nominal:
        raise ModelError("the posture is not of this geometry", hint="load the calibrated URDF and move its home there")
    poses = Poses(posture.T[None], posture.R[None], configuration=posture.configuration[None])
    return _frozen(Kinematics(geometry).geometry_jacobian(posture.q[None], poses)[0, :6])


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
    rest = np.zeros((1, posture.robot.n_actuators))
    on_tool = (real(x, "loads on the tool")[None] for x in (force, moment, payload))
    found = Moving(posture.robot, posture.configuration[None]).forces(rest, rest, *on_tool)
    return Forces(found.actuators[0], found.loops[0], found.rods[0])


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
    found = kinematics.loads(q, poses, force, payload).rods
    if not np.isfinite(found).all():
        raise SingularityError("the rods can't hold the platform at one of the poses", hint="leave it out")
    return found


def _commands(robot: Chain, q: npt.ArrayLike) -> Floats:
    values = real(q, f"commands for {robot.name}", f"give {robot.n_actuators} finite numbers")
    if values.shape != (robot.n_actuators,) or not np.isfinite(values).all():
        raise UnreachableError(f"commands {q!r} for {robot.name}", hint=f"give {robot.n_actuators} finite numbers")
    return values


def _frozen(array: Floats) -> Floats:
    array.flags.writeable = False
    return array


def _text(values: Floats) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"
