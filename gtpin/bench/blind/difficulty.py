"""How difficult an effect is to name: the energy of its displacement that geometry and each other effect leave unexplained.

Of a whitened displacement d, an effect with whitened displacements X for coefficients of typical size leaves d' (I + B B' +
s^2 X X')^-1 d, where B is the whitened derivative by the geometry in units of the tolerances and by the unknowns of
instruments in units of their prior sigmas. s is that scale, of those a diagnosis tries, at which the effect has the largest
evidence. E is the energy that the geometry alone leaves, d' (I + B B')^-1 d. D is the smallest energy that an effect other
than the true one leaves. Nonlinear parameters (a period, a place) are scanned. Displacements are whitened as they are
measured: by poses, or by readings of any instruments.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular

from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.displacement import Displacement
from gtpin.effects.effect import Effect
from gtpin.effects.operating_points import OperatingPoints
from gtpin.instruments.readings import Readings, single
from gtpin.model.model import Model
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats, Indices


def noise_of_rows(dataset: Dataset, split: Dataset, noise: Mapping[str, Floats]) -> tuple[Indices, list[Floats]]:
    """For each of the N rows of a dataset ``split`` by :func:`~gtpin.instruments.readings.single`: the index of the row of
    ``dataset`` of which it is a part, and the noise of its numbers, m or rad.

    ``noise``: by the instruments' names, (M, c) sigma of the numbers in the rows of their tables, m or rad. A known distance of
    sockets, which is in no table, has none.
    """
    whole, rows = dataset.readings, split.readings
    row, sigma = np.empty(len(split), dtype=np.intp), [np.zeros(0)] * len(split)
    for index, table in enumerate(rows.tables):
        own, mine = whole.rows_of(index), rows.rows_of(index)
        place = np.searchsorted(whole.line[own], rows.line[mine])
        row[mine] = own[place]
        for i, at, which in zip(mine, place, rows.component[mine], strict=True):
            sigma[i] = noise[table.name][at] if which < 0 else noise[table.name][at, which : which + 1]
    return row, sigma


Values = Sequence[float]
"""Values of the nonlinear parameter of an effect at one site: none, one, or several periods of a gear."""

SCALES = np.exp(np.linspace(np.log(0.05), np.log(40.0), 24))
"""Scales that are tried."""
STRIDE = 3
"""Step of a coarse scan of the nonlinear parameter; its values near the best one are tried afterwards."""
LINE = 4.0
"""Log prior odds against a further value, nats, in addition to ln(number of tried values): as in a diagnosis. The energy that a
further value must explain is twice the sum."""
BATCH = 128
"""Values of the nonlinear parameter whose displacements are held in memory at the same time."""


@dataclass(frozen=True)
class Best:
    """Energy of a displacement that an effect at a site leaves, at its best scale and nonlinear parameter.

    ``further`` are more values of the nonlinear parameter, where an effect may have several.
    """

    left: float
    scale: float
    shape_parameter: float | None
    effect: Effect
    site: str
    further: tuple[float, ...] = ()

    @property
    def values(self) -> tuple[float, ...]:
        """All values of the nonlinear parameter."""
        return () if self.shape_parameter is None else (self.shape_parameter, *self.further)


@dataclass(frozen=True)
class Difficulty:
    """Computes E and D of displacements at a dataset's rows."""

    operating_points: OperatingPoints  # The N poses at which something was measured, c numbers at each
    # (N, c, 6) or (c, 6) derivative of these numbers by the platform's motion, base frame, in units of the noise
    by_motion: Floats
    # (N, c, k) the same by the instruments' unknowns in prior sigmas; None where there are none
    unknowns: Floats | None = None
    # (N,) index of each pose's row in the dataset; None where the poses are the rows of the dataset
    row: Indices | None = None

    @staticmethod
    def of(dataset: Dataset, sigma: Floats, geometry: Geometry) -> Difficulty:
        """For a tracker's dataset and a geometry, which should be close to the machine's own.

        ``sigma``: (6,) or (N, 6) the instrument's noise, m and rad; infinite for what is not measured.
        """
        measured = np.where(np.arange(6) < (3 if dataset.orientation is None else 6), sigma, np.inf)
        return Difficulty(_operating_points(dataset, Model(geometry)), np.eye(6) / measured[..., None])

    @staticmethod
    def of_readings(dataset: Dataset, noise: Mapping[str, Floats], baseline: Calibration) -> Difficulty:
        """For a dataset of schema 2 and its calibration; no encoder may be among the instruments.

        ``noise``: by the instruments' names, (M, c) sigma of the numbers in the rows of their tables, m or rad. Where the
        instruments' readings have different lengths, each pose has one number. Known distances of sockets are left out: they do
        not depend on the pose, and are not in E.
        """
        split = single(dataset, baseline.model.robot)
        row, sigmas = noise_of_rows(dataset, split, noise)
        kept = np.flatnonzero([len(own) > 0 for own in sigmas])
        rows, sigma = split.take(kept), np.stack([sigmas[i] for i in kept])[..., None]
        readings, at = Readings.of(rows, baseline.model.robot, baseline.u), _operating_points(rows, baseline.model)
        unknowns, _ = readings.unknown_columns(baseline.model, at.poses, False, None)
        return Difficulty(at, readings.by_motion(at.poses) / sigma, unknowns / sigma, row[kept])

    @cached_property
    def _geometry(self) -> tuple[Floats, Floats]:
        """(c N, p) whitened derivative by the geometry and the unknowns of instruments, and the Cholesky factor of I + B'B."""
        at = self.operating_points
        geometry = at.kinematics.geometry
        B = self.whitened(at.kinematics.geometry_jacobian(at.q, at.poses) * geometry.tolerance)
        if self.unknowns is not None:
            B = np.hstack([B, self.unknowns.reshape(len(B), -1)])
        return B, cholesky(np.eye(B.shape[1]) + B.T @ B, lower=True)

    def whitened(self, columns: Floats) -> Floats:
        """(c N, m) whitened displacements (N, 6, m)."""
        return np.asarray(self.by_motion @ columns).reshape(-1, columns.shape[2])

    def true(self, displacement: Floats) -> Floats:
        """(c N,) whitened displacement from a displacement (rows, 6) at the dataset's rows."""
        here = displacement if self.row is None else displacement[self.row]
        return self.whitened(here[:, :, None])[:, 0]

    def noncentrality(self, displacement: Floats) -> float:
        """E of a displacement (rows, 6) at the dataset's rows."""
        d = self.true(displacement)
        return float(d @ self.orthogonal(d))

    def orthogonal(self, d: Floats) -> Floats:
        """(I + B B')^-1 d for whitened displacements, (c N,) or (c N, m)."""
        B, lower = self._geometry
        return np.asarray(d - B @ cho_solve((lower, True), B.T @ d))

    def left(self, displacement: Floats) -> dict[str, Best]:
        """Energy of a displacement (rows, 6) that every effect at every site leaves, by ``effect@site``."""
        at, d = self.operating_points, self.true(displacement)
        past, found = self.orthogonal(d), {}
        for effect in effects_by_id().values():
            for site in effect.sites(at.robot):
                if not effect.untestable(at, site):
                    taken, scale, values = self._by(effect, site, past)
                    one, left = values[0] if values else None, float(d @ past) - taken
                    found[f"{effect.id}@{site}"] = Best(left, scale, one, effect, site, tuple(values[1:]))
        return found

    def _by(self, effect: Effect, site: str, past: Floats) -> tuple[float, float, list[float]]:
        """The energy that an effect explains, its scale, and the values of its nonlinear parameter."""
        at, found = self.operating_points, list[float]()
        tried = np.array(effect.nonlinear_values(at, site))
        if (first := self._value(effect, site, tried, found, past)) is not None:
            found = [first]
        (taken,), (scale,), _ = self.explained(effect, site, [found], past)
        while found and at.robot.joint_sites and len(found) < effect.most_values:
            # (I + B B' + s^2 X X')^-1 d from (I + B B')^-1 d, with X the displacements with the values found so far.
            basis = effect.basis_of(at, site, found)
            X = scale * self.whitened(basis.displacement(at) * basis.sigma)
            own = self.orthogonal(X)
            rest = np.asarray(past - own @ np.linalg.solve(np.eye(X.shape[1]) + X.T @ own, X.T @ past))
            value = self._value(effect, site, tried, found, rest)
            if value is None:
                break
            (wider,), (its_scale,), _ = self.explained(effect, site, [[*found, value]], past)
            if wider < taken + 2.0 * (LINE + np.log(len(tried))):
                break
            found, taken, scale = [*found, value], wider, its_scale
        return float(taken), float(scale), found

    def _value(self, effect: Effect, site: str, values: Floats, others: list[float], past: Floats) -> float | None:
        """The value that explains most, of those that the poses can distinguish from ``others``; None where there is none."""
        if not len(values):
            return None
        kept = values[effect.resolved(self.operating_points, site, values, others)].tolist()
        tried: dict[int, float] = {}
        for places in (range(0, len(kept), STRIDE), range(len(kept))):
            near = max(tried, key=lambda i: tried[i]) if tried else None
            waiting = [i for i in places if near is None or abs(i - near) < STRIDE]
            taken, _, _ = self.explained(effect, site, [(kept[i],) for i in waiting], past)
            tried |= dict(zip(waiting, taken.tolist(), strict=True))
        return kept[max(tried, key=lambda i: tried[i])] if kept else None

    def explained(
        self, effect: Effect, site: str, trials: Sequence[Values], past: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """As :meth:`by_basis`, of an effect with each of some trials of the values of its nonlinear parameter."""
        found = [(np.zeros(0),) * 3]
        for start in range(0, len(trials), BATCH):
            some = trials[start : start + BATCH]
            found.append(self.by_basis([effect.basis_of(self.operating_points, site, v) for v in some], past))
        taken, scale, evidence = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return taken, scale, evidence

    def by_basis(self, bases: Sequence[Displacement], past: Floats) -> tuple[Floats, Floats, Floats]:
        """(S,) energy that each basis explains at its scale of largest evidence, the scale, and the log evidence, nats.

        ``past`` is :meth:`orthogonal` of the displacement.
        """
        B, lower = self._geometry
        width = len(bases[0])
        if bases[0].command is None:
            X = np.hstack([self.whitened(b.displacement(self.operating_points) * b.sigma) for b in bases])
            BtX, moments = B.T @ X, X.T @ past
            whole = X.reshape(len(X), len(bases), width).transpose(1, 2, 0)
        else:
            # Each displacement is the motion by one actuator times one number a pose: sums over N numbers instead of c N.
            actuator = bases[0].command[0]
            a = np.asarray(self.by_motion @ self.operating_points.command_jacobian[:, :, actuator, None])[:, :, 0]
            f = np.stack([b.command[1] * b.sigma for b in bases if b.command], axis=1)
            flat = f.reshape(len(f), -1)
            BtX = np.einsum("nci,nc->ni", B.reshape(*a.shape, -1), a, optimize=True).T @ flat
            moments = flat.T @ (a * past.reshape(a.shape)).sum(axis=1)
            whole = (f * np.sqrt((a**2).sum(axis=1))[:, None, None]).transpose(1, 2, 0)
        half = solve_triangular(lower, BtX, lower=True).reshape(len(lower), len(bases), width).transpose(1, 2, 0)
        grams = whole @ whole.transpose(0, 2, 1) - half @ half.transpose(0, 2, 1)
        values, vectors = np.linalg.eigh(grams)
        squares = np.einsum("sij,si->sj", vectors, moments.reshape(len(bases), width)) ** 2
        s2, values = (SCALES**2)[:, None, None], np.maximum(values, 0.0)
        taken = (s2 * squares / (1.0 + s2 * values)).sum(axis=2)
        evidence = 0.5 * taken - 0.5 * np.log1p(s2 * values).sum(axis=2)
        best = np.argmax(evidence, axis=0)
        return np.take_along_axis(taken, best[None], axis=0)[0], SCALES[best], evidence.max(axis=0)


def _operating_points(dataset: Dataset, model: Model) -> OperatingPoints:
    kinematics, temperature = model.kinematics, dataset.conditions.reference_temperature
    return OperatingPoints(kinematics, dataset.q, kinematics.forward(dataset.q), dataset.covariates, None, temperature)


TRIED, ROUNDS, SWEEPS = 13, 4, 3
"""Values that are tried between the neighbours of the best one of a scan, repetitions with a smaller step, and times that each
of several values is refined given the others."""


def true_parameters(difficulty: Difficulty, best: Best, displacement: Floats) -> dict[str, float]:
    """Parameters, by name, of an effect in its textbook form that is nearest to a true displacement (rows, 6).

    They are what a fit as in a diagnosis, with the geometry free, gives of noise-free data: the coefficients, in units of their
    typical sizes, are (X' M X + I / s^2)^-1 X' M d with M = (I + B B')^-1. So what calibration absorbs of an effect, such as a
    straight line in the form of a track, is no error of a parameter. The scale s and the nonlinear parameters are those of
    largest evidence.

    Several values of the nonlinear parameter are refined from those of ``best``; a single one is scanned again, because
    ``best`` has the value that explains most energy, not that of largest evidence.
    """
    d = difficulty.true(displacement)
    values, scale = _values(difficulty, best, difficulty.orthogonal(d))
    basis = best.effect.basis_of(difficulty.operating_points, best.site, values)
    X = difficulty.whitened(basis.displacement(difficulty.operating_points) * basis.sigma)
    MX = difficulty.orthogonal(X)
    c = np.linalg.solve(MX.T @ X + np.eye(X.shape[1]) / scale**2, MX.T @ d) * basis.sigma
    found = best.effect.parameters_of(difficulty.operating_points.robot, best.site, c, values)
    return {name: value for name, (value, _) in found.items()}


def _values(difficulty: Difficulty, best: Best, past: Floats) -> tuple[Values, float]:
    """The values of the nonlinear parameter and the scale of largest evidence."""
    if not best.values:
        return (), best.scale
    tried = np.sort(best.effect.nonlinear_values(difficulty.operating_points, best.site))
    values, scale = list(best.values), best.scale

    def best_of(trials: Sequence[Values]) -> tuple[list[float], float]:
        _, scales, evidence = difficulty.explained(best.effect, best.site, trials, past)
        top = int(np.argmax(evidence))
        return [float(value) for value in trials[top]], float(scales[top])

    if len(values) == 1:
        values, _ = best_of([(value,) for value in tried])
    for _ in range(SWEEPS if len(values) > 1 else 1):
        for i in range(len(values)):
            place = int(np.searchsorted(tried, values[i]))
            low, high = tried[[max(place - 1, 0), min(place + 1, len(tried) - 1)]]
            for _ in range(ROUNDS):
                near = np.linspace(low, high, TRIED)
                together, scale = best_of([(*values[:i], v, *values[i + 1 :]) for v in near])
                values[i] = together[i]
                low, high = values[i] - (near[1] - near[0]), values[i] + (near[1] - near[0])
    return values, scale
