"""Effects at sites as clauses, and clauses as sentences."""

from __future__ import annotations

from gtpin.effects.effect import Effect
from gtpin.report.words import site_words


def clause(effect: Effect, site: str) -> str:
    """An effect at a site as a clause, from its class: ``cart1 has backlash``; from its title if it has no clause."""
    words = effect.plural_clause if site == "arm" and effect.plural_clause else effect.clause
    return (words or f"{effect.title} at {{site}}").replace("{site}", site_words(site))


def sentence(words: str) -> str:
    """Words as a sentence: a capital first letter, unless it is a machine's own name, and a full stop."""
    name = any(c.isdigit() or c == "_" for c in words.split(" ")[0])
    return f"{words if name else words[:1].upper() + words[1:]}."
