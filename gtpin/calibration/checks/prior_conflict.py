"""Whether a fitted geometry contradicts its tolerances, which wrong assumption explains it, and the fit without it.

The assumption is of the instrument's frame or place, a zero, a part, or all tolerances.

To first order the whitened residual at nominal is y ~ N(0, I + B T B' + E S E'), with B the derivative by the geometry in
tolerances, T = I as declared, and E the derivative by other quantities that may be wrong. The marginal likelihood of y with
larger entries in T or S, over that with T = I and S = 0, says what was assumed wrongly.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.linalg import solve_triangular

from gtpin.calibration.checks import limits
from gtpin.calibration.checks.before_fit import moved_too_far
from gtpin.calibration.checks.suspected import UNEXPLAINED, warn_of_far_parameters, zeros_beyond, zeros_off
from gtpin.calibration.fit_state import FitState
from gtpin.calibration.problem import FRAME_UNIT, Point, Problem, rough_frame, with_unknowns
from gtpin.calibration.robust_fit import RobustFit
from gtpin.data.instrument_tables import InstrumentTable, TrackerTable
from gtpin.errors import ConvergenceError, listed, warn
from gtpin.instruments.frame_and_target import AWAY
from gtpin.instruments.readings import Readings
from gtpin.kinematics.rotations import frame_motions
from gtpin.model.model import Frame
from gtpin.typing import Floats, Mask

What = Literal["frame", "place", "zero", "part", "tolerances"]


PLACES = {"plane": ("plane_sigma", "normal_sigma"), "station": ("station_sigma",), "point": ("socket_sigma",)}
"""Unknown places of instruments by the names of their parameters, and the keys of dataset.toml with their prior sigmas."""


@dataclass(frozen=True)
class PriorConflict:
    """The wrong assumption that best explains why a fitted geometry contradicts its tolerances.

    - ``what``, ``site``: what was assumed wrongly: the instrument's ``frame``, the ``place`` of the planes, stations or sockets
      of the instrument ``site``, the ``zero`` of the actuator ``site``, one ``part`` (the parameter ``site``), or all
      ``tolerances``.
    - ``gain``: gain in log marginal likelihood, nats, without this assumption.
    - ``size``: how wrong it is. ``frame``: its shift, m. ``zero``: m, or rad for an arm. ``part``: deviation in units of
      the tolerances. ``tolerances``, ``place``: the factor by which these, or the prior sigmas, are too small.
    - ``turn``: rotation of a ``frame``, rad.
    """

    what: What
    site: str
    gain: float
    size: float
    turn: float = 0.0


def prior_conflict(settled: FitState) -> PriorConflict | None:
    """The assumption that a fitted geometry contradicts; None where the geometry agrees with its tolerances."""
    found = max(_Linear.of(settled).suspects(), key=lambda s: s.gain)
    return found if found.gain > limits.CONFLICT else None


def without_prior_conflict(fit: RobustFit, settled: FitState) -> FitState:
    """The result of the fit; if the priors contradict the data, repeated with wider tolerances or a free frame.

    Warns: of this. Where a target that is not where it is declared explains the contradiction, or residuals that exceed the
    noise, better, only of the target.
    Tolerances are not widened where a part would then be farther off than of any machine, and the geometry without this leaves
    less than most mistakes do. A soft rod is an example: joints that sit elsewhere can take up what it gives way.
    """
    admitted, text = _admitted(fit, settled)
    fitted = admitted.fit.point.model.geometry
    if fitted.is_widened and (far := moved_too_far(fitted, settled.geometry, fit.near, fit.found)):
        within = replace(fit, widen=False)
        if (plain := _near_nominal(within, settled)) is not None:
            kept = f"with wider tolerances it would move {far}, so the tolerances are kept"
            warn(f"{UNEXPLAINED}: {kept}")
            return without_prior_conflict(within, plain)
    if (text or _target_may_explain(admitted)) and (doubt := _elsewhere_on_platform(fit, admitted, fits=not text)):
        warn(doubt)
        return replace(admitted, doubt=doubt)
    if fit.widen:  # else causes may explain what is far off
        warn_of_far_parameters(admitted, settled.geometry.tolerance, zeros_off(admitted) in text)
    if text:
        warn(text)
    return admitted


def _near_nominal(within: RobustFit, settled: FitState) -> FitState | None:
    """The result with the given tolerances; None where it does not converge, leaves what most mistakes do, or has a part that
    is farther off than of any machine too."""
    try:
        plain = settled if settled.widened == 1.0 else within.run()
    except ConvergenceError:
        return None
    point = plain.fit.point
    left = plain.fit.problem.raw_residual(point, point.poses)[:, :3]
    poor = np.sqrt((left**2).sum(axis=1).mean()) >= limits.POOR
    return None if poor or moved_too_far(point.model.geometry, settled.geometry, within.near, within.found) else plain


def _admitted(fit: RobustFit, settled: FitState) -> tuple[FitState, str]:
    """The result without the assumption that the data contradict, and what to say of it; empty where there is none."""
    found = prior_conflict(settled)
    far = np.abs(settled.deviation).max(initial=0.0) > limits.FAR_FROM_PRIOR
    # Where no parameter deviates so far, the priors may be contradicted by another cause, such as a ball out of round.
    elsewhere = found is not None and found.what in ("frame", "place")
    if settled.widened == 1.0 and (found is None or not (far or elsewhere)):
        return settled, ""
    admit = "tolerances are widened to admit it"
    if settled.widened > 1.0 and (found is None or found.what == "tolerances"):
        size = f"its parameters are off by {settled.widened:.2g} times their tolerances"
        return settled, f"the nominal model is not this machine: {size}; {admit}"
    assert found is not None
    if found.what == "frame":
        size = f"{found.size * 1e3:.2g} mm and {found.turn * 1e3:.2g} mrad off the robot's"
        free = 'it is fitted as free; write frame = "free", or target = [x, y, z] if the target is off the TCP'
        return _with_free_frame(fit).run(), f"the instrument's frame looks {size}: {free}"
    if found.what == "place":
        return _with_other_place(fit, found)
    if not fit.widen:
        return settled, ""
    # A zero moves all that its joint carries: these tolerances hold the whole of it, though each parameter may deviate less.
    x = np.abs(settled.deviation)
    for zero in zeros_beyond(settled):
        x = np.maximum(x, np.abs(zero.way * zero.value) / settled.geometry.tolerance)
    wider = np.maximum(found.size if found.what == "tolerances" else 1.0, np.where(x > 3.0, x, 1.0))
    relaxed = fit.with_geometry(settled.geometry.with_tolerances(wider)).run()
    if zeros := zeros_off(relaxed):
        deviation = zeros
    elif found.what in ("part", "zero"):
        named = found.site if found.what == "part" else f"the zero of {found.site}"
        deviation = f"{named} looks off by more than the tolerances allow"
        if found.site.startswith("platform"):
            deviation += ", or the target is not where it is declared"
    else:
        deviation = f"its parameters are off by {found.size:g} times their tolerances"
    return relaxed, f"the nominal model is not this machine: {deviation}; {admit}"


def _target_may_explain(settled: FitState) -> bool:
    """Whether an unknown place of the target explains a part of residuals that exceed the noise, to first order.

    With the residual r, its derivatives J by the fit's unknowns and E by the place, and the prior precisions P and 1 / AWAY^2,
    the sum of squares falls by g' (S + 1 / AWAY^2)^-1 g, where g = E' r and S = E' E - E' J (J' J + P)^-1 J' E.
    """
    fit, problem = settled.fit, settled.fit.problem
    if settled.sigma_scale == 1.0:
        return False
    n = problem.size
    whole, g, before = np.zeros((n + 3, n + 3)), np.zeros(3), 0.0
    for rows in problem.chunks():
        poses = fit.point.poses[rows]
        moved = np.zeros((len(poses), 6 + 3 * len(poses.links) + len(poses.joints), 3))
        moved[:, :3] = poses.R
        J = np.concatenate([problem.jacobian(fit.point, rows), problem.columns(fit.point, moved, rows)], axis=2)
        weight = np.sqrt(fit.weight[rows])[:, None]
        flat, r = (J * weight[..., None]).reshape(-1, n + 3), (fit.residual[rows] * weight).ravel()
        whole += flat.T @ flat
        g += flat[:, n:].T @ r
        before += float(r @ r)
    inner = whole[:n, :n] + np.diag(problem.prior)
    S = whole[n:, n:] - whole[n:, :n] @ np.linalg.solve(inner, whole[:n, n:]) + np.eye(3) / AWAY**2
    # Wrong places of 85 and 120 mm left 0.23 and 0.76; elastic drives, a wrong scale and a hose 0.93 and more.
    return 1.0 - float(g @ np.linalg.solve(S, g)) / before < 0.9


def _elsewhere_on_platform(fit: RobustFit, admitted: FitState, *, fits: bool) -> str:
    """What to say of a tracker's target that is not where it is declared, if it explains the data better than ``admitted``.

    ``fits``: whether it must explain them to the noise.

    It does where the fit with the target's place as an unknown, of a prior sigma of some tenths of metres, has the larger
    marginal likelihood, and residuals that are about as small, or where its residuals are much smaller; and where the place
    that is found is another one than that declared.
    """
    whole, rows = fit.whole, fit.whole.measured.rows
    table = rows.tables[0]
    if len(rows.tables) > 1 or not isinstance(table, TrackerTable) or table.target == "free" or table.targets:
        return ""
    if fit.found is not None and fit.found.any():
        return ""
    free = "free" if whole.free_frame or table.frame == "free" else "robot"
    more = {"name": table.name or "tracker", "frame": free, "target_sigma": AWAY}
    # From the declared place: where the platform hardly turns, the nominal poses place a target tenths of metres away.
    readings, start = _described(fit, [table.model_copy(update=more)]), replace(whole.start, frame=Frame())
    tried = replace(fit, whole=replace(whole, start=start, measured=readings, free_frame=False))
    try:
        other, _ = _admitted(tried, tried.run())
    except ConvergenceError:
        return ""
    problem, names = other.fit.problem, [unknown.name for unknown in readings.unknowns]
    own = [problem.n_geometry + names.index(f"{more['name']}.target.{axis}") for axis in "xyz"]
    if len(problem.unit) != len(names):  # a frame was freed, so that the target is one of two assumptions
        return ""
    if fits and other.sigma_scale > 1.0:
        return ""
    gain, left = other.log_evidence - admitted.log_evidence, other.scale / admitted.scale
    if (gain < limits.CONFLICT or left > limits.AS_GOOD) and left > 1.0 / limits.AS_GOOD:
        return ""
    off, sigma = AWAY * other.fit.point.x[own], AWAY * np.sqrt(np.diag(other.fit.covariance)[own])
    # A target that sits where it is declared takes up a part of another error.
    if (np.abs(off) <= limits.FAR_FROM_PRIOR * sigma).all():
        return ""
    so = "fit to the noise" if fits else "fit as well, and the geometry is much nearer to nominal"
    at = off + np.array(table.fixed_targets[""])
    place = ", ".join(f"{value:.4f}" for value in at)
    return (
        f"the target does not look to be where dataset.toml has it, but at [{place}] m in the frame of the TCP (+- "
        f"{1e3 * sigma.max():.2g} mm): with it the data {so}; measure it, "
        f"and write target = [{place}] under its instrument in dataset.toml. Without it, zeros and joints of this result are "
        "wrong together with the tool"
    )


def _described(fit: RobustFit, tables: Iterable[InstrumentTable]) -> Readings:
    """The readings of a fit with other sections of dataset.toml, and with first values of the unknowns."""
    measured = fit.whole.measured
    readings = Readings.of_rows(measured.q, replace(measured.rows, tables=tuple(tables)), measured.robot)
    return readings.at(readings.start(fit.near))


def _with_free_frame(fit: RobustFit) -> RobustFit:
    """The fit with a free frame for every tracker that was assumed to measure in the robot's."""
    whole, rows = fit.whole, fit.whole.measured.rows
    if whole.measured.tracked:
        start = replace(whole.start, frame=rough_frame(fit.near, whole.poses))
        return replace(fit, whole=replace(whole, start=start, free_frame=True))
    tables = (t.model_copy(update={"frame": "free"}) if isinstance(t, TrackerTable) else t for t in rows.tables)
    return replace(fit, whole=replace(whole, measured=with_unknowns(_described(fit, tables), fit.near)))


def _with_other_place(fit: RobustFit, found: PriorConflict) -> tuple[FitState, str]:
    """The result with wider priors of the places of an instrument's planes, stations or sockets, and what to say of it."""
    tables = list(fit.whole.measured.rows.tables)
    index = [table.name for table in tables].index(found.site)
    sigmas = {key: value for keys in PLACES.values() for key in keys if (value := getattr(tables[index], key, None))}
    tables[index] = tables[index].model_copy(update={key: found.size * value for key, value in sigmas.items()})
    readings = with_unknowns(_described(fit, tables), fit.near)
    settled = replace(fit, whole=replace(fit.whole, measured=readings)).run()
    after = settled.fit.problem.readings(settled.fit.point.x)
    off = [
        (abs(far), f"{one.name} {u:+.3g} {one.unit}" if abs(u) >= 1.0 else f"{one.name} {1e3 * u:+.3g} m{one.unit}")
        for one, u, far in zip(after.unknowns, after.u, found.size * after.deviation, strict=True)
        if one.name.startswith(f"{found.site}.") and abs(far) > limits.FAR_FROM_PRIOR
    ]
    named = listed([words for _, words in sorted(off, reverse=True)], limits.NAMED)
    what = f"{found.site} does not look to be where dataset.toml has it: {named or 'its places'}; its prior sigmas are widened"
    same = "zeros that are off together, or another base frame, look the same to these data"
    return settled, f"{what} to admit it: correct what is declared, or give larger sigmas; {same}"


@dataclass(frozen=True)
class _Linear:
    """The normal equations about a fit: A = J'J and b = J'y over the fit's unknowns, the frame (6) and the actuators' zeros.

    The frame is that in which trackers measure that stand in the robot's own; where there are none, its columns are 0.
    """

    settled: FitState
    A: Floats
    b: Floats

    @staticmethod
    def of(settled: FitState) -> _Linear:
        fit, problem = settled.fit, settled.fit.problem
        p, n = problem.n_geometry, problem.size
        unit = np.ones(n)
        unit[:p] = settled.geometry.tolerance / problem.start.geometry.tolerance
        # What has a prior is measured from its nominal or declared value; all else from its fitted value.
        x = np.where(problem.prior == 1.0, fit.point.x[:n] / unit, 0.0)
        size = n + 6 + problem.start.robot.n_actuators
        whole, moment = np.zeros((size, size)), np.zeros(size)
        for rows in problem.chunks():
            weight = np.sqrt(fit.weight[rows])
            J = np.concatenate([problem.jacobian(fit.point, rows) * unit, _motions(problem, fit.point, rows)], axis=2)
            flat = (J * weight[:, None, None]).reshape(-1, J.shape[2])
            y = (fit.residual[rows] * weight[:, None]).ravel() + flat[:, :n] @ x
            whole += flat.T @ flat
            moment += flat.T @ y
        # Residuals that the fit leaves beyond the noise count as noise too: they do not come from wrong tolerances.
        return _Linear(settled, whole / settled.sigma_scale**2, moment / settled.sigma_scale**2)

    def suspects(self) -> Iterator[PriorConflict]:
        """All assumptions that might be wrong, each with the gain in log marginal likelihood without it."""
        problem = self.settled.fit.problem
        p, n, names = problem.n_geometry, problem.size, problem.start.geometry.names
        prior = np.zeros(len(self.b))
        prior[:n] = 1.0 / problem.prior
        base, place = self._evidence(prior), np.arange(len(prior))

        def best(own: Mask, sizes: tuple[float, ...]) -> tuple[float, float]:
            """The largest gain with some unknowns' standard deviations larger, and the size of these."""
            gains = [self._evidence(np.where(own, size**2, prior)) - base for size in sizes]
            return max(zip(gains, sizes, strict=True), key=lambda pair: pair[0])

        own = (place >= n) & (place < n + 6)
        if self.A[own].any():
            gain, size = best(own, limits.SCALES)
            s = np.sqrt(np.where(own, size**2, prior))
            mean = s * np.linalg.solve(np.eye(len(s)) + s[:, None] * self.A * s, s * self.b)
            shift, turn = (float(np.linalg.norm(part)) for part in np.split(mean[own] * FRAME_UNIT, 2))
            yield PriorConflict("frame", "frame", gain, shift, turn)
        for table in problem.measured.rows.tables:
            starts = tuple(f"{table.name}.{what}[" for what in PLACES)
            own = np.isin(place, [p + k for k, u in enumerate(problem.measured.unknowns) if u.name.startswith(starts)])
            if own.any():
                yield PriorConflict("place", table.name, *best(own & (prior == 1.0), limits.FACTORS))
        zeros = self._alone(prior, slice(n + 6, None), limits.SCALES)
        for site, gain, mean in zip(problem.start.geometry.robot.sites, *zeros, strict=True):
            yield PriorConflict("zero", site, float(gain), float(mean) * FRAME_UNIT)
        parts = self._alone(prior, slice(len(names)), limits.FACTORS)
        for name, gain, mean in zip(names, *parts, strict=True):
            yield PriorConflict("part", name, float(gain), float(mean))
        yield PriorConflict("tolerances", "", *best(place < p, limits.FACTORS))

    def _alone(self, prior: Floats, own: slice, sizes: tuple[float, ...]) -> tuple[Floats, Floats]:
        """For some unknowns, each with its variance alone larger: largest gain in log marginal likelihood, and the mean."""
        # With V = I + B P B' and e its column of the derivative, a variance larger by v changes V by v e e': all follows from
        # e' V^-1 e and e' V^-1 y.
        s = np.sqrt(prior)
        root, _ = self._root(s)
        half = root @ (s[:, None] * self.A[:, own])
        power = np.maximum(np.diag(self.A)[own] - (half**2).sum(axis=0), 0.0)
        moment = self.b[own] - half.T @ (root @ (s * self.b))
        more = np.square(sizes)[:, None] - prior[own]
        shrunk = 1.0 / (1.0 + more * power)
        gains = 0.5 * (more * shrunk * moment**2 + np.log(shrunk))
        best, every = np.argmax(gains, axis=0), np.arange(len(power))
        return gains[best, every], np.square(sizes)[best] * moment * shrunk[best, every]

    def _evidence(self, variance: Floats) -> float:
        s = np.sqrt(variance)
        root, log_determinant = self._root(s)
        return float(0.5 * ((root @ (s * self.b)) ** 2).sum() - 0.5 * log_determinant)

    def _root(self, s: Floats) -> tuple[Floats, float]:
        """K with K'K = (I + S A S)^-1, S the standard deviations, and the logarithm of the determinant of I + S A S."""
        inner = np.eye(len(s)) + s[:, None] * self.A * s
        try:
            lower = np.linalg.cholesky(inner)
        except np.linalg.LinAlgError:
            # A rounding error in a direction without a prior: without rounding, no eigenvalue is below 1.
            values, vectors = np.linalg.eigh(inner)
            values = np.maximum(values, 1.0)
            return (vectors / np.sqrt(values)).T, float(np.log(values).sum())
        root = solve_triangular(lower, np.eye(len(s)), lower=True)
        return np.asarray(root), 2.0 * float(np.log(np.diag(lower)).sum())


def _motions(problem: Problem, point: Point, rows: slice) -> Floats:
    """(M, c, 6 + n) whitened motions, per mm and mrad: of the frame about the middle of the poses, and of actuators' zeros."""
    zeros = point.model.kinematics.command_jacobian(problem.measured.q[rows], point.poses[rows])
    frame = np.zeros((*zeros.shape[:2], 6))
    frame[:, :6] = frame_motions(point.poses[rows].T - np.median(point.poses.T, axis=0))
    moved = problem.columns(point, FRAME_UNIT * np.concatenate([frame, zeros], axis=2), rows)
    of = problem.measured.rows
    known = [isinstance(t, TrackerTable) and t.frame == "robot" and not problem.free_frame for t in of.tables]
    moved[~np.array(known)[of.of[rows]], :, :6] = 0.0
    return moved
