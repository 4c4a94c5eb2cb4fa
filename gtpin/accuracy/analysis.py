"""An accuracy analysis: the sensitivity to each parameter, and the errors to expect over the workspace."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from gtpin.accuracy.dexterity import dexterity
from gtpin.accuracy.expected import ExpectedError, Uncertainty, expected_error, mean_length, response
from gtpin.accuracy.sensitivity import Sensitivity, rod_names, sensitivity
from gtpin.accuracy.workspace import Workspace, default_commands, space_of
from gtpin.errors import ModelError, check_kind, noted
from gtpin.kinematics.rotations import well_defined, zyz
from gtpin.model.model import Model
from gtpin.model.place import free_motions
from gtpin.output.shown import SavedResult, present
from gtpin.read_only import gives_read_only
from gtpin.real import real
from gtpin.threads import in_one_thread
from gtpin.typing import Floats

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


SCHEMA = "gtpin-accuracy/1"


@dataclass(frozen=True, repr=False)
class Accuracy(SavedResult):
    """An accuracy analysis of a model.

    Parameters
    ----------
    model, q
        The model, and the (N, n) commands, m or rad, at which it was analysed.
    sensitivity
        The motion of the TCP by a step in each parameter of each part (Dressler et al. 2010, Table III), at these commands.
    uncertainty, uncertain
        The uncertainty that causes the expected errors, and its source as text.
    expected
        The expected errors of the TCP.
    seed
        Seed of the random machines of ``expected``, and of the postures of a robot without rods.
    filling
        Whether the commands were chosen to fill the ranges of the actuators, and not given.
    warnings
        Texts of all warnings.

    Examples
    --------
    >>> import gtpin
    >>> accuracy = gtpin.analyse(gtpin.read_model("gantry_tau"))
    >>> accuracy.to_dataframe().columns.tolist()
    ['parameter', 'link', 'position_mm', 'rotation_rad', 'cost_m4']
    """

    model: Model
    q: Floats
    sensitivity: Sensitivity
    uncertainty: Uncertainty
    uncertain: str
    expected: ExpectedError
    seed: int = 0
    filling: bool = False
    warnings: tuple[str, ...] = ()

    @cached_property
    def space(self) -> Workspace:
        """The workspace for maps: see :func:`~gtpin.accuracy.workspace.space_of`."""
        return space_of(self.model, self.q, self.seed)

    @cached_property
    def maps(self) -> dict[str, Floats]:
        """By name, (M,) values at the postures of the workspace: expected errors, m and rad, and measures of dexterity.

        Orientations that never change, and values that are infinite everywhere, are left out. The condition number is
        infinite everywhere if the TCP is on the axis of a joint, whose command then does not move it.
        """
        covariance, at = response(self.model, self.space.q, self.uncertainty).covariance, self.space.dexterity
        found = {"position error": mean_length(covariance[:, :3, :3])}
        if not self.model.geometry.positions_only:
            found["orientation error"] = mean_length(covariance[:, 3:, 3:])
        found |= {"condition number": at.condition, "distance from singularity": at.singularity}
        return {name: values for name, values in found.items() if np.isfinite(values).any()}

    def to_json(self) -> dict[str, Any]:
        """The content of accuracy.json, SI units.

        ``schema``; ``robot``; ``poses``, their number; ``step`` of the sensitivity, m or rad; ``uncertainty``, its source as
        text; ``expected.position`` (m) and ``expected.orientation`` (rad), each with ``mean`` over the poses, ``p95`` over
        random machines and poses, and ``maximum``, the mean over machines of the largest error over the poses; ``zyz_range``,
        ranges of the ZYZ Euler angles over the poses (rad), null near their singularity; ``dexterity``, the ``least``,
        ``median`` and ``most`` of each measure over the poses that the robot has (see
        :class:`~gtpin.accuracy.dexterity.Dexterity`), null where it is infinite; ``warnings``. Values of orientation are null
        for a reduced arm.
        """
        poses = self.model.kinematics.forward(self.q)
        turns = self.expected.orientation is not None and not self.model.geometry.positions_only
        errors = {"position": self.expected.position, "orientation": self.expected.orientation if turns else None}
        measures = dexterity(self.model, self.q, poses).measures()
        return {
            "schema": SCHEMA,
            "robot": self.model.robot.name,
            "poses": len(self.q),
            "step": self.sensitivity.step,
            "uncertainty": self.uncertain,
            "expected": {
                name: None if error is None else {"mean": error.mean, "p95": error.p95, "maximum": error.maximum}
                for name, error in errors.items()
            },
            "zyz_range": dict(zip(("alpha", "beta", "gamma"), np.ptp(zyz(poses.R), axis=0).tolist(), strict=True))
            if turns and well_defined(poses.R)
            else None,
            "dexterity": {name: _range_json(values) for name, values in measures.items()},
            "warnings": list(self.warnings),
        }

    def plot_workspace(self, quantity: str = "position error") -> Figure:
        """Plot slices of the workspace, coloured by an expected error or a measure of dexterity.

        ``quantity``: ``position error``, ``orientation error``, ``condition number`` or ``distance from singularity``.
        """
        figure: Figure = present(self).workspace(quantity)
        return figure

    def plot_parameters(self) -> Figure:
        """Mean change of the TCP's position by a step in each parameter of each link, as a table."""
        figure: Figure = present(self).parameters()
        return figure


