"""Where the gap lies, what is left of it, the evidence of each candidate, and what could not be tested."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from gtpin.data.names import command_names
from gtpin.diagnosis.result import Findings
from gtpin.report.fit import FitPresentation
from gtpin.report.page import Bar, Bars, Block, Fold, Plots, Section, Table
from gtpin.report.phrases import named, reason_words
from gtpin.report.residual_plots import over_two
from gtpin.report.verdict import CHANCE
from gtpin.report.words import coordinate_words, counted, joined, percent, short, site_words, typeset, whole

LEAST = 0.01
"""Smallest share that has a bar."""
SHOWN = 12
"""Number of candidates with a bar; the others are in a table."""


def where_it_lies(r: FitPresentation) -> Section | None:
    """Shares by site, rod, axis, coordinate and region, as far as they exist."""
    if r.diagnosis is None:
        return None
    where = r.diagnosis.where
    groups = {
        "By rod: share of the gap": _bars(where.rod, percent),
        "By axis: share of the gap": _bars(where.axis, percent),
        "By site: log evidence": _bars({short(site_words(k)): v for k, v in where.site.items()}),
        "By coordinate: log evidence": _bars({short(coordinate_words(k)): v for k, v in where.covariate.items()}),
    }
    beside = [(title, bars) for title, bars in groups.items() if bars]
    if not beside or r.diagnosis.verdict == "none":
        return Section("where", "Where it lies", ["No cause is named: shares of the gap have no meaning."])
    content: list[Block] = [
        f"Computed before any cause is named. By {'rod, ' if where.rod else ''}axis and region: shares of the gap's mean "
        "square beyond noise. By site and by coordinate: the largest gain in log evidence of an effect or a smooth term, "
        "relative to the longest bar. Gains in log evidence are not proportional to shares of the gap.",
        Bars(beside),
    ]
    regions = {
        ", ".join(whole(f"{a} {low:.2f} to {high:.2f}") for a, low, high in zip("xyz", *box, strict=True)) + " m": share
        for box, share in where.region
    }
    if bars := _bars(regions, percent, 0.0)[:4]:
        content.append(Fold("By region of the workspace", [Bars([("", bars)])]))
    return Section("where", "Where it lies", content)


def _bars(shares: Mapping[str, float], words: Callable[[float], str] = lambda _: "", least: float = LEAST) -> list[Bar]:
    top = max(shares.values(), default=0.0)
    order = sorted(shares.items(), key=lambda pair: -pair[1])
    return [Bar(name, share / top, words(share)) for name, share in order if share >= least and share > 0.0]


def what_is_left(r: FitPresentation) -> Section | None:
    """What is left unexplained, and the coordinates with which it correlates, if it is more than noise."""
    if r.diagnosis is None:
        return None
    found = r.diagnosis.unexplained
    noise, p = found.p_value >= CHANCE, _rare(found.p_value)
    words = f"Nothing beyond noise: noise alone leaves as much with a probability of {p}."
    if not noise:
        words = (
            f"Of the chi-square beyond noise that geometry alone leaves, {percent(found.share)} is not explained. It is of all "
            "measured numbers at the fitted poses; the gap above is of positions at left-out poses. Noise alone would leave as "
            f"much with a probability of {p}."
        )
    content: list[Block] = [words]
    if found.correlates and (not noise or r.diagnosis.verdict == "unknown"):
        rows = [[site_words(o.site), coordinate_words(o.coordinates), _rare(o.p_value)] for o in found.correlates]
        content.append("Correlations of the residuals with smooth terms at every site:")
        content.append(Table(("site", "coordinates", "p-value under noise alone"), rows, (2,)))
        commands = found.correlates[0].coordinates.split(" ")[0].split(",")
        if len(commands) == 2 and {*commands} <= {*command_names(r.dataset.n_actuators)}:
            content.append(Plots([over_two(r.residuals, commands[0], commands[1], *r.components)]))
    return Section("left", "What is left", content)


def _rare(p_value: float) -> str:
    """A p-value as text; very small ones only as a bound."""
    return "less than 10⁻⁹" if p_value < 1e-9 else typeset(f"{p_value:.2g}")


def evidence(r: FitPresentation) -> Section | None:
    """The evidence of each candidate of a diagnosis."""
    if (d := r.diagnosis) is None:
        return None
    words = [
        "Gain in log evidence of geometry with one candidate over geometry alone: a gain of 5 is a Bayes factor of 150, one of "
        f"10 of 22000. {counted(sum(c.testable for c in d.candidates), 'candidate')} were tested."
    ]
    if d.verdict == "unknown":
        words.append(
            "A large gain alone does not prove a cause: smooth terms explain these data better than every effect, so that a "
            "candidate may only resemble the true cause."
        )
    return evidence_of(d, words)


def evidence_of(found: Findings, words: Sequence[Block]) -> Section:
    """Gain in log evidence of each single candidate, below ``words``: bars of the largest, and a table of the others."""
    causes = {(c.effect, c.site) for c in found.causes}
    tested = sorted((c for c in found.candidates if c.testable), key=lambda c: -c.log_evidence)
    top = max([c.log_evidence for c in tested], default=0.0)
    gains = [(named(found.effect(c.effect), c.site), whole(f"{c.log_evidence:.1f}")) for c in tested]
    bars = [
        Bar(name, max(c.log_evidence, 0.0) / top if top > 0.0 else 0.0, gain, (c.effect, c.site) in causes)
        for c, (name, gain) in zip(tested[:SHOWN], gains, strict=False)
    ]
    content: list[Block] = [*words, *([Bars([("", bars)])] if bars else [])]
    if rest := gains[SHOWN:]:
        content.append(Fold("The other candidates", [Table(("candidate", "gain in log evidence"), rest, (1,))]))
    return Section("evidence", "Evidence", content)


def what_could_not_be_tested(r: FitPresentation) -> Section | None:
    """Effects that could not be tested by a diagnosis."""
    return None if r.diagnosis is None else untestable_of(r.diagnosis)


def untestable_of(found: Findings) -> Section:
    """Effects that could not be tested, with the reason."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for c in found.candidates:
        if not c.testable:
            reasons.setdefault((c.effect, reason_words(c.reason, c.site)), []).append(site_words(c.site))
    rows = [[found.effect(effect).title, joined(sites), why] for (effect, why), sites in reasons.items()]
    content: list[Block] = ["Every effect of the catalogue could be tested."]
    if rows:
        content = [
            "These data have no information on the following effects, for the reason given. A cause among them can't be named.",
            Table(("effect", "at", "why not"), rows),
        ]
    return Section("untestable", "What could not be tested", content, "Not testable")
