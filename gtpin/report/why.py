"""What stands for and against one effect at a site, in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from gtpin.diagnosis.priors import SURE
from gtpin.diagnosis.result import Diagnosis, LeftOutErrors, Rival, Why
from gtpin.output.results import fields
from gtpin.output.shown import present
from gtpin.report.page import Block, Table
from gtpin.report.phrases import SHOWN, named, parameter, reason_words, value
from gtpin.report.words import chance, coordinate_words, joined, length, site_words, whole

SAME = 0.9
"""Share of a rival's gain from which an effect explains the same. Assumed."""


def why_json(d: Diagnosis, w: Why) -> dict[str, Any]:
    """The entry ``why`` of ``diagnosis.json``."""
    left, steps = w.left_out, d.next_experiment
    return {
        **fields(w, "effect", "site", "standing"),
        "words": why_words(d, w),
        "testable": w.standing != "untestable",
        "reason": reason_words(w.reason, w.site),
        **fields(w, "probability", "log_evidence", "odds", "beside", "needed"),
        "smooth": [{"site": site, "over": list(over)} for site, over in w.smooth],
        **fields(w, "beside_smooth", "in_place"),
        "rivals": [one._asdict() | {"effect": one.effect or None, "over": list(one.over)} for one in w.rivals],
        "parameters": {name: fields(e, "value", "sigma", "unit") for name, e in w.parameters.items()},
        "implausible": [q.parameter for q in w.questions],
        "left_out": left and left._asdict(),
        "position_rms_after": left.alone if left and left.unit else None,
        "next_experiment": next((k for k, e in enumerate(steps) if e is w.experiment), None),
    }


def why_content(d: Diagnosis) -> Iterator[Block]:
    """Where the effect that was asked for stands, the most important reason, and a table of what is for and against it."""
    if (w := d.why) is None:
        return
    if w.standing == "untestable":
        yield from (why_words(d, w), *([] if w.experiment is None else [present(w.experiment).short()]))
        return
    yield why_words(d, w)
    smooth, left = joined([_smooth(*term) for term in w.smooth]), w.left_out
    rows = [["gain in log evidence, alone", f"{_nats(w.log_evidence)} nats; {_nats(w.odds)} are needed"]]
    if d.causes:
        rows += [["beside the other causes", f"{_nats(w.beside)} nats; {_nats(w.needed)} are needed"]]
    if smooth:
        rows += [["beside smooth terms too", f"{_nats(w.beside_smooth)} nats ({smooth})"]]
    if w.rivals:
        rows += [["in the place of its rivals", f"{_nats(w.in_place)} nats, {chance(w.probability)}"]]
    for one in w.rivals:
        over = f" (of {coordinate_words(','.join(one.over))})" if one.over else ""
        what = f"{one.effect or 'a smooth function'} at {site_words(one.site)}"
        rows += [[f"  {what}", f"{_nats(one.log_evidence)} nats, {chance(one.probability)}{over}"]]
    if left:
        alone, without = (
            f"{_error(a, left.unit)} without it, {_error(b, left.unit)} with it"
            for a, b in ((left.geometry, left.alone), (left.without, left.with_it))
        )
        rows += [["error at left-out poses, geometry", alone]]
        rows += [["error at left-out poses, other causes", without]] if d.causes else []
    asked = {q.parameter: f", {'unusual' if q.believed else 'not possible'}: {q.why}" for q in w.questions}
    sizes = [f"{value(*one)}{asked.get(one[0], '')}" for one in w.parameters.items()]
    rows += [["alone, it would have", "\n".join(sizes[:SHOWN])]]
    if w.experiment is not None:
        rows += [["poses that would tell", present(w.experiment).short()]]
    yield Table((named(d.effect(w.effect), w.site), ""), rows, wide=(1,))


def why_words(d: Diagnosis, w: Why) -> str:
    """Where it stands, and the most important reason, as a sentence."""
    return f"{w.effect} at {site_words(w.site)}: {_standing(d, w)}."


def _standing(d: Diagnosis, w: Why) -> str:
    left = w.left_out or LeftOutErrors("m", 0.0, 0.0, 0.0, 0.0)
    size, less = _error(left.with_it, left.unit), _error(left.without, left.unit)
    enough, first = f"and {_nats(w.needed)} are needed", w.rivals[0] if w.rivals else Rival("", "", (), 0.0, 0.0)
    gains = f"gain {_nats(first.log_evidence)} against {_nats(w.in_place)} nats"
    more = f"{_rival(first)} explains {'the same' if w.in_place >= SAME * first.log_evidence else 'more'} ({gains})"
    match w.standing:
        case "untestable":
            said = f"not testable, because {reason_words(w.reason, w.site)}"
            return f"{said}; in the class of a cause ({chance(w.probability)})" if w.probability else said
        case "named":
            said = f"named with a probability of {chance(w.probability)}"
            if w.probability < SURE and first.effect:
                said += f"; {_rival(first)} could be in its place ({chance(first.probability)})"
            return f"{said}; without it the error at left-out poses is {less} instead of {size}"
        case "also":
            return f"small and undecided, with a probability of {chance(w.probability)}"
        case "impossible":
            q = next(q for q in d.questions if (q.effect, q.site) == (w.effect, w.site))
            size = " ".join(parameter(q.parameter, q.value, q.unit, q.sigma))
            return f"not named, because it would have {size}, which is not possible: {q.why}"
        case "description":
            return "no cause, because it can follow any smooth function of its coordinates"
        case "weak":
            return f"not named, because alone it gains {_nats(w.log_evidence)} nats, and {_nats(w.odds)} are needed"
        case "class":
            return f"not named, but possible ({chance(w.probability)}): {more}"
        case "taken":
            return f"not named, because {more}; beside the named causes it gains {_nats(w.beside)} nats, {enough}"
        case "beside":
            gain = f"beside the named causes it gains {_nats(w.beside)} nats, {enough}"
            return f"not named, because {gain} (alone it gains {_nats(w.log_evidence)})"
        case "chance":
            return "not named, because its periods are not significant against the scatter of the drive"
        case "smooth":
            what, s = joined([_smooth(*term) for term in w.smooth]), "s" if len(w.smooth) == 1 else ""
            gain = f"gain {_nats(w.beside)} nats without and {_nats(w.beside_smooth)} with, {enough}"
            return f"not named, because {what} take{s} its place ({gain})"
        case "left_out":
            return f"not named, because the error at left-out poses is no smaller with it: {size} instead of {less}"
        case "part":
            with_it = f"with it the error at left-out poses is {size} instead of {less}"
            return f"not named, because it could be a part of what is unknown; {with_it}"
    return f"not named, because {more}"


def _rival(one: Rival) -> str:
    return f"{one.effect} at {site_words(one.site)}" if one.effect else _smooth(one.site, one.over)


def _smooth(site: str, over: tuple[str, ...]) -> str:
    return f"a smooth function of {coordinate_words(','.join(over))} at {site_words(site)}"


def _nats(gain: float) -> str:
    return whole(f"{gain:.0f}" if abs(gain) >= 10.0 else f"{gain:.1f}")


def _error(size: float, unit: str) -> str:
    return length(size) if unit else f"{size:.3g} times the noise"
