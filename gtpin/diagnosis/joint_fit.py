"""Geometry and causes fitted together with exact kinematics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gtpin.calibration.fit_state import unexplained_by
from gtpin.calibration.gauss_newton import Fit, fit
from gtpin.calibration.problem import Point, Problem
from gtpin.diagnosis.design import Observed
from gtpin.diagnosis.evidence import Posterior, shares
from gtpin.diagnosis.hypothesis import Hypothesis, Term
from gtpin.diagnosis.hypothesis_set import HypothesisSet
from gtpin.diagnosis.result import Cause
from gtpin.diagnosis.verdict import Conclusion
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.displacement import Displacement
from gtpin.effects.operating_points import References
from gtpin.errors import ConvergenceError
from gtpin.estimate import Estimate
from gtpin.kinematics.poses import Poses
from gtpin.model.fit_conditions import FitConditions, ModelDiscrepancy
from gtpin.model.model import Model, root_of
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.robot.chain import Chain
from gtpin.typing import Floats, Indices

LAST_DECREASE = 0.1
"""Largest predicted decrease of the cost, nats, at which the fit may end although no step lowers the cost.

The prediction is not exact: the derivative leaves out that the effects depend on the geometry and move the robot. The cost is
half a sum of squares in sigmas: were the prediction exact, the minimum would be at most sqrt(2 * 0.1) = 0.45 sigma away.
Measured by finite differences where fits ended (tests/diagnosis/test_diagnosis_fit.py, and on a real arm): 0.02 nats were
predicted, and 1e-4 to 2e-3 were possible. Largest known: 0.37 nats on a virtual arm with a large bending of a link and a large
coupling, 0.9 sigma of one parameter of the target.
"""


def fit_together(
    observed: Observed, start: Model, causes: Sequence[Hypothesis], scale: Sequence[float], references: References
) -> Model:
    """Fit geometry, instrument's pose and coefficients of causes, from a calibrated model.

    ``causes``, ``scale``: the causes and their scales, which give the priors of their coefficients.

    Raises `ConvergenceError` if the fit does not converge.
    """
    problem = JointProblem.of(observed, start, causes, scale, references)
    deviation = start.geometry.deviation / start.geometry.tolerance
    x, known = np.zeros(problem.size), problem.first
    x[: len(known)] = known
    x[: len(deviation)] = deviation
    try:
        found = fit(problem, observed.weigh, x, left_out=LAST_DECREASE, inexact=len(known))
    except ConvergenceError as error:
        raise ConvergenceError(
            "geometry and causes have not settled together", hint="exclude the causes one by one"
        ) from error
    covariance, tolerance, p = found.covariance, start.geometry.tolerance, len(deviation)
    joint = problem.joint_covariance(covariance) if causes else None
    fitted, unexplained = start.fit, _unexplained(problem, found, observed.noise)
    if observed.measured.tracked:
        dof = max(found.residual.size - found.effective_parameters, 1.0)
        chi2 = float(found.weight @ (found.residual**2).sum(axis=1))
        fitted = FitConditions.of(observed.noise, chi2, dof, observed.measured.q, observed.covariates, unexplained)
    return replace(
        found.point.model,
        effects=problem.active(found.point.x, covariance),
        covariance=covariance[:p, :p] * np.outer(tolerance, tolerance),
        instruments=problem.readings(found.point.x).fitted,
        joint_covariance=joint,
        fit=fitted,
        unexplained=unexplained,
    )


def _unexplained(problem: JointProblem, found: Fit, noise: ReadingNoise) -> ModelDiscrepancy:
    """What geometry and causes leave unexplained between poses."""
    colour = np.linalg.inv(problem.whitening)
    errors = np.einsum("nij,nj->ni", colour, found.residual)
    variance = (colour**2).sum(axis=2)
    return unexplained_by(found, errors, variance, known=noise.known, dof=noise.dof)


@dataclass(frozen=True, eq=False, kw_only=True)
class JointProblem(Problem):
    """The fitted problem: x has the unknowns of a calibration, then the causes' coefficients in units of their priors' sigmas.

    - ``observed``: the poses, with the covariates on which the causes depend.
    - ``causes``, ``sizes``: the causes, and for each the (m,) prior standard deviations of its coefficients.
    - ``references``: reference values of the causes' covariates.
    """

    observed: Observed
    causes: Sequence[Hypothesis]
    sizes: Sequence[Floats]
    references: References

    @staticmethod
    def of(
        observed: Observed, start: Model, causes: Sequence[Hypothesis], scale: Sequence[float], references: References
    ) -> JointProblem:
        """The problem about the nominal geometry; the noise of the drives is computed at ``start``."""
        geometry = start.geometry
        nominal = replace(start, geometry=geometry.with_values(geometry.values - geometry.deviation), effects=())
        at = observed.operating_points(start, references)
        one = observed.take(slice(0, 1)).operating_points(start, references, at.poses[:1])
        sizes = [cause.basis(one).sigma * s for cause, s in zip(causes, scale, strict=True)]
        measured = observed.measured
        J = measured.change_by(at.command_jacobian, start, at.poses)
        whitening = observed.noise.whitening(J, measured.components)
        return JointProblem(
            nominal,
            measured,
            whitening,
            observed.free_frame,
            observed=observed,
            causes=causes,
            sizes=sizes,
            references=references,
        )

    @property
    def size(self) -> int:
        """Length of x."""
        return super().size + sum(map(len, self.sizes))

    @property
    def prior(self) -> Floats:
        """(size,) weight of the square of each x in the cost: 1 for a coefficient."""
        return np.concatenate([super().prior, *map(np.ones_like, self.sizes)])

    def residual(self, point: Point) -> Floats:
        """(N, c) whitened measured less predicted, with the effects in the closures."""
        return self.residual_at(point, self._displaced(point, slice(None)))

    def jacobian(self, point: Point, rows: slice | Indices, weight: Floats | None = None) -> Floats:
        """(M, c, size) derivative of the whitened prediction by x, for some rows.

        The derivative by the calibration's unknowns is taken at the poses with the effects, because a sensor whose mounting is
        hardly known turns far in one step. It is also taken at the commands with the deviations of the travel, and so is the
        derivative by the coefficients.
        """
        displaced = replace(point, poses=self._displaced(point, rows))
        at = self.observed.take(rows).operating_points(point.model, self.references, point.poses[rows])
        bases = [cause.basis(at) for cause in self.causes]
        q = self.observed.measured.q.copy()
        q[rows] = self._travelled(at.q, bases, point.x)
        problem = self.at_commands(q)
        at = replace(at, q=q[rows], poses=displaced.poses[rows])
        moved = [basis.displacement(at) * size for basis, size in zip(bases, self.sizes, strict=True)]
        columns = [problem.columns(point, J, rows, weight) for J in moved]
        return np.concatenate([Problem.jacobian(problem, displaced, rows, weight), *columns], axis=2)

    def _travelled(self, q: Floats, bases: Sequence[Displacement], x: Floats) -> Floats:
        """(M, n) commands with the deviations of the travel by the causes, m or rad."""
        moved, place = q.copy(), super().size
        for basis, size in zip(bases, self.sizes, strict=True):
            if basis.command is not None:
                moved[:, basis.command[0]] += basis.command[1] @ (x[place : place + len(size)] * size)
            place += len(size)
        return moved

    def _displaced(self, point: Point, rows: slice | Indices) -> Poses:
        """The poses of an iterate, base frame, some rows of them with the effects."""
        some, poses = self.observed.take(rows), point.poses
        effects = self.active(point.x, np.zeros((self.size, self.size)))
        moved = with_effects(point.model.kinematics, some.measured.q, some.covariates, effects, poses[rows])
        found = poses.copy()
        found.put(rows, moved)
        return found

    def joint_covariance(self, covariance: Floats) -> Floats:
        """(p + m, p + m) covariance of the p geometric parameters and m coefficients, from the covariance of x (size, size)."""
        tolerance, after = self.start.geometry.tolerance, super().size
        kept = [*range(len(tolerance)), *range(after, self.size)]
        sizes = np.concatenate([tolerance, *self.sizes])
        return np.asarray(covariance[np.ix_(kept, kept)] * np.outer(sizes, sizes))

    def active(self, x: Floats, covariance: Floats) -> tuple[ActiveEffect, ...]:
        """The causes with their coefficients at x; ``covariance`` (size, size) is that of x."""
        found, place = [], super().size
        for cause, size in zip(self.causes, self.sizes, strict=True):
            own = slice(place, place + len(size))
            place = own.stop
            spread = covariance[own, own] * np.outer(size, size)
            found.append(
                ActiveEffect(
                    cause.effect,
                    cause.site,
                    cause.shape_parameter,
                    x[own] * size,
                    spread,
                    self.references,
                    cause.further,
                )
            )
        return tuple(found)


PARAMETER_DRAWS = 150
"""Number of draws from a posterior for a parameter's sigma, at least; as many mirrored draws are added."""
LINEAR = 1e-6
"""Largest sum of the changes by a draw and by its mirror image, over the largest change, of a parameter that is linear."""
WITHIN = 0.6827
"""Share of the draws that differ from the value by less than sigma: as of a normal distribution."""


