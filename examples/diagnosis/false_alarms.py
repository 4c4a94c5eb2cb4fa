"""How often a cause is named where there is none, beside the rate that was asked for: a table of docs/diagnosis.md.

Machines without an effect, but with noise and with a repeatability of their own, are measured at few and at many poses,
by instruments that declare their sigmas and by such that don't. Run ``python examples/diagnosis/false_alarms.py
[MACHINES]`` (100 of each kind by default).
"""

from __future__ import annotations

import sys

from joblib import Parallel, delayed
from scipy.stats import beta

import gtpin
from gtpin.plant import make_case
from gtpin.plant.tracker import Noise

RATES = (0.3, 0.1, 0.03, 0.01)
"""Asked for, the largest first: what is silent at one of them is silent at the smaller ones."""
KINDS = tuple((poses, declared) for poses in (60, 220, 1000) for declared in (True, False))
SEEDS = 7_000_000
"""From here on nothing else draws its machines."""


def smallest_alarm(poses: int, declared: bool, number: int) -> float:
    """Smallest of the rates at which a diagnosis of a machine without an effect is not silent; infinite for none."""
    noise = Noise(declared=declared)
    case = make_case(SEEDS + number, n_effects=0, poses=poses, held_out=1, noise=noise, background=False)
    smallest = float("inf")
    for rate in RATES:
        if gtpin.diagnose(case.dataset, false_alarm=rate).verdict == "none":
            break
        smallest = rate
    return smallest


def bound(alarms: int, machines: int) -> float:
    """Upper 97.5 % bound of a rate (Clopper and Pearson)."""
    return float(beta.ppf(0.975, alarms + 1, machines - alarms)) if alarms < machines else 1.0


def main() -> None:
    machines = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    print("| poses | noise declared |" + "".join(f" {rate:g} |" for rate in RATES))
    print("|---|---|" + "---|" * len(RATES))
    for poses, declared in KINDS:
        found = Parallel(n_jobs=-1)(delayed(smallest_alarm)(poses, declared, i) for i in range(machines))
        counts = [sum(smallest <= rate for smallest in found) for rate in RATES]
        told = "".join(f" {n} of {machines} (below {bound(n, machines):.3f}) |" for n in counts)
        print(f"| {poses:,} | {'yes' if declared else 'no'} |{told}", flush=True)


if __name__ == "__main__":
    main()
