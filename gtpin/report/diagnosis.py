"""A diagnosis as text, terminal text, table, figures, page, JSON and files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gtpin.diagnosis.result import Diagnosis, Gap, HealthCheck, Member
from gtpin.effects.sites import joints
from gtpin.errors import GtpinError
from gtpin.model.departures import departures
from gtpin.model.model import Model
from gtpin.model.model_folder import write_model
from gtpin.output.results import fields, json_text
from gtpin.report.calibration import UNKNOWN
from gtpin.report.calibration_text import best_frame, nominal_words
from gtpin.report.effect_curves import curve_drawing, drawn_curves
from gtpin.report.figure import alone
from gtpin.report.fit import FitPresentation
from gtpin.report.geometry import geometry_words
from gtpin.report.next_experiment import FOLDER, write_experiments
from gtpin.report.page import Lead, Section, Table
from gtpin.report.phrases import cause_rows, named, parameter_rows, reason_words
from gtpin.report.sections import sections
from gtpin.report.sections.data import gap_method
from gtpin.report.sketch import drawing
from gtpin.report.steps import steps
from gtpin.report.verdict import gap_words, verdict
from gtpin.report.why import why_content, why_json
from gtpin.report.words import chance, percent, quantity, site_words
from gtpin.threads import in_one_thread

if TYPE_CHECKING:
    import pandas as pd
    from plotly.graph_objects import Figure

DIAGNOSIS = ("baseline", "model", "diagnosis.json", "report.html", FOLDER)
"""Names of the files of a diagnosis's folder."""


