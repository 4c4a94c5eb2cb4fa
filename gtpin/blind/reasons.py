"""Cases in which a diagnosis was not right, and why, as far as their truth tells."""

from __future__ import annotations

from gtpin.blind.judged import VISIBLE, Judged


def failure(case: Judged) -> str | None:
    """Why a case counts as a failure; None where it is right.

    Right is: one or more effects named alone, with their sites; no effect: silent; an unlisted effect: `unknown` and no
    name; listed and unlisted together: `unknown` and no false name. Rough and weak cases need the truth in the class, weak
    ones only if anything was named.
    """
    if case.error is not None:
        return case.error
    assert case.said is not None
    if case.kind == "none" or not case.truth:
        return f"false alarm: {case.said.verdict}" if case.detected else None
    if not case.listed:
        return _unlisted(case)
    if case.kind in ("rough", "power"):
        wrong = case.detected and case.testable and not case.in_class and bool(case.said.causes)
        return "the class does not hold the truth" if wrong else None
    if case.strict:
        return None
    return _single(case) if len(case.truth) == 1 else _several(case)


def _unlisted(case: Judged) -> str | None:
    assert case.said is not None
    told = [f"{name} named for it" for name in case.false_names]
    if case.said.verdict != "unknown":
        told.append(
            f"not recognised as unknown; known effects leave {_number(case, case.rival)}"
            if case.rival
            else "not recognised"
        )
    return "; ".join(told) or None


def _single(case: Judged) -> str:
    """Why a single effect was not named, alone, with its site."""
    assert case.said is not None
    effect, said = case.single, case.said
    if not case.testable:
        return "its covariate is missing or does not vary"
    told = []
    if said.verdict == "none":
        told.append("not detected")
    for name in case.false_names:
        beside = "named beside it" if effect.name in said.names else "named in its place"
        left = case.left.get(name)
        can = "" if left is None else f", and leaves {left:.0f} of it"
        told.append(f"{name} {beside}{can}")
    if said.verdict == "unknown":
        own = case.left.get(effect.name)
        told.append("called unknown" + ("" if own is None else f"; the textbook form leaves {own:.0f}"))
    if effect.name not in said.names and effect.name in said.members:
        told.append("in the class")
    if effect.energy is not None and effect.energy <= VISIBLE:
        told.append("weak: E <= 63")
    elif effect.leaves is not None and effect.leaves <= VISIBLE:
        told.append(f"hard to tell from {case.rival}: D <= 63")
    return "; ".join(told)


def _several(case: Judged) -> str:
    assert case.said is not None
    missing, false = sorted(case.names - set(case.said.names)), sorted(case.false_names)
    told = [f"missing {', '.join(missing)}"] if missing else []
    told += [f"false {', '.join(false)}"] if false else []
    return "; ".join(told) or f"verdict {case.said.verdict}"


def _number(case: Judged, rival: str) -> str:
    leaves = case.truth[0].leaves
    return f"{leaves:.0f} ({rival})" if leaves is not None else rival


def truth_words(case: Judged) -> str:
    """The truth in words, with E and D where they are known."""
    parts = []
    for effect in case.truth:
        size = [
            f"{word} {value:.0f}" for word, value in (("E", effect.energy), ("D", effect.leaves)) if value is not None
        ]
        parts.append(effect.name.removesuffix("@") + (f" ({', '.join(size)})" if size else ""))
    return ", ".join(parts) or ("no effect" if case.kind else "not known: its seal was broken")


def said_words(case: Judged) -> str:
    """What was said, in words."""
    if case.said is None:
        return "failed"
    causes = [f"{cause.name} ({cause.probability:.2f})" for cause in case.said.causes]
    return f"{case.said.verdict}: {', '.join(causes)}" if causes else case.said.verdict
