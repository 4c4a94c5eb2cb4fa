"""The verdict of a diagnosis in sentences: the causes, the gap, what to do, and what could not be tested."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from gtpin.data.names import is_own
from gtpin.diagnosis.priors import CLASS_SHARE, PRIORS
from gtpin.diagnosis.result import Cause, Considered, Correlate, Diagnosis, Findings, Gap, InstrumentGap
from gtpin.diagnosis.trials import kind
from gtpin.report.calibration_text import overruled, scatters, visits_over_declared
from gtpin.report.page import Lead
from gtpin.report.phrases import (
    PROBABLE,
    ROUGH,
    badge,
    cause_lines,
    doubt_words,
    named,
    others,
    overlap,
    parameter,
    reason_words,
    remedy,
    rough,
    sentence,
    sure_and_doubtful,
)
from gtpin.report.words import coordinate_words, joined, length, percent, quantity, site_words

TONES = {"none": "good", "explained": "accent", "ambiguous": "warn", "unknown": "mystery"}
"""Colour of the badge, by verdict."""
CHANCE = 0.01
"""Smallest p-value at which noise alone explains the residuals."""
PLACES = 2
"""Most places of an unknown error that its headline names."""
NEARLY = 0.8
"""Share of the squares that the best mechanism explains from which another one is named with it."""


def verdict(d: Diagnosis) -> Lead:
    """The verdict of a diagnosis in words: a badge with its colour, a headline of at most two lines, and advice."""
    by_verdict = {"none": _none, "explained": _explained, "ambiguous": _ambiguous, "unknown": _unknown}
    headline, advice = by_verdict[d.verdict](d)
    if small := joined([f"{site_words(one.site)} ({length(one.rms)})" for one in d.also]):
        advice = [*advice, f"Small and undecided, without influence on the verdict: {small}."]
    return Lead(
        f"Diagnosis of {d.model.robot.name} · {len(d.dataset)} measurements",
        "\n".join(headline),
        [words for words in (*advice, *_on_noise(d), *questions(d), untested(d)) if words],
        badge=badge(d) or ("too few poses" if too_few(d) else "geometry alone"),
        tone="warn" if may_hide(d) or scattered(d) or too_few(d) else TONES[d.verdict],
    )


def too_few(d: Diagnosis) -> str:
    """What shows that without a cause the poses are too few: at poses that it was not fitted to, the calibrated geometry is no
    better than the nominal one, or much worse than noise, as the fitted poses are not; empty where nothing does."""
    if d.verdict != "none" or d.gap.by_instrument or d.gap.before <= PRIORS.silent * d.gap.floor:
        return ""
    if worse_than_nominal(d):
        return "the calibrated geometry is no better than the nominal one"
    declared, size = d.noise_source == "declared" and d.noise_ratio == 1.0, gap_words(d.gap)
    return f"the calibrated geometry leaves {size.before}, noise {size.floor}" if declared else ""


def worse_than_nominal(d: Diagnosis) -> bool:
    """Whether the calibrated geometry is no better than the nominal one at poses that it was not fitted to."""
    return d.gap.before > next((one.before for one in d.baseline.by_instrument if one.unit == "m"), np.inf)


def beyond_chance(d: Diagnosis) -> str:
    """With what probability noise leaves as much as there is, where it is small, but no cause is found; else empty."""
    p = d.unexplained.p_value
    return f"{100.0 * max(p, 1e-4):.2g} %" if d.verdict == "none" and p < CHANCE else ""


def scattered(d: Diagnosis) -> bool:
    """Whether without a cause the machine itself does not repeat: visits of a pose differ by much more than the declared noise
    of the instrument. It may be loose."""
    noise = d.baseline.noise
    known = d.noise_source == "declared" and not d.gap.by_instrument
    drives = known and d.gap.floor > PRIORS.understated * np.sqrt(3.0) * noise.position_sigma
    return d.verdict == "none" and (drives or d.noise_ratio > PRIORS.understated)


def _on_noise(d: Diagnosis) -> Iterator[str]:
    """That visits agree with the declared noise after all, where they did not before the causes; and, where no sigma is
    declared, that the noise is that of repeated visits."""
    declared, noise = d.noise_source == "declared" and d.noise_ratio == 1.0, d.baseline.noise
    if d.causes and declared and visits_over_declared(d.baseline) > 1.0:
        yield "With the causes, repeated visits agree with the declared noise."
    if noise.source == "repeats" and noise.estimated.all() and not any(overruled(d.baseline)):
        yield (
            "No sigma is declared: the noise is that of repeated visits, and the scatter of the machine is in it. "
            "Declare the sigma in dataset.toml for what is expected of the machine alone."
        )


def untested(found: Findings) -> str:
    """A sentence on effects that could not be tested; empty where there is none."""
    if not (lacking := [c for c in found.candidates if not c.testable]):
        return ""
    missing = (c.reason.covariate for c in lacking if c.reason and c.reason.kind == "missing")
    names = ", ".join(dict.fromkeys(name.rstrip("0123456789") for name in missing))  # approach1, approach2: approach
    return (
        f"{len(lacking)} of {len(found.candidates)} candidates can't be tested with these data"
        f"{f' (not recorded: {names})' if names else ''}: a cause among them is not detected. The section on what could not be "
        "tested has the reasons."
    )


def _none(d: Diagnosis) -> tuple[list[str], list[str]]:
    size, supposed, fits = gap_words(d.gap), d.noise_source == "residuals", d.baseline.by_instrument
    if shown := too_few(d):
        return [f"These poses are too few: at left-out poses {shown}."], []
    hidden, rare = may_hide(d), beyond_chance(d)
    if rare:
        hidden = [
            f"With noise alone, residuals would be as large in {rare} of all datasets: too often for the verdict unknown. "
            "Visit some poses several times: noise differs between the visits, and an error repeats.",
            *hidden,
        ]
    if d.noise_ratio > PRIORS.understated:
        often = f"{d.noise_ratio:.2g} times the declared noise"
        headline = f"No cause is detected: {'most of ' if rare else ''}what is left is scatter between visits, {often}."
        wrong = "The declared sigma is wrong, or something changes between the visits: a loose part, or the instrument."
        return [headline], [wrong, *hidden]
    if may_hide(d) or scattered(d):
        why = "whose causes could not be tested" if may_hide(d) else "which no effect of a recorded column explains"
        headline = f"No cause is detected. Much of the noise is scatter between repeated visits, {why}."
        return [headline], [scatters(d.baseline), *hidden]
    if rare:
        headline = f"No cause beside the geometry is detected: noise alone would leave as much in {rare} of all cases."
        return [headline], hidden
    if d.baseline.unobservable and not any(one.kind == "tracker" for one in fits):
        read, noise = joined([one.name for one in fits]), ", if this is noise" if supposed else ""
        use = (
            f"The calibrated geometry explains the readings of {read}{noise}. Positions can still be wrong: gtpin calibrate "
            "lists what these data do not determine."
        )
    elif d.model.doubt:
        use = ""
    elif supposed:
        use = (
            "If this is the noise of the instrument and of the machine, no compensation beside the geometry is needed."
        )
    else:
        use = (
            "At payloads, temperatures and speeds as in these data, the calibrated geometry is enough: no other compensation "
            "is needed."
        )
    if not supposed:
        return ["No cause beside the geometry: only noise is left."], [use]
    why, declare = "no sigma was declared", "declare the instrument's sigma, or "
    if any(overruled(d.baseline)):
        why, declare = "these data show less than the declared sigma, which was not used", ""
    assumed = (
        f"It is assumed that {size.after} are noise: {why}, and too few poses were visited repeatedly. An error of up to this "
        f"size that differs between poses is not detected. To test it, {declare}visit ten poses again."
    )
    return [f"No cause beside the geometry: the {size.after} that it leaves can be noise."], [use, assumed]


def _explained(d: Diagnosis) -> tuple[list[str], list[str]]:
    return cause_lines(d), [*_remedies(d, d.causes), *on_the_gap(d)]


def _ambiguous(d: Diagnosis) -> tuple[list[str], list[str]]:
    lacking, (sure, open_) = not_recorded(d), sure_and_doubtful(d.causes)
    if not lacking and any(len(cause.members) > 1 for cause in open_):
        what = "can't decide between the members of a class"
        if all(cause.probability >= PROBABLE for cause in open_):
            what = "don't exclude the less probable members of a class"
        lacking = [f"These data {what}."]
    elif not lacking:
        lacking = ["These data do not make this cause certain: another one could leave the same errors."]
    return cause_lines(d), [*_remedies(d, sure), *on_the_gap(d), *lacking]


def questions(d: Diagnosis) -> list[str]:
    """Warnings about parameters outside their expected ranges, and what to check."""
    found = []
    for q in d.questions:
        size, who = " ".join(parameter(q.parameter, q.value, q.unit, q.sigma)), named(d.effect(q.effect), q.site)
        words = f"{who} would have {size}, which is not possible: {q.why}. It is not named as a cause."
        if q.believed:
            words = f"{who} has {size}, which is unusual: {q.why}."
        found.append(f"{words} Check unit and sign of the columns that it depends on.")
    return found


def anywhere(d: Diagnosis) -> list[str]:
    """The sites, in words, of which none explains the gap clearly better: more than a headline names; else empty."""
    shares = {} if d.causes else d.where.site
    least = NEARLY * max(shares.values(), default=0.0)
    order = sorted(shares, key=lambda site: -shares[site])
    alike = [site_words(site) for site in order if shares[site] >= least > 0.0]
    return alike if len(alike) > PLACES else []


def _moves(near: Sequence[Correlate], s: str) -> str:
    """What an unknown error displaces, and on what it depends, of each of some that are about equally probable; ``s`` ends the
    verbs."""
    over: dict[tuple[str, str], list[str]] = {}
    for one in near:
        verb, what = "displace", site_words(one.site)
        if one.site == "frame":
            what = "the instrument or the machine's base"
            if one.motion == "stretch":
                verb, what = "change", "the scale of the instrument or the whole machine"
        over.setdefault((verb, what), []).append(coordinate_words(one.coordinates))
    alike: dict[tuple[str, str], list[str]] = {}
    for (verb, what), coordinates in over.items():
        alike.setdefault((verb, " or ".join(coordinates)), []).append(what)
    return ", or ".join(f"{verb}{s} {' or '.join(every)} depending on {them}" for (verb, them), every in alike.items())


def _unknown(d: Diagnosis) -> tuple[list[str], list[str]]:
    open_, left = bool(_possible(d)), _of_each(d.gap, _left)
    if not any(_left(one) for one in d.gap.by_instrument or (d.gap,)):
        left = "smaller than the noise"
    what = "an effect that these data can't identify" if open_ else "an effect that is not in the catalogue"
    if any(doubt.reason == "excess" for doubt in d.doubts):
        headline = f"Scatter of {left} beyond the declared noise: these data don't show whether it is noise."
        look = "Visit poses again: noise differs between the visits to a pose, and an error repeats."
    elif part := [doubt.site for doubt in d.doubts if doubt.reason == "part"]:
        headline = f"Unknown, {left}: {what} in the readings of {part[0]}."
        look = "Its errors exceed the noise. Inspect this part of the instrument, and what it alone measures of the machine."
    elif d.unexplained.correlates:
        near = [one for one in d.unexplained.correlates if one.odds >= CLASS_SHARE][:PLACES]
        headline = f"Unknown, {left}: {what} {_moves(near, 's')}."
        look = f"Look for what could {_moves(near, '')}; the plots show how. Don't compensate it as one of the known effects."
        if alike := anywhere(d):
            headline = f"Unknown, {left}: {what}. These data do not show where it acts."
            look = (
                f"Motions of {joined(alike, 'or')} explain it about equally well, {_moves(near[:1], 's').partition(' ')[2]} "
                "best. Don't compensate it as one of the known effects."
            )
    else:
        headline = f"Unknown, {left}: {what}."
        look = (
            "It correlates with no single recorded coordinate; the maps show where it is. Don't compensate it as one of the "
            "known effects."
        )
    moved = "The unknown error can change the parameters of the geometry by more than their sigmas."
    advice = [nearest(d), look, *unused_columns(d), *_jumping(d), *doubt_words(d.doubts), *could_be(d), moved]
    lines = cause_lines(d, most=1)
    if lines:
        headline = f"Also {headline[:1].lower()}{headline[1:]}"
        advice += [*_remedies(d, sure_and_doubtful(d.causes)[0]), *on_the_gap(d)]
    else:
        advice.append("The corrected model has the calibrated geometry alone: no known effect is probable enough.")
    return [*lines, headline], advice


def unused_columns(d: Diagnosis) -> list[str]:
    """That columns which no effect looks at could drive the unknown error, and how to test one; empty where there is none."""
    tested = {driver.column for driver in d.dataset.drivers}
    columns = [name for name in d.dataset.covariates if is_own(name) and name not in tested]
    columns = [name for name in columns if np.ptp(np.asarray(d.dataset.covariates[name], dtype=float)) > 0.0]
    if not columns:
        return []
    place = d.unexplained.correlates[0].site if d.unexplained.correlates else "SITE"
    return [
        f"No effect looks at {joined(columns, 'or')}. If it may act on the machine, declare it in dataset.toml, and diagnose "
        f'again: [[driver]] with column = "{columns[0]}", site = "{place}", motion (x, y, z, rx, ry, rz or q) and size.'
    ]


def _jumping(d: Diagnosis) -> list[str]:
    """That the unknown error jumps in time, where it does, and that sessions would show whether a zero or the frame moved."""
    if not d.unexplained.jumps:
        return []
    at, site = joined([quantity(t, "s") for t in d.unexplained.jumps]), d.unexplained.correlates[0].site
    return [
        f"The error at {site_words(site)} jumps at {at}: if the machine was homed there, restarted or measured from "
        "another place, add a column session with a name for each part, and diagnose again."
    ]


def _remedies(d: Diagnosis, causes: Sequence[Cause]) -> list[str]:
    """What to do about each cause; of several causes, each sentence begins with the site."""
    found = [(c.site, ROUGH.remedy if rough(c) else remedy(d.effect(c.effect), d.model.robot)) for c in causes]
    if len(d.causes) == 1 == len(found):
        return [found[0][1]]
    return [sentence(f"{site_words(site)}: {words[:1].lower()}{words[1:].rstrip('.')}") for site, words in found]


def on_the_gap(d: Diagnosis) -> list[str]:
    """What limits the meaning of the explained fraction."""
    gap, size = d.gap, gap_words(d.gap)
    if gap.explained_fraction is None:
        return ["The explained fraction of the gap can't be estimated from these data."]
    if gap.before <= gap.floor:
        return [
            f"The gap, {size.before}, is below the assumed noise of these data, {size.floor}: its explained fraction can't be "
            "estimated well."
        ]
    return list(filter(None, (beyond_noise(gap), overlap(d))))


@dataclass(frozen=True)
class GapWords:
    """The quantity whose errors are given, and these errors on left-out data: without and with causes, and of noise alone."""

    what: str
    before: str
    after: str
    floor: str


def gap_words(gap: Gap) -> GapWords:
    """The gap in words."""
    what = "position error"
    if gap.by_instrument:
        what = f"error of the readings of {joined([one.name for one in gap.by_instrument])}"
    return GapWords(what, *(_of_each(gap, attrgetter(key)) for key in ("before", "after", "floor")))


def _of_each(gap: Gap, size: Callable[[Gap | InstrumentGap], float]) -> str:
    """An error of the positions; or of each instrument's readings, with the instrument's name if there are several."""
    if not gap.by_instrument:
        return length(size(gap))
    sizes = [(one.name, quantity(size(one), one.unit)) for one in gap.by_instrument]
    return joined([f"{words} ({name})" if len(sizes) > 1 else words for name, words in sizes])


def _left(one: Gap | InstrumentGap) -> float:
    """What is left beyond the noise floor with the causes."""
    return float(np.sqrt(max(one.after**2 - one.floor**2, 0.0)))


def beyond_noise(gap: Gap) -> str:
    """What the causes explain, in lengths, where the gap beyond noise is smaller than noise; else empty.

    A fraction of such a gap says little. The gap beyond noise is g = sqrt(before^2 - floor^2); with a fraction f of its power
    explained, the error that the causes explain is g sqrt(f), as beside each cause.
    """
    power = gap.before**2 - gap.floor**2
    if gap.by_instrument or gap.interval is None or not 0.0 < power < gap.floor**2:
        return ""
    size = float(np.sqrt(power))
    low, high = (length(size * float(np.sqrt(np.clip(share, 0.0, 1.0)))) for share in gap.interval)
    return f"Beyond noise the gap is {length(size)}; the causes explain {low} to {high} of it (95 %)."


def may_hide(d: Diagnosis) -> list[str]:
    """A hint on effects that vary between visits and could not be tested because a covariate is missing; empty unless the
    verdict is ``none`` and visits scatter."""
    if d.verdict != "none" or not scatters(d.baseline):
        return []
    unrecorded = [c for c in d.candidates if c.reason is not None and c.reason.kind in ("missing", "unusable")]
    lacking = [c for c in unrecorded if d.effect(c.effect).between_visits]
    if not lacking:
        return []
    effects = joined(list(dict.fromkeys(d.effect(c.effect).title for c in lacking)))
    names = dict.fromkeys(name for c in lacking for name in d.effect(c.effect).covariates(d.model.robot, c.site))
    what = f"record {joined(list(names))}, or fill in what is known, and diagnose again"
    return [f"{effects} could not be tested: {what}."]


def not_recorded(d: Diagnosis) -> list[str]:
    """Hints on members of classes that can't be ruled out because a covariate is missing, and on how to test them."""
    members = (m for cause in sure_and_doubtful(d.causes)[1] for m in cause.members)
    lacking = dict.fromkeys((m.effect, m.site) for m in members if not m.recorded)
    found = []
    for reason, rows in _by_reason(d, lacking).items():
        speeds = any(c.reason is not None and kind(c.reason.covariate) == "speed" for c in rows)
        record = f"record it, or fill in what is known of it{' (0 if the machine stood still)' if speeds else ''}"
        found.append(f"{_names(d, rows)} can't be ruled out, because {reason}: {record}, and diagnose again.")
    return found


