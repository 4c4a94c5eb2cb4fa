"""The model: a robot's geometry, and the pose of its base in the instrument's frame."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.linalg import block_diag

from gtpin.data.ids import normal_ids
from gtpin.data.instrument_tables import InstrumentTable, TrackerTable
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.operating_points import Column
from gtpin.errors import ModelError, renamed
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.poses import Poses
from gtpin.model.fit_conditions import FitConditions, ModelDiscrepancy
from gtpin.paper.kinematics import kinematics_of
from gtpin.real import real
from gtpin.robot.chain import Chain
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats

ROUNDING = 1e-9
"""Largest difference, relative to the standard deviations, of a joint covariance from the covariances of its parts."""


@dataclass(frozen=True)
class FittedInstrument:
    """An instrument whose unknowns were identified together with a model.

    - ``table``: its ``[[instrument]]`` section of dataset.toml.
    - ``columns``: names of the columns of numbers in its table of rows. They determine what is predicted: an orientation
      only where it was measured.
    - ``known``: by name of a column of ids (``station``, ``target``, ...): the ids in it.
    - ``unknowns``: by name, the identified value of each unknown less its declared value, m or rad.
    """

    table: InstrumentTable
    columns: tuple[str, ...] = ()
    known: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    unknowns: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Its name in dataset.toml."""
        return self.table.name

    @property
    def targets(self) -> dict[str, Floats]:
        """(3,) place of each target on the platform, TCP frame, m, by id: a single one has the id ``""``."""
        known = {} if self.table.targetless else self.table.fixed_targets
        return {key: np.array(at) + self.deviation(f"target[{key}]" if key else "target") for key, at in known.items()}

    def deviation(self, what: str, parts: Sequence[str] = ("x", "y", "z")) -> Floats:
        """Deviations of some unknowns from their declared values, m or rad; zeros for those that are known."""
        return np.array([self.unknowns.get(f"{self.name}.{what}.{part}", 0.0) for part in parts])


@dataclass(frozen=True)
class Frame:
    """Pose of the robot's base frame in the instrument's frame: a point p of the base frame is at T + R p.

    Parameters
    ----------
    T, R
        (3,) position, m, and (3, 3) rotation; by default the two frames are equal.

    Examples
    --------
    >>> import numpy as np
    >>> import gtpin
    >>> frame = gtpin.Frame(T=np.array([0.0, 0.0, 1.5]))
    >>> frame.R.shape
    (3, 3)
    """

    T: Floats = field(default_factory=lambda: np.zeros(3))
    R: Floats = field(default_factory=lambda: np.eye(3))

    @property
    def is_base(self) -> bool:
        """Whether the two frames are equal: the instrument measures in the base frame."""
        return not self.T.any() and bool((np.eye(3) == self.R).all())


def in_frame(J: Floats, frame: Frame) -> Floats:
    """Derivatives (N, 6 + j, p) of poses in the base frame, and of j joints, transformed to the instrument's frame."""
    if frame.is_base:
        return J
    seen = J.copy()
    seen[:, :3], seen[:, 3:6] = frame.R @ J[:, :3], frame.R @ J[:, 3:6]
    return seen


