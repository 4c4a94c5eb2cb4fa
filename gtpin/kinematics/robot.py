"""The robot that users hold: forward and inverse kinematics and the Jacobian, for one command or many at once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from gtpin.errors import ClosureError, ModelError
from gtpin.kinematics.dynamics import Forces
from gtpin.kinematics.frames import Moving, frame_of
from gtpin.kinematics.inverse import out_of_reach, solved
from gtpin.kinematics.kinematics import nominal
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.posture import ClosedPosture, home
from gtpin.real import real
from gtpin.robot import library
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

WANTED = "give (3,), (N, 3), (4, 4) or (N, 4, 4) numbers, or a pinocchio.SE3"
LARGEST = 1e6
"""Largest command, m or rad: of larger angles a float does not hold a microradian's part."""


class Robot(Chain):
    """A robot: a chain, a tree or loops of joints, with the n commands of its actuators and the TCP that they move.

    :func:`load_robot` makes it. Commands are in m for an actuator that slides and in rad for one that turns, in the order of
    :attr:`sites`. Poses are of the TCP frame in the base frame. These are the nominal kinematics; those of a calibrated or
    diagnosed machine are in :class:`~gtpin.model.model.Model`.

    All methods take one row of commands, velocities or accelerations (n,), or N rows (N, n), and give results of one or of N.
    They raise `ModelError` for an argument of another shape, for what is not finite, and for a frame that there is not, and
    `ClosureError` if the loops can't be closed at the commands; of many, the message has the index of the first such row.

    Parameters
    ----------
    description, tcp
        As for :class:`~gtpin.robot.constrained_model.ConstrainedModel`.

    Raises
    ------
    RobotError
        If the file does not describe a complete robot.

    Examples
    --------
    >>> import gtpin
    >>> robot = gtpin.load_robot("gantry_tau")
    >>> robot.n_actuators, robot.sites, robot.rod_sites
    (3, ('cart1', 'cart2', 'cart3'), ('link1', 'link2a', 'link2b', 'link3a', 'link3b', 'link3c'))
    >>> pose = robot.forward([0.1, 0.1, 0.2])
    >>> robot.inverse(pose.T).round(9).tolist()
    [0.1, 0.1, 0.2]
    >>> robot.jacobian([0.1, 0.1, 0.2]).shape
    (6, 3)
    """

    @cached_property
    def _home(self) -> ClosedPosture:
        return home(self)

    def forward(self, q: npt.ArrayLike, frame: str | None = None) -> Any:
        """The pose of the TCP, or of another frame, at commands: forward kinematics.

        Parameters
        ----------
        q
            (n,) commands, or (N, n) for N poses at once, m or rad.
        frame
            The name of a link, or of another frame of :attr:`model`; None: the TCP.

        Returns
        -------
        posture or poses
            Of one command, the :class:`ClosedPosture`: ``T`` (3,) position, m, and ``R`` (3, 3) rotation from the frame to
            the base frame; ``tcp`` is both as ``pinocchio.SE3``. Of many, the :class:`Poses`: ``T`` (N, 3) and ``R`` (N, 3, 3).

        Examples
        --------
        >>> import numpy as np
        >>> import gtpin
        >>> ur5 = gtpin.load_robot("ur5")
        >>> ur5.forward(np.zeros(6)).T.shape, ur5.forward(np.zeros((10, 6))).T.shape
        ((3,), (10, 3))
        """
        commands = self._commands(q)
        if commands.ndim == 1:
            return self._home.of(frame).moved_to(commands)
        if frame is None:
            return self._poses(commands)
        moving = self._moving(commands)
        return Poses(*moving.poses(frame_of(self, frame)), configuration=moving.X if self.constraints else None)

    def jacobian(self, q: npt.ArrayLike, frame: str | None = None) -> Floats:
        """The derivative of the pose of the TCP, or of another frame, by the commands.

        Parameters
        ----------
        q
            (n,) commands, or (N, n), m or rad.
        frame
            As for :meth:`forward`.

        Returns
        -------
        J
            (6, n), or (N, 6, n): position (m), then rotation vector (rad), in the axes of the base frame, per m or rad of each
            command. For an open chain this is Pinocchio's frame Jacobian with ``LOCAL_WORLD_ALIGNED``.
        """
        commands = self._commands(q)
        if commands.ndim == 1:
            return self._home.of(frame).moved_to(commands).jacobian.copy()
        if frame is not None:
            return self._moving(commands).jacobian(frame_of(self, frame))
        return nominal(self).command_jacobian(commands, self._poses(commands))[:, :6]

    def velocity(self, q: npt.ArrayLike, v: npt.ArrayLike, frame: str | None = None) -> Floats:
        """The velocity of the TCP, or of another frame, at velocities of the commands.

        Parameters
        ----------
        q, v
            (n,) or (N, n) commands, m or rad, and their velocities, m/s or rad/s; (n,) velocities are those at all N.
        frame
            As for :meth:`forward`.

        Returns
        -------
        velocity
            (6,) or (N, 6): of the frame's origin, m/s, then angular, rad/s, in the axes of the base frame.
        """
        return _like(q, self._moving(q).velocity(frame_of(self, frame), self._with(q, v)))

    def acceleration(self, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike, frame: str | None = None) -> Floats:
        """The acceleration of the TCP, or of another frame, at velocities and accelerations of the commands.

        It is ``jacobian(q, frame) a`` plus the drift, the time derivative of this Jacobian times v, which a = 0 gives alone.

        Parameters
        ----------
        q, v, a
            (n,) or (N, n) commands, m or rad, their velocities and accelerations; (n,) of the latter are those at all N.
        frame
            As for :meth:`forward`.

        Returns
        -------
        acceleration
            (6,) or (N, 6): of the frame's origin, m/s^2, then angular, rad/s^2, in the axes of the base frame: Pinocchio's
            classical acceleration, in which the passive joints accelerate so that the loops stay closed.
        """
        moving, rates = self._moving(q), (self._with(q, v), self._with(q, a))
        V, A = moving.velocities(rates[0]), moving.accelerations(*rates)
        return _like(q, moving.acceleration([frame_of(self, frame)], V, A)[:, 0])

    def inverse_dynamics(
        self,
        q: npt.ArrayLike,
        v: npt.ArrayLike,
        a: npt.ArrayLike,
        force: npt.ArrayLike | None = None,
        payload: npt.ArrayLike | None = None,
        moment: npt.ArrayLike | None = None,
    ) -> Floats:
        """The forces of the actuators that give a motion: inverse dynamics, with the masses of the robot's file.

        Bodies are rigid and joints have no friction. At v = a = 0 these are the static forces.

        Parameters
        ----------
        q, v, a
            As for :meth:`acceleration`.
        force, moment
            (3,) or (N, 3) force, N, and moment, N m, on the tool at the TCP of the robot's file, base frame; None: zero.
        payload
            Point mass held at this TCP, kg, one number or (N,), with its weight and inertia; None: zero.

        Returns
        -------
        forces
            (n,) or (N, n) force, N, or torque, N m, that each actuator must apply, positive in the direction of its command.

        Examples
        --------
        >>> import gtpin
        >>> robot = gtpin.load_robot("gantry_tau")
        >>> robot.inverse_dynamics(robot.home_q, [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]).shape
        (3,)
        """
        return _like(q, self._moving(q).actuator_forces(*self._loaded(q, v, a, force, moment, payload)))

    def forces(
        self,
        q: npt.ArrayLike,
        v: npt.ArrayLike,
        a: npt.ArrayLike,
        force: npt.ArrayLike | None = None,
        payload: npt.ArrayLike | None = None,
        moment: npt.ArrayLike | None = None,
    ) -> Forces:
        """As :meth:`inverse_dynamics`, with the constraint forces in the loops and the axial forces of the rods.

        Raises
        ------
        ModelError
            Also if the loops are redundant, so that nothing determines their forces.
        """
        found = self._moving(q).forces(*self._loaded(q, v, a, force, moment, payload))
        return Forces(*(_like(q, part) for part in (found.actuators, found.loops, found.rods)))

    def reflected_inertia(self, q: npt.ArrayLike) -> Floats:
        """The inertia matrix at the actuators: G' M G, with Pinocchio's M and the derivative G of all joints by the commands.

        Parameters
        ----------
        q
            (n,) or (N, n) commands, m or rad.

        Returns
        -------
        M
            (n, n) or (N, n, n): the kinetic energy is v' M v / 2 at velocities v (n,) of the commands; kg where the two
            actuators slide, kg m^2 where they turn, kg m where one slides and one turns.
        """
        return _like(q, self._moving(q).inertia())

    def inverse(self, T: Any, R: npt.ArrayLike | None = None, start: npt.ArrayLike | None = None) -> Floats:
        """Commands that bring the TCP to a pose: inverse kinematics, by Newton's method.

        Parameters
        ----------
        T
            (3,) or (N, 3) wanted positions, base frame, m: the orientation is free. Or whole poses: (4, 4) or (N, 4, 4)
            homogeneous matrices, a ``pinocchio.SE3``, or what :meth:`forward` returns.
        R
            (3, 3) or (N, 3, 3) wanted rotations from the TCP frame to the base frame, beside positions T.
        start
            (n,) or (N, n) commands near the wanted ones, m or rad; home by default. Of several solutions, one near the start
            is found.

        Returns
        -------
        q
            (n,) or (N, n) commands, m or rad, within their ranges. The pose there is the wanted one to 1e-10 m and rad.

        Raises
        ------
        UnreachableError
            If no such commands were found; of many poses, the message has the index of the first such row.

        Examples
        --------
        >>> import numpy as np
        >>> import gtpin
        >>> ur5 = gtpin.load_robot("ur5")
        >>> pose = ur5.forward([0.1, -1.0, 1.2, 0.3, 0.8, -0.4])
        >>> q = ur5.inverse(pose)
        >>> print(f"{np.abs(ur5.forward(q).T - pose.T).max():.6f} m")
        0.000000 m
        """
        T, R = _wanted(T, R)
        many, T = T.ndim == 2, np.atleast_2d(T)
        R = None if R is None else np.reshape(R, (-1, 3, 3))
        near = self.home_q if start is None else self._commands(start)
        if near.ndim == 2 and len(near) != len(T):
            raise ModelError(f"{len(near)} commands to start from for {len(T)} poses", hint="give one for each, or one")
        q = solved(nominal(self), T, R, np.array(np.broadcast_to(near, (len(T), self.n_actuators))))
        lost = np.flatnonzero(~np.isfinite(q).all(axis=1))
        if lost.size:
            raise out_of_reach(self.name, T[lost[0]], R is not None, row=int(lost[0]) if many else None)
        return q if many else q[0]

    def _commands(self, q: npt.ArrayLike) -> Floats:
        """Commands as an array (n,) or (N, n) of finite numbers; `ModelError` where they are none."""
        n = self.n_actuators
        hint = f"give {n} finite numbers, or N rows of {n}"
        commands = real(q, f"commands for {self.name}", hint)
        if commands.ndim not in (1, 2) or commands.shape[-1] != n or not np.isfinite(commands).all():
            raise ModelError(f"commands of shape {commands.shape} for {self.name}", hint=hint)
        if np.abs(commands).max(initial=0.0) > LARGEST:
            raise ModelError(f"commands of {np.abs(commands).max():.3g} for {self.name}", hint="give m and rad")
        return commands

    def _with(self, q: npt.ArrayLike, rates: npt.ArrayLike) -> Floats:
        """Velocities or accelerations (N, n) for N commands q, of (N, n) or (n,) of all."""
        return _rows_of(self._commands(rates), (np.atleast_2d(np.asarray(q)).shape[0], self.n_actuators), "velocities")

    def _loaded(
        self, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike, *tool: npt.ArrayLike | None
    ) -> list[Floats]:
        """Velocities, accelerations, and force, moment and payload on the tool, of N commands."""
        n = np.atleast_2d(np.asarray(q)).shape[0]
        shapes = zip(tool, ((n, 3), (n, 3), (n,)), ("forces", "moments", "payloads"), strict=True)
        loads = [_rows_of(0.0 if given is None else given, shape, what) for given, shape, what in shapes]
        return [self._with(q, v), self._with(q, a), *loads]

    def _moving(self, q: npt.ArrayLike) -> Moving:
        commands = np.atleast_2d(self._commands(q))
        configuration = self._poses(commands).configuration
        if configuration is None:  # of a tree
            configuration = self.with_commands(self.neutral, commands)
        return Moving(self, configuration)

    def _poses(self, q: Floats) -> Poses:
        """Poses (N) at commands (N, n); `ClosureError` where one can't be reached."""
        poses = nominal(self).forward(q)
        for row in np.flatnonzero(~poses.reached)[:1]:
            try:
                self._home.moved_to(q[row])
            except ClosureError as error:
                raise type(error)(f"row {row}: {error.what}", hint=error.hint) from None
            raise out_of_reach(self.name, q[row], False, row=int(row))
        return poses