def nearest(d: Diagnosis) -> str:
    """How much the mechanisms explain that come nearest to what is unknown, as a root mean square; empty where there is none.

    What could be in the place of one of them is named with it: the next of a cause's class; of what is no cause, the mechanism
    that by itself explains nearly as much.
    """
    best, before, leaders = d.unexplained.best_known, d.gap.before, d.unexplained.leaders
    if best is None and not leaders:
        return ""
    power = before**2 - (leaders[0].left if best is None else best.left) ** 2
    of = percent(max(power, 0.0) / before**2) + " of the squared error"
    if not d.gap.by_instrument:
        of = f"{length(float(np.sqrt(max(power, 0.0))))} of {length(before)}"
    if best is None:
        first = named(d.effect(leaders[0].effect), leaders[0].site)
        most = f": {first} explains {of} at left-out poses, more than any other" if power > 0.0 else ""
        return f"No known mechanism comes near{most}."
    instead = {(c.effect, c.site): (m.effect, m.site) for c in d.causes for m in others(c)[:1]}
    near = [(one.effect, one.site) for one in leaders if before**2 - one.left**2 > NEARLY * power]
    near = [place for place in near if place not in best.effects]
    if len(best.effects) == 1 and near and not d.causes:
        instead[best.effects[0]] = near[0]
    names = [named(d.effect(effect), site) for effect, site in best.effects]
    for k, place in enumerate(best.effects):
        if place in instead:
            second = named(d.effect(instead[place][0]), instead[place][1])
            names[k] += f" (or {second})" if len(names) > 1 else f", or {second}"
    return f"The best that is known explains {of} at left-out poses: {joined(names)}."


