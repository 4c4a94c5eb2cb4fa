"""Expected TCP error, position and orientation, from uncertainty, over a set of poses."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.special import elliprg

from gtpin.accuracy.sensitivity import check_closure_sigmas
from gtpin.errors import ModelError
from gtpin.kinematics.kinematics import Kinematics, reached_poses
from gtpin.kinematics.poses import Poses
from gtpin.model.fit_conditions import EXPLAINED
from gtpin.model.model import Model, root_of
from gtpin.model.place import free_motions, without_place
from gtpin.real import generator
from gtpin.typing import Floats

CHUNK = 5_000_000
"""Largest number of array elements in memory at the same time."""


@dataclass(frozen=True)
class Uncertainty:
    """The uncertainty of a machine.

    Parameters
    ----------
    parameters
        (p, p) covariance of the model's geometric parameters, in their units. Their errors are the same at all poses of a
        machine.
    closures
        (k,) standard deviation of each rod's closure residual \\|d\\|^2 - L^2, m^2, with d the vector between the rod's joints
        and L its length: independent from pose to pose, as in the paper's cost.
    repeatability
        Standard deviation of every actuator, m or rad, independent from pose to pose.
    """

    parameters: Floats | None = None
    closures: Floats | None = None
    repeatability: float = 0.0


@dataclass(frozen=True)
class ErrorResponse:
    """Response of the TCP to independent standard normal causes.

    ``fixed``: (N, c, a) response to causes that are the same at all poses of a machine, m and rad. ``fresh``: (N, c, b)
    response to causes that are independent from pose to pose, m and rad. ``place``: (N, c, a) motion of the whole machine by
    the former causes, m and rad, which is no part of the errors because no instrument shows it.
    """

    fixed: Floats
    fresh: Floats
    place: Floats = field(default_factory=lambda: np.zeros((1, 6, 0)))

    @property
    def covariance(self) -> Floats:
        """(N, c, c) covariance of the TCP's error at each pose."""
        return self.fixed @ np.swapaxes(self.fixed, 1, 2) + self.fresh @ np.swapaxes(self.fresh, 1, 2)


@dataclass(frozen=True)
class Error:
    """The length of an error vector, m or rad.

    - ``at``: (N,) expected length at each pose.
    - ``mean``: mean of ``at`` over the poses.
    - ``p95``: 95th percentile of the length over random machines and poses.
    - ``maximum``: mean over random machines of the largest length over the visited poses.
    - ``mean_spread``, ``maximum_spread``: standard deviations, from machine to machine, of the mean and of the largest over
      the visited poses.
    """

    at: Floats
    mean: float
    p95: float
    maximum: float
    mean_spread: float
    maximum_spread: float


@dataclass(frozen=True)
class ExpectedError:
    """The error to expect of a machine, relative to its model, at a set of poses.

    ``position``, ``orientation``: lengths of the position error, m, and of the error's rotation vector, rad; the latter
    None for a reduced arm. ``visits``: number of visited poses of ``maximum``.
    """

    position: Error
    orientation: Error | None
    visits: int


def closure_response(kinematics: Kinematics, q: Floats, poses: Poses) -> Floats:
    """(N, 6, k) change of the TCP's pose, base frame, per unit closure residual \\|d\\|^2 - L^2, m^2, of each rod.

    A residual c is that of a rod whose length is c / (2 L) longer.
    """
    on_platform, on_carriers = kinematics.rod_ends(q, poses)
    length = np.linalg.norm(on_platform - on_carriers, axis=2)
    return np.asarray(kinematics.motion(q, poses).by_rod_lengths[:, :6] / (2.0 * length[:, None]))


