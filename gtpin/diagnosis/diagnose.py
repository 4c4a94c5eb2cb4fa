"""Diagnose the gap between a model and measurements: where it lies, what causes it, how far it shrinks."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import logsumexp
from scipy.stats import chi2

from gtpin.calibration.calibrate import calibrate, measured_poses
from gtpin.calibration.result import Calibration
from gtpin.calibration.rounds import Progress
from gtpin.data import Dataset, by_region
from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import Conditional, Marginal, Posterior, Products, fixed
from gtpin.diagnosis.fit import Observed, fit_together
from gtpin.diagnosis.result import Cause, Considered, Diagnosis, Member, Unexplained, Verdict
from gtpin.diagnosis.rivals import rivals
from gtpin.diagnosis.search import Candidate, Pool, alternatives, search
from gtpin.diagnosis.shrinkage import gap
from gtpin.diagnosis.where import where
from gtpin.effects.active import ActiveEffect
from gtpin.effects.catalogue import catalogue
from gtpin.effects.effect import Effect
from gtpin.errors import ModelError
from gtpin.model import Model
from gtpin.robot.robot import Robot

Floats = npt.NDArray[np.float64]

FALSE_ALARM = 0.01
"""Chance of naming a cause where there is none."""
CLASS_SHARE = 0.05
"""Share of the leader's probability from which an effect belongs to its class."""
SURE = 0.95
"""Probability from which a cause stands alone."""
TEMPERATURE = 2.0
"""Gains in log evidence are divided by this before they become probabilities: forms are never exactly the machine's."""
UNKNOWN_GAIN, UNKNOWN_SHARE = 9.0, 0.01
"""Gain in log evidence of a free motion beside the named causes, and its share of theirs, from which something unknown is
there: the stronger a cause, the more its departure from the textbook shows."""
BEATEN, BEATEN_SHARE = 1.0, 0.0
"""Gain by which a free motion in the place of a cause must exceed the cause's own before the cause is in doubt."""
OWN_BEATEN, OWN_SHARE = 5.0, 0.03
"""The same for a free motion over the cause's own coordinates at its own site, which only says that it bends."""
BLOCKS = 12
CORRELATES = 5


@dataclass(frozen=True)
class _Rivals:
    """Free motions: products with the model's groups, and gains beside nothing and beside the model."""

    products: Products
    keys: dict[str, tuple[str, str]]
    alone: dict[tuple[str, str], float]
    beside: dict[tuple[str, str], float]


