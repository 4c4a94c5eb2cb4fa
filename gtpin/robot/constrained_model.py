"""A robot's chains as a Pinocchio model: a tree of joints, point-anchor constraints that close loops, and actuators.

Loops whose joints turn about parallel axes are planar: gtpin closes them in their plane only. A spherical ``<loop_joint>``
gives three equations. The passive joints of a planar loop can satisfy two of them. The third, across the plane, holds in the
nominal geometry, and can't be satisfied in one with deviations. A real machine has play in its bearings for it. The loop of a
spherical linkage, all of whose axes meet in one point, is the same: its anchors move on a sphere, and its plane is the sphere's
tangent plane, which is fixed in the frame of the first anchor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.linalg import block_diag

from gtpin.errors import RobotError, listed, warn
from gtpin.robot.description import ActuatorElement, Anchor, RobotDescription
from gtpin.robot.resting import followers, joint_jacobian, moving_model, neutral, put
from gtpin.typing import Floats, Mask

POSTURES = 6
"""Number of postures at which a loop's motions are examined: a planar loop moves in its plane at all of them. Assumed."""
PARALLEL = 1e-5
"""Ratio of motions across a plane to those in it, below which they count as zero: URDFs have at least five digits. Assumed."""
EVERY, NONE = np.eye(3), np.zeros((0, 3))


def postures(model: Any, neutral: Floats) -> list[Floats]:
    """Random configurations (nq,) around the neutral one, the same in each call. Their loops need not be closed."""
    rng = np.random.default_rng(0)
    return [pin.integrate(model, neutral, rng.uniform(-0.5, 0.5, model.nv)) for _ in range(POSTURES)]


def normal_of(motions: Floats, zero: float = PARALLEL) -> Floats:
    """(1, 3) unit normal of the plane of motions (3, k) of one anchor relative to the other; (0, 3) where they span no plane.

    ``zero``: ratio of motions across the plane to those in it below which they count as zero.
    """
    directions, sizes, _ = np.linalg.svd(motions)
    planar = len(sizes) == 3 and sizes[2] <= zero * sizes[0] < sizes[1]
    return np.asarray(directions[:, 2:].T) if planar else NONE


def of_further_point(normals: Floats, axis: str) -> Floats:
    """(k, 3) directions in which the second or third point of a loop of type ``fixed`` is not closed.

    Two frames coincide if their origins do, the point on x in y and z, and the point on y in z. In a plane one equation is
    enough: the point farther off the normal, along the plane and across its lever.

    ``normals``: those of the loop's origin. ``axis``: ``x`` or ``y``.
    """
    if not len(normals):
        return EVERY[:1] if axis == "x" else EVERY[:2]
    ways = np.cross(normals[0], EVERY[:2])
    lengths = np.linalg.norm(ways, axis=1)
    point = int(np.argmax(lengths))
    return axes_of(ways[point : point + 1] / lengths[point]) if axis == "xy"[point] and len(normals) == 1 else EVERY


def axes_of(normals: Floats) -> Floats:
    """(3 - k, 3) orthogonal unit vectors across orthogonal normals (k, 3)."""
    return np.asarray(np.linalg.svd(normals)[2][len(normals) :])


FARTHEST = 1e5
"""Distance of a joint from the base, m, from which rounding errors spoil a calibration, so that a robot is refused."""


@dataclass(frozen=True)
class Actuator:
    """A driven joint of one degree of freedom.

    - ``joint``, ``site``: name of the URDF joint, and of the part that it moves (``cart1``, ``leg3``).
    - ``joint_id``, ``index_q``, ``index_v``: the joint's index in Pinocchio, and its first index in a configuration and in
      a velocity.
    - ``lower``, ``upper``: range of its command, m or rad; infinite where the URDF gives none.
    - ``revolute``: True for a revolute joint (rad), False for a prismatic one (m).
    - ``axis``: (3,) direction of the joint's axis with all commands zero, a unit vector in the base frame.
    - ``origin``: (3,) a point of this axis with all commands zero, base frame, m.
    - ``scale_unknown``: whether the drive scale (travel per commanded unit) is always a parameter of the geometry:
      ``scale="unknown"`` in the URDF.
    """

    joint: str
    site: str
    joint_id: int
    index_q: int
    index_v: int
    lower: float
    upper: float
    revolute: bool
    axis: Floats
    origin: Floats
    scale_unknown: bool = False


