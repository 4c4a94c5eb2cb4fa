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
from gtpin.kinematics.inverse import out_of_reach, solved
from gtpin.kinematics.kinematics import Kinematics, kinematics
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.posture import ClosedPosture, home
from gtpin.robot import library
from gtpin.robot.chain import Chain
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats


class Robot(Chain):
    """A robot: a chain, a tree or loops of joints, with the n commands of its actuators and the TCP that they move.

    :func:`load_robot` makes it. Commands are in m for an actuator that slides and in rad for one that turns, in the order of
    :attr:`sites`. Poses are of the TCP frame in the base frame. These are the nominal kinematics; those of a calibrated or
    diagnosed machine are in :class:`~gtpin.model.model.Model`.

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

    @cached_property
    def _kinematics(self) -> Kinematics:
        return kinematics(Geometry.nominal(self))

    def forward(self, q: npt.ArrayLike) -> Any:
        """The pose of the TCP at commands: forward kinematics.

        Parameters
        ----------
        q
            (n,) commands, or (N, n) for N poses at once, m or rad.

        Returns
        -------
        posture or poses
            Of one command, the :class:`ClosedPosture`: ``T`` (3,) position, m, and ``R`` (3, 3) rotation from the TCP frame to
            the base frame; ``tcp`` is both as ``pinocchio.SE3``. Of many, the :class:`Poses`: ``T`` (N, 3) and ``R`` (N, 3, 3).

        Raises
        ------
        ModelError
            If q has another shape, or is not of finite numbers.
        ClosureError
            If the loops can't be closed at these commands; of many, the message has the index of the first such row.

        Examples
        --------
        >>> import numpy as np
        >>> import gtpin
        >>> ur5 = gtpin.load_robot("ur5")
        >>> ur5.forward(np.zeros(6)).T.shape, ur5.forward(np.zeros((10, 6))).T.shape
        ((3,), (10, 3))
        """
        commands = self._commands(q)
        return self._home.moved_to(commands) if commands.ndim == 1 else self._poses(commands)

    def jacobian(self, q: npt.ArrayLike) -> Floats:
        """The derivative of the TCP's pose by the commands.

        Parameters
        ----------
        q
            (n,) commands, or (N, n), m or rad.

        Returns
        -------
        J
            (6, n), or (N, 6, n): position (m), then rotation vector (rad), in the axes of the base frame, per m or rad of each
            command. For an open chain this is Pinocchio's frame Jacobian with ``LOCAL_WORLD_ALIGNED``.

        Raises
        ------
        ModelError, ClosureError
            As :meth:`forward`.
        """
        commands = self._commands(q)
        if commands.ndim == 1:
            return self._home.moved_to(commands).jacobian.copy()
        return self._kinematics.command_jacobian(commands, self._poses(commands))[:, :6]

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
        ModelError
            If an argument has another shape.
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
        q = solved(self._kinematics, T, R, np.array(np.broadcast_to(near, (len(T), self.n_actuators))))
        lost = np.flatnonzero(~np.isfinite(q).all(axis=1))
        if lost.size:
            raise out_of_reach(self.name, T[lost[0]], R is not None, row=int(lost[0]) if many else None)
        return q if many else q[0]

    def _commands(self, q: npt.ArrayLike) -> Floats:
        """Commands as an array (n,) or (N, n) of finite numbers; `ModelError` where they are none."""
        try:
            commands = np.asarray(q, dtype=float)
        except (TypeError, ValueError):
            commands = np.array(np.nan)
        if commands.ndim not in (1, 2) or commands.shape[-1] != self.n_actuators or not np.isfinite(commands).all():
            shape = f"shape {commands.shape}" if commands.ndim in (1, 2) else f"{type(q).__name__}"
            n = self.n_actuators
            raise ModelError(f"commands of {shape} for {self.name}", hint=f"give {n} finite numbers, or N rows of {n}")
        return commands

    def _poses(self, q: Floats) -> Poses:
        """Poses (N) at commands (N, n); `ClosureError` where one can't be reached."""
        poses = self._kinematics.forward(q)
        for row in np.flatnonzero(~poses.reached)[:1]:
            try:
                self._home.moved_to(q[row])
            except ClosureError as error:
                raise type(error)(f"row {row}: {error.what}", hint=error.hint) from None
            raise out_of_reach(self.name, q[row], False, row=int(row))
        return poses


def _wanted(T: Any, R: npt.ArrayLike | None) -> tuple[Floats, Floats | None]:
    """Positions (3,) or (N, 3), and rotations or None, of what :meth:`Robot.inverse` takes."""
    if R is None and isinstance(T, (ClosedPosture, Poses)):
        return T.T, T.R
    if R is None and isinstance(T, pin.SE3):
        return np.array(T.translation), np.array(T.rotation)
    try:
        wanted, rotations = np.asarray(T, dtype=float), None if R is None else np.asarray(R, dtype=float)
    except (TypeError, ValueError):
        wanted, rotations = np.array(np.nan), None
    if rotations is None and wanted.ndim in (2, 3) and wanted.shape[-2:] == (4, 4):
        return wanted[..., :3, 3], wanted[..., :3, :3]
    if wanted.ndim not in (1, 2) or wanted.shape[-1] != 3:
        shape = f"of shape {wanted.shape}" if wanted.ndim else f"{type(T).__name__}"
        raise ModelError(
            f"wanted poses {shape}", hint="give (3,), (N, 3), (4, 4) or (N, 4, 4) numbers, or a pinocchio.SE3"
        )
    if rotations is not None and rotations.shape != (*wanted.shape[:-1], 3, 3):
        hint = "give one 3 x 3 matrix for each position"
        raise ModelError(f"wanted rotations of shape {rotations.shape} for positions {wanted.shape}", hint=hint)
    return wanted, rotations


def load_robot(robot: str | Path, tcp: str | None = None, actuators: Sequence[str] = ()) -> Robot:
    """Load a robot by its name or by the path of its URDF or MJCF file.

    Parameters
    ----------
    robot
        The name of a shipped robot, or of one of the package example-robot-data; or a path. A string is a path if it ends in
        ``.urdf``, ``.xml``, ``.mjcf`` or ``.yaml`` (the loops of the URDF of the same name beside it), if it contains a
        separator, or if a file but no robot has this name.
    tcp
        The link whose pose is the robot's pose; None: the one that the file names.
    actuators
        The joints that are commanded, in the order of q; by default those that the file names, else all that move.

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
    return library.loaded(Robot, robot, tcp, actuators)
