"""Effects with fitted coefficients, and their exact application: the closures are solved with the displaced parts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gtpin.effects.basis import Basis
from gtpin.effects.effect import Effect
from gtpin.effects.situation import Column, References, Situation
from gtpin.effects.where_measured import where_measured
from gtpin.errors import ModelError
from gtpin.kinematics.chunks import chunks
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.protocol import Kinematics
from gtpin.kinematics.rotations import exp
from gtpin.typing import Floats


@dataclass(frozen=True, eq=False)
class ActiveEffect:
    """An effect at a site, with its coefficients.

    Parameters
    ----------
    effect, site, nonlinear
        The effect, its site, and the value of its nonlinear parameter; None where it has none.
    coefficients, covariance
        (m,) and (m, m), in the effect's own units.
    references
        Reference values of its covariates and loads.
    further
        Further values of the nonlinear parameter. Each value has its own coefficients.
    only_measured
        For a deviation of a turning joint's travel: it is zero at angles that its fit did not have
        (:func:`~gtpin.effects.where_measured.where_measured`).
    """

    effect: Effect
    site: str
    nonlinear: float | None
    coefficients: Floats
    covariance: Floats
    references: References
    further: tuple[float, ...] = ()
    only_measured: bool = False

    @property
    def values(self) -> tuple[float, ...]:
        """All values of its nonlinear parameter."""
        return () if self.nonlinear is None else (self.nonlinear, *self.further)

    @property
    def name(self) -> str:
        """``effect@site``."""
        return f"{self.effect.id}@{self.site}"

    def basis(self, at: Situation) -> Basis:
        """Displacements for unit coefficients, one column for each coefficient.

        Raises
        ------
        ModelError
            If a covariate that it needs is missing, or the number of coefficients is wrong.
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

    Parameters
    ----------
    q
        (N, n) commands, m or rad.
    covariates
        By name, (N,) each.
    plain
        The N poses without effects, base frame. By default they are computed.

    Raises
    ------
    ModelError
        If a covariate that an effect needs is missing, or an effect's number of coefficients is wrong.
    """
    plain = kinematics.forward(q) if plain is None else plain
    if not effects or not len(q):
        return plain
    T, R = plain.T.copy(), plain.R.copy()
    joints = {name: x.copy() for name, x in plain.joints.items()}
    reached = np.flatnonzero(plain.reached)
    for chunk in chunks(len(reached)) or [slice(0, 0)]:
        rows = reached[chunk]
        some = {name: values[rows] for name, values in covariates.items()}
        displaced = _displaced(kinematics, q[rows], plain[rows], some, effects)
        T[rows], R[rows] = displaced.T, displaced.R
        for name, x in joints.items():
            x[rows] = displaced.joints[name]
    lost = ~(np.isfinite(T).all(axis=1) & np.isfinite(R).all(axis=(1, 2)))
    T[lost], R[lost] = np.nan, np.nan
    return Poses(T, R, joints)


def _displaced(
    kinematics: Kinematics,
    q: Floats,
    plain: Poses,
    covariates: Mapping[str, Column],
    effects: Sequence[ActiveEffect],
) -> Poses:
    """Poses with effects, for rows whose closures the geometry without effects can solve."""
    commands, twist = q.copy(), np.zeros((len(q), 6))
    lengths, twists = np.zeros((1, 1)), dict[int, Floats]()
    for active in effects:
        at = Situation(kinematics, q, plain, covariates, fixed=active.references)
        basis, c = active.basis(at), active.coefficients
        if basis.command is not None:
            commands[:, basis.command[0]] += basis.command[1] @ c
        if basis.length is not None:
            lengths = lengths + basis.length @ c
        for index, moved in basis.placements:  # twists are small: their order is a second-order effect
            twists[index] = twists.get(index, 0.0) + moved @ c
        if basis.twist is not None:
            twist += basis.twist @ c
    poses = kinematics.displaced(q, plain, commands, twists, lengths)
    return replace(poses, T=poses.T + twist[:, :3], R=exp(twist[:, 3:]) @ poses.R)