class ConstrainedModel:
    """A robot's kinematic chains as a Pinocchio model with constraints, built from the URDF alone.

    Every ``<loop_joint>`` is a ``PointAnchorConstraintModel``. The base frame is the frame of the URDF's root link. Commands
    ``q`` are in the order of the ``<actuator>`` elements; Pinocchio's order may differ. A robot without loops and without a
    ``<gtpin>`` element works too: every moving joint is then an actuator, in document order. Joints with ``<mimic>`` follow
    their masters. Moving joints that no command and no loop moves stay at Pinocchio's neutral configuration.

    Parameters
    ----------
    description
        What the URDF says.
    tcp
        The link whose pose is the robot's pose; by default the one that ``<platform>`` names, or ``tool0``, or the end of
        the longest chain: see :class:`~gtpin.robot.tree.Tree`.

    Attributes
    ----------
    model : pinocchio.Model
    constraints : tuple of pinocchio.PointAnchorConstraintModel
        In the order of the loops.
    constraint_models : pinocchio.StdVec_ConstraintModel
        The same, as ``pinocchio.getConstraintsJacobian`` takes them.
    anchors : tuple of (int, pinocchio.SE3)
        For each of the 2 L anchors of L loops, the joint that carries it and its placement on this joint.
    actuators : tuple of Actuator
    driven : list of int
        Velocity indices of the actuators.
    passive : int array
        Velocity indices of the coordinates that the loops alone determine, ``n_passive`` of them.
    followers : tuple of Follower
        Joints that follow others, whose coordinates are neither driven nor passive: see :meth:`folded`.
    tcp_joint, tcp_placement
        The joint that carries the TCP frame, and the frame's placement on it. Payloads and tool forces act there, also where
        the measured target is elsewhere.
    planes : tuple of (k, 3) arrays
        For each loop the directions, in the frame of its first anchor, in which it is left open: the normal of a planar loop.
    home_joint, home_placement
        As ``tcp_joint`` and ``tcp_placement``, for the TCP whose pose the URDF's ``<home>`` gives.

    Raises
    ------
    RobotError
        If the URDF does not make a robot.

    Warns
    -----
    GtpinWarning
        If nothing names the TCP, and there are several ends of chains that it can be.
    """

    def __init__(self, description: RobotDescription, tcp: str | None = None) -> None:
        self.description = description
        self.name = description.name
        self.tolerance: Mapping[str, float] = MappingProxyType(dict(description.tolerance))
        elements = self._actuator_elements()
        self.model: Any = moving_model(description, [element.joint for element in elements])
        self.model.gravity.linear = np.array(description.gravity)
        self.data: Any = self.model.createData()
        """Scratch memory for the time in which the robot is built."""
        self.neutral: Floats = neutral(self.model, description)
        self.followers = followers(self.model, description.tree.mimics)
        self.fold: Floats = np.eye(self.model.nv)
        """(nv, nv) velocities of all joints by those of the joints that follow no other."""
        for follower in self.followers:
            self.fold[follower.index_v, follower.master_v] = follower.multiplier
        pin.computeJointJacobians(self.model, self.data, self.neutral)
        self.actuators = tuple(self._actuator(element) for element in elements)
        driven = [actuator.index_v for actuator in self.actuators]
        if len(set(driven)) != len(driven):
            raise description.error("two actuators drive one joint", "name each joint once")
        if len(set(self.sites)) != len(driven):
            raise description.error("two actuators have one site", "name each site once")
        self.driven = driven
        self._index_q = np.array([actuator.index_q for actuator in self.actuators])
        self._continuous = [i for i, a in enumerate(self.actuators) if self.model.nqs[a.joint_id] == 2]
        self._led = [(driven.index(led.master_v), led) for led in self.followers if led.master_v in driven]
        self.passive = np.setdiff1d(np.arange(self.model.nv), driven + [led.index_v for led in self.followers])
        self.n_passive = len(self.passive)
        if tcp is not None and tcp not in self.links:
            what, hint = f"{self.name} has no link {tcp!r}", f"links are {listed(self.links)}"
            raise RobotError(what, file=description.source, column="tcp", hint=hint)
        self.tcp_frame = tcp or description.tcp or description.platform or description.tree.tip
        if tcp is None and description.tcp_guessed:
            others = [link for link in description.tree.ends if link != self.tcp_frame]
            what = f"{self.name} names no TCP: {self.tcp_frame} is taken, and there are also {listed(others, 6)}"
            warn(f"{what}; name it (tcp, --tcp)")
        self.tcp_joint, self.tcp_placement = self._placement(Anchor(self.tcp_frame))
        home = description.home.link if description.home else None
        named = home or description.tcp or description.platform or self.tcp_frame
        self.home_joint, self.home_placement = self._placement(Anchor(named))
        self.anchors = tuple(self._placement(anchor) for anchor in self._anchor_elements)
        pairs = zip(self.anchors[::2], self.anchors[1::2], strict=True)
        self.constraints = tuple(pin.PointAnchorConstraintModel(self.model, *a, *b) for a, b in pairs)
        self.constraint_models = pin.StdVec_ConstraintModel()
        for constraint in self.constraints:
            self.constraint_models.append(pin.ConstraintModel(constraint))
        self.size = float(max([1.0] + [np.abs(placement.translation).max() for placement in self.data.oMi]))
        """Largest coordinate of a joint with all commands zero, base frame, but at least 1, m. Rounding errors grow with it."""
        for name, placement in zip(self.model.names, self.data.oMi, strict=True):
            where = np.abs(placement.translation).max()
            if not where < FARTHEST:
                raise description.error(f"joint {name} is {where:g} m from the base", "lengths are in m")
        if (at_home := description.home) and len(at_home.q) != self.n_actuators:
            what = f"home has {len(at_home.q)} commands for {self.n_actuators} actuators"
            raise description.error(what, "mend <home q>")
        moving = self.constraints and not (self.description.planes or self.description.rods)
        motions = self.relative_motions(postures(self.model, self.neutral)) if moving else np.zeros((0, 0))
        pin.computeJointJacobians(self.model, self.data, self.neutral)
        self.leave_open(self.planes_of(motions))

    def leave_open(self, planes: tuple[Floats, ...]) -> None:
        """Close each loop only across the directions ``planes`` (k, 3), in the frame of its first anchor."""
        self.planes = planes
        self.closed_axes = tuple(axes_of(normals) for normals in planes)
        """By loop, the (e, 3) directions in which it is closed, in the frame of its first anchor: of a planar loop two."""
        self._in_planes = block_diag(*self.closed_axes) if planes else np.zeros((0, 0))
        self.seeking: Floats = np.vstack([self._in_planes, self._levers()])
        """(m + k, 3 L) as the matrix of :meth:`closing`, with equations for loops of type ``fixed`` that tell half turns."""

    @property
    def _anchor_elements(self) -> list[Anchor]:
        return [anchor for loop in self.description.loops for anchor in (loop.anchor1, loop.anchor2)]

    @cached_property
    def leading_anchors(self) -> tuple[int, ...]:
        """By anchor, the index of the one with which it moves on its link: of a loop of type ``fixed`` that at its origin."""
        names = [loop.name for loop in self.description.loops]
        first = [names.index(loop.point_of or loop.name) for loop in self.description.loops]
        return tuple(anchor for i in first for anchor in (2 * i, 2 * i + 1))

    @cached_property
    def anchor_axes(self) -> Floats:
        """(2 L, 3, 3) rotation from the frame of each anchor's link to the frame of the joint that carries it."""
        links = (self.link(anchor.link) for anchor in self._anchor_elements)
        return np.array([link.placement.rotation for link in links]).reshape(-1, 3, 3)

    @property
    def n_actuators(self) -> int:
        """Number of commands."""
        return len(self.actuators)

    @cached_property
    def sites(self) -> tuple[str, ...]:
        """Names of the actuators' sites, in the order of q."""
        return tuple(actuator.site for actuator in self.actuators)

    @property
    def links(self) -> tuple[str, ...]:
        """Names of its links."""
        return tuple(frame.name for frame in self.model.frames if frame.type == pin.FrameType.BODY)

    def link(self, name: str) -> pin.Frame:
        """The frame of a link on the joint that carries it."""
        return self.model.frames[self.model.getFrameId(name, pin.FrameType.BODY)]

    @property
    def lower(self) -> Floats:
        """(n,) lower ends of the commands' ranges, m or rad."""
        return np.array([actuator.lower for actuator in self.actuators])

    @property
    def ends(self) -> tuple[Floats, Floats]:
        """(n,) lower and (n,) upper ends of the commands' ranges, m or rad; -pi and pi where there are none."""
        lower, upper = self.lower, self.upper
        return np.where(np.isfinite(lower), lower, -np.pi), np.where(np.isfinite(upper), upper, np.pi)

    @property
    def upper(self) -> Floats:
        """(n,) upper ends of the commands' ranges, m or rad."""
        return np.array([actuator.upper for actuator in self.actuators])

    @property
    def revolute(self) -> npt.NDArray[np.bool_]:
        """(n,) whether each actuator turns instead of sliding."""
        return np.array([actuator.revolute for actuator in self.actuators])

    @cached_property
    def whole_turns(self) -> Mask:
        """(nv,) whether a whole turn of a joint changes nothing: it turns about one axis, and its followers by whole turns."""
        model, found = self.model, np.zeros(self.model.nv, dtype=bool)
        for joint in range(1, model.njoints):
            if model.nvs[joint] == 1:
                found[model.idx_vs[joint]] = joint_axis(model, joint)[3:].any()
        for follower in self.followers:
            found[follower.master_v] &= found[follower.index_v] and follower.multiplier.is_integer()
        return found

    @property
    def endless(self) -> Mask:
        """(n,) whether commands that differ by whole turns are one posture: of actuators that turn without limits."""
        return self.whole_turns[self.driven] & ~np.isfinite(self.upper - self.lower)

    @property
    def loop_joints(self) -> tuple[int, ...]:
        """Pinocchio's joints that move one anchor of a loop relative to the other."""
        supports = self.model.supports
        ends = ((set(supports[c.joint1_id]), set(supports[c.joint2_id])) for c in self.constraints)
        return tuple(sorted({int(j) for one, other in ends for j in one ^ other} - {0}))

    @property
    def readable(self) -> tuple[str, ...]:
        """Names of the joints that can be measured: those of one coordinate that nothing but the loops moves."""
        model = self.model
        joints = (j for j in range(1, model.njoints) if model.nvs[j] == 1 and model.idx_vs[j] in self.passive)
        return tuple(model.names[j] for j in joints)

    @property
    def moving_joints(self) -> tuple[int, ...]:
        """Pinocchio's joints that can move the TCP: those that carry it, and those of the loops."""
        ends = [self.tcp_joint, *(j for c in self.constraints for j in (c.joint1_id, c.joint2_id))]
        return tuple(sorted({int(j) for end in ends for j in self.model.supports[end]} - {0}))

    @cached_property
    def home_q(self) -> Floats:
        """(n,) commands of the home posture.

        Where the file names none they are zero; for a robot with loops, of an actuator whose range excludes zero, its middle.
        """
        home, posture = self.description.home, self.description.posture
        q = np.zeros(self.n_actuators)
        if self.constraints:
            lower, upper = self.lower, self.upper
            with np.errstate(invalid="ignore"):
                middle = np.where(np.isfinite(lower + upper), (lower + upper) / 2.0, np.clip(q, lower, upper))
            q = np.where((lower > 0.0) | (upper < 0.0), middle, q)
        for i, actuator in enumerate(self.actuators):
            q[i] = posture.get(actuator.joint, (q[i],))[0]
        q = np.array(home.q) if home else q
        q.flags.writeable = False
        return q

    @property
    def start(self) -> Floats:
        """(nq,) configuration from which home is closed: neutral, with the coordinates of joints that the file names."""
        configuration, model = self.neutral.copy(), self.model
        for name, values in self.description.posture.items():
            if model.existJointName(name):
                joint, index = model.joints[model.getJointId(name)], int(model.idx_qs[model.getJointId(name)])
                if len(values) == 1 and joint.nv == 1:
                    put(configuration, index, values[0], joint.nq == 2)
                elif len(values) == joint.nq == 7:
                    configuration[index : index + 7] = values
                else:
                    raise self.description.error(f"home of joint {name} has {len(values)} numbers", "mend <home>")
            elif not self.model.existFrame(name):
                raise self.description.error(f"home of no joint {name}", "mend <home>")
        return self.with_commands(configuration, self.home_q)

    def with_commands(self, configuration: Floats, q: Floats) -> Floats:
        """Configurations (..., nq) with the actuators at ``q`` (..., n), and all else as in ``configuration`` (..., nq)."""
        changed = np.array(np.broadcast_to(configuration, (*q.shape[:-1], configuration.shape[-1])))
        changed[..., self._index_q] = q
        for i in self._continuous:
            put(changed, self._index_q[i], q[..., i], True)
        for i, follower in self._led:
            put(changed, follower.index_q, follower.multiplier * q[..., i] + follower.offset, follower.continuous)
        return changed

    def folded(self, derivative: Floats) -> Floats:
        """A derivative (..., nv) by Pinocchio velocities, in which the columns of masters include the motion of followers."""
        return derivative @ self.fold if self.followers else derivative

    def carriers(self, actuator: int) -> tuple[tuple[int, float], ...]:
        """Joints that carry the TCP and that an actuator moves: its own, then those that follow it, each with its ratio.

        Its own joint alone in a robot with loops, and where nothing that it moves carries the TCP.
        """
        own, model = self.actuators[actuator], self.model
        way = [] if self.constraints else [int(j) for j in model.supports[self.tcp_joint]]
        ratio = {f.index_v: f.multiplier for f in self.followers if f.master_v == own.index_v}
        led = [(j, ratio[int(model.idx_vs[j])]) for j in way if j and int(model.idx_vs[j]) in ratio]
        return ((own.joint_id, 1.0), *led) if own.joint_id in way or not led else tuple(led)

    def offset(self, joint_id: int) -> float:
        """Coordinate of a joint, m or rad, where the joint that it follows is at zero; 0 where it follows none."""
        index = int(self.model.idx_vs[joint_id])
        return next((follower.offset for follower in self.followers if follower.index_v == index), 0.0)

    def closing(self, gaps: Floats) -> Floats:
        """Values (m, ...) of the closure equations, from the vectors (3 k, ...) between the anchors of k loops.

        Or their derivatives, from those of the vectors. All three components of a vector are equations; for a planar loop,
        those in its plane.
        """
        return np.asarray(self._in_planes @ gaps)

    # ------------------------------------------------------------------------------------------------ building

    def _actuator_elements(self) -> tuple[ActuatorElement, ...]:
        if self.description.actuators:
            return self.description.actuators
        if self.description.loops:
            where = "in its <actuator>" if self.description.kind == "mjcf" else "in a <gtpin> element"
            hint = f"name the driven joints {where}, or where it is used: --actuators, or actuators in dataset.toml"
            raise self.description.error("loops but no actuators", hint)
        names = self.description.tree.moving
        if not names:
            raise self.description.error("nothing moves", "give the robot a moving joint")
        return tuple(ActuatorElement(name, name) for name in names)

    def _actuator(self, element: ActuatorElement) -> Actuator:
        model = self.model
        if not model.existJointName(element.joint):
            hint = f"moving joints are {listed(self.description.tree.moving)}"
            raise self.description.error(f"no moving joint is called {element.joint}", hint)
        joint_id = int(model.getJointId(element.joint))
        if model.nvs[joint_id] != 1:
            what = f"actuator {element.joint} has {model.nvs[joint_id]} degrees of freedom"
            raise self.description.error(what, "drive one")
        index_q, index_v = int(model.idx_qs[joint_id]), int(model.idx_vs[joint_id])
        column = joint_jacobian(model, self.data, joint_id)[:, index_v]
        if not column.any():
            raise self.description.error(f"actuator {element.joint} has an axis of no length", "mend its <axis>")
        revolute = bool(np.linalg.norm(column[3:]) > 0.5)
        axis, at = column[3:] if revolute else column[:3], self.data.oMi[joint_id].translation.copy()
        place = joint_id, index_q, index_v, *limits(model, joint_id)
        return Actuator(element.joint, element.site, *place, revolute, axis.copy(), at, element.scale_unknown)

    def _placement(self, anchor: Anchor) -> tuple[int, Any]:
        if not self.model.existFrame(anchor.link, pin.FrameType.BODY):
            raise self.description.error(f"no link is called {anchor.link}", "mend the loop, platform or TCP")
        frame = self.link(anchor.link)
        local = pin.SE3(pin.rpy.rpyToMatrix(*map(float, anchor.rpy)), np.array(anchor.xyz, dtype=float))
        return int(frame.parentJoint), frame.placement * local

    def _levers(self) -> Floats:
        """(k, 3 L) components of gaps along the levers of the k further points of loops of type ``fixed``."""
        loops, each = self.description.loops, np.eye(3 * len(self.description.loops))
        axes = {loop.name: 3 * i for i, loop in enumerate(loops)}
        ways = [(axes[o.name], axes[o.point_of], "xy".index(o.name[-1])) for o in loops if o.point_of]
        return np.reshape([each[own + c] - each[origin + c] for own, origin, c in ways], (len(ways), len(each)))

    def gaps(self) -> Floats:
        """(3 L,) vectors from the first to the second anchor of each loop, m, in the first one's frame, at :attr:`data`."""
        ends = [self.data.oMi[joint] * placement for joint, placement in self.anchors]
        pairs = zip(ends[::2], ends[1::2], strict=True)
        return np.array([one.actInv(other).translation for one, other in pairs]).ravel()

    def constraint_data(self, data: Any) -> Any:
        """``pinocchio.StdVec_ConstraintData`` for :attr:`constraint_models` where ``data`` has the joints' Jacobians."""
        found = pin.StdVec_ConstraintData()
        for constraint in self.constraint_models:
            found.append(constraint.createData())
            constraint.calc(self.model, data, found[-1])
        return found

    def gaps_jacobian(self, data: Any) -> Floats:
        """(3 L, nv) derivative of the gaps where ``data`` is; joints that follow others (``<mimic>``) move with them."""
        if not self.constraints:
            return np.zeros((0, self.model.nv))
        jacobian = pin.getConstraintsJacobian(self.model, data, self.constraint_models, self.constraint_data(data))
        return self.folded(np.reshape(jacobian, (-1, self.model.nv)))

    def relative_motions(self, configurations: Sequence[Floats]) -> Floats:
        """(3 L, c) motions of the second anchors relative to the first, in their frames, by the passive joints at postures."""
        found = []
        for configuration in configurations:
            pin.computeJointJacobians(self.model, self.data, configuration)
            found.append(self.gaps_jacobian(self.data)[:, self.passive])
        return np.hstack(found)

    def planes_of(self, motions: Floats, zero: float = PARALLEL) -> tuple[Floats, ...]:
        """By loop, the (k, 3) directions in which it needs not be closed: those that the file names, or of the motions.

        ``motions``: as :meth:`relative_motions` has them; (0, 0): not known. ``zero``: see ``normal_of``.
        """
        found: dict[str, Floats] = dict(self.description.planes)
        loops = self.description.loops
        for loop in (loop for loop in loops if loop.name not in found):
            if loop.point_of:
                found[loop.name] = of_further_point(found[loop.point_of], loop.name[-1])
            elif motions.size:
                own = [loop.name in (other.name, other.point_of) for other in loops]
                found[loop.name] = normal_of(np.hstack([*motions.reshape(len(loops), 3, -1)[own]]), zero)
            else:
                found[loop.name] = NONE
        return tuple(found[loop.name] for loop in loops)


def limits(model: Any, joint_id: int) -> tuple[float, float]:
    """Smallest and largest coordinate of a joint, m or rad; infinite where it turns without end, or its range is empty."""
    index = int(model.idx_qs[joint_id])
    lower, upper = float(model.lowerPositionLimit[index]), float(model.upperPositionLimit[index])
    return (lower, upper) if model.nqs[joint_id] == 1 and lower < upper else (-np.inf, np.inf)


def joint_axis(model: Any, joint_id: int) -> Floats:
    """(6,) twist of a joint of one degree of freedom by a unit of its velocity, in its placement frame."""
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    column = pin.getJointJacobian(model, data, joint_id, pin.LOCAL).reshape(6, -1)[:, model.idx_vs[joint_id]]
    return np.asarray(column, dtype=float)
