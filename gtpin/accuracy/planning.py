"""Information on the geometry from measurements at planned poses, and the choice of the most informative poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.calibration.observability import Observability, observability
from gtpin.calibration.thinning import gains
from gtpin.errors import ModelError
from gtpin.kinematics.kinematics import reached_poses
from gtpin.kinematics.rotations import frame_motions
from gtpin.model.model import Model, in_frame
from gtpin.noise.noise import Noise
from gtpin.read_only import gives_read_only
from gtpin.real import generator
from gtpin.threads import in_one_thread
from gtpin.typing import Floats

Rows = npt.NDArray[np.intp]

FREE = 1.0
"""Prior sigma of an instrument's pose that is not known, m and rad."""
WORTH = 1e-9
"""Smallest gain, nats, for which poses are exchanged."""


@dataclass(frozen=True)
class Signal:
    """Information from poses: derivatives of their whitened measurements by standard normal unknowns.

    ``B``: (N, c, size) derivatives of the c whitened numbers of each pose: by the geometry in units of the tolerances, then
    by the pose of a free instrument in units of ``FREE``. ``names``: names of the geometry's p parameters.
    """

    B: Floats
    names: tuple[str, ...]

    def information(self, rows: Rows | None = None) -> Floats:
        """(size, size) B'B summed over the poses ``rows``; None: over all."""
        B = self.B if rows is None else self.B[rows]
        flat = B.reshape(-1, B.shape[2])
        return np.asarray(flat.T @ flat)

    def nats(self, rows: Rows | None = None) -> float:
        """log det(I + B'B), which D-optimal poses maximise: twice the mutual information of measurements and unknowns, nats."""
        information = self.information(rows)
        return float(np.linalg.slogdet(np.eye(len(information)) + information)[1])

    def covariance(self, rows: Rows | None = None) -> Floats:
        """(p, p) covariance of the geometry after measuring, in units of the tolerances."""
        information = self.information(rows)
        p = len(self.names)
        return np.asarray(np.linalg.inv(np.eye(len(information)) + information)[:p, :p])

    def variance_reduction(self, rows: Rows | None = None) -> Floats:
        """(p,) variance reduction of each parameter by measuring."""
        return np.asarray(1.0 - np.diag(self.covariance(rows)))

    def observability(self, rows: Rows | None = None) -> Observability:
        """Observability by measuring: variance reduction by direction, and the indices O1 to O5."""
        B = self.B if rows is None else self.B[rows]
        p, size = len(self.names), self.B.shape[2]
        free = np.eye(size)[p:]  # the instrument's pose has a prior here, so that few poses give information too
        return observability(np.vstack([B.reshape(-1, size), free]), p, B.shape[0] * B.shape[1])


def signal(model: Model, q: Floats, noise: Noise, *, orientation: bool = True, free_frame: bool = False) -> Signal:
    """Information from measuring at commands q (N, n), with the geometry's tolerances as priors.

    ``noise``: noise of the poses. Where it has a line of sight, this must be that of the same poses. ``orientation``:
    whether orientations are measured too. ``free_frame``: whether the instrument's pose is identified too.

    Raises `UnreachableError` if the commands can't be reached.
    """
    kinematics = model.kinematics
    poses = reached_poses(kinematics, q)
    components = 6 if orientation else 3
    J = kinematics.geometry_jacobian(q, poses)[:, :6] * model.geometry.tolerance
    J = in_frame(J, model.frame)
    if free_frame:
        T = model.in_instrument_frame(poses).T
        J = np.concatenate([J, FREE * frame_motions(T - T.mean(axis=0))], axis=2)
    whitening = noise.whitening(in_frame(kinematics.command_jacobian(q, poses)[:, :6], model.frame), components)
    return Signal(whitening @ J[:, :components], model.geometry.names)


def best_poses(signal: Signal, count: int) -> Rows:
    """(count,) ascending rows of the poses that together give most information (D-optimal): greedy choice, then exchanges.

    An exchange replaces one pose by the pose with the largest gain (Fedorov 1972). At the end no exchange of a single pose
    improves the result; this need not be the global optimum.

    Raises `ModelError` if there are not that many poses.
    """
    if not 0 < count <= len(signal.B):
        raise ModelError(
            f"{count} poses out of {len(signal.B)}", hint="ask for at least one, and no more than there are"
        )
    chosen: list[int] = []
    for _ in range(count):
        gain = _gains(signal, chosen)
        chosen.append(int(gain.argmax()))
    improved = True
    while improved:
        improved = False
        for place, row in enumerate(chosen):
            others = chosen[:place] + chosen[place + 1 :]
            gain = _gains(signal, others)
            best = int(gain.argmax())
            if gain[best] > gain[row] + WORTH:
                chosen[place] = best
                improved = True
    return np.array(sorted(chosen))


def _gains(signal: Signal, chosen: list[int]) -> Floats:
    """(N,) gain of each pose, nats, given the chosen ones; minus infinity for chosen poses."""
    information = signal.information(np.array(chosen, dtype=np.intp))
    gain = gains(signal.B, np.eye(len(information)) + information)
    gain[chosen] = -np.inf
    return gain


@dataclass(frozen=True)
class Plan:
    """The best poses out of candidates, compared with random poses.

    - ``rows``: (count,) the chosen candidates.
    - ``nats``, ``random_nats``: log det(I + B'B) of the chosen poses, and (draws,) of random choices of as many.
    - ``error``, ``random_error``: root mean square error, m, of the positions that the model predicts at other commands
      after a calibration: with the chosen poses, and (draws,) with random ones.
    - ``variance_reduction``: (p,) variance reduction of each parameter with the chosen poses.
    - ``observability``: variance reduction by direction, and the indices O1 to O5.
    """

    rows: Rows
    nats: float
    random_nats: Floats
    error: float
    random_error: Floats
    variance_reduction: Floats
    observability: Observability


@in_one_thread
@gives_read_only
def plan_poses(
    model: Model,
    candidates: Floats,
    count: int,
    noise: Noise,
    at: Floats,
    *,
    orientation: bool = True,
    free_frame: bool = False,
    draws: int = 100,
    seed: int = 0,
) -> Plan:
    """Choose the best poses for a calibration.

    ``candidates``: (N, n) commands to choose from, m or rad. ``count``: number of poses to choose. ``noise``,
    ``orientation``, ``free_frame``: see :func:`signal`. ``at``: (M, n) commands, m or rad, at which
    the errors of the calibrated model are computed. ``draws``, ``seed``: number of random choices to compare with, and
    their seed.

    Raises `ModelError` if there are fewer candidates than are to be chosen. `UnreachableError` if commands can't be
    reached.
    """
    candidate_signal = signal(model, candidates, noise, orientation=orientation, free_frame=free_frame)
    rows = best_poses(candidate_signal, count)
    rng = generator(seed)
    random = [rng.choice(len(candidates), count, replace=False) for _ in range(draws)]
    predicted = model.kinematics.geometry_jacobian(at, reached_poses(model.kinematics, at))[:, :3]
    scaled = predicted * model.geometry.tolerance

    def error(rows: Rows) -> float:
        spread = np.einsum("nip,pq,niq->n", scaled, candidate_signal.covariance(rows), scaled, optimize=True)
        return float(np.sqrt(spread.mean()))

    return Plan(
        rows=rows,
        nats=candidate_signal.nats(rows),
        random_nats=np.array([candidate_signal.nats(drawn) for drawn in random]),
        error=error(rows),
        random_error=np.array([error(drawn) for drawn in random]),
        variance_reduction=candidate_signal.variance_reduction(rows),
        observability=candidate_signal.observability(rows),
    )
