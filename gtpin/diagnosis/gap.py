"""What is left: errors on poses that were not fitted, and where they lie."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
import numpy.typing as npt

from gtpin.calibration.left_out import of_block
from gtpin.data import Dataset, by_region, random
from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import NOTHING, Posterior, given, marginal_power
from gtpin.diagnosis.hypothesis import Hypothesis, Proxy, SmoothTerm, Term
from gtpin.diagnosis.hypothesis_set import Gain, HypothesisSet, causes
from gtpin.diagnosis.priors import PRIORS, UNLIKELY, Priors
from gtpin.diagnosis.result import Cause, Correlate, Gap, HoldOut, InstrumentGap, Turns, Unexplained, Where
from gtpin.diagnosis.smooth_terms import COMMON
from gtpin.diagnosis.verdict import Conclusion
from gtpin.distributions import chi2, t
from gtpin.effects.operating_points import OperatingPoints
from gtpin.errors import DatasetError, ModelError, unheard
from gtpin.instruments.readings import Readings
from gtpin.typing import Floats, Mask

INTERVAL_DRAWS = 400
"""Number of random draws from which an interval is computed."""
PREDICTED_POSES = 120
"""Number of other poses of the explained fraction's interval. Assumed: a user wants to predict this many."""


@dataclass(frozen=True)
class LeftOut:
    """A linear model fitted to all poses, and the errors of its predictions of left-out blocks.

    - ``errors``: (N, 3) measured less predicted position, m, each block predicted from the others; for readings (N, c), in
      units of the noise.
    - ``turned``: (N, 3) measured less predicted orientation, rad, likewise; (N, 0) where it was not measured.
    - ``noise``: (N,) estimate of the squared length of each pose's position noise from the fit, m^2.
    - ``kept``: (N, 3), for readings (N, c): share of each number that the other blocks determine, 1 or less.
    - ``z``, ``root``: (k,) fitted coefficients in units of their priors' sigmas, and (k, k) a root of their covariance root
      @ root'.
    - ``columns``: (N, 3, k) derivative of the positions by ``z``, m, in a fit without the pose's block.
    """

    errors: Floats
    turned: Floats
    noise: Floats
    kept: Floats
    z: Floats
    root: Floats
    columns: Floats


def leave_out(design: Design, causes: Floats, blocks: list[Mask], unseen: Floats | None = None) -> LeftOut:
    """Fit geometry and causes, and predict each block from the others.

    ``causes``: (N c, m) whitened displacements of the causes, for coefficients of one prior sigma; m may be 0. ``blocks``:
    (N,) masks of the poses left out together, a partition. ``unseen``: (N c, m) the displacements in a fit without the
    pose's block, where these are different.
    """
    c = design.components
    J, prior = design.beside(causes)
    root = np.linalg.inv(np.linalg.cholesky(J.T @ J + np.diag(prior))).T
    z = root @ (root.T @ (J.T @ design.y))
    residual, half = design.y - J @ z, J @ root
    apart = np.zeros_like(J) if unseen is None else np.hstack([design.B, unseen]) - J
    out, inside, kept = np.empty_like(residual), np.empty_like(residual), np.empty_like(residual)
    for block in blocks:
        rows = np.flatnonzero(np.repeat(block, c))
        out[rows], kept[rows] = of_block(half[rows], residual[rows])
        inside[rows] = residual[rows] * out[rows]
        if unseen is not None:
            out[rows] -= apart[rows] @ (z - root @ (half[rows].T @ out[rows]))
    colour, some, counted = design.units, design.compared, design.counted
    errors = np.einsum("nij,nj->ni", colour, out.reshape(-1, c)) * counted
    # The mean of the product of the fit's residual and the left-out residual is the noise's variance, whatever the leverage.
    size = np.einsum("nij,nj->n", colour[:, some] ** 2, inside.reshape(-1, c) * counted)
    columns = (
        np.einsum("nij,njk->nik", colour, (J if unseen is None else J + apart).reshape(-1, c, J.shape[1]))[:, some]
        * counted[:, some, None]
    )
    whole = (kept.reshape(-1, c) * counted)[:, some]
    return LeftOut(errors[:, some], errors[:, some.stop :], size, whole, z, root, columns)


