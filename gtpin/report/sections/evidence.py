"""Where the gap lies, what is left of it, the evidence of each candidate, and what could not be tested."""

from __future__ import annotations

from collections.abc import Mapping

from gtpin.data.names import command_names
from gtpin.report.page import Bar, Bars, Block, Fold, Plots, Section, Table
from gtpin.report.phrases import named, reason_words
from gtpin.report.residual_plots import over_two
from gtpin.report.sections import Reported, section
from gtpin.report.words import coordinate_words, counted, joined, percent, short, site_words, typeset, whole

CHANCE = 0.01
"""Smallest p-value at which noise alone explains what is left."""
SHOWN = 12
"""Number of candidates with a bar; the others are in a table."""


@section(10)
def where_it_lies(r: Reported) -> Section | None:
    """Shares by site, rod, axis, coordinate and region, as far as they exist."""
    if r.diagnosis is None:
        return None
    where = r.diagnosis.where
    coordinates = {short(coordinate_words(k)): v for k, v in where.covariate.items()}
    groups = {
        "By site": {short(site_words(k)): v for k, v in where.site.items()},
        "By rod": where.rod,
        "By axis": where.axis,
        "By coordinate, the strongest correlation as 100 %": coordinates,
    }
    beside = [(title, bars) for title, shares in groups.items() if (bars := _bars(shares, 0.01))]
    if not beside or r.diagnosis.verdict == "none":
        return Section("where", "Where it lies", ["The residuals are noise: shares have no meaning."])
    content: list[Block] = [
        f"Computed before any cause is named. By {'rod, ' if where.rod else ''}axis and region: shares of the gap's mean "
        "square beyond noise. By site: shares of the largest gain in log evidence at each site, by an effect or a smooth term "
        "alone; common motions of several parts are left out. By covariate: the largest gain of a smooth term over it, "
        "relative to the best covariate.",
        Bars(beside=beside),
    ]
    regions = {
        ", ".join(whole(f"{a} {low:.2f} to {high:.2f}") for a, low, high in zip("xyz", *box, strict=True)) + " m": share
        for box, share in where.region
    }
    if bars := _bars(regions, 0.0)[:4]:
        content.append(Fold("By region of the workspace", [Bars(bars)]))
    return Section("where", "Where it lies", content)


def _bars(shares: Mapping[str, float], least: float) -> list[Bar]:
    top = max(shares.values(), default=0.0)
    order = sorted(shares.items(), key=lambda pair: -pair[1])
    return [Bar(name, share / top, percent(share)) for name, share in order if share >= least and share > 0.0]


@section(30)
def what_is_left(r: Reported) -> Section | None:
    """What is left unexplained, and the coordinates with which it correlates, if it is more than noise."""
    if r.diagnosis is None:
        return None
    found = r.diagnosis.unexplained
    noise, p = found.p_value >= CHANCE, _rare(found.p_value)
    words = f"Nothing beyond noise: noise alone leaves as much with a probability of {p}."
    if not noise:
        words = (
            f"In units of the noise, all that was measured together, {percent(found.share)} of what geometry alone leaves "
            "beyond noise is not explained. (The gap above is in the measurements' own units, on poses that were not fitted.) "
            f"Noise alone would leave as much with a probability of {p}."
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


@section(80)
def evidence(r: Reported) -> Section | None:
    """Gain in log evidence of geometry with each single candidate over geometry alone: bars and a table."""
    if (d := r.diagnosis) is None:
        return None
    causes = {(c.effect, c.site) for c in d.causes}
    tested = sorted((c for c in d.candidates if c.testable), key=lambda c: -c.log_evidence)
    top = max([c.log_evidence for c in tested], default=0.0)
    gains = [(named(d.effect(c.effect), c.site), whole(f"{c.log_evidence:.1f}")) for c in tested]
    bars = [
        Bar(name, max(c.log_evidence, 0.0) / top if top > 0.0 else 0.0, gain, (c.effect, c.site) in causes)
        for c, (name, gain) in zip(tested[:SHOWN], gains, strict=False)
    ]
    content: list[Block] = [
        "Gain in log evidence of geometry with one candidate over geometry alone: a gain of 5 is a Bayes factor of 150, one of "
        f"10 of 22000. {counted(len(tested), 'candidate')} were tested."
    ]
    if d.verdict == "unknown":
        content.append(
            "A large gain alone does not prove a cause: smooth terms without a name explain these data better, so a candidate "
            "may only resemble the true cause."
        )
    content.append(Bars(bars))
    if rest := gains[SHOWN:]:
        content.append(Fold("The other candidates", [Table(("candidate", "gain in log evidence"), rest, (1,))]))
    return Section("evidence", "Evidence", content)


@section(100)
def what_could_not_be_tested(r: Reported) -> Section | None:
    """Effects that could not be tested, with the reason."""
    if r.diagnosis is None:
        return None
    reasons: dict[tuple[str, str], list[str]] = {}
    for c in r.diagnosis.candidates:
        if not c.testable:
            reasons.setdefault((c.effect, reason_words(c.reason, c.site)), []).append(site_words(c.site))
    rows = [[r.diagnosis.effect(effect).title, joined(sites), why] for (effect, why), sites in reasons.items()]
    content: list[Block] = ["Every effect of the catalogue could be tested."]
    if rows:
        content = [
            "These data have no information on the following effects, for the reason given. A cause among them can't be named.",
            Table(("effect", "at", "why not"), rows),
        ]
    return Section("untestable", "What could not be tested", content, "Not testable")