def cause(
    model: Model, hypothesis: Hypothesis, found: Conclusion, named: Hypothesis, hypotheses: HypothesisSet
) -> Cause:
    """A cause ``named`` in a conclusion, with its parameters from the fitted model. Its ``explained_fraction`` is 0 at first.

    The others of its class have the parameters of a linear fit in its place. Its own sigmas contain what its parameters
    would be beside each that could act together with it.
    """
    active = next(e for e in model.effects if (e.effect.id, e.site) == hypothesis.place)
    own = next(m for m in found.classes[named] if m.hypothesis.place == hypothesis.place)
    linear = found.model if hypothesis == named else hypotheses.replaced(found.model, named, hypothesis)
    parameters = estimates(model.robot, active, _ends(hypotheses, linear, hypothesis, active.references))
    beside = ((m.hypothesis, m.beside) for m in found.classes[named])
    together = [one for one, first in beside if first is not None and first.place == hypothesis.place]
    parameters = _or_beside(hypotheses, linear, hypothesis, parameters, together, active.references)
    members = []
    for contender, member in zip(found.classes[named], found.members(named), strict=True):
        other, values = contender.hypothesis, parameters
        if other.place != hypothesis.place:
            alone = contender.recorded and contender.beside is None
            values = _in_its_place(hypotheses, found, named, other, active.references) if alone else {}
        members.append(replace(member, parameters=values))
    share = shares(hypotheses.groups, found.model)[named]
    return Cause(*hypothesis.place, own.probability, tuple(members), parameters, 0.0, found.nature(hypothesis), share)


