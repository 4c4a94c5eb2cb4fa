"""Effects with fitted coefficients, and their exact application: the closures are solved with the displaced parts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gtpin.effects.displacement import Displacement, along_track
from gtpin.effects.effect import Effect
from gtpin.effects.operating_points import PARTS, TURN, Column, OperatingPoints, References, part_of_turn
from gtpin.errors import ModelError, renamed, warn
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.poses import Poses, chunks
from gtpin.kinematics.rotations import exp
from gtpin.robot.chain import Chain
from gtpin.typing import Floats


@dataclass(frozen=True, eq=False)
class ActiveEffect:
    """An effect at a site, with its coefficients.

    - ``effect``, ``site``, ``shape_parameter``: the effect, its site, and the value of its nonlinear parameter; None where
      it has none.
    - ``coefficients``, ``covariance``: (m,) and (m, m), in the effect's own units.
    - ``references``: reference values of its covariates and loads.
    - ``further``: further values of the nonlinear parameter. Each value has its own coefficients.
    - ``only_measured``: for a deviation of a turning joint's travel: it is zero at angles that its fit did not have
      (:func:`~gtpin.effects.active.where_measured`).
    """

    effect: Effect
    site: str
    shape_parameter: float | None
    coefficients: Floats
    covariance: Floats
    references: References
    further: tuple[float, ...] = ()
    only_measured: bool = False
    nonlinear = renamed("nonlinear", "shape_parameter")

    @property
    def values(self) -> tuple[float, ...]:
        """All values of its nonlinear parameter."""
        return () if self.shape_parameter is None else (self.shape_parameter, *self.further)

    @property
    def name(self) -> str:
        """``effect@site``."""
        return f"{self.effect.id}@{self.site}"

    def basis(self, at: OperatingPoints) -> Displacement:
        """Displacements for unit coefficients, one column for each coefficient.

        Raises `ModelError` if a covariate that it needs is missing, or the number of coefficients is wrong.
        """
        try:
            if self.only_measured:
                basis = where_measured(at, self.effect, self.site, self.values)
            else:
                basis = self.effect.basis_of(at, self.site, self.values)
        except ModelError as error:
            raise ModelError(f"{error.what}, which {self.name} needs", column=error.column, hint=error.hint) from None
        if len(basis) != len(self.coefficients):
            raise ModelError(
                f"{self.name} has {len(self.coefficients)} coefficients instead of {len(basis)}",
                hint="fit it again with this version of the effect",
            )
        return basis


def with_effects(
    kinematics: Kinematics,
    q: Floats,
    covariates: Mapping[str, Column],
    effects: Sequence[ActiveEffect],
    plain: Poses | None = None,
) -> Poses:
    """Poses (base frame) at commands, with effects. The closures are solved again, exactly, with all displacements.

    ``q``: (N, n) commands, m or rad. ``covariates``: by name, (N,) each. ``plain``: the N poses without effects, base
    frame. By default they are computed.

    Raises `ModelError` if a covariate that an effect needs is missing, or an effect's number of coefficients is wrong.
    """
    plain = kinematics.forward(q) if plain is None else plain
    if not effects or not len(q):
        return plain
    found = plain.copy()
    reached = np.flatnonzero(plain.reached)
    for chunk in chunks(len(reached)) or [slice(0, 0)]:
        rows = reached[chunk]
        some = {name: values[rows] for name, values in covariates.items()}
        displaced = _displaced(kinematics, q[rows], plain[rows], some, effects)
        found.put(rows, displaced)
    lost = ~(np.isfinite(found.T).all(axis=1) & np.isfinite(found.R).all(axis=(1, 2)))
    found.T[lost], found.R[lost] = np.nan, np.nan
    return found


def _displaced(
    kinematics: Kinematics,
    q: Floats,
    plain: Poses,
    covariates: Mapping[str, Column],
    effects: Sequence[ActiveEffect],
) -> Poses:
    """Poses with effects, for rows whose closures the geometry without effects can solve."""
    commands, twist = q.copy(), np.zeros((len(q), 6 + 3 * len(plain.links)))
    twists = dict[int, Floats]()
    for active in effects:
        at = OperatingPoints(kinematics, q, plain, covariates, fixed=active.references)
        basis, c = active.basis(at), active.coefficients
        if basis.command is not None:
            commands[:, basis.command[0]] += basis.command[1] @ c
        moved = {index: twist @ c for index, twist in basis.placements}
        if basis.length is not None:
            _add(moved, at.lengthened(basis.length @ c))
        if basis.carrier_joints is not None:
            on_carriers = at.on_carriers(basis.carrier_joints)
            _add(moved, {index: twist @ c for index, twist in on_carriers.items()})
        _add(twists, moved)  # twists are small: their order is a second-order effect
        if basis.twist is not None:
            own = (basis.twist @ c)[:, : twist.shape[1]]
            twist[:, : own.shape[1]] += own
    poses = kinematics.displaced(q, plain, commands, twists)
    turns = exp(twist[:, 3:].reshape(len(q), -1, 3))
    links = {name: turns[:, i] @ R for i, (name, R) in enumerate(poses.links.items(), 1)}
    return replace(poses, T=poses.T + twist[:, :3], R=turns[:, 0] @ poses.R, links=links)


def _add(twists: dict[int, Floats], moved: Mapping[int, Floats]) -> None:
    for index, twist in moved.items():
        twists[index] = twists.get(index, 0.0) + twist


def where_measured(at: OperatingPoints, effect: Effect, site: str, values: tuple[float, ...]) -> Displacement:
    """The basis of a turning joint's deviation, as :meth:`~gtpin.effects.effect.Effect.basis_of`, for a new calibration.

    The deviation is zero at angles that the fit did not have. The geometry absorbs a deviation of the form
    p0 + p1 cos(q) + p2 sin(q), exactly or nearly; an earlier fit determines this part badly. It is subtracted by least squares
    over the angles of the fit, so that the new geometry need not absorb it at these angles alone.
    """
    j = at.robot.sites.index(site)
    lower, upper = (float(ends[j]) for ends in at.references.commands)
    middles = TURN * (np.arange(PARTS) + 0.5)[at.references.angles[j]] / PARTS  # of the measured parts of a turn
    angles = np.clip(_within(middles, lower, upper), lower, upper)
    at_home = _with(np.tile(at.robot.home_q, (len(angles), 1)), j, angles)
    there = replace(at, q=at_home, poses=at.kinematics.forward(at_home), covariates={}, fixed=at.references)
    columns = effect.basis_of(there, site, values).command
    assert columns is not None
    absorbed = np.linalg.lstsq(_absorbed(angles), columns[1], rcond=None)[0]
    q = _within(at.q[:, j], lower, upper)
    basis = effect.basis_of(replace(at, q=_with(at.q, j, q)), site, values)
    assert basis.command is not None
    kept = (basis.command[1] - _absorbed(q) @ absorbed) * at.references.angles[j][part_of_turn(at.q[:, j])][:, None]
    return along_track(at, site, kept, basis.sigma)


def _within(angle: Floats, lower: float, upper: float) -> Floats:
    """Angles moved by whole turns into the range of the fit where possible, else as near to it as possible."""
    middle = 0.5 * (lower + upper)
    outside = (angle < lower) | (angle > upper)
    nearest = angle - TURN * np.round((angle - middle) / TURN)
    return np.where(outside, nearest, angle)


def _absorbed(angle: Floats) -> Floats:
    """(N, 3) 1, cos(q), sin(q)."""
    return np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)


def _with(q: Floats, j: int, angle: Floats) -> Floats:
    changed = q.copy()
    changed[:, j] = angle
    return changed


OF_ITS_DAY = frozenset(("session", "time"))
"""Covariates on which an effect of the instrument or the target does not hold on another day."""


def lasts(active: ActiveEffect, robot: Chain) -> bool:
    """Whether an effect is neither a drift of the instrument or the target, nor a shift of them between sessions."""
    set_up = active.site in ("frame", "platform")
    return not (set_up and bool(OF_ITS_DAY & set(active.effect.covariates(robot, active.site))))


MARGIN = 0.05
"""Share of the fit's range by which commands may be outside it without a warning. Assumed; it changes no prediction."""


