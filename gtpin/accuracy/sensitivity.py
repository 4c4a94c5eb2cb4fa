"""The effect of a small error of each part of a chain on the TCP: Table III of the paper, for any robot."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.special import ndtr

from gtpin.errors import ConvergenceError, ModelError, warn
from gtpin.kinematics.kinematics import Kinematics, reached_poses
from gtpin.kinematics.motion import FrameMotion
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import well_defined, zyz_change, zyz_rates
from gtpin.model.model import Model
from gtpin.robot.chain import Chain
from gtpin.robot.placement_frames import frame_of_anchor, frame_of_joint, frame_of_tcp, shift
from gtpin.typing import Floats

if TYPE_CHECKING:
    import pandas as pd

STEP = 5e-5
"""The paper's step: 50 um, or 5e-5 rad, or 5e-5 in a component of a unit vector."""


@dataclass(frozen=True)
class Sums:
    """Changes summed over poses and both signs of the step, (p, k) by parameter and link; NaN where a link has none.

    Parameters
    ----------
    position
        \\|T - T+\\| + \\|T - T-\\|, m, with T+ and T- the TCP's positions after a step to each side (Dressler et al. 2010, eq.
        7).
    rotation
        Absolute changes of the three ZYZ Euler angles, rad; NaN where these are not well defined, as near the identity.
    cost
        Absolute changes of the link's own squared closure residual (\\|d\\|^2 - L^2)^2, m^4, with d the vector between its
        joints and L its length; None where residuals are not known.
    """

    position: Floats
    rotation: Floats
    cost: Floats | None


@dataclass(frozen=True)
class Sensitivity:
    """The sensitivity of a model at given commands.

    - ``parameters``, ``links``: names of the p parameters and k parts. Rods have those of
      :data:`~gtpin.accuracy.sensitivity.PARAMETERS`; the placements of joints (named by the joint), of the tool
      (``platform``) and of loops' anchors have ``x y z rx ry rz``, own axes.
    - ``poses``: number of commands that were summed over.
    - ``step``: the step, m, or rad for ``rx ry rz``, or m/m for directions.
    - ``exact``: changes from the forward kinematics, solved again after the step.
    - ``linear``: changes from the Jacobian.
    """

    parameters: tuple[str, ...]
    links: tuple[str, ...]
    poses: int
    step: float
    exact: Sums
    linear: Sums

    def to_table(self, way: Literal["exact", "linear"] = "exact") -> pd.DataFrame:
        """The columns ``parameter link position_mm rotation_rad cost_m4``, a row for each parameter that a link has.

        ``cost_m4`` is NaN where residuals are not known. A rod whose carrier has no track has no rows ``vx vy vz``.
        """
        import pandas as pd

        sums = self.exact if way == "exact" else self.linear
        cost = np.full(sums.position.shape, np.nan) if sums.cost is None else sums.cost
        table = pd.DataFrame(
            {
                "parameter": np.repeat(self.parameters, len(self.links)),
                "link": np.tile(self.links, len(self.parameters)),
                "position_mm": 1e3 * sums.position.ravel(),
                "rotation_rad": sums.rotation.ravel(),
                "cost_m4": cost.ravel(),
            }
        )
        return table.dropna(subset=["position_mm"]).reset_index(drop=True)


def sensitivity(
    model: Model,
    q: Floats,
    *,
    sigmas: Floats | None = None,
    step: float = STEP,
) -> Sensitivity:
    """Change every part's parameters, one at a time, by a step to both sides.

    Parameters
    ----------
    q
        (N, n) commands, m or rad.
    sigmas
        For a robot with k rods: (k,) standard deviations of the rods' closure residuals \\|d\\|^2 - L^2, m^2. The changes of
        the cost are then expectations over Gaussian residuals. The paper's Table II gives each rod's final cost f, m^4, the sum
        of the squared residuals over M poses: sigma = sqrt(f / M).
    step
        m or rad; for directions m/m.

    Raises
    ------
    ModelError
        If a robot without rods is given ``sigmas``, or there is not one for each rod.
    UnreachableError
        If the commands can't be reached.
    ConvergenceError
        If the closures have no solution after a step, as may happen near a singularity.

    Warns
    -----
    GtpinWarning
        If the TCP's z axis is nearly parallel to the base's, so that ZYZ angles are singular at
        a pose: ``rotation`` is then NaN.
    """
    kinematics = model.kinematics
    poses = reached_poses(kinematics, q)
    if sigmas is not None:
        check_closure_sigmas(model, sigmas)
    defined = well_defined(poses.R)
    if not defined:
        warn("changes of orientation are left out: ZYZ angles jump where the z axes of TCP and base are parallel")
    rates = zyz_rates(poses.R) if defined else np.full((len(q), 3, 3), np.nan)
    cells: dict[tuple[str, str], tuple[Floats, Floats]] = {}
    motion = kinematics.motion(q, poses)
    for error in small_errors(kinematics, q, motion):
        moved = step * error.rate(motion)
        linear = np.full(3, np.nan)
        linear[0] = 2.0 * np.linalg.norm(moved[:, :3], axis=1).sum()
        linear[1] = 2.0 * np.abs(np.einsum("nij,nj->ni", rates, moved[:, 3:])).sum()
        both = (_changes(poses, error.after(kinematics, q, poses, s * step)) for s in (1.0, -1.0))
        exact = np.append(sum(both, np.zeros(2)), np.nan)
        if sigmas is not None and error.rod is not None:
            exact[2], linear[2] = _cost(error, kinematics, q, poses, step, float(sigmas[error.rod]))
        cells[error.parameter, error.link] = exact, linear
    parameters, links = (tuple(dict.fromkeys(names)) for names in zip(*cells, strict=True))
    tables = np.full((2, 3, len(parameters), len(links)), np.nan)
    for (parameter, link), cell in cells.items():
        tables[:, :, parameters.index(parameter), links.index(link)] = cell
    one, two = (Sums(s[0], s[1], None if sigmas is None else s[2]) for s in tables)
    return Sensitivity(parameters, links, len(q), step, one, two)


