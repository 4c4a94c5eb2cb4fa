"""What is said of a cause whose covariate nobody recorded: a table of docs/diagnosis.md.

Machines with one effect each, energies log-uniform from 100 to 4,000, are measured without the columns that the effect
depends on. ``python examples/pages/refresh.py --measure missing_covariates`` measures the table of the page again.
"""

from __future__ import annotations

import warnings

import pandas as pd

import gtpin
from gtpin.bench.simulator import make_case

KINDS = (
    ("backlash", ("approach",)),
    ("servo_lag", ("speed",)),
    ("zero_shift", ("session",)),
    ("frame_shift", ("session",)),
    ("tracker_drift", ("time",)),
    ("thermal_links", ("temp_link",)),
    ("thermal_links", ("temp",)),
    ("thermal_track", ("temp_frame",)),
    ("thermal_track", ("temp",)),
    ("link_compliance", ("payload", "fx", "fy", "fz")),
    ("cart_compliance", ("payload", "fx", "fy", "fz")),
)
SEEDS = 8_000_000
"""From here on nothing else draws its machines."""
SURE = 0.95
ANSWERS = ("another cause, sure of it", "a class that holds it", "a class without it", "unknown", "none")
HEADS = ("wrong cause with confidence", "class holds the truth", "class without the truth", "unknown", "none")
"""The answers as the head of the table has them."""


def jobs(machines: int) -> list[dict[str, object]]:
    """Which machines are diagnosed."""
    return [
        {"effect": effect, "without": " ".join(without), "seed": 1000 * number + machine}
        for number, (effect, without) in enumerate(KINDS)
        for machine in range(machines)
    ]


def measured(effect: str, without: str, seed: int) -> list[dict[str, str]]:
    """What a diagnosis says of a machine with such an effect."""
    case = make_case(
        SEEDS + seed,
        effects=[(effect, None)],
        noncentrality=(100.0, 4000.0),
        held_out=1,
        without=tuple(without.split()),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)  # of poses that a large effect makes look like gross errors
        found = gtpin.diagnose(case.dataset)
    return [{"answer": answer(found, (effect, case.effects[0].site))}]


def answer(found: gtpin.Diagnosis, truth: tuple[str, str]) -> str:
    """One of ``ANSWERS``."""
    if any(c.probability >= SURE and (c.effect, c.site) != truth for c in found.causes):
        return ANSWERS[0]
    if found.verdict in ("unknown", "none"):
        return found.verdict
    held = any((m.effect, m.site) == truth for c in found.causes for m in c.members)
    return ANSWERS[1] if held else ANSWERS[2]


def table(records: pd.DataFrame) -> str:
    """Answers by effect and columns missing."""
    lines = [
        "| effect | columns missing |" + "".join(f" {words} |" for words in HEADS),
        "|---|---|" + "---|" * len(ANSWERS),
    ]
    for (effect, without), rows in records.groupby(["effect", "without"], sort=False):
        columns = " ".join(f"`{name}`" for name in str(without).split())
        told = "".join(f" {int((rows['answer'] == a).sum())} |" for a in ANSWERS)
        lines.append(f"| `{effect}` | {columns} |{told}")
    return "\n".join(lines)


if __name__ == "__main__":
    print(table(pd.DataFrame([{**job, **row} for job in jobs(2) for row in measured(**job)])))
