"""The page of a score, with the reason why each incorrect diagnosis is not correct."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from gtpin.bench.blind.judged import VISIBLE, Judged
from gtpin.bench.blind.score import EDGES, matched_filter, of_kind
from gtpin.report.figure import ACCENT, BAD, DATA, FIT, GOOD, LOW, MID, MYSTERY, WARN, ZERO, Drawing, Plot
from gtpin.report.page import Block, Lead, Plots, Section, Table, report, versions


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
        reasons = [f"{name} named instead" for name in case.false_names]
        if case.said.verdict != "unknown":
            leaves = case.truth[0].leaves
            known = case.rival if leaves is None else f"{leaves:.0f} ({case.rival})"
            reasons.append(
                f"not recognised as unknown; known effects leave {known}" if case.rival else "not recognised"
            )
        return "; ".join(reasons) or None
    if case.kind in ("rough", "power"):
        wrong = case.detected and case.testable and not case.in_class and bool(case.said.causes)
        return "the class does not contain the truth" if wrong else None
    if case.strict:
        return None
    return _single(case) if len(case.truth) == 1 else _several(case)


def _single(case: Judged) -> str:
    """The reason why the diagnosis did not name a single effect with its site and nothing else."""
    assert case.said is not None
    effect, statement = case.single, case.said
    if not case.testable:
        return "its covariate is missing or does not vary"
    reasons = ["not detected"] if statement.verdict == "none" else []
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


def truth_words(case: Judged) -> str:
    """The true effects as text, with E and D if known."""
    parts = []
    for effect in case.truth:
        both = (("E", effect.energy), ("D", effect.leaves))
        size = ", ".join(f"{word} {value:.0f}" for word, value in both if value is not None)
        parts.append(effect.name.removesuffix("@") + (f" ({size})" if size else ""))
    return ", ".join(parts) or ("no effect" if case.kind else "not known: its seal was broken")


def statement_words(case: Judged) -> str:
    """Verdict and named causes as text."""
    if case.said is None:
        return "failed"
    causes = [f"{cause.name} ({cause.probability:.2f})" for cause in case.said.causes]
    return f"{case.said.verdict}: {', '.join(causes)}" if causes else case.said.verdict


def score_page(result: Mapping[str, Any], cases: Sequence[Judged]) -> str:
    """The score as one self-contained HTML file. ``result``: the content of ``score.json``. ``cases``: the judged cases."""
    drawn = plots(result, cases)

    def drawings(*names: str) -> Plots:
        return Plots([drawn[name] for name in names if name in drawn])

    effects, instruments, failures = effect_table(result), instrument_table(result), failure_table(cases)
    by_effect: list[Block] = ["There was no case with a single effect of the catalogue."]
    if effects.rows:
        by_effect = [effects, drawings("confusion"), drawings("difficulty", "power")]
    probabilities: list[Block] = [drawings("reliability", "shrinkage"), reliability_table(result)]
    one_by_one: list[Block] = [
        f"{len(failures.rows)} cases of {result['cases']} were not correct in the strictest sense: all effects named with "
        "their sites and nothing else; none without an effect; unknown outside the catalogue.",
        failures,
    ]
    sections = [
        Section("figures", "Figures", [figure_table(result)]),
        Section("effects", "By effect", by_effect),
        Section("instruments", "By instrument", [ABOUT_INSTRUMENTS, instruments]),
        Section("probabilities", "Probabilities and explained fraction of the gap", probabilities),
        Section("failures", "Failures, one by one", one_by_one if failures.rows else ["None."], "Failures"),
    ]
    if not instruments.rows:
        del sections[2]
    words = {
        "strict": "single effects named correctly, nothing else named",
        "in_class": "class contains the truth",
        "false_alarm": "false alarms",
        "unknown_recognised": "unlisted recognised as unknown",
        "set_f1": "F1 of several effects",
        "shrinkage_error": "error of the explained fraction",
    }
    if "set_f1_visible" in result:
        del words["set_f1"]
        words["set_f1_visible"] = "F1 of several visible effects"
    settings = [[name, str(value)] for name, value in result.get("check", {}).items() if value is not None]
    numbers = [(number(result[key]), words[key]) for key in words]
    lead = Lead(f"Blind check · {result['cases']} cases", headline(result), [ABOUT], numbers, tab="Blind check")
    origin = Section("provenance", "Provenance", [Table(("what", "which"), versions() + settings)])
    return report(lead, [*sections, origin])


ABOUT = """Machines with hidden effects were made, their truths sealed, their data diagnosed by processes without other
information, and the seals opened at the end. E is an effect's whitened energy that geometry can't explain; D is the part
of E that the best wrong effect leaves."""
ABOUT_INSTRUMENTS = """An effect with E of 63 or less counts as not visible to what measured: a diagnosis of these readings
need not find it. In the F1 of several effects it is left out, whether it is named or not; the last column says how many of
the effects in cases with several are such. Fractions have Wilson's 95 % bounds, means (F1, shrinkage error) 1.96 standard
errors."""


def headline(result: Mapping[str, Any]) -> str:
    """Text with the numbers of reached targets and of failed cases."""
    reached = [row["reached"] for row in result["figures"] if row["reached"] is not None]
    failed = len(result["failures"])
    end = f"; {failed} cases failed" if failed else ""
    return f"{sum(reached)} of {len(reached)} targets reached{end}" if reached else f"{result['cases']} cases{end}"


def figure_table(result: Mapping[str, Any]) -> Table:
    """Figures with their targets."""
    rows = []
    for row in result["figures"]:
        ends = (("≥", row["least"]), ("≤", row["most"]))
        target = "".join(f"{sign} {end:g}" for sign, end in ends if end is not None)
        mark = {True: "reached", False: "missed", None: ""}[row["reached"]]
        rows.append((row["figure"], number(row["value"]), bounds(row), str(row["of"]), target, mark))
    return Table(("figure", "value", "95 %", "of", "target", ""), rows, range(1, 5))


def effect_table(result: Mapping[str, Any]) -> Table:
    """Accuracy by effect."""
    columns = {
        "strict": "strict",
        "strict_bounds": "95 %",
        "in_class": "in class",
        "class_size": "class size",
        "detected": "detected",
        "where": "where",
        "taken_out": "taken out",
        "taken_out_unknown": "then unknown",
        "taken_out_misnamed": "then misnamed",
    }
    rows = []
    for effect, row in result["by_effect"].items():
        low, high = row["strict_bounds"]
        cells = {key: number(row[key]) for key in columns if not key.endswith("bounds")}
        cells |= {"strict_bounds": f"{low:.2f} .. {high:.2f}", "taken_out": str(row["taken_out"])}
        rows.append((effect, str(row["cases"]), *(cells[key] for key in columns)))
    return Table(("effect", "cases", *columns.values()), rows, range(1, 10))


def instrument_table(result: Mapping[str, Any]) -> Table:
    """Rates by instrument; no rows where a tracker alone measured."""
    columns = {
        "detected": "detected, E > 63",
        "in_class": "class right, E > 63",
        "strict": "strict, D > 63",
        "silent": "silent",
        "false_with_confidence": "false with confidence",
        "set_f1_visible": "F1 of several, E > 63",
        "shrinkage_error": "shrinkage error",
    }

    def cell(one: Mapping[str, Any]) -> str:
        within = f" ({bounds(one)})" if one["low"] is not None else ""
        return f"{number(one['value'])}{within} of {one['of']}" if one["of"] else number(None)

    rows = [
        (name, str(row["cases"]), *(cell(row[key]) for key in columns), f"{row['not_visible']} of {row['effects']}")
        for name, row in result.get("by_instrument", {}).items()
    ]
    return Table(("instrument", "cases", *columns.values(), "not visible"), rows, (1,))


def reliability_table(result: Mapping[str, Any]) -> Table:
    """Reliability of the probabilities, by tenths."""
    rows = []
    for t in result["reliability"]["causes"]:
        right, tenth = t["right"], f"{t['start']:.1f} .. {t['start'] + 0.1:.1f}"
        rows.append((tenth, number(t["said"]), number(right["value"]), bounds(right), str(right["of"])))
    return Table(("probability", "mean predicted", "correct", "95 %", "causes"), rows, range(1, 4))


def failure_table(cases: Sequence[Judged]) -> Table:
    """Cases with an incorrect diagnosis: truth, diagnosis and reason."""
    reasons = ((case, failure(case)) for case in cases)
    rows = [(c.name, c.kind or "", truth_words(c), statement_words(c), why) for c, why in reasons if why is not None]
    return Table(("case", "kind", "truth", "diagnosis", "reason"), rows)


def number(value: float | None) -> str:
    """A fraction or mean with three digits; a dash where there is none."""
    return "–" if value is None else f"{value:.3f}"


def bounds(row: Mapping[str, Any]) -> str:
    """The 95 % bounds of a rate."""
    return "" if row["low"] is None else f"{row['low']:.3f} .. {row['high']:.3f}"


COLORS = (ACCENT, FIT, GOOD, MYSTERY)
DOTTED = {"color": ZERO, "dash": "dot"}
Trace = dict[str, Any]


def plots(result: Mapping[str, Any], cases: Sequence[Judged]) -> dict[str, Plot]:
    """By name: ``reliability``, ``power``, ``confusion``, ``shrinkage``, ``difficulty``; plots without data are omitted."""
    made = (
        _reliability(result["reliability"]),
        _power(result["power"]),
        _confusion(result["confusion"]),
        _explained_fraction(cases),
        _difficulty(cases),
    )
    return {plot.name: plot for plot in made if plot is not None}


def _plot(name: str, title: str, caption: str, traces: Sequence[Trace], layout: Trace, **more: Any) -> Plot:
    return Plot(name, title, partial(Drawing, traces, layout), (), caption, **more)


def _axis(title: str, low: float | None = None, high: float | None = None, **more: Any) -> Trace:
    return {"title": {"text": title}, **({} if low is None else {"range": [low, high]}), **more}


def _diagonal(start: float) -> Trace:
    """A dotted line of equal numbers, without a legend."""
    ends = [start, 1]
    return {"x": ends, "y": ends, "mode": "lines", "line": DOTTED, "showlegend": False, "hoverinfo": "skip"}


def _rates(x: Sequence[float], rates: Sequence[Mapping[str, Any]], **more: Any) -> Trace:
    """Rates with their bounds, and their numbers of cases as text."""
    above, below = [r["high"] - r["value"] for r in rates], [r["value"] - r["low"] for r in rates]
    bars = {"type": "data", "symmetric": False, "array": above, "arrayminus": below, "thickness": 1}
    texts = [f"{r['of']} cases" for r in rates]
    return {"x": x, "y": [r["value"] for r in rates], "error_y": bars, "text": texts, **more}


def _reliability(rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> Plot | None:
    traces = [_diagonal(0)]
    for (name, tenths), color in zip(rows.items(), COLORS, strict=False):
        said, right = [t["said"] for t in tenths], [t["right"] for t in tenths]
        traces.append(_rates(said, right, name=name, mode="markers", marker={"color": color, "size": 8}))
    caption = "Probabilities of the named causes, and of all members of their classes, by tenths; bars: 95 %."
    axes = {"xaxis": _axis("predicted probability", 0, 1.02), "yaxis": _axis("fraction correct", -0.02, 1.02)}
    title = "Reliability of the probabilities"
    return _plot("reliability", title, caption, traces, axes) if rows["causes"] else None


def _power(rows: Sequence[Mapping[str, Any]]) -> Plot | None:
    if not rows:
        return None
    grid = np.geomspace(EDGES[0], EDGES[-1], 60)
    limit = [matched_filter(e) for e in grid]
    traces: list[Trace] = [{"x": grid, "y": limit, "mode": "lines", "name": "matched filter", "line": DOTTED}]
    for number, color in zip(sorted({row["poses"] for row in rows}), COLORS, strict=False):
        some = [row for row in rows if row["poses"] == number]
        found = [row["found"] for row in some]
        look = {"name": f"{number} poses", "mode": "lines+markers", "line": {"color": color}}
        traces.append(_rates([row["energy"] for row in some], found, **look))
    caption = "Single effects by the energy that geometry can't explain; bars: 95 %."
    axes = {"xaxis": _axis("E", type="log"), "yaxis": _axis("share detected", -0.02, 1.05)}
    return _plot("power", "Share detected by energy", caption, traces, axes)


def _confusion(counts: Mapping[str, Mapping[str, int]]) -> Plot | None:
    if not counts:
        return None
    last = ["unknown", "ambiguous", "explained", "none", "failed"]
    named = sorted({word for row in counts.values() for word in row} - set(last))
    words = [*dict.fromkeys([*counts, *named]), *last]
    columns = [word for word in words if any(word in row for row in counts.values())]
    trace = {
        "type": "heatmap",
        "x": columns,
        "y": list(counts),
        "z": [[row.get(word, 0) / sum(row.values()) for word in columns] for row in counts.values()],
        "text": [[row.get(word, 0) or "" for word in columns] for row in counts.values()],
        "texttemplate": "%{text}",
        "showscale": False,
        "colorscale": [[0, LOW], [1, MID]],
        "hovertemplate": "%{y} diagnosed as %{x}: %{text}<extra></extra>",
        "xgap": 1,
        "ygap": 1,
    }
    axes = {"yaxis": {"autorange": "reversed"}, "xaxis": {"side": "top", "tickangle": -60}}
    layout: Trace = {**axes, "margin": {"t": 110}}
    caption = "Numbers of cases, by the true effect (rows) and the leading cause, or the verdict if no cause is named."
    title = "Confusion matrix of single effects"
    return _plot("confusion", title, caption, [trace], layout, height=130 + 24 * len(counts))


def _explained_fraction(cases: Sequence[Judged]) -> Plot | None:
    some = [
        (c, c.said.explained_fraction, c.shrunk.share)
        for c in cases
        if c.said and c.shrunk and c.said.explained_fraction is not None
    ]
    if not some:
        return None
    dots = {
        "x": [predicted for _, predicted, _ in some],
        "y": [max(share, -1.0) for _, _, share in some],
        "mode": "markers",
        "name": "cases",
        "marker": {"color": DATA, "size": 5, "opacity": 0.6},
        "text": [c.name for c, _, _ in some],
    }
    axes: Trace = {"xaxis": _axis("predicted"), "yaxis": _axis("realised at held-out commands"), "showlegend": False}
    title = "Explained fraction of the gap, predicted and realised"
    caption = "One dot per case; values below -1 are drawn at -1."
    return _plot("shrinkage", title, caption, [_diagonal(-0.2), dots], axes)


def _difficulty(cases: Sequence[Judged]) -> Plot | None:
    one = [c for c in of_kind(cases, "one") if c.noncentrality == c.noncentrality and c.leaves == c.leaves]
    if not one:
        return None
    rest = [c for c in one if not c.strict]
    groups = {
        "right, alone": (GOOD, [c for c in one if c.strict]),
        "class holds it": (WARN, [c for c in rest if c.detected and c.in_class]),
        "wrong or unknown": (BAD, [c for c in rest if c.detected and not c.in_class]),
        "not detected": (DATA, [c for c in rest if not c.detected]),
    }
    traces = []
    for name, (color, some) in groups.items():
        look = {"mode": "markers", "name": name, "marker": {"color": color, "size": 6}}
        x, y = [c.noncentrality for c in some], [max(c.leaves, 1.0) for c in some]
        traces.append({"x": x, "y": y, "text": [f"{c.name} {c.single.name}" for c in some], **look})
    line = {"type": "line", "y0": VISIBLE, "y1": VISIBLE, "xref": "paper", "x0": 0, "x1": 1, "line": DOTTED}
    axes: Trace = {"xaxis": _axis("E", type="log"), "yaxis": _axis("D", type="log"), "shapes": [line]}
    title, caption = "Energy, and what the best wrong effect leaves", "Single effects; dotted: D = 63."
    return _plot("difficulty", title, caption, traces, axes)
