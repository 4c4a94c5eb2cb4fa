"""What a step in one parameter does pose by pose: the data of the paper's Figs. 9 and 10."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from paper_closures import closure_residual, with_rods

from gtpin.accuracy.expected import closure_response
from gtpin.accuracy.sensitivity import PARAMETERS, STEP, of_rod, rod_names
from gtpin.errors import ModelError
from gtpin.kinematics.kinematics import reached_poses
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp, zyz_change
from gtpin.model.model import Model

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Errors:
    """A model against measured poses (N).

    Parameters
    ----------
    position
        (N,) length of the TCP's error, m.
    rotation
        (N, 3) model less measured ZYZ angles, rad.
    costs
        (N, k) every link's squared closure residual (\\|d\\|^2 - L^2)^2, m^4.
    """

    position: Floats
    rotation: Floats
    costs: Floats


@dataclass(frozen=True)
class StepChange:
    """A model as it is, and after a step of one parameter of one link to either side.

    Parameters
    ----------
    parameter, link, step
        What was changed, whose, and by how much.
    before, plus, minus
        Errors without and after the steps.
    """

    parameter: str
    link: str
    step: float
    before: Errors
    plus: Errors
    minus: Errors


def step_change(model: Model, q: Floats, measured: Poses, parameter: str, link: str, step: float = STEP) -> StepChange:
    """Step a parameter of a link to both sides.

    Parameters
    ----------
    q
        (N, n) commands.
    measured
        (N) poses measured there, base frame.
    parameter, link
        One of :data:`~gtpin.accuracy.sensitivity.PARAMETERS`, and the name of a rod.

    Raises
    ------
    ModelError
        If the link has no such parameter, or there is no such link.
    UnreachableError, ConvergenceError
        As for :func:`~gtpin.accuracy.sensitivity.sensitivity`.
    """
    kinematics, links = model.kinematics, rod_names(model)
    if link not in links or parameter not in PARAMETERS:
        raise ModelError(f"no parameter {parameter} of a link {link}", hint=f"links are {', '.join(links)}")
    poses, rod = reached_poses(kinematics, q), links.index(link)
    change = of_rod(model.robot, q, kinematics.motion(q, poses), parameter, rod)
    if change is None or change.moved is None:
        raise ModelError(f"link {link} of {model.robot.name} has no track", hint=f"{parameter} is of a track")
    rods = with_rods(model.geometry)
    ends, closures = rods.ends(q), -closure_residual(rods, q, measured)
    # Per unit of the parameter, at the measured poses: change of the rod's length and of its vector.
    grown = float(parameter == "L")
    by_step = measured.R @ np.eye(3)["xyz".index(parameter[1])] if parameter[0] == "P" else change.moved
    d, L = ends.vectors(measured)[:, rod], ends.L[rod]

    def errors(size: float) -> Errors:
        now = change.after(kinematics, q, poses, size) if size else poses
        moved, by = closures.copy(), size * by_step
        # Expanded: a difference of two squares of lengths of about 2 m would lose seven digits.
        moved[:, rod] += np.einsum("ni,ni->n", 2.0 * d + by, by) - (2.0 * L + size * grown) * size * grown
        off = np.linalg.norm(now.T - measured.T, axis=1)
        return Errors(off, zyz_change(now.R, measured.R), moved**2)

    return StepChange(parameter, link, step, errors(0.0), errors(step), errors(-step))


def drawn_measurements(model: Model, q: Floats, sigmas: Floats, seed: int = 0) -> Poses:
    """Poses (N), base frame, of a machine whose closures miss the model's by Gaussian residuals of sigmas (k,), m^2."""
    kinematics = model.kinematics
    poses = reached_poses(kinematics, q)
    residual = sigmas * np.random.default_rng(seed).standard_normal((len(q), len(model.robot.rods)))
    off = np.einsum("nij,nj->ni", closure_response(kinematics, q, poses), residual)
    return Poses(poses.T + off[:, :3], exp(off[:, 3:]) @ poses.R)