def between_members(hypotheses: HypothesisSet, found: Conclusion) -> Floats | None:
    """(p, p) covariance of the geometry's parameters between the members of open classes; None where no class is open.

    It is sum of p_k (d_k - d)(d_k - d)' over the members that recorded covariates show: p_k is the probability of a member, d_k
    are the parameters by the linear fit with it in the place of the cause, and d those with the named causes.
    """
    groups, design, geometry = hypotheses.groups, hypotheses.design, hypotheses.design.model.geometry
    p, sure = len(geometry.parameters), found.sure()

    def parameters(model: Posterior[Term]) -> Floats:
        ends = np.cumsum(model.widths)[:-1]
        parts = zip(model.terms, np.split(model.mean, ends), strict=True) if model.terms else ()
        left = design.y - sum(groups.columns(term) @ mean for term, mean in parts)
        return groups.marginal.deviation(left)[:p] * geometry.tolerance

    whole, spread = found.model, np.zeros((p, p))
    for named in (cause for cause in found.classes if cause not in sure):
        kept = [(term, scale) for term, scale in zip(whole.terms, whole.scale, strict=True) if term != named]
        taken = {term.place for term, _ in kept if isinstance(term, Hypothesis)}
        for member in found.classes[named]:
            instead = [h for h in (member.hypothesis, member.beside) if h is not None and h.place not in taken]
            if member.recorded and member.hypothesis.place != named.place:
                terms = [*kept, *((h, 1.0) for h in instead)]
                off = parameters(hypotheses.of([t for t, _ in terms], [s for _, s in terms])) - parameters(whole)
                spread += member.probability * np.outer(off, off)
    return spread if spread.any() else None


def _or_beside(
    hypotheses: HypothesisSet,
    model: Posterior[Term],
    own: Hypothesis,
    alone: dict[str, Estimate],
    together: Sequence[Hypothesis],
    references: References,
) -> dict[str, Estimate]:
    """Parameters of a hypothesis with sigmas that contain those beside others: the largest of s_k^2 + (v_k - v)^2, with v_k and
    s_k the value and the sigma beside one that could act ``together`` with it, and v the value alone."""
    for other in together:
        both = estimates_in(hypotheses, hypotheses.extended(model, other), own, references)
        far = {n: float(np.hypot(both[n].sigma, both[n].value - e.value)) for n, e in alone.items()}
        alone = {n: replace(e, sigma=max(e.sigma, far[n])) for n, e in alone.items()}
    return alone