def gap(
    design: Design,
    causes: Floats,
    floor: Floats,
    blocks: list[Mask],
    rng: np.random.Generator,
    unseen: Floats | None = None,
    of_blocks: bool = False,
    inferred: Floats | None = None,
) -> Gap:
    """Compare a geometry alone with geometry and causes on poses that were left out.

    ``design``: the linear problem, without the causes. ``causes``: (N c, m) whitened displacements of the causes, for
    coefficients of one prior sigma; m may be 0. ``floor``: (N, k) expected square of the noise of each compared number, m^2;
    for readings whitened. ``blocks``: (N,) masks of the poses left out together, a partition.
    ``unseen``: as for :func:`leave_out`. ``of_blocks``: True: the interval is for another block, from the differences
    between blocks. False: it is for other poses. ``inferred``: as ``floor``, by the noise that the search assumed; None:
    the same.
    """
    alone = leave_out(design, np.zeros((len(design.y), 0)), blocks)
    b2 = (alone.errors**2).sum(axis=1)
    of_numbers = (floor, floor if inferred is None else inferred)
    floor, inferred = ((some * alone.kept).sum(axis=1) for some in of_numbers)
    assumed = _root(np.minimum(inferred.mean(), b2.mean()))
    if not causes.shape[1]:
        turns = _turns(design, alone, alone)
        of = instrument_gaps(design, alone, alone, *of_numbers)
        least = _root(np.minimum(floor.mean(), b2.mean()))
        return Gap(_root(b2), _root(b2), least, None, None, turns=turns, by_instrument=of, inferred=assumed)
    whole = leave_out(design, causes, blocks, unseen)
    a2 = (whole.errors**2).sum(axis=1)
    # The noise of these poses as the fit shows it, but at most two standard deviations of chance above the known noise.
    least = min(float(whole.noise.mean()), float(floor.mean()) * (1.0 + 2.0 * np.sqrt(2.0 / alone.kept.sum())))
    explained_fraction = _share(float(b2.mean()), float(a2.mean()), least)
    drawn = _draws(alone, whole, max(float(a2.mean()) - least, 0.0), a2, rng)
    low, high = (float(value) for value in np.percentile(drawn, (2.5, 97.5)))
    if of_blocks:
        reach = _reach(np.array([[b2[block].mean(), a2[block].mean()] for block in blocks]) - least, explained_fraction)
        low, high = min(low, max(explained_fraction - reach, -1.0)), max(high, min(explained_fraction + reach, 1.0))
    interval = (min(low, explained_fraction), max(high, explained_fraction))
    turns, of = _turns(design, alone, whole), instrument_gaps(design, alone, whole, *of_numbers)
    floor_ = float(np.sqrt(least))
    return Gap(
        _root(b2), _root(a2), floor_, explained_fraction, interval, turns=turns, by_instrument=of, inferred=assumed
    )


def instrument_gaps(
    design: Design, alone: LeftOut, whole: LeftOut, floor: Floats, inferred: Floats
) -> tuple[InstrumentGap, ...]:
    """Errors of each instrument's left-out readings; none for a single tracker. ``floor``, ``inferred``: as for `gap`."""
    readings = design.measured
    if not readings.rows.names:
        return ()
    colour = np.linalg.inv(design.whitening)
    before, after = (np.einsum("nij,nj->ni", colour, part.errors) for part in (alone, whole))
    size = (colour**2).sum(axis=2) * alone.kept
    noise, assumed = (np.sqrt(size * some) for some in (floor, inferred))
    found = []
    for i, one in enumerate(readings.instruments):
        mine = readings.rows.of == i
        if not mine.any():
            continue
        b, a, n, m = (readings.rms(i, part) for part in (before, after, noise, assumed))
        unit = next(c.unit for c in one.components if c.shown)
        found.append(InstrumentGap(one.name, one.kind, b, a, min(n, b), unit, min(m, b)))
    return tuple(found)


def position_rms(design: Design, left: LeftOut) -> float | None:
    """Root mean square length of left-out position errors, m, of the first tracker; None where nothing reads positions."""
    readings = design.measured
    if not readings.rows.names:
        return _root((left.errors**2).sum(axis=1))
    tracker = next((i for i, one in enumerate(readings.instruments) if one.kind == "tracker"), None)
    if tracker is None:
        return None
    return readings.rms(tracker, np.einsum("nij,nj->ni", np.linalg.inv(design.whitening), left.errors))


