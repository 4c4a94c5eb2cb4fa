"""Effects at sites as clauses, and clauses as sentences."""

from __future__ import annotations

from gtpin.effects.effect import ChainWords, Effect
from gtpin.report.words import site_words
from gtpin.robot.robot import Robot


def clause(effect: Effect, site: str, robot: Robot | None = None) -> str:
    """An effect at a site as a clause, such as ``cart1 has backlash``: from the effect's class, or from its title.

    Parameters
    ----------
    robot
        The robot: effects of robots without rods have other words.
    """
    own = effect.of_chains if robot is not None and not robot.rods else ChainWords()
    one, many = own.clause or effect.clause, own.plural or effect.plural_clause
    words = many if site == "arm" and many else one
    return (words or f"{effect.title} at {{site}}").replace("{site}", site_words(site))


def remedy(effect: Effect, robot: Robot) -> str:
    """What an engineer can do about an effect, as a sentence."""
    own = "" if robot.rods else effect.of_chains.remedy
    return own or effect.remedy


def sentence(words: str) -> str:
    """Words as a sentence: a full stop, and a capital first letter unless the first word is the name of a site."""
    name = any(c.isdigit() or c == "_" for c in words.split(" ")[0])
    return f"{words if name else words[:1].upper() + words[1:]}."