def _in_its_place(
    hypotheses: HypothesisSet, found: Conclusion, named: Hypothesis, other: Hypothesis, references: References
) -> dict[str, Estimate]:
    """Parameters of another member of a cause's class in its place, by a linear fit; none where it is a cause itself."""
    terms = found.model.terms
    if other.place in {term.place for term in terms if isinstance(term, Hypothesis)}:
        return {}
    model = hypotheses.of([other if term == named else term for term in terms], found.model.scale)
    return estimates_in(hypotheses, model, other, references)


def estimates_in(
    hypotheses: HypothesisSet, model: Posterior[Term], own: Hypothesis, references: References
) -> dict[str, Estimate]:
    """Parameters of a hypothesis of a model, by name, by the linear fit."""
    coefficients, covariance = _fitted(hypotheses, model, own)
    robot, value = hypotheses.design.operating_points.robot, own.shape_parameter
    active = ActiveEffect(own.effect, own.site, value, coefficients, covariance, references, own.further)
    return estimates(robot, active, _ends(hypotheses, model, own, references))


def _fitted(hypotheses: HypothesisSet, model: Posterior[Term], own: Hypothesis) -> tuple[Floats, Floats]:
    """(m,) coefficients of a hypothesis of a model by the linear fit, and their (m, m) covariance."""
    start = sum(model.widths[: model.terms.index(own)])
    sigma = own.basis(hypotheses.design.operating_points).sigma
    part = slice(start, start + len(sigma))
    return model.mean[part] * sigma, model.covariance[part, part] * np.outer(sigma, sigma)


def _ends(hypotheses: HypothesisSet, model: Posterior[Term], own: Hypothesis, references: References) -> Floats:
    """(l, 2, 1 + m) changes of each of a hypothesis's l nonlinear values, and of its m coefficients with it, to one standard
    deviation below and above the value."""
    robot, (coefficients, _) = hypotheses.design.operating_points.robot, _fitted(hypotheses, model, own)
    found = np.zeros((len(own.lines), 2, 1 + len(coefficients)))
    for i, (value, sigma) in enumerate(own.lines):
        for k, end in enumerate(own.effect.ends(robot, own.site, references, value, sigma)):
            if end not in own.values:
                moved = own.with_lines([*own.lines[:i], (end, sigma), *own.lines[i + 1 :]])
                other, _ = _fitted(hypotheses, hypotheses.replaced(model, own, moved), moved)
                found[i, k] = [end - value, *(other - coefficients)]
    return found


def estimates(robot: Chain, active: ActiveEffect, ends: Floats) -> dict[str, Estimate]:
    """Parameters by name: value at the coefficients' posterior mean, and sigma, within which 68 % of draws lie about it.

    ``ends``: (l, 2, 1 + m) changes of each of the l nonlinear values, and of the m coefficients with it, to one standard
    deviation below and above the value. In between and beyond, both change in proportion.

    Draws from the posterior are needed because some parameters, such as a curve's root mean square, are not linear in the
    coefficients. Of one that is, which mirrored draws change in opposite ways, sigma is their root mean square: this is exact,
    because the draws have the covariance of the posterior. Draws are not needed for the value: a mean or a median of draws of
    such a norm is too large, because the draws add the posterior's variance to coefficients that contain the noise already.
    """
    root, m = root_of(active.covariance), len(active.coefficients)
    n = max(PARAMETER_DRAWS, m + len(ends))
    unit = np.sqrt(n) * np.linalg.qr(np.random.default_rng(0).standard_normal((n, m + len(ends))))[0]
    drawn = []
    for z in np.vstack([unit, -unit]):
        c = active.coefficients + root @ z[:m]
        steps = [abs(size) * both[int(size > 0.0)] for size, both in zip(z[m:], ends, strict=False)]
        c = c + sum(step[1:] for step in steps)
        places = [value + float(step[0]) for value, step in zip(active.values, steps, strict=True)]
        drawn.append([v for v, _ in active.effect.parameters_of(robot, active.site, c, places).values()])
    said = active.effect.parameters_of(robot, active.site, active.coefficients, active.values)
    off = np.array(drawn) - [value for value, _ in said.values()]
    size = np.abs(off)
    linear = np.abs(off[:n] + off[n:]).max(axis=0) < LINEAR * size.max(axis=0)
    sigma = np.where(linear, np.sqrt((off**2).mean(axis=0)), np.quantile(size, WITHIN, axis=0))
    return {name: Estimate(value, float(s), unit) for (name, (value, unit)), s in zip(said.items(), sigma, strict=True)}