def check_closure_sigmas(model: Model, sigmas: Floats) -> None:
    """Raise `ModelError` if a robot has no rods, or there is not one standard deviation for each of them."""
    names = rod_names(model)
    if np.shape(sigmas) != (len(names),):
        raise ModelError(f"{np.size(sigmas)} closure sigmas", hint=f"give one for each of the {len(names)} rods")


def rod_names(model: Model) -> tuple[str, ...]:
    """Names of the rods; `ModelError` if there are none."""
    if not model.robot.rod_sites:
        raise ModelError(f"{model.robot.name} has no rods", hint="this analysis is of rods that hold a platform")
    return tuple(model.robot.rod(i).name for i in range(len(model.robot.rod_sites)))


def step_sums(kinematics: Kinematics, q: Floats, poses: Poses, error: SmallError, sigma: float, step: float) -> Floats:
    """(3,) exact sums of :class:`Sums` over poses (N) and both signs of a step of any error of one rod.

    ``sigma``: standard deviation of the rod's closure residual, m^2.
    """
    both = (_changes(poses, error.after(kinematics, q, poses, s * step)) for s in (1.0, -1.0))
    return np.array([*sum(both, np.zeros(2)), _cost(error, kinematics, q, poses, step, sigma)[0]])


def _changes(poses: Poses, moved: Poses) -> Floats:
    """(2,) sums over the poses of the changes of position, m, and of the ZYZ angles, rad; these NaN where not well defined."""
    rotation = np.abs(zyz_change(moved.R, poses.R)).sum() if well_defined(poses.R) else np.nan
    return np.array([np.linalg.norm(moved.T - poses.T, axis=1).sum(), rotation])


def closure_change(error: SmallError, kinematics: Kinematics, q: Floats, poses: Poses, step: float) -> Floats:
    """(N,) change of a rod's closure |d|^2 - L^2 at fixed poses (N,) by a step of an error of it, m^2."""
    d, L = _rod(error, kinematics, q, poses)
    assert error.moved is not None
    move, longer = step * error.moved, step * error.longer
    # Expanded: a difference of two squares of lengths of about 2 m would lose seven digits.
    return np.asarray(np.einsum("ni,ni->n", 2.0 * d + move, move) - (2.0 * L + longer) * longer)


def _rod(error: SmallError, kinematics: Kinematics, q: Floats, poses: Poses) -> tuple[Floats, Floats]:
    """(N, 3) the vector of an error's rod, from carrier to platform, base frame, and (N,) its length, m."""
    on_platform, on_carriers = kinematics.rod_ends(q, poses)
    d = (on_platform - on_carriers)[:, error.rod]
    return d, np.linalg.norm(d, axis=1)


def _cost(
    error: SmallError, kinematics: Kinematics, q: Floats, poses: Poses, step: float, sigma: float
) -> tuple[float, float]:
    """Exact and linear sums over poses and signs of the expected changes of the squared closure, whose sigma is given."""
    d, L = _rod(error, kinematics, q, poses)
    assert error.moved is not None
    slope = np.einsum("ni,ni->n", d, error.moved) - L * error.longer
    changes = (closure_change(error, kinematics, q, poses, s * step) for s in (1.0, -1.0))
    exact = sum(_expected_change(change, sigma).sum() for change in changes)
    return float(exact), float(2.0 * _expected_change(2.0 * step * slope, sigma).sum())


def _expected_change(by: Floats, sigma: float) -> Floats:
    """(N,) expectation of |(c + by)^2 - c^2| for c ~ N(0, sigma^2): the mean of a folded normal distribution."""
    mean, spread = by**2, 2.0 * np.abs(by) * sigma
    safe = np.where(spread > 0.0, spread, 1.0)
    ratio = mean / safe
    folded = spread * np.sqrt(2.0 / np.pi) * np.exp(-0.5 * ratio**2) + mean * (1.0 - 2.0 * ndtr(-ratio))
    return np.where(spread > 0.0, folded, mean)


