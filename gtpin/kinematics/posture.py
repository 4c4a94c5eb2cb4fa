"""A closed posture: forward kinematics and its derivatives, from Pinocchio."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from gtpin.errors import AssemblyModeError, ClosureError, SingularityError, UnreachableError, check_kind
from gtpin.kinematics import newton
from gtpin.robot.assembly import NEAR, closest
from gtpin.robot.chain import Chain
from gtpin.robot.constraints import constraint_jacobian
from gtpin.typing import Floats

HOME_OFF = 0.1
"""Distance, m, from the home in the URDF, beyond which the loops count as closed in another assembly mode. Assumed."""
HOME_TURNED = 0.2
"""Angle, rad, from the home in the URDF, beyond which they count so too. Assumed: both are far larger than rounding errors,
and smaller than the difference of assembly modes."""
MOST_KEPT = 2_000
"""Most postures that are kept of those that were reached from a home: 6 MB of a five-bar, 33 MB of a Gantry-Tau with its
derivatives, for each geometry."""
MOST_FOUND = 50_000
"""Most commands whose configurations are kept of a nominal robot: 20 MB of a five-bar."""
SMALLEST_STEP = 1.0 / 4096.0
"""Smallest step as a fraction of the line to the target; where a smaller one is needed, the target is given up. A line of 1 rad
that passes a limit of a five-bar of 1 m at a distance of 1 um needs no smaller ones."""
DISPLACED = 100.0
"""Such a ratio of a robot with displaced joints, above which the nominal robot's posture is not used to start from. Assumed."""
AIM = 0.7 * newton.CHANGE
"""Change of the closures' derivative that a step aims at."""
SINGULAR = 1e3
"""Ratio of a posture's amplification to that of home, above which it counts as near a singularity. Assumed."""


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
    jacobian
        (m, nv) constraint Jacobian (not the property :attr:`jacobian`) at this configuration or within a Newton step of it. It
        identifies the assembly mode and predicts the next posture.
    reference
        The home posture, whose assembly mode this posture has; None for the home posture itself.
    steps
        Number of Newton steps that closed the loops.

    Examples
    --------
    >>> import gtpin
    >>> robot = gtpin.load_robot("gantry_tau")
    >>> posture = gtpin.home(robot).moved_to(robot.home_q + [0.05, 0.0, 0.0])
    >>> posture.jacobian.shape
    (6, 3)
    """

    def __init__(
        self,
        robot: Chain,
        q: Floats,
        configuration: Floats,
        jacobian: Floats,
        reference: ClosedPosture | None,
        steps: int,
    ) -> None:
        self.robot = robot
        self.steps = steps
        self._q = _frozen(q.copy())
        self._configuration = configuration.copy()
        self._configuration.flags.writeable = False
        self._nearby = jacobian
        self._home = self if reference is None else reference
        self._nominal: ClosedPosture | None = None
        self._reached: dict[bytes, ClosedPosture | ClosureError] = {}
        self._found: dict[bytes, Floats | None] = {}

    @property
    def configuration(self) -> Floats:
        """(nq,) Pinocchio configuration, read-only."""
        return self._configuration

    @property
    def q(self) -> Floats:
        """(n,) commands, m or rad, read-only."""
        return self._q

    @property
    def tcp(self) -> Any:
        """The TCP frame in the base frame, a ``pinocchio.SE3`` (m). A copy: changing it does not change the posture."""
        return self._tcp.copy()

    @cached_property
    def _tcp(self) -> Any:
        return self.placement(self.robot.tcp_joint) * self.robot.tcp_placement

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
        pin.forwardKinematics(self.robot.model, self.robot.data, self._configuration)
        return self.robot.data.oMi[joint_id].copy()

    def refresh(self) -> Any:
        """The robot's ``pinocchio.Data``, with the joint placements and joint Jacobians of this posture.

        All postures of a robot share it: a call for another posture overwrites it.
        """
        pin.computeJointJacobians(self.robot.model, self.robot.data, self._configuration)
        return self.robot.data

    @cached_property
    def constraint_jacobian(self) -> Floats:
        """(m, nv) derivative of the m loop equations by Pinocchio velocities.

        A loop equation is a component of the gap between a loop's two anchors, in metres, in the frame of the first anchor.
        """
        self.refresh()
        return _frozen(constraint_jacobian(self.robot))

    @cached_property
    def tcp_jacobian(self) -> Floats:
        """(6, nv) derivative of the TCP by Pinocchio velocities: position (m) and rotation vector (rad), base frame.

        The column of a joint that other joints follow (``<mimic>``) includes the motion of these joints.
        """
        data = self.refresh()
        frame = pin.getFrameJacobian(
            self.robot.model, data, self.robot.tcp_joint, self.robot.tcp_placement, pin.LOCAL_WORLD_ALIGNED
        )
        return _frozen(self.robot.folded(np.reshape(np.array(frame), (6, self.robot.model.nv))))

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
        """(n_passive, m) inverse of the constraint Jacobian's passive columns; the pseudoinverse if they are not square."""
        return _frozen(newton.Passive(self.constraint_jacobian[:, self.robot.passive], self.robot.rank).inverse)

    @cached_property
    def _passive(self) -> newton.Passive:
        return newton.Passive(self._nearby[:, self.robot.passive], self.robot.rank)

    @property
    def amplification(self) -> float:
        """Frobenius norm of :attr:`passive_inverse`, to within a Newton step: infinite at a singularity."""
        return self._passive.amplification

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
        target = _commands(self.robot, q)
        if self is not self._home:
            return self._along(target)
        # Poses and their derivatives are computed at the same commands, one after the other.
        place = target.tobytes()
        if place not in self._reached:
            if len(self._reached) >= MOST_KEPT:
                self._reached.clear()
            try:
                self._reached[place] = self._from_home(target)
            except ClosureError as error:
                self._reached[place] = error
        found = self._reached[place]
        if isinstance(found, ClosureError):
            raise found
        return found

    def _from_home(self, target: Floats) -> ClosedPosture:
        """As :meth:`moved_to`, from home to valid commands."""
        known = None if self._nominal is None else self._nominal._configuration_at(target)
        if known is not None:
            # From the posture of the nominal robot: its assembly mode, without the way from home.
            trial = self._closed_at(target, newton.close(self.robot, known, change=newton.CHANGE))
            if trial is not None and trial.amplification <= DISPLACED * self.amplification:
                return trial
        try:
            return self._along(target)
        except ClosureError:
            # For a displaced robot the nominal one was asked for other ways.
            if known is None and (self._nominal is not None or not self._can_close(target)):
                raise
            for way in _ways_round(self.robot, target):
                try:
                    posture = self
                    for stop in way:
                        posture = posture._along(stop)
                except ClosureError:
                    continue
                configuration = self.robot.with_commands(posture.configuration, target)
                return ClosedPosture(self.robot, target, configuration, posture._nearby, self, posture.steps)
            raise

    def _configuration_at(self, target: Floats) -> Floats | None:
        """(nq,) configuration at commands that are reached from this home; None where they are not."""
        place = target.tobytes()
        if place not in self._found:
            if len(self._found) >= MOST_FOUND:
                self._found.clear()
            try:
                self._found[place] = self._from_home(target).configuration
            except ClosureError:
                self._found[place] = None
        return self._found[place]

    def _can_close(self, target: Floats) -> bool:
        """Whether the loops nearly close at commands in any assembly mode that is found from home."""
        start = self.robot.with_commands(self._configuration, target)
        return closest(self.robot, start, tolerance=1e-4)[1] <= 1e-3 * self.robot.size

    def _along(self, target: Floats) -> ClosedPosture:
        """To valid commands along the straight line."""
        posture, way = self, target - self.q
        done, stride = 0.0, 1.0
        while done < 1.0:
            reach = min(1.0, done + stride)
            goal = target if reach == 1.0 else self.q + reach * way
            closing = newton.close(self.robot, posture._ahead(goal), posture._passive, change=newton.CHANGE)
            trial = self._closed_at(goal, closing)
            # The change grows with the step.
            share = AIM / max(closing.change, 1e-3)
            if trial is not None:
                posture, done, stride = trial, reach, min(max(share, 0.5), 4.0) * stride
            elif (stride := min(max(share, 0.1), 0.5) * stride) < SMALLEST_STEP:
                posture._give_up(target)
        return posture

    def _closed_at(self, q: Floats, closing: newton.Closing) -> ClosedPosture | None:
        """The posture of a result of Newton's method; None where the loops are open or it is near a singularity."""
        if not closing.closed:
            return None
        found = ClosedPosture(self.robot, q, closing.configuration, closing.jacobian, self._home, closing.steps)
        return found if found.amplification <= SINGULAR * self._home.amplification else None

    def _ahead(self, q: Floats) -> Floats:
        """(nq,) configuration at other commands, with passive coordinates to first order: the next start of Newton's method."""
        robot = self.robot
        gaps = self._nearby[:, robot.driven] @ (q - self.q)
        velocity = robot.velocity(q - self.q, -self._passive.inverse @ gaps)
        return robot.with_commands(pin.integrate(robot.model, self._configuration, velocity), q)

    def _give_up(self, target: Floats) -> None:
        where = (
            f"commands {_text(target)} can't be reached by {self.robot.name}: on the way to them, at {_text(self.q)},"
        )
        if self.amplification > 10.0 * self._home.amplification:
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
    nominal = _nominal_home(robot.nominal) if robot.nominal is not robot else None
    start = robot.assembly.configuration if nominal is None else nominal.configuration
    closing = newton.close(robot, start, contraction=1.0)
    if not closing.closed:
        raise _open_at_home(robot)
    posture = ClosedPosture(robot, robot.home_q, closing.configuration, closing.jacobian, None, closing.steps)
    posture._nominal = nominal
    declared = robot.description.home
    if declared is not None:
        there = posture.placement(robot.home_joint) * robot.home_placement
        off = float(np.linalg.norm(there.translation - np.array(declared.tcp_xyz)))
        turned = float(np.linalg.norm(pin.log3(there.rotation @ pin.exp3(np.array(declared.tcp_rotvec)).T)))
        if off > HOME_OFF or turned > HOME_TURNED:
            far = f"{off:.3g} m" if off > HOME_OFF else f"{turned:.3g} rad"
            raise AssemblyModeError(
                f"the loops of {robot.name} close {far} from the home that its URDF tells", hint="mend <home>"
            )
    return posture