def _turns(design: Design, alone: LeftOut, whole: LeftOut) -> Turns | None:
    if not alone.turned.size:
        return None
    before, after = (float(np.sqrt((part.turned**2).sum(axis=1).mean())) for part in (alone, whole))
    colour = design.units[:, 3:]
    floor = float(np.sqrt((colour**2).sum(axis=(1, 2)).mean()))
    return Turns(before, after, min(floor, before))


def _reach(powers: Floats, explained_fraction: float) -> float:
    """Half width of the 95 % interval of another block's explained fraction, from the differences of K blocks.

    The explained fraction f is a ratio of means, 1 - mean(after) / mean(before), and block k departs from it by
    e_k = (before_k - after_k - f before_k) / mean(before) (Cochran, Sampling Techniques, 3rd ed., section 6.3). Another
    block's departure is Student's t with K - 1 degrees of freedom, times the e_k's scatter, times sqrt(1 + 1 / K).

    ``powers``: (K, 2) each block's mean square error before and after, less the floor, m^2.
    """
    before, after = powers.T
    departure = (before - after - explained_fraction * before) / max(float(before.mean()), 1e-300)
    free = len(powers) - 1
    scatter = float(np.sqrt((departure**2).sum() / free))
    return float(t.isf(0.025, free)) * scatter * float(np.sqrt(1.0 + 1.0 / len(powers)))


def _draws(alone: LeftOut, whole: LeftOut, error: float, squares: Floats, rng: np.random.Generator) -> Floats:
    """Random draws (INTERVAL_DRAWS,) of the explained fraction on other poses, given the covariance of what was fitted.

    ``error``: mean squared length of the prediction error on left-out poses without noise, m^2. ``squares``: (N,) squared
    errors of the poses left out, m^2.
    """
    count = len(squares)
    unit = rng.standard_normal((len(whole.z), INTERVAL_DRAWS))
    off = np.einsum("nik,kd->nid", whole.columns, whole.root @ unit, optimize=True)
    expected = float(((whole.columns @ whole.root) ** 2).sum() / count)
    # The rest is what the causes' equations do not describe. Only the left-out poses measure it.
    lacking = max(error - expected, 0.0)
    spread = float(np.sqrt(2.0 / count)) * float(squares.mean())
    predicted = np.einsum("nik,k->ni", whole.columns, whole.z)
    predicted -= np.einsum("nik,k->ni", alone.columns, alone.z)
    shares = np.empty(INTERVAL_DRAWS)
    for d in range(INTERVAL_DRAWS):
        rows = rng.integers(0, count, PREDICTED_POSES)
        more = max(lacking + spread * float(rng.standard_normal()), 0.0)
        after = float((off[rows, :, d] ** 2).sum(axis=1).mean()) + more
        before = float(((off[rows, :, d] + predicted[rows]) ** 2).sum(axis=1).mean()) + more
        shares[d] = _share(before, after, 0.0)
    return shares


def _root(squares: Floats | float) -> float:
    return float(np.sqrt(np.mean(squares)))


def _share(before: float, after: float, floor: float) -> float:
    """Explained fraction of the power beyond the floor; noise can make it less than 0."""
    power = max(before - floor, 1e-300)
    return float(np.clip(1.0 - (after - floor) / power, -1.0, 1.0))


BLOCK_POSES = 4
"""Number of poses that are left out together, neighbours or drawn at random."""
TIME_BLOCKS = 10
"""Number of intervals of time that are left out in turn."""


def check_hold_out(dataset: Dataset, hold_out: str) -> None:
    """Check that a dataset can be split in this way.

    Raises `ModelError` if there is no such way to split. `DatasetError` if the column is missing, or has one value only.
    """
    if hold_out not in get_args(HoldOut):
        raise ModelError(f"no hold-out is called {hold_out!r}", hint=f"use {', '.join(get_args(HoldOut))}")
    if hold_out not in ("session", "time"):
        return
    hint = "hold out by region"
    if hold_out in dataset.unusable:
        raise DatasetError(f"the column can't be used to hold out by {hold_out}", column=hold_out, hint=hint)
    if hold_out not in dataset.covariates:
        raise DatasetError(f"there is no {hold_out} to hold out by", file=dataset.file, column=hold_out, hint=hint)
    if len(set(dataset.covariates[hold_out])) < 2:
        raise DatasetError(f"one {hold_out} only: it can't be held out", file=dataset.file, column=hold_out, hint=hint)


