"""How often a cause is named where there is none, beside the rate that was asked for: a table of docs/diagnosis.md.

Machines without an effect, but with noise and with a repeatability of their own, are measured at few and at many poses,
by instruments that declare their sigmas and by such that don't. ``python examples/pages/refresh.py --measure false_alarms``
measures the table of the page again.
"""

from __future__ import annotations

import pandas as pd
from scipy.stats import beta

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.recipe import SimulatedNoise

RATES = (0.3, 0.1, 0.03, 0.01)
"""Asked for, the largest first: what is silent at one of them is silent at the smaller ones."""
KINDS = tuple((poses, declared) for poses in (60, 220, 1000) for declared in (True, False))
SEEDS = 7_000_000
"""From here on nothing else draws its machines."""


def jobs(machines: int) -> list[dict[str, object]]:
    """Which machines are diagnosed."""
    return [{"poses": p, "declared": d, "machine": i} for p, d in KINDS for i in range(machines)]


def measured(poses: int, declared: bool, machine: int) -> list[dict[str, float]]:
    """Smallest of the rates at which a diagnosis of a machine without an effect is not silent; infinite for none."""
    noise = SimulatedNoise(declared=declared)
    case = make_case(SEEDS + machine, n_effects=0, poses=poses, held_out=1, noise=noise, background=False)
    smallest = float("inf")
    for rate in RATES:
        if gtpin.diagnose(case.dataset, false_alarm=rate).verdict == "none":
            break
        smallest = rate
    return [{"smallest": smallest}]


def bound(alarms: int, machines: int) -> float:
    """Upper 97.5 % bound of a rate (Clopper and Pearson)."""
    return float(beta.ppf(0.975, alarms + 1, machines - alarms)) if alarms < machines else 1.0


def table(records: pd.DataFrame) -> str:
    """Alarms by rate, with bounds; data with the same counts share a row."""
    lines = [
        "| poses, and noise |" + "".join(f" `--false-alarm {rate:g}` |" for rate in RATES),
        "|---|" + "---|" * len(RATES),
    ]
    shared: dict[str, list[str]] = {}
    for (poses, declared), rows in records.groupby(["poses", "declared"], sort=False):
        counts = [int((rows["smallest"].astype(float) <= rate).sum()) for rate in RATES]
        told = "".join(f" {n} of {len(rows)} (below {bound(n, len(rows)):.3f}) |" for n in counts)
        shared.setdefault(told, []).append(f"{poses:,} {'declared' if declared else 'not declared'}")
    return "\n".join([*lines, *(f"| {', '.join(data)} |{told}" for told, data in shared.items())])


if __name__ == "__main__":
    print(table(pd.DataFrame([{**job, **row} for job in jobs(3) for row in measured(**job)])))
