"""Reasons why a diagnosis is not correct, derived from the truth of the case."""

from __future__ import annotations

from gtpin.bench.blind.judged import VISIBLE, Judged


def failure(case: Judged) -> str | None:
    """The reason why a case counts as a failure; None if the diagnosis is correct.

    Correct is: for one or more listed effects, exactly these are named, with their sites; without effects, the verdict is
    `none`; for an unlisted effect, `unknown` and no cause named; for listed and unlisted effects together, `unknown` and no
    false cause named. In rough and weak cases the class must contain the truth, in weak ones only if a cause is named.
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
        return "the class does not contain the truth" if wrong else None
    if case.strict:
        return None
    return _single(case) if len(case.truth) == 1 else _several(case)


def _unlisted(case: Judged) -> str | None:
    assert case.said is not None
    reasons = [f"{name} named instead" for name in case.false_names]
    if case.said.verdict != "unknown":
        reasons.append(
            f"not recognised as unknown; known effects leave {_energy(case, case.rival)}"
            if case.rival
            else "not recognised"
        )
    return "; ".join(reasons) or None


def _single(case: Judged) -> str:
    """The reason why the diagnosis did not name a single effect with its site and nothing else."""
    assert case.said is not None
    effect, statement = case.single, case.said
    if not case.testable:
        return "its covariate is missing or does not vary"
    reasons = []
    if statement.verdict == "none":
        reasons.append("not detected")
    for name in case.false_names:
        place = "named in addition" if effect.name in statement.names else "named instead"
        left = case.left.get(name)
        energy = "" if left is None else f", and leaves {left:.0f} of it"
        reasons.append(f"{name} {place}{energy}")
    if statement.verdict == "unknown":
        own = case.left.get(effect.name)
        reasons.append("called unknown" + ("" if own is None else f"; the textbook form leaves {own:.0f}"))
    if effect.name not in statement.names and effect.name in statement.members:
        reasons.append("in the class")
    if effect.energy is not None and effect.energy <= VISIBLE:
        reasons.append("weak: E <= 63")
    elif effect.leaves is not None and effect.leaves <= VISIBLE:
        reasons.append(f"hard to distinguish from {case.rival}: D <= 63")
    return "; ".join(reasons)


def _several(case: Judged) -> str:
    assert case.said is not None
    hidden = case.not_visible if case.instruments else frozenset()
    missing, false = case.names - set(case.said.names), sorted(case.false_names)
    reasons = [f"missing {', '.join(sorted(missing - hidden))}"] if missing - hidden else []
    reasons += [f"not visible (E <= 63) {', '.join(sorted(missing & hidden))}"] if missing & hidden else []
    reasons += [f"false {', '.join(false)}"] if false else []
    return "; ".join(reasons) or f"verdict {case.said.verdict}"


def _energy(case: Judged, alternative: str) -> str:
    leaves = case.truth[0].leaves
    return f"{leaves:.0f} ({alternative})" if leaves is not None else alternative


def truth_words(case: Judged) -> str:
    """The true effects as text, with E and D if known."""
    parts = []
    for effect in case.truth:
        size = [
            f"{word} {value:.0f}" for word, value in (("E", effect.energy), ("D", effect.leaves)) if value is not None
        ]
        parts.append(effect.name.removesuffix("@") + (f" ({', '.join(size)})" if size else ""))
    return ", ".join(parts) or ("no effect" if case.kind else "not known: its seal was broken")


def statement_words(case: Judged) -> str:
    """Verdict and named causes as text."""
    if case.said is None:
        return "failed"
    causes = [f"{cause.name} ({cause.probability:.2f})" for cause in case.said.causes]
    return f"{case.said.verdict}: {', '.join(causes)}" if causes else case.said.verdict