def diagnose(
    dataset: Dataset,
    robot: Robot | None = None,
    *,
    exclude: Collection[str] = (),
    false_alarm: float = FALSE_ALARM,
    seed: int = 0,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find what a calibrated geometry leaves out of measurements.

    Parameters
    ----------
    dataset
        Measured poses, with whatever is known of their circumstances.
    robot
        The nominal robot; the one that the dataset names by default.
    exclude
        ``effect`` or ``effect@site``: what is taken out of the catalogue.
    false_alarm
        Chance of naming a cause where there is none.
    seed
        Of the resampling behind intervals.

    Raises
    ------
    GtpinError
        If the dataset can't be read as one of this robot, or an excluded effect is not known.
    """
    baseline = calibrate(dataset, robot, progress=progress)
    kept = dataset.take(~np.isin(dataset.pose.astype(str), baseline.rejected))
    observed = _observed(kept, baseline)
    design = observed.design(baseline.model)
    pool, untestable = _pool(design, exclude, false_alarm)
    if progress is not None:
        progress("searching for causes", 0, float(np.sqrt(baseline.chi2_per_dof)))
    found = search(pool)
    free = _rivals(design, pool, found)
    left_over = max(free.beside.values(), default=0.0) > UNKNOWN_GAIN + UNKNOWN_SHARE * max(found.log_evidence, 0.0)
    doubtful = {name for name in found.names if _beaten(pool, free, found, name)}
    unknown = left_over or bool(doubtful)
    names = tuple(n for n in _sure_beside(pool, free, found) if n not in doubtful) if unknown else found.names
    causes_model = _only(pool, found, names)
    classes = {name: _class(pool, causes_model, name) for name in causes_model.names}
    verdict = _verdict(unknown, classes)
    candidates = [pool.candidates[name] for name in causes_model.names]
    model = fit_together(observed, baseline.model, candidates, causes_model.scale, design.situation.references)
    rng = np.random.default_rng(seed)
    blocks = by_region(kept, max(2, min(BLOCKS, int(kept.visits.max()) + 1)))
    floor = np.trace(
        observed.noise.covariance(design.situation.command_jacobian, design.components)[:, :3, :3], axis1=1, axis2=2
    )
    columns = {n: pool.columns[n] * s for n, s in zip(causes_model.names, causes_model.scale, strict=True)}
    together = np.hstack([*columns.values(), np.zeros((len(design.y), 0))])
    whole = gap(design, together, floor, blocks, rng)
    shares = {}
    for cause in columns:
        others = np.hstack([*(v for n, v in columns.items() if n != cause), np.zeros((len(design.y), 0))])
        shares[cause] = gap(design, others, floor, blocks, rng)
    causes = [
        _cause(pool, model, i, name, classes[name], (whole.shrinkage or 0.0) - (shares[name].shrinkage or 0.0))
        for i, name in enumerate(causes_model.names)
    ]
    left = design.y - design.B @ pool.marginal.deviation(design.y)
    return Diagnosis(
        verdict=verdict,
        causes=tuple(sorted(causes, key=lambda c: -c.shrinkage)),
        candidates=tuple(_considered(pool, classes)) + tuple(untestable),
        where=where(design, left, free.alone, blocks),
        gap=whole,
        unexplained=_unexplained(pool, free, causes_model, baseline),
        baseline=baseline,
        model=model,
    )


def _observed(dataset: Dataset, baseline: Calibration) -> Observed:
    measured = measured_poses(dataset)
    return Observed(
        measured=measured,
        covariates=dataset.covariates,
        noise=baseline.noise,
        weight=np.ones(len(dataset)),
        temperature=dataset.conditions.reference_temperature,
        free_frame=dataset.instrument.frame == "free",
    )


def _pool(design: Design, exclude: Collection[str], false_alarm: float) -> tuple[Pool, list[Considered]]:
    """Testable candidates, and what is said of the others."""
    at = design.situation
    known = catalogue()
    for word in exclude:
        named, _, place = word.partition("@")
        if named not in known or (place and place not in known[named].sites(at.robot)):
            raise ModelError(f"no effect is called {word!r}", hint=f"effects are {', '.join(known)}")
    plain, scanned, untestable = {}, [], []
    for effect in known.values():
        for site in effect.sites(at.robot):
            if effect.id in exclude or f"{effect.id}@{site}" in exclude:
                continue
            reason = effect.untestable(at, site) or _absorbed(design, effect, site)
            if reason:
                untestable.append(Considered(effect.id, site, 0.0, 0.0, False, reason))
            elif effect.settings(at, site):
                scanned.append(Candidate(effect, site))
            else:
                plain[f"{effect.id}@{site}"] = Candidate(effect, site)
    count = len(plain) + len(scanned)
    threshold = float(np.log(max(count, 1)) + np.log(1.0 / false_alarm))
    return Pool(design, plain, tuple(scanned), threshold), untestable


def _absorbed(design: Design, effect: Effect, site: str) -> str:
    """Whether geometry takes nearly all of an effect of ten times its usual size."""
    at = design.situation
    if effect.settings(at, site):
        return ""
    basis = effect.basis(at, site)
    X = design.columns(basis) * 10.0
    left = float(np.trace(Marginal(design.B).product(X, X)))
    return "" if left > 15.8 else "geometric calibration absorbs it"


def _rivals(design: Design, pool: Pool, model: Posterior) -> _Rivals:
    keys, columns = {}, {name: pool.columns[name] for name in model.names}
    for site, coordinates, basis in rivals(design.situation):
        name = f"{site}|{coordinates}"
        keys[name] = (site, coordinates)
        columns[name] = design.columns(basis)
    products = pool.marginal.products(design.y, columns)
    beside = Conditional.on(products, model)
    alone = Conditional.on(products, fixed(products, (), ()))
    return _Rivals(
        products,
        keys,
        {key: alone.single(name)[0] for name, key in keys.items()},
        {key: beside.single(name)[0] for name, key in keys.items()},
    )


def _sure_beside(pool: Pool, free: _Rivals, model: Posterior) -> tuple[str, ...]:
    """Causes that stand even beside the free motion that explains the rest best."""
    best = max(free.beside, key=lambda key: free.beside[key])
    name = next(n for n, key in free.keys.items() if key == best)
    sure = []
    for cause in model.names:
        others = [(n, s) for n, s in zip(model.names, model.scale, strict=True) if n != cause]
        rest = fixed(free.products, [n for n, _ in others] + [name], [s for _, s in others] + [1.0])
        if Conditional.on(free.products, rest).single(cause)[0] > 2.0 * pool.threshold:
            sure.append(cause)
    return tuple(sure)


def _beaten(pool: Pool, free: _Rivals, model: Posterior, name: str) -> bool:
    """Whether a free motion explains what a cause explains better than the cause does."""
    others = [(n, s) for n, s in zip(model.names, model.scale, strict=True) if n != name]
    beside = Conditional.on(free.products, fixed(free.products, [n for n, _ in others], [s for _, s in others]))
    own = beside.single(name)[0]
    candidate = pool.candidates[name]
    for rival, (site, coordinates) in free.keys.items():
        gain = beside.single(rival)[0]
        words = coordinates.split(" ")[0].split(",")
        same = site == candidate.site and set(words) <= set(
            candidate.effect.coordinates(pool.design.situation.robot, site)
        )
        if gain > own + (OWN_BEATEN + OWN_SHARE * own if same else BEATEN + BEATEN_SHARE * own):
            return True
    return False


def _only(pool: Pool, model: Posterior, names: Sequence[str]) -> Posterior:
    kept = [(n, s) for n, s in zip(model.names, model.scale, strict=True) if n in names]
    return fixed(pool.products, [n for n, _ in kept], [s for _, s in kept])


def _class(pool: Pool, model: Posterior, name: str) -> tuple[Member, ...]:
    """Everything that could stand in for a cause, the likeliest first."""
    gains = dict(alternatives(pool, model, name))
    names = list(gains)
    log = np.array([gains[n] for n in names]) / TEMPERATURE
    probability = np.exp(log - logsumexp(log))
    members = [
        Member(*_split(n), float(p))
        for n, p in zip(names, probability, strict=True)
        if p >= CLASS_SHARE * probability.max()
    ]
    return tuple(sorted(members, key=lambda m: -m.probability))


def _verdict(unknown: bool, classes: dict[str, tuple[Member, ...]]) -> Verdict:
    if unknown:
        return "unknown"
    if any(members[0].probability < SURE for members in classes.values()):
        return "ambiguous"
    return "explained" if classes else "none"


def _cause(pool: Pool, model: Model, place: int, name: str, members: tuple[Member, ...], shrinkage: float) -> Cause:
    effect, site = _split(name)
    own = next((m for m in members if (m.effect, m.site) == (effect, site)), members[0])
    return Cause(effect, site, own.probability, members, _parameters(model.effects[place]), shrinkage)


def _parameters(active: ActiveEffect) -> dict[str, tuple[float, float, str]]:
    """Named parameters with sigmas, propagated from the coefficients' covariance by differences."""
    values = active.effect.parameters(active.coefficients, active.setting)
    found = {}
    size = np.sqrt(np.diag(active.covariance))
    for name, (value, unit) in values.items():
        slope = np.zeros(len(size))
        for i, step in enumerate(size * 1e-3):
            if step > 0.0:
                moved = active.coefficients + step * np.eye(len(size))[i]
                slope[i] = (active.effect.parameters(moved, active.setting)[name][0] - value) / step
        found[name] = (value, float(max(float(slope @ active.covariance @ slope), 0.0) ** 0.5), unit)
    return found


def _split(name: str) -> tuple[str, str]:
    effect, _, site = name.partition("@")
    return effect, site


def _considered(pool: Pool, classes: dict[str, tuple[Member, ...]]) -> list[Considered]:
    gains = pool.gains(pool.empty)
    probability = {f"{m.effect}@{m.site}": m.probability for members in classes.values() for m in members}
    rows = [
        Considered(*_split(name), float(gain), probability.get(name, 0.0), True, "") for name, gain in gains.items()
    ]
    return sorted(rows, key=lambda row: -row.log_evidence)


def _unexplained(pool: Pool, free: _Rivals, model: Posterior, baseline: Calibration) -> Unexplained:
    power = Conditional.on(pool.products, model).products.power
    columns = pool.products.columns(model.names)
    taken = float(np.einsum("ij,ji->", model.covariance, pool.products.gram[np.ix_(columns, columns)]))
    dof = max(len(pool.design.y) - pool.design.n_geometry - taken, 1.0)
    excess = max(pool.products.power - len(pool.design.y) + pool.design.n_geometry, 1e-9)
    correlates = []
    beside = Conditional.on(free.products, model).products
    for name, key in free.keys.items():
        g = free.products.groups[name]
        values, vectors = np.linalg.eigh(beside.gram[g, g])
        seen = values > 1e-6 * max(values.max(), 1e-300)
        statistic = float(((vectors.T @ beside.moment[g])[seen] ** 2 / values[seen]).sum())
        correlates.append((*key, float(chi2.sf(statistic, int(seen.sum())))))
    correlates.sort(key=lambda row: row[2])
    share = float(np.clip((power - dof) / excess, 0.0, 1.0)) if excess > 1e-9 else 0.0
    return Unexplained(
        share, float(chi2.sf(power, dof)), tuple(row for row in correlates[:CORRELATES] if row[2] < 1e-3)
    )
