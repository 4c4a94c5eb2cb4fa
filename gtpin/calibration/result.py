"""The result of a calibration: values with sigmas, variance reduction, observability, and quality of the fit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from gtpin.calibration.observability import Direction, Observability
from gtpin.calibration.zeros import Zero, equivalent_zeros
from gtpin.data import Dataset, Instrument
from gtpin.estimate import Estimate
from gtpin.model.model import Model
from gtpin.noise.noise import Noise
from gtpin.output.shown import Shown, present
from gtpin.typing import Floats

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


Lengths = tuple[float, float | None]
CORRELATED = 0.7
"""Smallest absolute correlation of two parameters that is listed."""


@dataclass(frozen=True, repr=False)
class Calibration(Shown):
    """A calibrated model with its uncertainty and the quality of the fit.

    Parameters
    ----------
    model
        The model with the identified geometry. It predicts poses.
    covariance
        (p, p) posterior covariance of the geometry's parameters, m, rad and m/m, in the order of ``names``.
    observability
        Variance reduction along the principal directions of the parameter space, and observability indices.
    noise
        Noise of the measurements, declared or estimated.
    enlarged
        Ratio of the poses' mean residuals to the noise of such means where chi-square shows a lack of fit, else 1.
        ``covariance`` includes it already: it is computed with the noise multiplied by this ratio.
    freedom
        Degrees of freedom of the Student t distribution of the noise; infinite for Gaussian noise.
    poses, rejected
        Number of used rows, and the ids of poses with rows that were rejected as outliers.
    rejected_rows
        Line numbers of the rejected rows in their file. Other rows of the same pose may be used.
    chi2, dof
        Sum of squares of the whitened residuals; measured components minus effective number of parameters.
    iterations
        Number of Gauss-Newton steps, summed over the fits of the robust reweighting.
    residual
        (poses, 3 or 6) measured less predicted of the used rows, m and rad, instrument's frame.
    residual_before
        The same for the nominal geometry.
    instrument
        The dataset's instrument. A declared value that the data contradict is left out: it is estimated instead.
    dataset
        The input data.
    paper_model
        Number of the paper's model 1 to 5 whose parameters these are; None for the default parameters.
    left_out
        Root mean square length of the position errors, m, and of the orientation errors, rad (None where not measured), each
        pose predicted by a fit without it: see :func:`~gtpin.calibration.left_out.left_out`. None for readings.
    floor
        The same lengths as the noise alone would give; None where the noise was neither declared nor shown by repeated visits.
    warnings
        Texts of all warnings, also of those when the dataset was read.

    Examples
    --------
    >>> import gtpin
    >>> calibration = gtpin.calibrate(gtpin.Dataset.read("measured"))
    >>> length = calibration["length[2a]"]
    >>> low, high = length.interval
    >>> low < length.value < high
    True
    >>> calibration.to_dataframe().loc["length[2a]", "unit"]
    'm'
    """

    model: Model
    covariance: Floats
    observability: Observability
    noise: Noise
    enlarged: float
    freedom: float
    poses: int
    rejected: tuple[str, ...]
    rejected_rows: tuple[int, ...]
    chi2: float
    dof: float
    iterations: int
    residual: Floats
    residual_before: Floats
    instrument: Instrument
    dataset: Dataset
    paper_model: int | None = None
    left_out: Lengths | None = None
    floor: Lengths | None = None
    warnings: tuple[str, ...] = ()

    def used(self, dataset: Dataset) -> npt.NDArray[np.bool_]:
        """(N,) mask: True for the rows of ``dataset`` that the calibration used, False for outliers.

        ``dataset`` is the calibrated one or a part of it: rows are recognised by their line numbers.
        """
        return ~np.isin(dataset.row, self.rejected_rows)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the p parameters of the geometry."""
        return self.model.geometry.names

    @property
    def values(self) -> Floats:
        """(p,) identified values of the parameters, m, rad or m/m."""
        return self.model.geometry.values

    @cached_property
    def sigma(self) -> Floats:
        """(p,) standard deviations of the parameters, m, rad or m/m."""
        return np.sqrt(np.diag(self.covariance))

    @cached_property
    def learned(self) -> Floats:
        """(p,) Variance reduction 1 - (sigma / tolerance)^2: 0 if the data give no information on a parameter."""
        return np.asarray(1.0 - (self.sigma / self.model.geometry.tolerance) ** 2)

    @cached_property
    def correlation(self) -> Floats:
        """(p, p) correlations of the parameters."""
        return np.asarray(self.covariance / np.outer(self.sigma, self.sigma))

    @property
    def unobservable(self) -> tuple[Direction, ...]:
        """Directions in parameter space with a variance reduction below 0.5, the smallest first."""
        return self.observability.unobservable(self.names)

    @cached_property
    def zeros(self) -> tuple[Zero, ...]:
        """For each actuator that carries rods: the shift of its zero that is equivalent to the shifts of its joints."""
        return equivalent_zeros(self.model.geometry, self.covariance)

    @property
    def chi2_per_dof(self) -> float:
        """Chi-square per degree of freedom: 1 for a model that fits data whose noise is known."""
        return self.chi2 / self.dof

    def __getitem__(self, name: str) -> Estimate:
        """One parameter's value and sigma, by its name; `ModelError` where no parameter has this name."""
        value, index = self.model.geometry[name], self.names.index(name)
        return Estimate(value, float(self.sigma[index]), self.model.geometry.parameters[index].unit)

    def correlated(self, least: float = CORRELATED) -> list[tuple[str, str, float]]:
        """Pairs of parameters with an absolute correlation of at least ``least``, the strongest first.

        Each entry is (name, name, correlation).
        """
        i, j = np.triu_indices(len(self.names), 1)
        rho = self.correlation[i, j]
        order = [k for k in np.argsort(-np.abs(rho), kind="stable") if abs(rho[k]) >= least]
        return [(self.names[i[k]], self.names[j[k]], float(rho[k])) for k in order]

    def to_json(self) -> dict[str, Any]:
        """The content of ``calibration.json``."""
        return calibration_json(self)

    def save(self, folder: Path | str, *, force: bool = False) -> None:
        """Write what ``gtpin calibrate`` writes: ``model/``, ``calibration.json``, ``report.html`` and ``report.txt``.

        With ``force``, files of these names that gtpin has not written are renamed (``NAME.old-1``).
        """
        present(self).save(Path(folder), force=force)

    def plot_residuals(self, against: str, component: str | None = None) -> Figure:
        """Plot a component of the residuals against a command or covariate.

        Parameters
        ----------
        against
            The column: ``q1``, ``time``, ...
        component
            An axis of the pose (``x``, ``y``, ``z``, ``rx``, ``ry``, ``rz``), or the site of an actuator for the error of its
            travel. By default the first actuator. For a dataset of schema 2 a component of its readings takes the place of the
            axis and of the default: its name (``range``) where there is one instrument; where there are several, the
            instrument's name (``wire``), followed by the component if it reads more than one (``cup.x``).

        Raises
        ------
        DatasetError
            If there is no such column or component.
        """
        figure: Figure = present(self).residuals(against, component)
        return figure

    def plot_workspace(self, view: str = "xy") -> Figure:
        """Plot the position residuals in a plane of the base frame: ``xy``, ``xz`` or ``yz``.

        For a dataset of schema 2: the size of each reading's residual over its sigma.
        """
        figure: Figure = present(self).workspace(view)
        return figure

    def plot_ball_bar(self, circle: int = 0) -> Figure:
        """Polar plots of a circular test: deviations of the radius as measured, and as the calibrated geometry leaves them.

        The dataset needs a ``range`` instrument with readings along half a turn or more about a station, as a ball bar gives.

        Parameters
        ----------
        circle
            Index of the circle, counted from 0, where the dataset has several.

        Raises
        ------
        DatasetError
            If there is no such circle.
        """
        figure: Figure = present(self).ball_bar(circle)
        return figure

    def plot_parameters(self) -> Figure:
        """The table of the geometry's parameters, as a figure."""
        figure: Figure = present(self).parameters()
        return figure


