"""The blind check of every machine but the Gantry-Tau, for docs/blind.md: python scores.py FOLDER [CASES [SEED]].

Writes docs/figures/machines.json; ``python examples/pages/refresh.py`` makes the page's table of it.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

MACHINES = ("tau", "gantry_tau_6dof", "stewart", "linear_delta", "stewart_jugglebot")
RECORD = Path(__file__).parents[2] / "docs" / "figures" / "machines.json"
KEPT = ("cases", "check", "failures", "figures")


def score(machine: str, folder: Path, cases: int, seed: int) -> dict[str, object]:
    """What the page needs of a machine's ``score.json``."""
    asked = ["--robot", machine, "--cases", str(cases), "--seed", str(seed), "-o", str(folder / machine)]
    subprocess.run([sys.executable, "-m", "gtpin", "blind", *asked], check=True, stdout=subprocess.DEVNULL)
    found = json.loads((folder / machine / "score.json").read_text(encoding="utf-8"))
    return {key: found[key] for key in KEPT}


def main(folder: Path, cases: int, seed: int) -> None:
    found = {machine: score(machine, folder, cases, seed) for machine in MACHINES}
    RECORD.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("give a folder for the checks: python scores.py FOLDER [CASES [SEED]]")
    numbers = [int(word) for word in sys.argv[2:]]
    main(Path(sys.argv[1]), *(numbers + [60, 0][len(numbers) :]))
