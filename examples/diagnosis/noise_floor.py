"""How far left-out poses are from the noise floor where the causes are right: the source of priors.silent and core_leaves.

Machines with no effect, one, or two are diagnosed. Of those whose causes are exactly the machine's own, the table has the
largest ratio of the position error on left-out poses, with the causes, to the noise floor; the largest share of the gap that
is left where this ratio is at least 1.05; and how many verdicts are ``unknown`` all the same.
``python examples/pages/refresh.py --measure noise_floor`` measures the table of docs/diagnosis.md again.
"""

from __future__ import annotations

import warnings

import pandas as pd

import gtpin
from gtpin.bench.simulator import make_case

SEEDS = 7_000
"""From here on each kind draws its machines."""


def jobs(machines: int) -> list[dict[str, object]]:
    """Which machines are diagnosed."""
    return [{"effects": effects, "machine": k} for effects in (0, 1, 2) for k in range(machines)]


def measured(effects: int, machine: int) -> list[dict[str, object]]:
    """The ratio, the share of the gap that is left, and whether what was named is just the machine's own."""
    case = make_case(SEEDS + 100 * effects + machine, n_effects=effects)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        found = gtpin.diagnose(case.dataset)
    truth = {(t.effect, t.site) for t in case.effects}
    right = {(c.effect, c.site) for c in found.causes} == truth
    left = 0.0 if found.gap.explained_fraction is None else 1.0 - found.gap.explained_fraction
    told = {"right": right, "unknown": found.verdict == "unknown", "left": left}
    return [{"causes": len(found.causes), "ratio": found.gap.after / found.gap.floor, **told}]


def table(records: pd.DataFrame) -> str:
    """The largest ratio without and with causes."""
    right = records[records["right"].astype(str) == "True"]
    lines = ["| named | machines | largest ratio | largest share left | `unknown` |", "|---|---|---|---|---|"]
    for words, rows in (("no cause", right[right["causes"] == 0]), ("causes", right[right["causes"] > 0])):
        far = rows[(rows["ratio"] >= 1.05) & (rows["causes"] > 0)]
        share = f"{far['left'].max():.2f}" if len(far) else ""
        unknown = (rows["unknown"].astype(str) == "True").sum()
        lines.append(f"| {words} | {len(rows)} | {rows['ratio'].max():.2f} | {share} | {unknown} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(table(pd.DataFrame([{**job, **row} for job in jobs(2) for row in measured(**job)])))