def response(model: Model, q: Floats, uncertainty: Uncertainty) -> ErrorResponse:
    """The TCP's response at commands q (N, n), base frame, to the causes of an uncertainty.

    It is without where the machine stands, as far as no instrument shows it: see :mod:`~gtpin.model.place`.

    Raises `ModelError` if the uncertainty does not have the model's number of parameters, or has closures for a robot
    without rods. `UnreachableError` if the commands can't be reached.
    """
    kinematics = model.kinematics
    poses = reached_poses(kinematics, q)
    whole = fixed = np.zeros((len(q), 6, 0))
    fresh = [fixed]
    if uncertainty.parameters is not None:
        count = len(model.geometry.parameters)
        if uncertainty.parameters.shape != (count, count):
            shape = uncertainty.parameters.shape
            raise ModelError(f"a covariance of shape {shape}", hint=f"{model.robot.name} has {count} parameters here")
        fixed = kinematics.geometry_jacobian(q, poses)[:, :6] @ root_of(uncertainty.parameters)
        whole, fixed = fixed, without_place(fixed, poses.T, free_motions(model))
    if uncertainty.closures is not None:
        check_closure_sigmas(model, uncertainty.closures)
        fresh.append(closure_response(kinematics, q, poses) * uncertainty.closures)
    if uncertainty.repeatability > 0.0:
        fresh.append(kinematics.command_jacobian(q, poses)[:, :6] * uncertainty.repeatability)
    return ErrorResponse(fixed, np.concatenate(fresh, axis=2), whole - fixed)


def unexplained_error(model: Model, by_commands: Floats) -> tuple[float, float, float]:
    """What a model does not explain of the data of its fit, as one sigma per axis of the TCP's position, m, and the ends of its
    95 % interval.

    It is the root mean square over N poses of the model's discrepancy and of the noise of the drives, which is an error of
    the machine too. Where the noise of the instrument is not known, the discrepancy has both.

    ``by_commands``: (N, 6, n) derivative of the poses by the commands, m and rad.
    """
    left, drives = model.unexplained or EXPLAINED, 0.0
    if left.noise_known and model.fit is not None:
        drives = float(((model.fit.drives * by_commands[:, :3]) ** 2).sum(axis=(1, 2)).mean()) / 3.0
    size, least, most = (float(np.sqrt(one**2 + drives)) for one in (left.position, *left.interval))
    return size, least, most


def expected_rms(fixed: float, unexplained: float, *, noise_known: bool) -> float:
    """The root mean square error, m, to expect of two mean squares, m^2: that of what the data do not determine, ``fixed``, and
    ``unexplained``. Where the latter may be noise, anything from none to all of it is an error of the machine: then it is the
    geometric mean of these two ends."""
    whole = float(np.sqrt(fixed + unexplained))
    return whole if noise_known else float(np.sqrt(np.sqrt(fixed) * whole))


@dataclass(frozen=True)
class Undetermined:
    """Root mean square motions of the TCP by what data do not determine of a machine.

    ``base``: where it stands, as far as no instrument shows it (:mod:`~gtpin.model.place`). ``tool``: where the tool sits, if
    the place of the target was unknown. ``rest``: everything else. They are of positions, m, and their squares add up.
    ``orientation``: of the orientation, rad, with everything but ``base``.
    """

    base: float
    tool: float
    rest: float
    orientation: float

    @staticmethod
    def of(model: Model, motion: Floats, poses: Poses) -> Undetermined:
        """The parts of motions (N, 6, k), m and rad, by k independent standard normal unknowns at N poses of the tool.

        ``model``: the model of the measurements.
        """
        free, shift = free_motions(model), motion[:, :3]
        placed = without_place(shift, poses.T, free)
        rest = without_place(shift, poses.T, free, poses.R) if model.free_target else placed
        powers = [float((one**2).sum(axis=(1, 2)).mean()) for one in (shift, placed, rest)]
        base, tool = (float(np.sqrt(max(a - b, 0.0))) for a, b in itertools.pairwise(powers))
        turned = without_place(motion, poses.T, free)[:, 3:]
        return Undetermined(base, tool, float(np.sqrt(powers[2])), float(np.sqrt((turned**2).sum(axis=(1, 2)).mean())))


