"""The blind check of every machine but the Gantry-Tau, for docs/machines.md: python scores.py FOLDER [CASES [SEED]]."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

MACHINES = ("tau", "gantry_tau_6dof", "stewart", "linear_delta", "stewart_jugglebot")
FIGURES = {
    "detected, E > 63": "detected, E > 63",
    "class holds the truth, E > 63": "class right, E > 63",
    "cause and site right, nothing else named, D > 63": "cause right, D > 63",
    "no effect: silent": "silent on nothing",
    "no false name with confidence, D <= 63": "no false name, D <= 63",
    "two effects: F1 of the set": "F1 of two",
    "taken out of the catalogue: unknown, where others leave more than 250": "taken out: unknown",
    "95 % interval of shrinkage covers": "shrinkage covered",
}


def told(row: dict[str, float]) -> str:
    """A rate with its 95 % bounds and what it is of."""
    if row["value"] is None:
        return "no case"
    bounds = "" if row["low"] is None else f" ({row['low']:.2f} to {row['high']:.2f})"
    return f"{row['value']:.2f}{bounds} of {row['of']}"


def main(folder: Path, cases: int, seed: int) -> None:
    print("| machine | failed | " + " | ".join(FIGURES.values()) + " |")
    print("|---" * (len(FIGURES) + 2) + "|")
    for machine in MACHINES:
        asked = ["--robot", machine, "--cases", str(cases), "--seed", str(seed), "-o", str(folder / machine)]
        subprocess.run([sys.executable, "-m", "gtpin", "blind", *asked], check=True, stdout=subprocess.DEVNULL)
        score = json.loads((folder / machine / "score.json").read_text(encoding="utf-8"))
        rows = {row["figure"]: row for row in score["figures"]}
        cells = [told(rows[name]) for name in FIGURES]
        print(f"| `{machine}` | {len(score['failures'])} of {cases} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    numbers = [int(word) for word in sys.argv[2:]]
    main(Path(sys.argv[1]), *(numbers + [60, 0][len(numbers) :]))
