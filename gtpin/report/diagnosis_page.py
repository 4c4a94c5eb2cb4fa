"""The page of a diagnosis: the verdict first, then the evidence for it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from gtpin.calibration.checks.prepared import with_positions
from gtpin.data import Dataset
from gtpin.diagnosis.inference.where import Where
from gtpin.diagnosis.linear.cross_validation import InstrumentGap
from gtpin.diagnosis.result import Diagnosis
from gtpin.report.ball_bar_plot import circular_tests
from gtpin.report.corrected import sure_corrections
from gtpin.report.curve_plots import curve_notes, curve_plots, reach
from gtpin.report.diagnosis_json import gap_method
from gtpin.report.drawing import drawing
from gtpin.report.effect_curves import Curve, curves
from gtpin.report.embedded import Choice, Plot
from gtpin.report.evidence import Bar, evidence_bars, named_causes, testable_count, untestable
from gtpin.report.experiments import confirmation, experiments
from gtpin.report.gap_words import gap_words
from gtpin.report.geometry_table import geometry_tables
from gtpin.report.instruments_table import gap_table, unknowns_table
from gtpin.report.maps import maps
from gtpin.report.page import render
from gtpin.report.provenance import provenance
from gtpin.report.quality import nominal_words, quality
from gtpin.report.residual_columns import View, commanded, leading
from gtpin.report.residual_plots import LAYERS, ONE_LAYER, against_columns, components, over_two, selection
from gtpin.report.residuals import Residuals
from gtpin.report.verdict import verdict
from gtpin.report.words import coordinate_words, joined, percent, quantity, short, site_words, typeset, whole

CONTENTS = (
    ("where", "Where it lies"),
    ("causes", "The causes"),
    ("left", "What is left"),
    ("instruments", "The instruments"),
    ("circles", "Circular tests"),
    ("maps", "Over the workspace"),
    ("covariates", "Against what was recorded"),
    ("evidence", "Evidence"),
    ("apart", "What to measure next"),
    ("untestable", "Not testable"),
    ("parameters", "Parameters"),
    ("data", "Data"),
    ("provenance", "Provenance"),
)

CHANCE = 0.01
"""Smallest p-value at which noise alone explains what is left."""


def diagnosis_page(diagnosis: Diagnosis, dataset: Dataset, *, seed: int = 0) -> str:
    """The whole report of a diagnosis as one self-contained HTML file.

    Parameters
    ----------
    diagnosis, dataset
        The result, and the data.
    seed
        Seed of the diagnosis, to be recorded on the page.
    """
    robot = diagnosis.baseline.model.robot
    dataset = with_positions(dataset, robot)
    residuals = Residuals.of(dataset, diagnosis.baseline, diagnosis.model, diagnosis.set_aside_rows)
    own_curves = _found_curves(diagnosis, residuals)
    named = named_causes(diagnosis, {key: reach(found) for key, found in own_curves.items()})
    sites = [c.site for c in diagnosis.causes] or [site for site, _, _ in diagnosis.unexplained.correlates]
    seen, component = components(residuals, leading(residuals, sites, diagnosis.where.axis))
    layers = LAYERS if named else ONE_LAYER
    against = against_columns(residuals, diagnosis.where.covariate, seen, (component, layers))
    views = maps(residuals, layers)
    tests = circular_tests(residuals, bool(named))
    by_cause = {c.key: curve_plots(c.key, own_curves.get((c.effect, c.site), ())) for c in named}
    bars, others = evidence_bars(diagnosis)
    absent = {"causes"} if not named else set[str]()
    absent |= {"instruments"} if residuals.of_poses else set()
    absent |= set() if tests else {"circles"}
    moved, parameters = geometry_tables(diagnosis.baseline, diagnosis.model if named else None)
    return render(
        "diagnosis.html",
        title=f"{robot.name}: {diagnosis.verdict}",
        contents=[(id_, name) for id_, name in CONTENTS if id_ not in absent],
        plots={
            "left": _left(diagnosis, residuals, seen, component),
            "against": against,
            "maps": views.plots,
            **{test.key: test.plots for test in tests},
            **by_cause,
        },
        provenance=provenance(dataset, robot, seed),
        robot=robot.name,
        poses=len(dataset),
        verdict=verdict(diagnosis),
        numbers=_numbers(diagnosis),
        sketch=_sketch(diagnosis, dataset),
        causes=named,
        notes={cause.key: curve_notes(own_curves.get((cause.effect, cause.site), ())) for cause in named},
        where=_where_bars(diagnosis.where),
        rods=bool(diagnosis.where.rod),
        regions=_regions(diagnosis.where),
        component=component,
        selection=selection(residuals),
        layers=layers,
        views=views,
        bars=bars,
        others=others,
        tested=testable_count(diagnosis),
        unexplained=_unexplained(diagnosis),
        correlates=_correlates(diagnosis),
        doubtful=[cause for cause in named if len(cause.members) > 1],
        corrected=joined(sure_corrections(diagnosis)),
        confirm=confirmation(diagnosis),
        next_experiment=experiments(diagnosis),
        untestable=untestable(diagnosis.candidates),
        moved=moved,
        parameters=parameters,
        quality=quality(dataset, diagnosis.baseline, diagnosis.set_aside_rows),
        method=gap_method(diagnosis.gap),
        of_poses=residuals.of_poses,
        tests=tests,
        instruments=gap_table(diagnosis.gap),
        unknowns=unknowns_table(diagnosis.model, diagnosis.baseline),
    )


def _numbers(d: Diagnosis) -> list[tuple[str, str]]:
    """The key figures under the headline."""
    if len(d.gap.by_instrument) > 1:
        return [_number(one, bool(d.causes)) for one in d.gap.by_instrument] + _shrinkage(d)
    size = gap_words(d.gap)
    numbers = [
        (nominal_words(d.baseline), "nominal geometry, RMS"),
        (size.before, "calibrated geometry, at left-out poses"),
    ]
    if d.causes:
        numbers.append((size.after, "with the causes"))
    left = d.baseline.model.unexplained
    known = left is None or left.noise_known
    numbers.append((size.floor, "noise alone" if known else "left of the fit: the noise is not known"))
    return numbers + _shrinkage(d)


def _number(one: InstrumentGap, causes: bool) -> tuple[str, str]:
    """The key figures of one instrument of several."""
    before, after, floor = (quantity(value, one.unit) for value in (one.before, one.after, one.floor))
    if not causes:
        return before, f"{one.name}, gap of the calibrated geometry; noise alone {floor}"
    return (
        f"{before} → {after}",
        f"{one.name}, gap of the calibrated geometry, and with the causes; noise alone {floor}",
    )


def _shrinkage(d: Diagnosis) -> list[tuple[str, str]]:
    """The explained fraction of the gap as a key figure; empty where there is no gap."""
    if d.gap.shrinkage is None or d.gap.before <= d.gap.floor:
        return []
    between = f", 95 %: {percent(d.gap.interval[0])} to {percent(d.gap.interval[1])}" if d.gap.interval else ""
    return [(percent(d.gap.shrinkage), f"of the power beyond noise is explained{between}")]


def _sketch(d: Diagnosis, dataset: Dataset) -> str | None:
    q = dataset.q.mean(axis=0)
    if d.verdict == "none":
        return drawing(d.model, q)
    return drawing(d.model, q, d.where.site, d.where.rod, [c.site for c in d.causes])


def _left(d: Diagnosis, residuals: Residuals, views: Mapping[str, View], component: Choice) -> Plot | None:
    """Residuals over the two commands on which they depend most, if they depend on two."""
    for _, coordinates, _ in d.unexplained.correlates[:1]:
        commands = coordinates.split(" ")[0].split(",")
        if len(commands) == 2 and all(name in commanded(residuals) for name in commands):
            return over_two(residuals, commands[0], commands[1], views, component)
    return None


def _found_curves(d: Diagnosis, residuals: Residuals) -> dict[tuple[str, str], tuple[Curve, ...]]:
    return {(active.effect.id, active.site): curves(active, residuals) for active in d.model.effects}


def _where_bars(where: Where) -> list[tuple[str, list[Bar]]]:
    """Shares by site, rod, axis and coordinate, as far as they exist."""
    groups = (
        ("By site", {short(site_words(k)): v for k, v in where.site.items()}),
        ("By rod", where.rod),
        ("By axis", where.axis),
        (
            "By coordinate, the strongest correlation as 100 %",
            {short(coordinate_words(k)): v for k, v in where.covariate.items()},
        ),
    )
    return [(title, bars) for title, shares in groups if (bars := _bars(shares))]


def _bars(shares: Mapping[str, float]) -> list[Bar]:
    top = max(shares.values(), default=0.0)
    order = sorted(shares.items(), key=lambda pair: -pair[1])
    return [Bar(name, share / top, percent(share)) for name, share in order if share >= 0.01] if top > 0.0 else []


def _regions(where: Where) -> list[Bar]:
    """The boxes of the workspace with most of the gap."""
    order = sorted(where.region, key=lambda pair: -pair[1])[:4]
    top = max((share for _, share in order), default=0.0)
    return [
        Bar(
            _box(box),
            share / top,
            percent(share),
        )
        for box, share in order
        if share > 0.0
    ]


def _box(box: npt.NDArray[np.float64]) -> str:
    """A box of the workspace in words."""
    return ", ".join(whole(f"{a} {low:.2f} to {high:.2f}") for a, low, high in zip("xyz", *box, strict=True)) + " m"


def _correlates(d: Diagnosis) -> list[tuple[str, str, str]]:
    """Coordinates with which the residuals correlate, if they are more than noise."""
    if d.unexplained.p_value >= CHANCE and d.verdict != "unknown":
        return []
    return [(site_words(site), coordinate_words(c), _rare(p)) for site, c, p in d.unexplained.correlates]


def _rare(chance: float) -> str:
    """A p-value as text; very small ones only as a bound."""
    return "less than 10⁻⁹" if chance < 1e-9 else typeset(f"{chance:.2g}")


def _unexplained(d: Diagnosis) -> str:
    left, p = percent(d.unexplained.share), _rare(d.unexplained.p_value)
    share = (
        f"In units of the noise, all that was measured together, {left} of what geometry alone leaves beyond noise is not "
        "explained. (The gap above is in the measurements' own units, on poses that were not fitted.)"
    )
    if d.unexplained.p_value >= CHANCE:
        return f"Nothing beyond noise: noise alone leaves as much with a probability of {p}."
    return f"{share} Noise alone would leave as much with a probability of {p}."