@dataclass(frozen=True, repr=False)
class Model:
    """Predicts poses from a geometry and active effects, in the instrument's frame; in the base frame of data of schema 2.

    It has no reference to the data from which it was identified.

    Parameters
    ----------
    geometry
        Geometry of a robot.
    frame
        The base frame in the instrument's frame; by default, the instrument measures in the base frame.
    effects
        Effects that the geometry does not describe, with their coefficients.
    covariance
        (p, p) posterior covariance of the geometry's parameters, m, rad and m/m; None if they are nominal.
    instruments
        The instruments of a dataset of schema 2, with the values of their unknowns; empty for one tracker. With such
        instruments, ``frame`` keeps its default, and predictions are in the base frame.
    joint_covariance
        (p + m, p + m) posterior covariance of the p parameters of the geometry, then the m coefficients of all effects in the
        order of ``effects``. None where it is not known, or there are no effects.
    between_members
        (p, p) covariance of the geometry's parameters between the members of open classes, each in the place of its cause:
        the other covariances hold with ``effects``. None where no class is open.
    fit
        Noise and temperatures of the poses that the model was fitted to; None where they are not known.
    unexplained
        What the model left unexplained of the data that it was fitted to; None where it is not known.
    doubt
        What else the data of the fit agree with, with a geometry much nearer to nominal, in words: the parameters may all be
        wrong. Empty where nothing is known.

    Examples
    --------
    >>> import gtpin
    >>> model = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau")))
    >>> model.predict(model.robot.home_q[None]).T.shape
    (1, 3)
    """

    geometry: Geometry
    frame: Frame = field(default_factory=Frame)
    effects: tuple[ActiveEffect, ...] = ()
    covariance: Floats | None = None
    instruments: tuple[FittedInstrument, ...] = ()
    joint_covariance: Floats | None = None
    fit: FitConditions | None = None
    unexplained: ModelDiscrepancy | None = None
    doubt: str = ""
    between_members: Floats | None = None

    def __repr__(self) -> str:
        effects = ", ".join(active.name for active in self.effects) or "none"
        known = "nominal" if self.covariance is None else "identified"
        return f"Model of {self.robot.name}: {known} geometry, effects: {effects}"

    @property
    def robot(self) -> Chain:
        """The robot, with its nominal geometry."""
        return self.geometry.robot

    @cached_property
    def kinematics(self) -> Kinematics:
        """The kinematics of the model's geometry, without effects, in the base frame."""
        return kinematics_of(self.geometry)

    def predict(self, q: npt.ArrayLike, covariates: Mapping[str, Column] | None = None) -> Poses:
        """Poses (N) that the instrument would read without noise at commands q (N, n), in the instrument's frame.

        Of a model that was identified from named instruments (``[[instrument]]``) they are those of the TCP in the base frame:
        each instrument has a frame and targets of its own.

        Parameters
        ----------
        q
            (N, n) commands, m or rad.
        covariates
            By name, (N,) each: the covariates on which the effects depend; None where they depend on none. For a session that
            was not in the fit, an effect of sessions takes the mean over the fitted sessions, with a warning.

        Returns
        -------
        poses
            NaN where the robot can't reach the pose.

        Raises
        ------
        ModelError
            If a covariate that an effect needs is missing, or is not N finite numbers (ids, for the session).
        """
        commands = real(q, "commands")
        kinematics = self.kinematics
        if not self.effects:
            return self.in_instrument_frame(kinematics.forward(commands))
        known = {name: _column(name, values, len(commands)) for name, values in (covariates or {}).items()}
        return self.in_instrument_frame(with_effects(kinematics, commands, known, self.effects))

    def without(self, names: Collection[str]) -> Model:
        """The model without the effects whose names (``effect@site``) are in ``names``; unknown names are ignored."""
        kept = tuple(active for active in self.effects if active.name not in names)
        joint = self.joint_covariance
        if joint is not None:
            sizes = [len(self.geometry.parameters), *(len(active.coefficients) for active in self.effects)]
            rows = np.repeat([True, *(active.name not in names for active in self.effects)], sizes)
            joint = joint[np.ix_(rows, rows)] if kept else None
        return replace(self, effects=kept, joint_covariance=joint)

    def sample(self, n: int, rng: np.random.Generator) -> tuple[Model, ...]:
        """Models drawn from the posterior: machines that the data of the fit allow.

        The geometry and the effects' coefficients are drawn from a normal distribution with ``joint_covariance``. Where that is
        None, they are drawn independently, from ``covariance`` and each effect's own covariance. A nominal geometry is drawn
        from its manufacturing tolerances. Nonlinear parameters of effects and the instrument keep their values.

        Parameters
        ----------
        n
            Number of models.
        rng
            Source of random numbers.

        Returns
        -------
        models
            The n models. Their covariances are zero: each stands for one machine.

        Examples
        --------
        >>> import numpy as np
        >>> import gtpin
        >>> machines = gtpin.read_model("ur5").sample(20, np.random.default_rng(0))
        >>> len(machines), machines[0].robot.name
        (20, 'ur5')
        """
        geometry, p = self.geometry, len(self.geometry.parameters)
        known = np.diag(geometry.tolerance**2) if self.covariance is None else self.covariance
        covariance = joined([known, *(active.covariance for active in self.effects)], self.joint_covariance)
        mean = np.concatenate([geometry.values, *(active.coefficients for active in self.effects)])
        ends = p + np.cumsum([0, *(len(active.coefficients) for active in self.effects)])
        return tuple(
            replace(
                self,
                geometry=geometry.with_values(x[:p]),
                effects=tuple(
                    replace(active, coefficients=x[start:end], covariance=np.zeros_like(active.covariance))
                    for active, start, end in zip(self.effects, ends, ends[1:], strict=False)
                ),
                covariance=np.zeros_like(known),
                joint_covariance=None,
                between_members=None,
            )
            for x in draws(mean, covariance, n, rng)
        )

    @property
    def geometry_covariance(self) -> Floats | None:
        """(p, p) covariance of the geometry's parameters, whichever member of an open class is the cause; None if nominal."""
        p = len(self.geometry.parameters)
        own = self.covariance if self.joint_covariance is None else self.joint_covariance[:p, :p]
        return own if own is None or self.between_members is None else own + self.between_members

    @property
    def targets(self) -> dict[str, pin.SE3]:
        """Places of the measured targets on the TCP, by the names that their links have in an export; not those at the TCP.

        An only target is ``target``, another one ``target_NAME_ID`` of the instrument NAME. Of a target that several
        instruments measure, each has its own.
        """
        if self.geometry.target is not None:
            return {"target": pin.exp6(self.geometry.target)}
        found = {
            "_".join(part for part in ("target", one.name, key) if part): pin.SE3(
                pin.exp3(one.deviation(f"target[{key}]" if key else "target", ("rx", "ry", "rz"))), at
            )
            for one in self.instruments
            for key, at in one.targets.items()
            if at.any()
        }
        if len(found) == 1:
            (only,) = found.values()
            return {"target": only}
        return found

    @property
    def targets_free(self) -> bool:
        """Whether every target was ``free``: the tool then stays where the robot's file has it."""
        tables = [one.table for one in self.instruments if not one.table.targetless]
        free = [isinstance(table, TrackerTable) and table.target == "free" for table in tables]
        return self.geometry.target is not None or (bool(free) and all(free))

    @property
    def free_target(self) -> bool:
        """Whether the place of every measured target on the tool was unknown: the data then show nothing of the tool.

        So it is where a target was declared ``free``, or only to within more than the tool's own tolerance.
        """
        if self.geometry.target is not None:
            return True
        tool = [p.tolerance for p in self.geometry.parameters if p.kind == "platform" and p.unit == "m"]
        tables = [one.table for one in self.instruments if not one.table.targetless]
        return bool(tables) and all(
            (isinstance(table, TrackerTable) and table.target == "free")
            or table.target_sigma > max(tool, default=np.inf)
            for table in tables
        )

    def of_tool(self) -> Model:
        """The model whose poses are those of the robot's own TCP, in the place of a free target; the same where there is none.

        The TCP is where the robot's file has it, within the robot's tolerances, independent of the other parameters:
        :meth:`~gtpin.robot.geometry.Geometry.at_tool`.
        """
        if self.geometry.target is None:
            return self
        geometry = self.geometry.at_tool()
        tool = np.array([p.kind == "platform" for p in geometry.parameters])

        def independent(covariance: Floats | None) -> Floats | None:
            if covariance is None:
                return None
            found, own = covariance.copy(), np.flatnonzero(tool)
            found[own], found[:, own] = 0.0, 0.0
            found[own, own] = geometry.tolerance[tool] ** 2
            return found

        joint, between = independent(self.joint_covariance), self.between_members
        return replace(
            self,
            geometry=geometry,
            covariance=independent(self.covariance),
            joint_covariance=joint,
            between_members=between if between is None else between * np.outer(~tool, ~tool),
        )

    seen = renamed("seen", "in_instrument_frame")

    def in_instrument_frame(self, poses: Poses) -> Poses:
        """``poses``, given in the base frame, transformed to the instrument's frame."""
        return poses if self.frame.is_base else poses.moved(self.frame.T, self.frame.R)


