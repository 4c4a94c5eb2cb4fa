"""How the answers to sealed cases move when a number of ``gtpin.diagnosis.priors`` is halved and doubled.

Cases are drawn as ``gtpin blind`` draws them, from a seed of their own. Data, calibration, outliers and noise are settled once
for each; hypotheses are then proposed and inferred with each number at its value, at half and at twice of it.
``python examples/pages/refresh.py --measure priors`` measures the table of docs/statistics.md again.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pandas as pd

import gtpin
from gtpin.bench.blind.draw import drafts, made
from gtpin.diagnosis.hypothesis import Scope
from gtpin.diagnosis.noise import SearchState, searchable_rows, settle
from gtpin.diagnosis.prepare import prepare
from gtpin.diagnosis.priors import PRIORS
from gtpin.diagnosis.propose import propose
from gtpin.diagnosis.verdict import Conclusion, infer
from gtpin.errors import GtpinError
from gtpin.robot.library import load_robot

SEED = 5_100
"""Nothing else draws its cases from it."""
VISIBLE = 63.0
"""Energy from which an effect is to be found, as docs/blind.md has it."""
VARIED = (
    "scale_spread",
    "unnamed",
    "third",
    "same",
    "related",
    "other",
    "departure",
    "modulation",
    "temperature",
)
"""Numbers that matter while hypotheses are compared."""
FACTORS = (0.5, 2.0)
FIGURES = ("found", "alone", "silent", "unknown", "false")


def jobs(machines: int) -> list[dict[str, object]]:
    """Which cases are inferred with which number changed; the first time with none."""
    return [{"case": case, "prior": name} for case in range(machines) for name in ("", *VARIED)]


def measured(case: int, prior: str) -> list[dict[str, object]]:
    """What is said of a case with a number halved and doubled, or with all as they are; nothing where it is refused."""
    found = _settled(case)
    if found is None:
        return []
    settled, scope, truth, kind = found
    rows = []
    for factor in FACTORS if prior else (1.0,):
        priors = replace(PRIORS, **{prior: factor * getattr(PRIORS, prior)}) if prior else PRIORS
        said = _inferred(settled, replace(scope, priors=priors))
        rows.append({"factor": factor, **_said(said, truth, kind)})
    return rows


@lru_cache(maxsize=1)
def _settled(case: int) -> tuple[SearchState, Scope, dict[tuple[str, str], float], str] | None:
    """A case before its hypotheses are compared, with its truth and kind; None where it is refused."""
    draft = list(drafts(case + 1, SEED, without=("measurement_delay",)))[case]  # newer than the record
    drawn = made(draft)
    robot = load_robot(drawn.dataset.robot_reference)
    scope = Scope.of(gtpin.catalogue(), (), 0.01, robot)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        try:
            prepared = prepare(drawn.dataset, robot)
            rows = searchable_rows(prepared, scope.priors)
            settled = settle(prepared, rows, scope, np.random.default_rng(0))
        except GtpinError:
            return None
    return settled, scope, {(t.effect, t.site): t.noncentrality for t in drawn.effects}, draft.kind


def _inferred(settled: SearchState, scope: Scope) -> Conclusion:
    return infer(replace(settled, hypotheses=propose(settled.hypotheses.design, scope)))


def _said(found: Conclusion, truth: dict[tuple[str, str], float], kind: str) -> dict[str, object]:
    """Right or wrong by five measures; empty where one does not apply."""
    classes = [{m.hypothesis.place for m in members} for members in found.classes.values()]
    sure = {cause.place for cause in found.sure()}
    clear = [place for place, energy in truth.items() if energy > VISIBLE]
    single = kind in ("one", "power") and len(clear) == 1
    return {
        "found": int(any(clear[0] in members for members in classes)) if single else "",
        "alone": int(sure == set(clear)) if single else "",
        "silent": int(found.verdict == "none") if kind == "none" else "",
        "unknown": int(found.verdict == "unknown") if kind == "unlisted" and clear else "",
        "false": int(bool(sure - set(truth))),
    }


def table(records: pd.DataFrame) -> str:
    """Share of the cases in which each measure holds, by number and factor; values with the same counts share a row."""
    heads = ("effect in a class", "effect alone", "silent on none", "unlisted called unknown", "a false cause sure")
    lines = ["| number, and its value | " + " | ".join(heads) + " |", "|---|" + "---|" * len(heads)]
    shared: dict[tuple[str, ...], list[str]] = {}
    for name in ("", *VARIED):
        for factor in (1.0,) if not name else FACTORS:
            rows = records[(records["prior"] == name) & (records["factor"].astype(float) == factor)]
            label = "as they are" if not name else f"`{name}` {factor * getattr(PRIORS, name):g}"
            shared.setdefault(tuple(_share(rows[figure]) for figure in FIGURES), []).append(label)
    lines += [f"| {', '.join(labels)} | " + " | ".join(counts) + " |" for counts, labels in shared.items()]
    return "\n".join(lines)


def _share(values: pd.Series) -> str:
    known = pd.to_numeric(values, errors="coerce").dropna()
    return f"{int(known.sum())} of {len(known)}"
