"""The uncertainty budget of the corrected machine (GUM, JCGM 100): contributions to the error of the TCP's pose."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from gtpin.accuracy.expected import ErrorResponse, expected_of
from gtpin.distributions import norm, t, truncated
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import turning_joint
from gtpin.extras.certificate.held_against import ModelPosterior, by_commands
from gtpin.extras.certificate.quantity import Missing
from gtpin.model.model import root_of
from gtpin.typing import Floats

COVERAGE = 2.0
"""Coverage factor k: 95 % of a normal distribution (JCGM 100, 6.3.3)."""
Source = Literal["model", "frame", "repeatability", "unexplained", "instrument"]
DIRECTIONS, UNKNOWNS = 6, 3
"""Number of listed directions of the unknowns, and number of unknowns listed for each."""
DRAWS = 1000
"""Number of machines that are drawn to compute the radius."""


def unexplained(observed: float, noise: float, posterior: float, freedom: float) -> float:
    """The unexplained mean square of errors between poses, m^2 or rad^2, enlarged so that coverage factor 2 gives 95 % although
    it is estimated from few errors.

    Errors are assumed to be isotropic normal vectors: the relative standard deviation of a mean square with f degrees of
    freedom is sqrt(2 / f). With a flat prior on values above 0, the unexplained variance has a truncated normal posterior
    with mean m and standard deviation d. It has nu = 2 (m / d)^2 degrees of freedom (JCGM 100, E.4.3 and G.4.2), and its
    sum with the model's variance v has nu ((v + m) / m)^2 (Welch and Satterthwaite, G.4.1). Student's quantile t for these
    degrees of freedom would replace the coverage factor 2 (G.3.2). To keep the factor 2, the sum is multiplied by (t /
    2)^2, and the increase is added to the unexplained part.

    ``observed``: mean square length of the errors at poses that were not fitted. ``noise``, ``posterior``: expected parts,
    by the scatter of visits and by the model's uncertainty: mean traces of their covariances. ``freedom``: degrees of
    freedom of ``observed``: three for each different pose, less the effective number of fitted parameters. Repeated visits
    of a pose add none.
    """
    mean, sd = truncated(observed - noise - posterior, observed * float(np.sqrt(2.0 / freedom)))
    whole = posterior + mean
    factor = float(t.isf(norm.sf(COVERAGE), 2.0 * (whole / sd) ** 2)) / COVERAGE
    return whole * factor**2 - posterior


def mean_trace(covariance: Floats) -> float:
    """Mean trace of covariances (N, 3, 3)."""
    return float(np.trace(covariance, axis1=1, axis2=2).mean())


@dataclass(frozen=True)
class Contribution:
    """One row of the budget.

    Parameters
    ----------
    source
        What contributes.
    covariance
        (N, 6, 6) covariance that it adds to the TCP's pose, m and rad, at each pose of the budget; None where it is not known.
    input
        Standard uncertainty of the quantity that contributes, in ``unit``, where it is one number; else None.
    kind
        A: evaluated by statistics of the measurements; B: by other knowledge (JCGM 100, 4.2 and 4.3).
    missing
        Why ``covariance`` is None.
    """

    source: Source
    covariance: Floats | None
    input: float | None = None
    unit: str = ""
    kind: Literal["A", "B"] = "A"
    missing: Missing | None = None

    @property
    def position(self) -> float | None:
        """Its contribution to the standard uncertainty of the position, m: root of the sum of the axes' variances, averaged
        over the poses."""
        return None if self.covariance is None else float(np.sqrt(mean_trace(self.covariance[:, :3, :3])))

    @property
    def sensitivity(self) -> float | None:
        """``position`` over ``input``, m per ``unit``; None where one of them is not known."""
        return None if self.position is None or not self.input else self.position / self.input


@dataclass(frozen=True)
class ErrorDirection:
    """A direction in the space of the model's unknowns that is uncorrelated with the other directions.

    ``changes``: the three unknowns of this direction that move the TCP most: name, change for one standard deviation of the
    direction, and unit. ``position``: its contribution to the standard uncertainty of the position, m. The squares of all
    directions add up to the posterior's variance of the position.
    """

    changes: tuple[tuple[str, float, str], ...]
    position: float


@dataclass(frozen=True)
class Budget:
    """The uncertainty budget over N poses of the workspace.

    Parameters
    ----------
    q
        (N, n) commands of these poses, m or rad.
    rows
        The contributions.
    directions
        The six directions of the model's unknowns that contribute most.
    radius
        95th percentile of the length of the position error, m, over these poses and over machines drawn from the budget.
    orientation
        Whether orientation was measured.
    """

    q: Floats
    rows: tuple[Contribution, ...]
    directions: tuple[ErrorDirection, ...]
    radius: float
    orientation: bool

    @cached_property
    def covariance(self) -> Floats:
        """(N, 6, 6) combined covariance of the TCP's pose, m and rad (JCGM 100, 5.2.2)."""
        return np.asarray(sum(row.covariance for row in self.rows if row.covariance is not None))

    @cached_property
    def at(self) -> Floats:
        """(N, 6) expanded uncertainty of each axis at each pose, m and rad, with coverage factor 2."""
        return COVERAGE * np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @cached_property
    def combined(self) -> Floats:
        """(6,) combined standard uncertainty of each axis, m and rad: root mean square over the poses."""
        return np.asarray(np.sqrt((self.at**2).mean(axis=0)) / COVERAGE)

    @cached_property
    def largest(self) -> Floats:
        """(6,) the largest expanded uncertainty of each axis over the poses, m and rad."""
        return np.asarray(self.at.max(axis=0))

    def share(self, row: Contribution) -> float | None:
        """Share of a contribution in the position's variance, mean over the poses; None where not known. Shares sum to 1."""
        if row.covariance is None:
            return None
        whole = mean_trace(self.covariance[:, :3, :3])
        return mean_trace(row.covariance[:, :3, :3]) / max(whole, 1e-300)