def calibration_json(calibration: Calibration) -> dict[str, Any]:
    """The content of ``calibration.json``."""
    before, after = lengths(calibration.residual_before), lengths(calibration.residual)
    out, floor = (found or (None, None) for found in (calibration.left_out, calibration.floor))
    errors = {
        "position_rms_before": before[0],
        "position_rms_after": after[0],
        "position_rms_left_out": out[0],
        "position_noise_floor": floor[0],
        "orientation_rms_before": before[1],
        "orientation_rms_after": after[1],
        "orientation_rms_left_out": out[1],
        "orientation_noise_floor": floor[1],
    }
    noise = {
        "position_sigma": calibration.noise.position_sigma,
        "orientation_sigma": calibration.noise.orientation_sigma if calibration.residual.shape[1] == 6 else None,
        "repeatability": calibration.noise.repeatability,
        "lack": calibration.noise.lack,
        "range_ratio": calibration.noise.range_ratio if calibration.noise.sight is not None else None,
        "source": calibration.noise.source,
    }
    return fit_json(calibration, errors, noise)


def fit_json(calibration: Calibration, errors: dict[str, Any], noise: dict[str, Any]) -> dict[str, Any]:
    """The content of ``calibration.json`` with given errors and noise."""
    return {
        "schema": "gtpin-calibration/1",
        "model": "default" if calibration.paper_model is None else calibration.paper_model,
        "poses": calibration.poses,
        "rejected": list(calibration.rejected),
        **errors,
        "chi2_per_dof": calibration.chi2_per_dof,
        "iterations": calibration.iterations,
        "parameters": [
            {
                "name": p.name,
                "value": float(value),
                "sigma": float(sigma),
                "unit": p.unit,
                "nominal": p.nominal,
                "tolerance": p.tolerance,
                "learned": float(learned),
            }
            for p, value, sigma, learned in zip(
                calibration.model.geometry.parameters,
                calibration.values,
                calibration.sigma,
                calibration.learned,
                strict=True,
            )
        ],
        "unobservable": [{"direction": d.weights, "learned": d.learned} for d in calibration.unobservable],
        "equivalent_zeros": [
            {"site": z.site, "value": z.value, "sigma": z.sigma, "unit": z.unit} for z in calibration.zeros
        ],
        "correlations": [{"a": a, "b": b, "rho": rho} for a, b, rho in calibration.correlated()],
        "observability": calibration.observability.indices,
        "degrees_of_freedom": calibration.dof,
        "noise": {
            **noise,
            "tail_freedom": calibration.freedom if np.isfinite(calibration.freedom) else None,
            "enlarged": calibration.enlarged,
        },
        "warnings": list(calibration.warnings),
    }


def lengths(residual: Floats) -> tuple[float, float | None]:
    """Root mean square length of position (m) and rotation (rad) residuals."""
    position = float(np.sqrt((residual[:, :3] ** 2).sum(axis=1).mean()))
    if residual.shape[1] == 3:
        return position, None
    return position, float(np.sqrt((residual[:, 3:] ** 2).sum(axis=1).mean()))
