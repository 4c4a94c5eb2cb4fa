"""A check against an earlier model in sentences: the changes, what to do, and changes that the poses can't show."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from gtpin.diagnosis.inference.findings import Cause, Smallest
from gtpin.diagnosis.result import HealthCheck
from gtpin.report.doubts import doubt_words
from gtpin.report.gap_words import gap_words
from gtpin.report.phrases import clause, remedy, sentence
from gtpin.report.reasons import reason_words
from gtpin.report.sure_causes import sure_and_doubtful
from gtpin.report.words import chance, counted, joined, number_word, percent, quantity, site_words


def change(check: HealthCheck, effect: str, site: str) -> str:
    """A change as a clause."""
    if changed := check.effect(effect).changed:
        return changed.replace("{site}", site_words(site))
    return clause(check.effect(effect), site, check.model.robot)


def headline(check: HealthCheck) -> str:
    """The changes, in one or two sentences."""
    if check.verdict == "none":
        return "Nothing has changed since the model was identified, as far as these poses show."
    sure, doubtful = sure_and_doubtful(check.causes)
    known = sentence(joined([change(check, c.effect, c.site) for c in sure])) if sure else ""
    if check.verdict == "unknown":
        also = f" Also certain: {known}" if sure else ""
        return f"Something has changed that no known effect explains.{also}"
    if doubtful:
        either = " ".join(sentence(_either(check, c)) for c in doubtful)
        return f"Changed since the model was identified: {either}{f' Certain: {known}' if sure else ''}"
    several = f"{number_word(len(sure))} changes since the model was identified: " if len(sure) > 1 else ""
    return sentence(several + joined([change(check, c.effect, c.site) for c in sure]))


def _either(check: HealthCheck, cause: Cause) -> str:
    named = [f"{change(check, m.effect, m.site)} ({chance(m.probability)})" for m in cause.members]
    if len(named) == 1:
        return f"probably {named[0]}, but these poses don't decide it"
    more = f", or one of {len(named) - 3} others" if len(named) > 4 else ", or another" if len(named) == 4 else ""
    return f"{joined(named[:3], 'or')}{more}: these poses can't tell"


def error_of(check: HealthCheck) -> str:
    """Which error of a model a check states: that of positions, or that of other instruments' readings."""
    return "Error of readings" if check.gap.by_instrument else "Position error"


def advice(check: HealthCheck) -> list[str]:
    """What to do, and what limits the check."""
    size = gap_words(check.gap)
    after = f"with the changes: {size.after}; " if check.causes else ""
    found = [
        f"{error_of(check)} of the earlier model at {counted(check.poses, 'pose')}, RMS: {size.before}; "
        f"{after}{floor_words(check)}: {size.floor}."
    ]
    left = check.unexplained_before
    if not left.none:
        parts = [quantity(size, unit) for size, unit in ((left.position, "m"), (left.orientation, "rad")) if size]
        found.append(
            f"The earlier model did not explain its own data: {joined(parts)} per axis were left between poses, and count as a "
            f"part of its uncertainty. Changes that are smaller can't be told. {smallest_words(check)}"
        )
    for cause in check.causes:
        found.append(
            f"{cause.effect} at {site_words(cause.site)}: {remedy(check.effect(cause.effect), check.model.robot)}"
        )
    if check.verdict == "unknown":
        found += [*doubt_words(check.doubts), "Calibrate again with enough poses, and diagnose these."]
    if check.set_aside:
        found.append(f"Set aside as gross errors: {joined(list(check.set_aside))}. Measure them again.")
    if check.assumed and any(_thermal(check, m.effect, m.site) for c in check.causes for m in c.members):
        found.append(
            f"{joined(list(check.assumed))} could have changed: record it at the model's poses and at the check's."
        )
    if check.free_frame:
        found.append(
            "The instrument stood anywhere: changes that look like another place of the instrument are hidden."
        )
    return found


def floor_words(check: HealthCheck) -> str:
    """What the noise floor of a check is called: it is noise only where that is known."""
    return "noise alone" if check.noise_known else "left of the earlier model's own fit"


def smallest_words(check: HealthCheck) -> str:
    """What would make smaller changes visible."""
    if check.unexplained_before.noise_known:
        return "gtpin diagnose at many poses finds what the earlier model lacks."
    return (
        "Its noise is neither declared nor shown by repeated visits: declare it, or repeat visits, and calibrate again."
    )


def _thermal(check: HealthCheck, effect: str, site: str) -> bool:
    return bool(set(check.effect(effect).covariates(check.model.robot, site)) & set(check.assumed))


def power_words(check: HealthCheck) -> str:
    """The smallest of the most common changes that such poses show with the check's power."""
    first = dict.fromkeys(s.effect for s in check.smallest if check.effect(s.effect).first_checked)
    parts = [
        f"{effect.replace('_', ' ')} {_largest([s for s in check.smallest if s.effect == effect])}" for effect in first
    ]
    if not parts:
        return "These poses show none of the changes that crashes and wear cause first."
    return f"Changes that such poses show in {percent(check.power)} of cases, from: {joined(parts)} at the worst site."


def _largest(rows: Sequence[Smallest]) -> str:
    if any(row.value is None for row in rows):
        return "of no size"
    worst = max(rows, key=lambda row: row.value or 0.0)
    return quantity(worst.value or 0.0, worst.unit)


def unseen(check: HealthCheck) -> list[str]:
    """Changes that these poses can't show, by reason."""
    by_reason: dict[str, list[str]] = {}
    for c in check.candidates:
        if not c.testable:
            # Reasons name the column of each site: without its number, one sentence serves all sites of an effect.
            reason = reason_words(c.reason, "the site").rstrip("0123456789")
            by_reason.setdefault(reason, []).append(c.effect)
    return [f"{joined(list(_once(effects)))}: {reason}." for reason, effects in by_reason.items()]


def _once(words: Iterable[str]) -> Iterable[str]:
    return dict.fromkeys(words)