def expected_error(
    model: Model, q: Floats, uncertainty: Uncertainty, *, visits: int | None = None, draws: int = 2000, seed: int = 0
) -> ExpectedError:
    """The error to expect at commands q (N, n); see :func:`expected_of`, and :func:`response` for errors."""
    return expected_of(response(model, q, uncertainty), visits=visits, draws=draws, seed=seed)


def expected_of(
    response: ErrorResponse, *, visits: int | None = None, draws: int = 2000, seed: int = 0
) -> ExpectedError:
    """The error to expect of a response to standard normal causes.

    Means are in closed form (see :func:`mean_length`); percentiles and largest errors are from random machines.

    ``visits``: number of visited poses over which each machine's largest error is taken. They are drawn from the N poses,
    without repetition unless there are more visits than poses. By default all N. ``draws``: number of random machines.
    ``seed``: seed of the random numbers.
    """
    count = len(response.fixed)
    visits = count if visits is None else visits
    if visits < 1 or draws < 1:
        raise ModelError(f"{visits} visits of {draws} machines", hint="ask for at least one of each")
    covariance = response.covariance
    sampled = _sample(response, visits, draws, generator(seed))
    parts = [_error(covariance[:, :3, :3], sampled[0])]
    if covariance.shape[1] == 6:
        parts.append(_error(covariance[:, 3:, 3:], sampled[1]))
    return ExpectedError(parts[0], parts[1] if len(parts) == 2 else None, visits)


def mean_length(covariance: Floats) -> Floats:
    """(N,) expected length of normal vectors of covariance (N, 3, 3).

    E|x| = 2 sqrt(2 / pi) R_G(a, b, c) with a, b, c the eigenvalues: the radius of a standard normal vector has the mean
    2 sqrt(2 / pi), and R_G is the mean of sqrt(a u1^2 + b u2^2 + c u3^2) over the unit sphere (Carlson; DLMF 19.23.6_5).
    """
    a, b, c = np.maximum(np.linalg.eigvalsh(covariance), 0.0).T
    return np.asarray(2.0 * np.sqrt(2.0 / np.pi) * elliprg(a, b, c))


def _error(covariance: Floats, lengths: Floats) -> Error:
    at = mean_length(covariance)
    mean, largest = lengths.mean(axis=1), lengths.max(axis=1)
    p95 = float(np.quantile(lengths, 0.95))
    return Error(at, float(at.mean()), p95, float(largest.mean()), float(mean.std()), float(largest.std()))


def _sample(response: ErrorResponse, visits: int, draws: int, rng: np.random.Generator) -> Floats:
    """(1 or 2, draws, visits) lengths of position and orientation errors."""
    count, components, causes = response.fresh.shape
    kept = np.empty((components // 3, draws, visits))
    block = max(1, CHUNK // (visits * max(components, causes) * components))
    for start in range(0, draws, block):
        size = min(block, draws - start)
        rows = np.array([_visited(count, visits, rng) for _ in range(size)])
        machine = rng.standard_normal((size, response.fixed.shape[2]))
        noise = rng.standard_normal((size, visits, causes))
        error = np.tensordot(machine, response.fixed, axes=(1, 2))[np.arange(size)[:, None], rows]
        error += np.einsum("mvci,mvi->mvc", response.fresh[rows], noise, optimize=True)
        for part in range(components // 3):
            kept[part, start : start + size] = np.linalg.norm(error[..., 3 * part : 3 * part + 3], axis=2)
    return kept


def _visited(count: int, visits: int, rng: np.random.Generator) -> npt.NDArray[np.intp]:
    if visits == count:
        return np.arange(count)
    passes = -(-visits // count)
    return np.concatenate([rng.permutation(count) for _ in range(passes)])[:visits]
