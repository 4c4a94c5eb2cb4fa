"""The identification regressor of a calibration, and its base parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import qr, solve_triangular

from gtpin.calibration.gauss_newton import Fit
from gtpin.calibration.problem import FRAME_UNIT
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats

if TYPE_CHECKING:
    import pandas as pd

RANK = 1e-8
"""Pivot of the triangular factor, relative to the largest, below which a column depends on those before it: that of FIGAROH's
QR decomposition."""
LEAST_FACTOR = 1e-6
"""Smallest factor, in units of the tolerances, of a parameter that is part of a base parameter: that of FIGAROH too."""


@dataclass(frozen=True, eq=False, repr=False)
class Regressor:
    """The stacked, whitened Jacobian of a fit: ``J x`` is the change of the predictions, in sigmas of the noise, by x.

    - ``J``: (m, k) derivative of the m predicted numbers by the k unknowns, in their own units: per m, rad or m/m.
    - ``residual``: (m,) measured less predicted, in sigmas of the noise.
    - ``prior``: (k,) 1-sigma prior of each unknown about its nominal value; infinite where it has none.
    - ``rows``: names of the m rows: pose and number, as ``("p12", "x")``. Where the noise of a pose's numbers is correlated, a
      whitened row is a combination of numbers of this pose.
    - ``columns``: names of the unknowns: parameters of the geometry, unknowns of the instruments, and ``frame.x`` to
      ``frame.rz`` of a free frame (about the middle of the measured positions).

    Rows are multiplied by the roots of the weights of the robust fit.
    """

    J: Floats
    residual: Floats
    prior: Floats
    rows: tuple[tuple[str, str], ...]
    columns: tuple[str, ...]

    def __repr__(self) -> str:
        return f"Regressor of {len(self.columns)} unknowns: {len(self.rows)} rows"

    def to_dataframe(self) -> pd.DataFrame:
        """J as a table with the names of its rows and columns."""
        import pandas as pd

        index = pd.MultiIndex.from_tuples(self.rows, names=["pose", "number"])
        return pd.DataFrame(self.J, index=index, columns=list(self.columns))


def regressor(fit: Fit, poses: Sequence[str]) -> Regressor:
    """The regressor of a fit. ``poses``: (N,) ids of its rows."""
    problem = fit.problem
    J = np.concatenate([problem.jacobian(fit.point, rows, fit.weight[rows]) for rows in problem.chunks()])
    geometry, frame = problem.start.geometry, ["x", "y", "z", "rx", "ry", "rz"] if problem.free_frame else []
    size = np.concatenate([geometry.tolerance, problem.unit, [FRAME_UNIT for _ in frame]])
    columns = (*geometry.names, *(one.name for one in problem.measured.unknowns), *(f"frame.{name}" for name in frame))
    names = problem.measured.number_names
    rows = [(pose, name) for pose, own in zip(poses, names, strict=True) for name in own]
    with np.errstate(divide="ignore"):
        prior = np.where(problem.prior > 1e-3, size / np.sqrt(problem.prior), np.inf)
    residual = (fit.residual * np.sqrt(fit.weight)[:, None]).ravel()
    return Regressor(J.reshape(-1, len(size)) / size, residual, prior, tuple(rows), columns)


@dataclass(frozen=True)
class BaseParameter:
    """A sum of parameters that the data determine; the parameters in it are not determined one by one.

    - ``name``: of the parameter that stands for the sum.
    - ``terms``: by name, the factor of each parameter's deviation from nominal; 1 for the first.
    - ``value``, ``sigma``: of the sum, in ``unit``.
    """

    name: str
    terms: dict[str, float]
    value: float
    sigma: float
    unit: str


def base_parameters(triangular: Floats, geometry: Geometry, covariance: Floats) -> tuple[BaseParameter, ...]:
    """The base parameters of a geometry, by QR factorisation with column pivoting of its regressor (Gautier 1991).

    With ``W P = Q R``, the first r columns independent and ``R = [R1 R2; 0 0]``, the data determine ``x1 + R1^-1 R2 x2``.

    ``triangular``: (r, p) a matrix F with F'F = W'W, W the whitened derivative by the p parameters in their tolerances.
    ``covariance``: (p, p) of the parameters.
    """
    R, order = qr(triangular, mode="r", pivoting=True)[:2]
    rank = int(np.count_nonzero(np.abs(np.diag(R)) > RANK * abs(R[0, 0])))
    beta = solve_triangular(R[:rank, :rank], R[:rank, rank:])
    found = []
    for i, parameter in enumerate(geometry.parameters[k] for k in order[:rank]):
        scaled = np.zeros(len(order))
        scaled[order[i]], scaled[order[rank:]] = 1.0, np.where(np.abs(beta[i]) > LEAST_FACTOR, beta[i], 0.0)
        weight = parameter.tolerance * scaled / geometry.tolerance
        terms = {geometry.names[k]: float(weight[k]) for k in (order[i], *order[rank:]) if weight[k]}
        sigma = float(np.sqrt(weight @ covariance @ weight))
        found.append(BaseParameter(parameter.name, terms, float(weight @ geometry.deviation), sigma, parameter.unit))
    return tuple(found)