def load_robot(
    robot: str | Path | pin.Model,
    tcp: str | None = None,
    actuators: Sequence[str] = (),
    home: Sequence[float] | str = (),
    constraints: Sequence[Any] = (),
) -> Robot:
    """Load a robot by its name or by the path of its URDF or MJCF file, or take a Pinocchio model.

    Parameters
    ----------
    robot
        The name of a shipped robot, or of one of the package example-robot-data; or a path. A string is a path if it ends in
        ``.urdf``, ``.xml``, ``.mjcf`` or ``.yaml`` (the loops of the URDF of the same name beside it), if it contains a
        separator, or if a file but no robot has this name. Or a ``pinocchio.Model``: what is supported of it is in
        :func:`~gtpin.robot.pinocchio_model.urdf_of`.
    tcp
        The link whose pose is the robot's pose; None: the one that the file names.
    actuators
        The joints that are commanded, in the order of q; by default those that the file names, else all that move.
    home
        (n,) commands, m or rad, of the home posture, which chooses the assembly; or the name of a keyframe of an MJCF. By
        default the home that the file names: of an MJCF its first keyframe. Of a ``pinocchio.Model``, the name of one of its
        reference configurations.
    constraints
        The constraint models that close the loops of a ``pinocchio.Model``: ``RigidConstraintModel`` (3D or 6D),
        ``PointAnchorConstraintModel`` or ``FrameAnchorConstraintModel``. ``actuators`` then names the driven joints.

    Raises
    ------
    RobotError
        If there is no such robot, or its file is not a valid robot.

    Warns
    -----
    GtpinWarning
        Names the posture at home where the file does not choose among several, passive motions that the loops do not
        determine, and actuators that do not move the TCP.

    Examples
    --------
    >>> import gtpin
    >>> gtpin.load_robot("gantry_tau").sites
    ('cart1', 'cart2', 'cart3')
    >>> gtpin.load_robot("panda", tcp="panda_hand", actuators=[f"panda_joint{i}" for i in range(1, 8)]).n_actuators
    7
    """
    return library.loaded(Robot, robot, tcp, actuators, home, constraints)