def _possible(d: Diagnosis) -> list[tuple[str, str]]:
    """What could be the unknown cause, without a first leader that explains next to nothing of what is left."""
    reasons, left = {(c.effect, c.site): c.reason for c in d.candidates}, d.gap.after**2
    least = PRIORS.weak * (left - d.gap.floor**2)
    weak = [(one.effect, one.site) for one in d.unexplained.leaders[:1] if left - one.left**2 < least]
    return [place for place in d.unexplained.could_be if place not in weak or reasons[place] is not None]


def could_be(d: Diagnosis) -> list[str]:
    """Five effects that could be the unknown cause: likely ones, and those that can't be tested, with the reason."""
    places = _possible(d)[:5]
    likely = [c for c in d.candidates if c.reason is None and (c.effect, c.site) in places]
    lines = []
    if likely:
        alike = "these data can't distinguish it from an effect that gtpin does not know"
        lines.append(f"It could be {_names(d, likely)}; {alike}.")
    for reason, rows in _by_reason(d, places).items():
        untested = "" if all(c.testable for c in rows) else ", which these data can't test"
        lines.append(f"It could be {_names(d, rows)}{untested}: {reason}.")
    return lines


def _by_reason(d: Diagnosis, effects: Iterable[tuple[str, str]]) -> dict[str, list[Considered]]:
    """Effects at their sites, by the reason why they are untestable."""
    rows = {(c.effect, c.site): c for c in d.candidates if c.reason}
    found: dict[str, list[Considered]] = {}
    for effect in effects:
        if effect in rows:
            found.setdefault(reason_words(rows[effect].reason, rows[effect].site), []).append(rows[effect])
    return found


def _names(d: Diagnosis, rows: Iterable[Considered]) -> str:
    return joined([named(d.effect(c.effect), c.site) for c in rows], "or")