@in_one_thread
@gives_read_only
def analyse(
    model: Model,
    q: Floats | None = None,
    *,
    costs: Mapping[str, float] | None = None,
    cost_poses: int = 61,
    uncertainty: Uncertainty | None = None,
    seed: int = 0,
) -> Accuracy:
    """Analyse a model's accuracy.

    Parameters
    ----------
    q
        (N, n) commands, m or rad; None: commands that fill the workspace.
    costs
        For a robot with rods: by link, the cost after a calibration: the sum over ``cost_poses`` poses of the squared closure
        residual, m^4 (Dressler et al. 2010, Table II); None where costs are not known.
    cost_poses
        Number of poses of these sums; 61 in the paper.
    uncertainty
        The uncertainty of the machine. By default: where ``costs`` are given, closure residuals of their size; else the
        geometry, with its covariance, or with its tolerances where it is nominal.
    seed
        Seed of the random machines, and of the commands and postures that fill the ranges of a robot without rods.

    Raises
    ------
    ModelError
        If a robot without rods is given ``costs``, or a link has no cost or an impossible one.
    UnreachableError
        If the commands can't be reached.

    Examples
    --------
    >>> import gtpin
    >>> import numpy as np
    >>> found = gtpin.analyse(gtpin.read_model("gantry_tau"), np.array([[0.1, 0.2, 0.0], [-0.3, -0.1, -0.2]]))
    >>> found.q.shape
    (2, 3)
    """
    check_kind(model, Model)
    filling = q is None
    with noted() as texts:
        q = default_commands(model, seed=seed) if q is None else real(q, "commands")
        sigmas = None if costs is None else _sigmas(model, costs, cost_poses)
        found = sensitivity(model, q, sigmas=sigmas)
        uncertain = "as given"
        if uncertainty is None:
            uncertain, uncertainty = _usual_uncertainty(model, sigmas)
        expected = expected_error(model, q, uncertainty, seed=seed)
    return Accuracy(model, q, found, uncertainty, uncertain, expected, seed, filling, tuple(dict.fromkeys(texts)))


def _usual_uncertainty(model: Model, sigmas: Floats | None) -> tuple[str, Uncertainty]:
    if sigmas is not None:
        return "closure residuals of the given costs", Uncertainty(closures=sigmas)
    if model.covariance is not None:
        free = ", without where the machine stands" if free_motions(model).size else ""
        return f"covariance of the calibration{free}", Uncertainty(model.covariance)
    sizes: dict[str, list[float]] = {}
    for p in model.geometry.parameters:
        sizes.setdefault(p.unit, []).append(1e3 * p.tolerance)
    ranges = [f"{min(of):g}{f' to {max(of):g}' if max(of) > min(of) else ''} m{unit}" for unit, of in sizes.items()]
    assumed = "" if model.robot.tolerance else ", which are assumed: the robot's description gives none"
    words = f"manufacturing tolerances (1 sigma) of {' and '.join(ranges)}{assumed}"
    return words, Uncertainty(np.diag(model.geometry.tolerance**2))


def _sigmas(model: Model, costs: Mapping[str, float], poses: int) -> Floats:
    links = rod_names(model)
    if set(costs) != set(links) or poses < 1 or not all(0.0 <= cost < np.inf for cost in costs.values()):
        raise ModelError(
            "costs that can't be the model's", hint=f"give one in m^4 for each of the links {', '.join(links)}"
        )
    return np.sqrt(np.array([costs[link] for link in links]) / poses)


def _range_json(values: Floats) -> dict[str, Any]:
    """Smallest value, median and largest value over the poses (N) or (N, c), as JSON; None for values that are not finite."""
    figures = {"least": values.min(axis=0), "median": np.median(values, axis=0), "most": values.max(axis=0)}
    return {name: np.asarray(np.where(np.isfinite(v), v, None)).tolist() for name, v in figures.items()}