def blocks_of(dataset: Dataset, hold_out: HoldOut, rng: np.random.Generator) -> list[Mask]:
    """(N,) masks of the rows that are left out together, a partition.

    With ``region`` and ``random``, visits to one pose are in one block. With ``session`` and ``time`` they need not be: these
    blocks are to show how well another session or time is predicted.

    Raises `DatasetError` if the dataset can't be split in this way.
    """
    check_hold_out(dataset, hold_out)
    if hold_out == "session":
        return _by_value(np.asarray(dataset.covariates["session"]).astype(str))
    if hold_out == "time":
        return _by_value(_stretch(np.asarray(dataset.covariates["time"], dtype=float)))
    groups = max(2, (int(dataset.visits.max()) + 1) // BLOCK_POSES)
    if hold_out == "random":
        return random(dataset, groups, int(rng.integers(2**32)))
    return by_region(dataset, groups)


def _stretch(time: npt.NDArray[np.float64]) -> npt.NDArray[np.int_]:
    """(N,) index of each row's interval of time. Intervals have about equally many rows; rows of one instant stay together."""
    _, instant, count = np.unique(time, return_inverse=True, return_counts=True)
    earlier = np.cumsum(count) - count
    return np.asarray((earlier * TIME_BLOCKS // len(time))[instant])


def _by_value(values: npt.NDArray[np.generic]) -> list[Mask]:
    return [values == value for value in np.unique(values)]


Place = tuple[str, str]


def gaps(
    hypotheses: HypothesisSet,
    found: Conclusion,
    floor: Floats,
    blocks: list[Mask],
    rng: np.random.Generator,
    of_blocks: bool = False,
    inferred: Floats | None = None,
) -> tuple[Gap, dict[Place, Gap]]:
    """The gap with all causes; and, by cause, the gap without it.

    The parameters are those of :func:`~gtpin.diagnosis.gap.gap`.
    """
    design, groups = hypotheses.design, hypotheses.groups
    columns = {c.place: groups.columns(c) * found.scale[c] for c in found.classes}
    unseen = {c.place: as_unseen(design, c, groups.columns(c), blocks) * found.scale[c] for c in found.classes}

    def of(places: Iterable[Place]) -> Gap:
        none, places = np.zeros((len(design.y), 0)), tuple(places)
        causes, new = (np.hstack([none, *(some[p] for p in places)]) for some in (columns, unseen))
        return gap(
            design, causes, floor, blocks, rng, None if np.array_equal(causes, new) else new, of_blocks, inferred
        )

    return of(columns), {place: of(p for p in columns if p != place) for place in columns}


def lost(whole: Gap, less: Gap) -> float:
    """Explained fraction of the gap that is lost without a cause, with one noise floor for both. ``less``: the gap without it.

    A fit without the cause takes a part of its displacements for noise.
    """
    return float(np.clip((less.after**2 - whole.after**2) / max(whole.before**2 - whole.floor**2, 1e-300), -1.0, 1.0))


def capped_by_left_out_errors(
    found: Conclusion,
    whole: Gap,
    less: Mapping[Place, Gap],
    causes: Iterable[Cause],
    wrist: bool,
    priors: Priors = PRIORS,
) -> Conclusion:
    """The conclusion, in which a cause is not likely without which left-out errors are no larger, or whose size is open.

    Errors are compared by the product of those of positions and of measured orientations; without a ``wrist``, those of
    positions must be larger too: only they are reported. A size is open where each root mean square could be zero
    (``priors.determined``). ``whole``, ``less``: as :func:`gaps` returns them. ``causes``: the same, with parameters.
    """

    rms = {(c.effect, c.site): [e for name, e in c.parameters.items() if name.startswith("rms")] for c in causes}

    def size(of: Gap) -> float:
        return of.after if of.turns is None else of.after * of.turns.after

    def holds(cause: Hypothesis) -> bool:
        other, sizes = less[cause.place], rms[cause.place]
        smaller = size(whole) < size(other) and (wrist or whole.after < other.after)
        return smaller and (not sizes or any(e.value > priors.determined * e.sigma for e in sizes))

    return found.bounded([c for c in found.classes if not holds(c)], UNLIKELY)


def as_unseen(design: Design, cause: Hypothesis, columns: Floats, blocks: list[Mask]) -> Floats:
    """Whitened displacements (N c, m) at each pose as predicted by a model that was fitted without the pose's block.

    A session that is completely in one block has no fitted coefficients then: it gets the mean of the other sessions, as in
    :func:`~gtpin.effects.smooth.session_columns`. ``columns``: (N c, m) displacements for coefficients of typical size.
    """
    at = design.operating_points
    if "session" not in cause.covariates(at.robot) or not at.has("session"):
        return columns
    sessions = np.array([str(name) for name in at.covariates["session"]])
    found = columns.copy()
    for block in blocks:
        lost = set(sessions[block]) - set(sessions[~block])
        if not lost:
            continue
        rows = np.repeat(block, design.components)
        elsewhere = columns[~rows].any(axis=0)
        some = OperatingPoints(
            at.kinematics,
            at.q[block],
            at.poses[block],
            {name: values[block] for name, values in at.covariates.items()},
            replace(at.references, sessions=tuple(name for name in at.references.sessions if name not in lost)),
            at.temperature,
            at.unusable,
        )
        with unheard():  # of sessions that were not fitted: here they are intended
            basis = cause.basis(some)
        moved = basis.displacement(some) * basis.sigma
        seen = design.measured.take(block).change_by(moved, design.model, some.poses)
        unseen = np.asarray(design.whitening[block] @ seen).reshape(-1, moved.shape[2])
        if unseen.shape[1] != elsewhere.sum():
            continue  # a user's own effect, with other coefficients than those of the sessions
        found[rows] = 0.0
        found[np.ix_(rows, elsewhere)] = unseen
    return found


def where(hypotheses: HypothesisSet, blocks: list[Mask]) -> Where:
    """Divide the gap that the geometry alone leaves into shares; ``blocks``: (N,) masks of the poses of each region."""
    design, alone = hypotheses.design, hypotheses.gains(NOTHING, hypotheses.every)
    residual = design.y - design.B @ hypotheses.groups.marginal.deviation(design.y)
    c = design.components
    whitened = residual.reshape(-1, c)
    excess = whitened**2 - design.independent
    axis = _shares(_by_reading(design.measured, excess))
    by_pose = excess.sum(axis=1)
    T = design.operating_points.poses.T
    regions = _shares({str(k): float(by_pose[b].sum()) for k, b in enumerate(blocks)})
    boxes = tuple(
        (np.stack([T[b].min(axis=0), T[b].max(axis=0)]), regions[str(k)]) for k, b in enumerate(blocks) if b.any()
    )
    rods = {}
    if design.measured.tracked:
        rods = design.operating_points.rod_shares(
            design.coloured(whitened), np.asarray(np.linalg.inv(design.whitening))
        )
    return Where(rods, _sites(alone), axis, _covariates(alone), boxes)


def _by_reading(readings: Readings, excess: Floats) -> dict[str, float]:
    """Power beyond noise of each instrument's components, by name, divided by the number of rows."""
    found: dict[str, float] = {}
    for i, one in enumerate(readings.instruments):
        mine = readings.rows.of == i
        for k, component in enumerate(one.components):
            if readings.components == 1 and len(one.components) > 1:
                power = excess[mine & (readings.rows.component == k)].sum()
            else:
                power = excess[mine][:, k].sum()
            found[one.label(component)] = float(power) / len(excess)
    return found


def _sites(alone: Mapping[Term, Gain]) -> dict[str, float]:
    """Shares of the largest gain at each site, by an effect or a smooth term; common motions are left out."""
    best: dict[str, float] = {}
    for term, gain in alone.items():
        if isinstance(term, Proxy) or (isinstance(term, SmoothTerm) and term.motion in COMMON):
            continue
        best[term.site] = max(best.get(term.site, 0.0), gain.value)
    return _shares(best)


def _covariates(alone: Mapping[Term, Gain]) -> dict[str, float]:
    """Largest gain of a smooth term over each coordinate, relative to the largest of all."""
    best: dict[str, float] = {}
    for term, gain in alone.items():
        for coordinate in term.over if isinstance(term, SmoothTerm) else ():
            best[coordinate] = max(best.get(coordinate, 0.0), gain.value)
    top = max(best.values(), default=0.0)
    return {name: (gain / top if top > 0.0 else 0.0) for name, gain in best.items()}


def _shares(power: Mapping[str, float]) -> dict[str, float]:
    positive = {name: max(float(value), 0.0) for name, value in power.items()}
    total = sum(positive.values())
    return {name: (value / total if total > 0.0 else 0.0) for name, value in positive.items()}


MOST_CORRELATES = 5
"""Most sites and coordinates that are reported."""


def unexplained(
    hypotheses: HypothesisSet, model: Posterior[Term], unknown: bool, *, scaled: bool = False
) -> Unexplained:
    """Chi-square of the residuals of a model, and the smooth terms that correlate with them.

    ``model``: the named causes. ``unknown``: whether something unknown is assumed as well. ``scaled``: p-values are of a noise
    that is as large as what a smooth term leaves, where this is larger: too small a noise is no correlation.
    """
    groups, design = hypotheses.groups, hypotheses.design
    power = marginal_power(groups, model)
    gram = np.vstack([np.zeros((0, len(model.mean))), *(groups.across(n, model.terms) for n in model.terms)])
    effective_parameters = float(np.einsum("ij,ji->", model.covariance, gram))
    dof = max(design.dof - effective_parameters, 1.0)
    excess = groups.power - design.dof
    correlates, most = dict[tuple[str, tuple[str, ...]], Correlate](), 0.0
    gains = hypotheses.gains(model, hypotheses.smooth)
    for smooth in sorted(gains, key=lambda s: -gains[s].value):  # p-values of several may be 0
        if len(correlates) == MOST_CORRELATES:
            break
        if (smooth.site, smooth.over) in correlates:  # of several motions of a site over the same coordinates, the best
            continue
        own, seen = given(groups, model, smooth)
        values, vectors = np.linalg.eigh(own)
        kept = values > 1e-6 * max(float(values.max()), 1e-300)
        statistic = float(((vectors.T @ seen)[kept] ** 2 / values[kept]).sum())
        left = max((power - statistic) / max(dof - kept.sum(), 1.0), 1.0) if scaled else 1.0
        p_value = float(chi2.sf(statistic / left, kept.sum()))
        if p_value < hypotheses.priors.seen:
            most = most if correlates else gains[smooth].value
            odds = float(np.exp((gains[smooth].value - most) / hypotheses.priors.temperature_of(most)))
            correlates[smooth.site, smooth.over] = Correlate(smooth.site, smooth.words, p_value, smooth.motion, odds)
    share = float(np.clip((power - dof) / excess, 0.0, 1.0)) if excess > 1e-9 else 0.0
    best = tuple(correlates.values())
    could_be = dict.fromkeys(_could_be(hypotheses, model, {one.site for one in best[:1]}) if unknown else ())
    return Unexplained(share, float(chi2.sf(power, dof)), best, could_be)


def _could_be(hypotheses: HypothesisSet, model: Posterior[Term], sites: set[str]) -> tuple[Place, ...]:
    """Effect and site of untestable effects that could be the unknown.

    First those whose proxies gain nearly as much as the best smooth term, the best first. Then those at ``sites``, where the
    best smooth term acts, that lack a covariate and have no proxy: nothing in these data speaks for or against them.
    """
    priors = hypotheses.priors
    best = max((gain.value for gain in hypotheses.gains(model, hypotheses.smooth).values()), default=0.0)
    gains = hypotheses.gains(model, hypotheses.proxies)
    enough = [
        p
        for p in sorted(gains, key=lambda p: -gains[p].value)
        if gains[p].value >= max(priors.accounts * best, priors.surely)
    ]
    taken, tried = {cause.place for cause in causes(model)}, {proxy.hypothesis.place for proxy in hypotheses.proxies}
    untried = (u.hypothesis.place for u in hypotheses.untested if u.reason.kind in ("missing", "unusable"))
    return (
        *(p.hypothesis.place for p in enough if p.hypothesis.place not in taken),
        *(place for place in untried if place[1] in sites and place not in tried),
    )