def _like(q: npt.ArrayLike, found: Floats) -> Floats:
    """Results (N, ...) as they are for commands (N, n); the first for one command (n,)."""
    return found if np.ndim(q) == 2 else found[0]


def _rows_of(values: npt.ArrayLike, shape: tuple[int, ...], what: str) -> Floats:
    """Values as an array of a shape; `ModelError` where they are no finite numbers, or don't fit."""
    given = real(values, what)
    try:
        found = np.array(np.broadcast_to(given, shape))
    except ValueError:
        found = np.array(np.nan)
    if not np.isfinite(found).all():
        raise ModelError(f"{what} that don't fit {shape[0]} commands", hint=f"give finite numbers of the shape {shape}")
    return found


def _wanted(T: Any, R: npt.ArrayLike | None) -> tuple[Floats, Floats | None]:
    """Positions (3,) or (N, 3), and rotations or None, of what :meth:`Robot.inverse` takes."""
    if isinstance(T, ClosedPosture) and T.frame is not None:
        raise ModelError(f"a pose of {T.frame}", hint="give one of the TCP, or load the robot with tcp=")
    if R is None and isinstance(T, (ClosedPosture, Poses)):
        return T.T, T.R
    if R is None and isinstance(T, pin.SE3):
        return np.array(T.translation), np.array(T.rotation)
    wanted = real(T, "wanted poses", WANTED)
    rotations = None if R is None else real(R, "wanted rotations")
    if rotations is None and wanted.ndim in (2, 3) and wanted.shape[-2:] == (4, 4):
        return wanted[..., :3, 3], wanted[..., :3, :3]
    if wanted.ndim not in (1, 2) or wanted.shape[-1] != 3:
        raise ModelError(f"wanted poses of shape {wanted.shape}", hint=WANTED)
    if rotations is not None and rotations.shape != (*wanted.shape[:-1], 3, 3):
        hint = "give one 3 x 3 matrix for each position"
        raise ModelError(f"wanted rotations of shape {rotations.shape} for positions {wanted.shape}", hint=hint)
    return wanted, rotations
