"""How far left-out poses are from the noise floor where the verdict is right: the source of SILENT and NAMED.

Machines with no effect, one, or two are diagnosed. Of those whose causes are the machine's own, the largest ratio of the
held-out position error with the causes in to the noise floor is printed. Run ``python examples/diagnosis/noise_floor.py
[MACHINES]`` (20 of each kind by default).
"""

from __future__ import annotations

import sys
import warnings

import gtpin
from gtpin.plant import make_case

SEEDS = 7_000
"""From here on each kind draws its machines."""


def ratio(number: int, effects: int) -> tuple[str, float] | None:
    """The verdict and the ratio; None where the causes are not the machine's."""
    case = make_case(SEEDS + 100 * effects + number, n_effects=effects)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        found = gtpin.diagnose(case.dataset)
    truth = {(t.effect, t.site) for t in case.effects}
    if found.verdict == "unknown" or not {(c.effect, c.site) for c in found.causes} <= truth:
        return None
    return ("no cause" if not found.causes else "causes"), found.gap.after / found.gap.floor


def main(machines: int) -> None:
    """Print the largest ratio without and with causes."""
    found = [r for effects in (0, 1, 2) for k in range(machines) if (r := ratio(k, effects))]
    for kind in ("no cause", "causes"):
        ratios = [value for verdict, value in found if verdict == kind]
        print(f"{kind}: {len(ratios)} machines, at most {max(ratios, default=float('nan')):.3f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