@lru_cache(maxsize=4)
def _nominal_home(robot: Chain) -> ClosedPosture:
    """The home posture of a nominal robot, which keeps the configurations from which displaced copies are closed."""
    return home(robot)


def _open_at_home(robot: Chain) -> UnreachableError:
    what, declared = f"the loops of {robot.name} don't close at its home", robot.description.home is not None
    gap = robot.assembly.gap
    if not declared and gap > NEAR:
        what += f": {gap:.3g} m is the smallest gap found between their anchors"
    hint = "mend <home> or the loops' anchors" if declared else "mend the joints or the loops' anchors"
    return UnreachableError(what, hint=hint)


def _ways_round(robot: Chain, target: Floats) -> Iterator[list[Floats]]:
    """Other ways from home to commands than the straight line: lists of stops, each reached on a straight line."""
    home_q, turns = robot.home_q, 2.0 * np.pi
    endless = robot.revolute & ~np.isfinite(robot.upper - robot.lower)
    wrapped = np.where(endless, target - turns * np.round((target - home_q) / turns), target)
    if (wrapped != target).any():
        yield [wrapped]
    count = robot.n_actuators
    for order in (range(count), range(count)[::-1]) if count > 1 else ():
        moved = [np.isin(np.arange(count), order[: i + 1]) for i in range(count)]
        yield [np.where(there, wrapped, home_q) for there in moved]


def _commands(robot: Chain, q: npt.ArrayLike) -> Floats:
    try:
        values = np.asarray(q, dtype=float)
    except (TypeError, ValueError):
        values = np.array(np.nan)
    if values.shape != (robot.n_actuators,) or not np.isfinite(values).all():
        raise UnreachableError(f"commands {q!r} for {robot.name}", hint=f"give {robot.n_actuators} finite numbers")
    return values


def _frozen(array: Floats) -> Floats:
    array.flags.writeable = False
    return array


def _text(values: Floats) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"