def warn_of_extrapolation(
    effects: Sequence[ActiveEffect], robot: Chain, q: Floats, covariates: Mapping[str, Column]
) -> None:
    """Warn of effects outside the range of their fit: of an actuator's travel at commands q (N, n), m or rad, and over time.

    For robots with rods the range of commands is not stored, and there is no warning of them.
    """
    warn_of_other_times(effects, robot, covariates)
    for active in effects:
        low, high = active.references.commands
        if not active.effect.of_travel or active.only_measured or active.site not in robot.sites or not len(low):
            continue
        j = robot.sites.index(active.site)
        margin = MARGIN * float(high[j] - low[j])
        outside = int(((q[:, j] < low[j] - margin) | (q[:, j] > high[j] + margin)).sum())
        if outside:
            unit, factor = ("deg", 180.0 / np.pi) if robot.revolute[j] else ("m", 1.0)
            fitted = f"{low[j] * factor:.4g} to {high[j] * factor:.4g} {unit}"
            warn(
                f"{outside} of {len(q)} commands of {active.site} are outside {fitted}, where {active.name} was fitted: "
                "its deviation there is extrapolated, and can be wrong"
            )


def warn_of_other_times(effects: Sequence[ActiveEffect], robot: Chain, covariates: Mapping[str, Column]) -> None:
    """Warn of effects that change with ``time`` where there are no times, or times outside those of their fit."""
    for active in effects:
        needed = active.effect.covariates(robot, active.site)
        if "time" not in (*needed, *active.effect.uses) or "time" not in active.references.covariates:
            continue
        if "time" not in covariates:
            if "time" not in needed:
                warn(f"there is no column time: {active.name} is used as it was at the end of its fit")
            continue
        start, span = active.references.time
        time = np.atleast_1d(np.asarray(covariates["time"], dtype=float))
        outside = int(((time < start - MARGIN * span) | (time > start + (1.0 + MARGIN) * span)).sum())
        if outside:
            warn(
                f"{outside} of {len(time)} times are outside {start:.4g} to {start + span:.4g} s, where {active.name} was "
                "fitted: it is taken as it was at the nearest of those, and can have changed since"
            )
