"""Effects that go with what was not recorded: what was recorded tells how well they could stand in for a cause."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from gtpin.diagnosis.hypotheses.hypothesis import Candidate
from gtpin.diagnosis.hypotheses.missing_covariates import guesses, loaded, pauses, with_column
from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.linear.evidence import NOTHING, Groups, Marginal, gain
from gtpin.effects.catalogue import OWN
from gtpin.effects.situation import Situation
from gtpin.effects.untestable import Untestable
from gtpin.errors import warn

Floats = npt.NDArray[np.float64]

USUAL, CONSTANT = 0.2, 0.05
"""Odds that an effect is there although nobody recorded what it goes with, over those of one that can be tested; the second
for sessions where nothing tells of a pause, and for payloads: a column that does not vary is often left out."""
UNLOADED = Untestable("unrecorded_payload", "payload")
"""Why an effect that goes with forces could be what it does not look like by gravity of the robot alone."""


@dataclass(frozen=True)
class Hidden:
    """An effect that could stand in.

    Parameters
    ----------
    columns
        (N c, m) whitened displacements by a guess of what was not recorded.
    odds
        How likely that is, over an effect of what was recorded.
    reason
        Why it could be the cause, although it can be tested by what was recorded; None where it can't.
    """

    candidate: Candidate
    columns: Floats
    odds: float
    reason: Untestable | None = None

    @property
    def name(self) -> str:
        """Of its group; unlike that of the same effect by what was recorded."""
        return f"{self.candidate.name} by what was not recorded"


def stand_ins(design: Design, untestable: Iterable[Candidate], testable: Iterable[Candidate]) -> Iterator[Hidden]:
    """Effects that lack a covariate, and effects of forces where the payload was not recorded, as far as there is a guess."""
    at, failed = design.situation, dict[str, str]()
    for candidate in untestable:
        columns = _tried(candidate, partial(stand_in, design, candidate), failed)
        if columns is not None:
            yield Hidden(candidate, columns, odds(at, candidate))
    spells = loaded(at)
    for candidate in testable if spells else ():
        if "payload" in candidate.coordinates(at.robot) and not candidate.effect.has_nonlinear:
            columns = _tried(candidate, partial(_under, design, candidate, spells), failed)
            if columns is not None:
                yield Hidden(candidate, columns, CONSTANT, UNLOADED)
    for effect, why in failed.items():
        text = f"{effect} can't be tried with a guess of what was not recorded ({why}): it stands in no class"
        warn(text)


def _tried(candidate: Candidate, columns: Callable[[], Floats | None], failed: dict[str, str]) -> Floats | None:
    """Displacements; None for an effect of others that can't do with values that nobody recorded, with why in ``failed``."""
    try:
        found = columns()
    except Exception as error:  # a stranger's effect may fail in any way
        if type(candidate.effect) in OWN:
            raise
        failed[candidate.effect.id] = f"{type(error).__name__}: {error}"
        return None
    return found if found is not None and np.isfinite(found).all() else None


def _under(design: Design, candidate: Candidate, spells: list[Situation]) -> Floats:
    """An effect's displacements, and by how much more its core moves with a payload in each spell."""
    effect, site = candidate.effect, candidate.site
    plain = design.columns(effect.basis(design.situation, site))
    core = list(effect.core) or list(range(plain.shape[1]))
    more = [design.columns(effect.basis(at, site))[:, core] - plain[:, core] for at in spells]
    return np.hstack([plain, *more])


def odds(at: Situation, candidate: Candidate) -> float:
    """How likely an effect is without what it goes with, over one that can be tested.

    What was recorded and can't be used was there to vary, so nothing speaks against it.
    """
    missing = _missing(at, candidate)
    if at.unusable.issuperset(missing):
        return 1.0
    once = missing == ["session"] and not len(pauses(at))
    return CONSTANT if once else USUAL


def stand_in(design: Design, candidate: Candidate) -> Floats | None:
    """(N c, m) whitened displacements of an effect whose covariate is missing, by what goes with that covariate.

    None where nothing recorded does, or something else than one missing covariate keeps it from being tested.
    """
    at, (effect, site) = design.situation, (candidate.effect, candidate.site)
    missing = _missing(at, candidate)
    if len(missing) != 1 or effect.has_nonlinear:
        return None
    found = [
        np.hstack([design.columns(effect.basis(with_column(at, missing[0], values), site)) for values in together])
        for together in guesses(at, missing[0])
    ]
    return _best(design, found) if found else None


def _missing(at: Situation, candidate: Candidate) -> list[str]:
    return [name for name in candidate.effect.covariates(at.robot, candidate.site) if not at.has(name)]


def _best(design: Design, found: list[Floats]) -> Floats:
    """The guess that fits best."""
    if len(found) == 1:
        return found[0]
    groups = Groups(Marginal(design.B), design.y)
    gains = []
    for columns in found:
        groups.set("guess", columns)
        gains.append(gain(groups, NOTHING, "guess")[0])
    return found[int(np.argmax(gains))]
