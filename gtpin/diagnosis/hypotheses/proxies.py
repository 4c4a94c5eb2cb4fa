"""Effects whose covariate was not recorded, computed with a proxy of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.missing_covariates import guesses, loaded, pauses, with_column
from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.linear.evidence import Groups, Marginal
from gtpin.diagnosis.linear.posterior import NOTHING, all_gains
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.effects.catalogue import OWN
from gtpin.effects.situation import Situation
from gtpin.effects.untestable import Untestable
from gtpin.errors import warn
from gtpin.typing import Floats

UNLOADED = Untestable("unrecorded_payload", "payload")
"""Why an effect that depends on forces could be the cause although its test with the robot's own weight does not show it."""


@dataclass(frozen=True, eq=False)
class Proxy:
    """A hypothesis with a proxy in the place of a covariate that was not recorded.

    Parameters
    ----------
    hypothesis
        The hypothesis.
    columns
        (N c, m) whitened displacements, computed with the proxy.
    odds
        Prior odds of the hypothesis relative to a testable one.
    reason
        For a hypothesis that the recorded columns can test: why it could be the cause although that test does not show it. None
        for an untestable one.
    """

    hypothesis: Hypothesis
    columns: Floats
    odds: float
    reason: Untestable | None = None


def proxies(
    design: Design, untestable: Iterable[Hypothesis], testable: Iterable[Hypothesis], priors: Priors = PRIORS
) -> Iterator[Proxy]:
    """Proxies of effects with a missing covariate, and of effects of forces where the payload was not recorded."""
    at, failed = design.situation, dict[str, str]()
    for hypothesis in untestable:
        columns = _tried(hypothesis, partial(proxy_columns, design, hypothesis, priors), failed)
        if columns is not None:
            yield Proxy(hypothesis, columns, odds(at, hypothesis, priors))
    spells = loaded(at, priors)
    for hypothesis in testable if spells else ():
        if "payload" in hypothesis.coordinates(at.robot) and not hypothesis.effect.has_nonlinear:
            columns = _tried(hypothesis, partial(_under, design, hypothesis, spells), failed)
            if columns is not None:
                yield Proxy(hypothesis, columns, priors.not_varied, UNLOADED)
    for effect, why in failed.items():
        text = f"{effect} can't be tried with a proxy of what was not recorded ({why}): it is in no class"
        warn(text)


def _tried(hypothesis: Hypothesis, columns: Callable[[], Floats | None], failed: dict[str, str]) -> Floats | None:
    """The result of ``columns``. None where there is no proxy, where a displacement is not finite, or where a user's own effect
    fails with the proxy; ``failed`` then gets the error."""
    try:
        found = columns()
    except Exception as error:  # a user's effect may fail in any way
        if type(hypothesis.effect) in OWN:
            raise
        failed[hypothesis.effect.id] = f"{type(error).__name__}: {error}"
        return None
    return found if found is not None and np.isfinite(found).all() else None


def _under(design: Design, hypothesis: Hypothesis, spells: list[Situation]) -> Floats:
    """An effect's displacements, and those that a payload in each interval of time adds to its core."""
    effect, site = hypothesis.effect, hypothesis.site
    plain = design.columns(effect.basis(design.situation, site))
    core = list(effect.core) or list(range(plain.shape[1]))
    more = [design.columns(effect.basis(at, site))[:, core] - plain[:, core] for at in spells]
    return np.hstack([plain, *more])


def odds(at: Situation, hypothesis: Hypothesis, priors: Priors = PRIORS) -> float:
    """Prior odds of an effect with a missing covariate relative to a testable effect.

    They are 1 where the covariate was recorded but can't be used, and smaller for a session that began without a pause.
    """
    missing = _missing(at, hypothesis)
    if at.unusable.issuperset(missing):
        return 1.0
    once = missing == ["session"] and not len(pauses(at, priors))
    return priors.not_varied if once else priors.not_recorded


def proxy_columns(design: Design, hypothesis: Hypothesis, priors: Priors = PRIORS) -> Floats | None:
    """(N c, m) whitened displacements of an effect whose covariate is missing, by the proxy of that covariate that fits best.

    None where there is no proxy, or where the effect is untestable for another reason than one missing covariate.
    """
    at, (effect, site) = design.situation, (hypothesis.effect, hypothesis.site)
    missing = _missing(at, hypothesis)
    if len(missing) != 1 or effect.has_nonlinear:
        return None
    found = [
        np.hstack([design.columns(effect.basis(with_column(at, missing[0], values), site)) for values in together])
        for together in guesses(at, missing[0], priors)
    ]
    return _best(design, found) if found else None


def _missing(at: Situation, hypothesis: Hypothesis) -> list[str]:
    return [name for name in hypothesis.effect.covariates(at.robot, hypothesis.site) if not at.has(name)]


def _best(design: Design, found: list[Floats]) -> Floats:
    """The proxy that fits best."""
    if len(found) == 1:
        return found[0]
    groups: Groups[int] = Groups(Marginal(design.B), design.y)
    for i, columns in enumerate(found):
        groups.add(i, columns)
    gains = all_gains(groups, NOTHING, range(len(found)))
    best: int = max(gains, key=lambda i: gains[i])
    return found[best]