PARAMETERS = ("L", "Px", "Py", "Pz", "Cx", "Cy", "Cz", "vx", "vy", "vz")
"""Small errors of a rod (Dressler et al. 2010, Table III): of its length L; of its joint P on the platform, TCP frame; of its
joint C on the carrier at command 0 and of the direction v of its track, base frame."""
COMPONENTS = ("x", "y", "z", "rx", "ry", "rz")
"""Components of a placement (of a joint on its parent, of the TCP on its body): translation, m, and rotation, rad, own axes."""


@dataclass(frozen=True)
class SmallError:
    """A small error of one part at N poses.

    ``parameter``, ``link``: its name (``L``, ``Px``, ``rx``), and the name of the part. ``rod``: index of the rod; None for
    other parts. ``frame``, ``twist``: the frame that moves, and (N, 6) its twist per unit of the parameter, own axes.
    ``longer``, ``moved``: change of the rod's length, and (N, 3) of the vector from its joint on the carrier to that on the
    platform, base frame, per unit at a fixed pose.
    """

    parameter: str
    link: str
    frame: int
    twist: Floats
    rod: int | None = None
    longer: float = 0.0
    moved: Floats | None = None

    def rate(self, motion: FrameMotion) -> Floats:
        """(N, 6) motion of the TCP per unit of the parameter, base frame."""
        return np.asarray(motion.by_twist(self.frame, self.twist[:, :, None])[:, :6, 0])

    def after(self, kinematics: Kinematics, q: Floats, poses: Poses, step: float) -> Poses:
        """Poses (N) after an error of a size, m or rad, in the same assembly mode.

        Raises `ConvergenceError` where the loops open.
        """
        found = kinematics.displaced(q, poses, q, {self.frame: step * self.twist})
        if not found.reached.all():
            what = f"a step of {step:g} opens the loops at row {np.flatnonzero(~found.reached)[0]}"
            raise ConvergenceError(what, hint="leave out commands near a singularity")
        return found


def small_errors(kinematics: Kinematics, q: Floats, motion: FrameMotion) -> Iterator[SmallError]:
    """Errors of the length, the joints and the track of each rod; of a robot without rods, of its joints, TCP and anchors."""
    robot = kinematics.robot
    if robot.rod_sites:
        for parameter in PARAMETERS:
            for i in range(len(robot.rod_sites)):
                error = of_rod(robot, q, motion, parameter, i)
                if error is not None:
                    yield error
        return
    places = [(f"{robot.model.names[j]}", frame_of_joint(j), 6) for j in robot.moving_joints]
    places.append(("platform", frame_of_tcp(robot), 6))
    loops = [(loop.name, anchor.link) for loop in robot.description.loops for anchor in (loop.anchor1, loop.anchor2)]
    places += [(f"{loop}.{link}", frame_of_anchor(robot, a), 3) for a, (loop, link) in enumerate(loops)]
    for link, frame, count in places:
        for c in range(count):
            yield SmallError(COMPONENTS[c], link, frame, np.tile(np.eye(6)[c], (len(q), 1)))


def of_rod(robot: Chain, q: Floats, motion: FrameMotion, parameter: str, i: int) -> SmallError | None:
    """An error of a parameter of a rod at commands q (N, n); None for a direction where the rod's carrier has no track.

    C = C0 + q (v + dv): as in the paper, a step dv of the direction is added without normalisation. For a carrier that turns,
    the parameter C is the joint's position at command 0.
    """
    rod, still = robot.rod(i), np.zeros((len(q), 3))
    if parameter == "L":
        along = robot.anchor_axes[rod.tip].T @ rod.along
        return SmallError("L", rod.name, frame_of_anchor(robot, rod.tip), _each(shift(along), q), i, 1.0, still)
    axis = np.eye(3)["xyz".index(parameter[1])]
    if parameter[0] == "P":
        frame = frame_of_joint(rod.joint_id)
        own = robot.model.jointPlacements[rod.joint_id].rotation.T @ robot.tcp_placement.rotation @ axis
        moved = motion.frame(frame_of_tcp(robot))[0] @ axis
        return SmallError(parameter, rod.name, frame, _each(shift(np.asarray(own)), q), i, 0.0, moved)
    frame = frame_of_anchor(robot, rod.seat)
    if parameter[0] == "C":
        moved = np.tile(axis, (len(q), 1))
        if rod.carrier is not None and robot.actuators[rod.carrier].revolute:  # the carrier has turned since command 0
            at_zero = (
                robot.model.jointPlacements[robot.actuators[rod.carrier].joint_id].rotation
                @ robot.anchor_axes[rod.seat]
            )
            moved = motion.frame(frame)[0] @ np.asarray(at_zero.T @ axis)
    elif rod.carrier is None or robot.actuators[rod.carrier].revolute:
        return None
    else:
        moved = q[:, rod.carrier, None] * axis
    local = np.einsum("nji,nj->ni", motion.frame(frame)[0], moved)
    return SmallError(parameter, rod.name, frame, np.hstack([local, still]), i, 0.0, -moved)


def _each(twist: Floats, q: Floats) -> Floats:
    return np.tile(twist, (len(q), 1))