def budget(
    posterior: ModelPosterior,
    at: OperatingPoints,
    repeatability: float | Missing,
    left: tuple[float, float],
    instrument: float | None,
    *,
    orientation: bool,
    seed: int = 0,
) -> Budget:
    """Propagate all contributions to the TCP at N commands, to first order.

    ``posterior``: uncertainty of the model's unknowns. ``at``: the commands. ``repeatability``: that of each actuator, m or
    rad, or why it is not known. ``left``: errors that the model does not explain, per axis: of position, m, and of
    orientation, rad (0 where not measured). ``instrument``: systematic error of the instrument, per axis, m, from its
    certificate; None where not known. ``orientation``: whether orientation was measured. ``seed``: seed of the machines that
    are drawn for ``radius``.
    """
    model, count, D = posterior.model, len(at.q), posterior.derivatives(at)
    # Geometry and effects are one contribution: they are correlated, and by themselves each can be far larger than both.
    half = D @ posterior.root
    rows = [Contribution("model", np.asarray(half @ np.swapaxes(half, 1, 2)))]
    fixed, fresh = [half], [np.zeros((count, 6, 0))]
    if posterior.frame is not None:
        F = posterior.frame.motions(model, at)
        rows.append(Contribution("frame", F @ posterior.frame.covariance @ np.swapaxes(F, 1, 2)))
        fixed.append(F @ root_of(posterior.frame.covariance))
    if isinstance(repeatability, str):
        rows.append(Contribution("repeatability", None, missing=repeatability))
    else:
        J = by_commands(model, at)
        unit = "rad" if all(turning_joint(model.robot, site) for site in model.robot.sites) else "m"
        rows.append(Contribution("repeatability", repeatability**2 * J @ np.swapaxes(J, 1, 2), repeatability, unit))
        fresh.append(J * repeatability)
    size = np.broadcast_to(np.diag([left[0]] * 3 + [left[1]] * 3), (count, 6, 6))
    rows.append(Contribution("unexplained", size**2, left[0], "m"))
    fresh.append(size)
    if instrument is None:
        rows.append(Contribution("instrument", None, kind="B", missing="not_stated"))
    else:
        size = np.broadcast_to(np.diag([instrument] * 3 + [0.0] * 3), (count, 6, 6))
        rows.append(Contribution("instrument", size**2, instrument, "m", kind="B"))
        fixed.append(size)
    response = ErrorResponse(np.concatenate(fixed, axis=2), np.concatenate(fresh, axis=2))
    expected = expected_of(response, draws=DRAWS, seed=seed)
    return Budget(at.q, tuple(rows), _directions(posterior, D), expected.position.p95, orientation)


def _directions(posterior: ModelPosterior, D: Floats) -> tuple[ErrorDirection, ...]:
    """Principal directions of the TCP's position error: eigenvectors of the mean over the poses of F' J' J F, with J the
    derivative of the position by the unknowns and F F' the posterior covariance."""
    model, root = posterior.model, posterior.root
    names: list[tuple[str, str]] = [(one.name, one.unit) for one in model.geometry.parameters]
    for active in model.effects:
        names += [(f"{active.name} [{k + 1}]", "") for k in range(len(active.coefficients))]
    moved = (D[:, :3] @ root).reshape(-1, root.shape[1])
    powers, axes = np.linalg.eigh(moved.T @ moved / len(D))
    motion = np.sqrt((D[:, :3] ** 2).sum(axis=1).mean(axis=0))
    found = []
    for i in range(len(powers) - 1, max(len(powers) - 1 - DIRECTIONS, -1), -1):
        change = root @ axes[:, i]
        largest: list[int] = np.argsort(-np.abs(change) * motion, kind="stable")[:UNKNOWNS].tolist()
        changes = tuple((names[k][0], float(change[k]), names[k][1]) for k in largest)
        found.append(ErrorDirection(changes, float(np.sqrt(max(powers[i], 0.0)))))
    return tuple(found)