@dataclass(frozen=True)
class DiagnosisPresentation(FitPresentation):
    """A diagnosis; its table is that of its causes' parameters."""

    files = DIAGNOSIS

    @property
    def diagnosis(self) -> Diagnosis:
        """The diagnosis."""
        assert isinstance(self.result, Diagnosis)
        return self.result

    @cached_property
    def lead(self) -> Lead:
        """From the nominal to the calibrated geometry, which parameters make it, the causes, and what to do."""
        d = self.diagnosis
        said, doubt, (geometry, table) = verdict(d), d.model.doubt, geometry_words(d.model, d.dataset.q)
        # Without a gap, a free motion of a part explains nothing.
        shares = () if d.verdict == "none" else (d.where.site, [c.site for c in d.causes])
        blue = " Blue: the sites of the causes." if d.causes else ""
        causes = Table(("cause", "probability", "parameters", "part of the gap"), cause_rows(d), (1,), wide=(0, 2))
        return replace(
            said,
            headline="\n".join(filter(None, (geometry, said.headline))),
            advice=[*([f"{doubt[:1].upper()}{doubt[1:]}."] if doubt else []), *said.advice],
            numbers=_numbers(d),
            sketch=drawing(d.model, d.dataset.q.mean(axis=0), *shares),
            caption=f"Redder: a free motion of this part alone explains the errors better.{blue}" if shares else "",
            content=[*why_content(d), *table, *([causes] if d.causes else [])],
            steps=steps(d),
            warnings=d.warnings,
            tab=f"{d.model.robot.name}: {d.verdict}",
        )

    @cached_property
    def sections(self) -> Sequence[Section]:
        """The sections of the page."""
        return sections(self)

    def table(self) -> pd.DataFrame:
        """A row for each parameter of each cause."""
        import pandas as pd

        rows = [
            (c.effect, c.site, c.probability, c.explained_fraction, name, e.value, e.sigma, *e.interval, e.unit)
            for c in self.diagnosis.causes
            for name, e in c.parameters.items()
        ]
        columns = ["effect", "site", "probability", "shrinkage", "parameter", "value", "sigma", "low", "high", "unit"]
        return pd.DataFrame(rows, columns=columns)

    def effect(self, number: int, name: str | None) -> Figure:
        """The curve of a cause with its interval."""
        causes = self.diagnosis.causes
        if not 0 <= number < len(causes):
            raise GtpinError(f"there is no cause {number}", hint=f"there are {len(causes)}, counted from 0")
        cause = causes[number]
        found = self.curves[cause.effect, cause.site]
        chosen = drawn_curves(found) if name is None else [curve for curve in found if curve.name == name]
        if not chosen:
            known = ", ".join(dict.fromkeys(curve.name for curve in found))
            raise GtpinError(f"{cause.effect} at {cause.site} has no curve of {name!r}", hint=f"it has {known}")
        drawing = curve_drawing(chosen[0])
        title = f"{named(self.diagnosis.effect(cause.effect), cause.site)}, 95 % interval"
        return alone(drawing, title, yaxis={"title": {"text": drawing.layout["title"]["text"]}})

    def parameters(self) -> Figure:
        """The causes' parameters."""
        d, rows = self.diagnosis, []
        for c in d.causes:
            about = (d.effect(c.effect).title, site_words(c.site), chance(c.probability))
            rows += [[*about, *size, percent(c.explained_fraction)] for size in parameter_rows(c)]
        head = ("cause", "at", "probability", "parameter", "value", "95 % from", "to", "part of the gap")
        return Table(head, rows).figure("Parameters of the causes")

    @in_one_thread
    def write(self, folder: Path) -> dict[str, object]:
        """Write ``baseline/``, ``model/``, ``diagnosis.json``, ``report.html`` and the next experiments' commands.

        Returns the content of ``diagnosis.json``.
        """
        d = self.diagnosis
        return write_findings(d, d.baseline.model, self.json(), self.page(), folder)

    def json(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``."""
        return diagnosis_json(self.diagnosis)


def write_findings(
    found: Diagnosis | HealthCheck, baseline: Model, result: dict[str, Any], page: str, folder: Path
) -> dict[str, Any]:
    """Write the files of a diagnosis or a check into a folder; returns the content of ``diagnosis.json``."""
    write_model(baseline, folder / "baseline")
    write_model(found.model, folder / "model")
    (folder / "diagnosis.json").write_text(json_text(result), encoding="utf-8")
    write_experiments(found, folder)
    (folder / "report.html").write_text(page, encoding="utf-8")
    return result


def _numbers(d: Diagnosis) -> list[tuple[str, str]]:
    numbers, size = list[tuple[str, str]](), gap_words(d.gap)
    if len(d.gap.by_instrument) > 1:
        for one in d.gap.by_instrument:
            before, after, floor = (quantity(value, one.unit) for value in (one.before, one.after, one.floor))
            words = f"{one.name}, gap of the calibrated geometry{', and with the causes' if d.causes else ''}"
            numbers.append((f"{before} → {after}" if d.causes else before, f"{words}; noise alone {floor}"))
    else:
        noise = "noise alone, by repeated visits, causes taken away" if d.noise_ratio > 1.0 else "noise alone"
        where = "sessions" if d.gap.hold_out == "session" else "poses"
        numbers += [
            (nominal_words(d.baseline), f"nominal geometry{best_frame(d.baseline)}: {size.what}, RMS"),
            (size.before, f"calibrated geometry, at left-out {where}"),
            *([(size.after, "with the causes")] if d.causes else []),
            (size.floor, noise if d.noise_source != "residuals" else UNKNOWN),
        ]
    if d.gap.explained_fraction is not None and d.gap.before > d.gap.floor:
        between = f", 95 %: {percent(d.gap.interval[0])} to {percent(d.gap.interval[1])}" if d.gap.interval else ""
        numbers.append((percent(d.gap.explained_fraction), f"of the gap's power beyond noise is explained{between}"))
    return numbers


def diagnosis_json(d: Diagnosis | HealthCheck) -> dict[str, Any]:
    """The content of ``diagnosis.json``."""
    none, where, unexplained, best = d.verdict == "none", d.where, d.unexplained, d.unexplained.best_known
    geometry = [
        fields(one, "value", "sigma", "unit", "position_rms") | {"parameter": one.name}
        for one in (departures(d.model, d.dataset.q) if isinstance(d, Diagnosis) else ())
    ]
    regions = [{"box": np.asarray(box).tolist(), "share": share} for box, share in where.region]
    return {
        "schema": "gtpin-diagnosis/1",
        "verdict": d.verdict,
        "causes": [
            {
                **fields(c, "effect", "site", "probability"),
                "class": _class(c.members),
                "parameters": {name: fields(e, "value", "sigma", "unit") for name, e in c.parameters.items()},
                "shrinkage": c.explained_fraction,
                **fields(c, "nature", "share"),
            }
            for c in d.causes
        ],
        "also": [fields(one, "site", "rms") | {"class": _class(one.members)} for one in d.also],
        "candidates": [
            fields(c, "effect", "site", "log_evidence", "probability", "testable")
            | {"reason": reason_words(c.reason, c.site)}
            for c in d.candidates
        ],
        "where": fields(where, "rod", "site", "axis", "covariate") | {"region": regions, "geometry": geometry},
        "gap": {
            **_errors(d.gap),
            "shrinkage": None if none else d.gap.explained_fraction,
            "interval": None if none or d.gap.interval is None else list(d.gap.interval),
            "method": gap_method(d.gap),
            **_turns(d),
        },
        "unexplained": {
            **fields(unexplained, "share", "p_value"),
            "correlates": [
                {"site": o.site, "covariate": o.coordinates, "p_value": o.p_value} for o in unexplained.correlates
            ],
            "descriptions": [
                fields(t, "effect", "site") | {"over": list(t.over)} | fields(t, "rms", "probability")
                for t in unexplained.descriptions
            ],
            "could_be": [_place(place) | {"position_rms_after": left} for place, left in unexplained.could_be.items()],
            "leaders": [fields(one, "effect", "site", "log_evidence", "left") for one in unexplained.leaders],
            "best_known": best and {"effects": [_place(place) for place in best.effects], "left": best.left},
            "jumps": list(unexplained.jumps),
            "questions": [
                fields(q, "effect", "site", "parameter", "value", "sigma", "unit")
                | {"expected": [end if np.isfinite(end) else None for end in (q.low, q.high)]}
                | fields(q, "why", "believed")
                for q in d.questions
            ],
        },
        "rows": d.dataset.rows_used,
        "next_experiment": [e.to_json() for e in d.next_experiment],
        "warnings": list(d.warnings),
        **({"why": why_json(d, d.why)} if isinstance(d, Diagnosis) and d.why is not None else {}),
    }


def _place(place: tuple[str, str]) -> dict[str, str]:
    return dict(zip(("effect", "site"), place, strict=True))


def _class(members: Iterable[Member]) -> list[dict[str, Any]]:
    return [fields(m, "effect", "site", "probability") for m in members]


def _errors(gap: Gap) -> dict[str, Any]:
    """Position errors, those of the first tracker where there are several instruments, and errors of each instrument."""
    known, by_instrument = ("before", "after", "floor", "inferred"), gap.by_instrument
    keys = ("position_rms_before", "position_rms_after", "noise_floor", "noise_inferred")
    whose = next((one for one in by_instrument if one.kind == "tracker"), None) if by_instrument else gap
    found: dict[str, Any] = {key: getattr(whose, name, None) for key, name in zip(keys, known, strict=True)}
    if by_instrument:
        keys = ("rms_before", "rms_after", "noise_floor", "noise_inferred")
        found["by_instrument"] = {
            one.name: {key: getattr(one, name) for key, name in zip(keys, known, strict=True)} | {"unit": one.unit}
            for one in by_instrument
        }
    return found


def _turns(d: Diagnosis | HealthCheck) -> dict[str, float]:
    """Orientation errors on left-out poses, rad; only for robots without rods, whose wrists rotate the tool and hardly shift
    it."""
    if d.gap.turns is None or not joints(d.model.robot):
        return {}
    before, after, floor = d.gap.turns.before, d.gap.turns.after, d.gap.turns.floor
    return {"orientation_rms_before": before, "orientation_rms_after": after, "orientation_noise_floor": floor}
