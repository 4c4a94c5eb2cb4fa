"""What is said of a cause whose covariate nobody recorded: a table of docs/diagnosis.md.

Machines with one effect each, energies log-uniform from 100 to 4,000, are measured without the columns that the effect
goes with. Run ``python examples/diagnosis/missing_covariates.py [MACHINES]`` (20 of each kind by default).
"""

from __future__ import annotations

import sys
import warnings
from collections import Counter

from joblib import Parallel, delayed

import gtpin
from gtpin.plant import make_case

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


def answer(effect: str, without: tuple[str, ...], seed: int) -> str:
    """What a diagnosis says of a machine with such an effect."""
    warnings.simplefilter("ignore", gtpin.GtpinWarning)  # of poses that a large effect makes look like gross errors
    case = make_case(SEEDS + seed, effects=[(effect, None)], energy=(100.0, 4000.0), held_out=1, without=without)
    found = gtpin.diagnose(case.dataset)
    truth = (effect, case.effects[0].site)
    if any(c.probability >= SURE and (c.effect, c.site) != truth for c in found.causes):
        return ANSWERS[0]
    if found.verdict in ("unknown", "none"):
        return found.verdict
    held = any((m.effect, m.site) == truth for c in found.causes for m in c.members)
    return ANSWERS[1] if held else ANSWERS[2]


def main() -> None:
    machines = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    print("| effect | columns missing |" + "".join(f" {words} |" for words in ANSWERS))
    print("|---|---|" + "---|" * len(ANSWERS))
    for number, (effect, without) in enumerate(KINDS):
        seeds = range(1000 * number, 1000 * number + machines)
        told = Counter(Parallel(n_jobs=-1)(delayed(answer)(effect, without, seed) for seed in seeds))
        print(
            f"| `{effect}` | {' '.join(f'`{name}`' for name in without)} |" + "".join(f" {told[a]} |" for a in ANSWERS),
            flush=True,
        )


if __name__ == "__main__":
    main()