def _column(name: str, values: npt.ArrayLike, count: int) -> Column:
    """A covariate in the form that effects need: sessions as ids in their normal form, all others as finite numbers."""
    try:
        column: Column = normal_ids(np.ravel(values)) if name == "session" else real(values, f"the covariate {name}")
    except (TypeError, ValueError) as error:
        raise ModelError(f"the covariate {name} can't be: {error}", column=name) from None
    if column.shape != (count,):
        raise ModelError(f"the covariate {name} has shape {column.shape} for {count} commands", column=name)
    if name != "session" and not np.isfinite(np.asarray(column, dtype=float)).all():
        raise ModelError(f"the covariate {name} is not finite everywhere", column=name, hint="leave those poses out")
    return column


def joined(parts: Sequence[Floats], joint: Floats | None) -> Floats:
    """Covariance of all parts together: ``joint`` where its diagonal blocks are the parts, else without cross-covariances.

    ``parts``: (m_i, m_i) covariance of each part: of the geometry, then of each effect's coefficients. ``joint``: (m, m), m
    the sum of the m_i; None where it is not known.
    """
    apart = np.asarray(block_diag(*parts), dtype=float)
    if joint is None or joint.shape != apart.shape:
        return apart
    sigma = np.sqrt(np.maximum(apart.diagonal(), 0.0))
    inside = np.asarray(block_diag(*(np.ones_like(part) for part in parts)), dtype=bool)
    off = np.abs(joint - apart) > ROUNDING * np.outer(sigma, sigma)
    return apart if (off & inside).any() else joint


def inverse_root(information: Floats) -> Floats:
    """F (m, m) with F F' the inverse of a symmetric matrix with positive eigenvalues.

    From eigenvectors: an inverse that is computed row by row is not symmetric, and where its variances differ much in size, the
    root of either half has variances that are far too large.
    """
    size = np.sqrt(information.diagonal())
    values, vectors = np.linalg.eigh(information / np.outer(size, size))
    return np.asarray(vectors / np.sqrt(np.maximum(values, np.finfo(float).eps)) / size[:, None])


def draws(mean: Floats, covariance: Floats, n: int, rng: np.random.Generator) -> Floats:
    """(n, m) draws of a normal distribution with mean (m,) and covariance (m, m), which may be singular."""
    return np.asarray(mean + rng.standard_normal((n, len(mean))) @ root_of(covariance).T)


def root_of(covariance: Floats) -> Floats:
    """F with F F' = ``covariance``, which may be singular; of all such F the one that rounding does not turn.

    Scaled to correlations, it is the symmetric root: signs and, of equal eigenvalues, directions of eigenvectors are arbitrary.
    """
    sigma = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
    size = np.where(sigma > 0.0, sigma, 1.0)
    # Parameters have different units: the eigenvalues are those of the correlations.
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    return np.asarray(size[:, None] * ((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T))
