"""Which effects a diagnosis may name, and with what probability of a false alarm."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.effects.effect import Effect
from gtpin.errors import ModelError
from gtpin.robot.robot import Robot


@dataclass(frozen=True)
class Scope:
    """Effects that a diagnosis may name.

    ``effects``: the effects; their ids are different. ``exclude``: effects that are not tried, each as ``effect`` (at all its
    sites) or ``effect@site``. ``false_alarm``: probability of naming a cause where there is none. ``priors``: the constants on
    which verdicts depend.
    """

    effects: tuple[Effect, ...]
    exclude: frozenset[str]
    false_alarm: float
    priors: Priors = PRIORS

    @staticmethod
    def of(
        effects: Iterable[Effect], exclude: Collection[str], false_alarm: float, robot: Robot, priors: Priors = PRIORS
    ) -> Scope:
        """The scope of a user's arguments, checked.

        Raises `ModelError` if two effects have the same id, or an excluded effect or site does not exist.
        """
        known = tuple(effects)
        by_id = {effect.id: effect for effect in known}
        for effect in known:
            if by_id[effect.id] is not effect:
                raise ModelError(f"two effects have the id {effect.id!r}", hint="give each an id of its own")
        for word in exclude:
            named, at, place = word.partition("@")
            if named not in by_id or (at and not place):
                raise ModelError(f"no effect is called {word!r}", hint=f"effects are {', '.join(by_id)}")
            if place and place not in by_id[named].sites(robot):
                sites = ", ".join(by_id[named].sites(robot))
                raise ModelError(f"no effect is called {word!r}", hint=f"sites of {named} are {sites}")
        return Scope(known, frozenset(exclude), false_alarm, priors)

    def hypotheses(self, robot: Robot) -> Iterator[Hypothesis]:
        """Every effect at each of its sites, each once, without those that are excluded."""
        for effect in self.effects:
            for site in dict.fromkeys(effect.sites(robot)):
                found = Hypothesis(effect, site)
                if effect.id not in self.exclude and str(found) not in self.exclude:
                    yield found
