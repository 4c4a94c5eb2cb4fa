"""What to do now: commands for the model of a result, and what to measure next."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from gtpin.calibration.result import Calibration
from gtpin.compensation.compensate import NOT_THE_MACHINE
from gtpin.compensation.machine import correctable, lacks
from gtpin.diagnosis.priors import SURE
from gtpin.diagnosis.result import Diagnosis, HealthCheck
from gtpin.errors import unheard
from gtpin.model.dh import chain_of
from gtpin.model.model import Model
from gtpin.model.place import movers
from gtpin.report.calibration_text import cannot_judge, lost
from gtpin.report.page import Step
from gtpin.report.phrases import named
from gtpin.report.verdict import beyond_chance, scattered, too_few, worse_than_nominal
from gtpin.report.words import joined, length

MEASURE = Step(
    "Measure more poses, and run the command again. Poses to choose:",
    "gtpin plan DIR --for calibration --poses 40 -o plan",
)
REPEAT = Step(
    "Find what changes between the visits: visit ten poses five times each, at rest, from both directions, and diagnose these "
    "poses with the others. An error that repeats is no noise."
)
SETTLE = Step(
    "Measure where the target sits, write it into dataset.toml, and run the command again: until then, export nothing."
)
NEARER = 0.9
"""Largest ratio of the errors of two geometries at which the one calibrated without the causes is better. Assumed: about the
scatter of such errors. Tables of single actuators need the other geometry."""
PROGRAM = "gtpin export DIR --commands program.csv -o corrected.csv"


def steps(d: Diagnosis) -> list[Step]:
    """What to do after a diagnosis."""
    if d.model.doubt:
        return [SETTLE]
    few = [MEASURE] if too_few(d) else []
    if few and worse_than_nominal(d):
        return few
    again = [REPEAT] if not few and (scattered(d) or beyond_chance(d)) else []
    folder, words, best = _geometry(d)
    found = few + again + geometry_steps(d.model, d.verdict != "unknown", folder, words)
    if (kept := sure_corrections(d)) and _left(d, [active.name for active in correctable(d.model)]) <= best:
        of = "the calibrated geometry" if folder == "DIR" else "the geometry of gtpin export DIR -o with_causes.urdf"
        what = f"Tables that correct {joined(kept)}, for a controller that has {of}:"
        found.append(Step(what, "gtpin export DIR -o corrections.csv"))
    if d.causes and d.verdict != "unknown":
        found.append(Step(f"A program, corrected for everything that the model knows{beside(d.model)}:", PROGRAM))
    members = {f"{m.effect}@{m.site}" for c in d.causes if c.probability < SURE for m in c.members}
    wanted = members | ({"unknown"} if d.verdict == "unknown" else set())
    found += [Step(e.measure) for e in d.next_experiment if wanted & {*e.separates}][:1]
    if d.verdict == "explained":
        repair = "repair the cause or load the corrections, then measure as many poses again and diagnose them"
        found.append(Step(f"Confirm: {repair}. Only noise should be left."))
    return found


def calibration_steps(c: Calibration) -> list[Step]:
    """What to do after a calibration."""
    if c.model.doubt:
        return [SETTLE]
    if c.explained and lost(c):
        return [MEASURE]
    cause = Step("The causes of the errors that are left:", "gtpin diagnose DATASET -o diagnosis")
    judged = c.explained and not cannot_judge(c)
    return [*([] if judged else [cause]), *geometry_steps(c.model, c.explained)]


def check_steps(check: HealthCheck) -> list[Step]:
    """What to do after a check against an earlier model."""
    if check.verdict == "none":
        return [Step("Use the earlier model further.")]
    found = Step(f"A program, corrected for the changes too{beside(check.model)}:", PROGRAM)
    again = (
        "Calibrate again: measure many poses, and diagnose them. This also distinguishes the changes. Poses to choose:"
    )
    return [*([found] if check.causes and check.verdict == "explained" else []), replace(MEASURE, words=again)]


def beside(model: Model) -> str:
    """Which effects corrected commands leave out, and in what frame they hold, as an insertion; empty for none."""
    left = [named(active.effect, active.site) for active in model.effects if active.site in NOT_THE_MACHINE]
    mean = " (in the frame's mean over the measurements, not that at their start)" if movers(model) else ""
    return f" of the machine, without {joined(left)}{mean}" if left else ""


def geometry_steps(model: Model, explained: bool, folder: str = "DIR", words: str = "") -> list[Step]:
    """The commands that write a calibrated geometry; its parameters are only right where it explains the data.

    ``folder``: of its model. ``words``: what to say of it.
    """
    found = [Step(f"The calibrated geometry for other programs{words}:", f"gtpin export {folder} -o corrected.urdf")]
    if explained and chain_of(model.robot):
        found.append(Step("What to add to the controller's table:", f"gtpin export {folder} -o dh.csv --format dh"))
    return found


def _geometry(d: Diagnosis) -> tuple[str, str, float]:
    """The folder of the geometry that is nearest to the machine where a program has the geometry alone, what to say of it,
    and its error at left-out poses, m: that of the model with the causes, or that which was calibrated without them."""
    if not d.model.effects or (of := d.gap.of_positions) is None:
        return "DIR", "", np.inf
    before, own = of.before, _left(d, ())
    folder, error = ("DIR/baseline", before) if before < NEARER * own else ("DIR", own)
    other = f", calibrated without the causes; that of DIR: {length(own)}"
    words = f" ({length(error)} at left-out poses{other if folder != 'DIR' else ', without the causes'})"
    return folder, words, error


def _left(d: Diagnosis, held: Collection[str]) -> float:
    """The error at left-out poses, m, of the model's geometry with the effects ``held`` alone; 0 where it is not known."""
    if (of := d.gap.of_positions) is None:
        return 0.0
    rows = d.dataset.take(~np.isin(d.dataset.row, d.set_aside_rows))
    names = [active.name for active in d.model.effects if active.name not in held]
    with unheard():
        return float(np.hypot(of.after, lacks(d.model, names, rows.q, rows.covariates)))


def sure_corrections(d: Diagnosis) -> list[str]:
    """Certain causes that a controller with the calibrated geometry can correct, with tables for single actuators that
    ``gtpin export`` writes."""
    sure = {(c.effect, c.site) for c in d.causes if c.probability >= SURE}
    kept = [active for active in correctable(d.model) if (active.effect.id, active.site) in sure]
    return [named(active.effect, active.site) for active in kept]
