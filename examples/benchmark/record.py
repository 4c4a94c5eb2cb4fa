"""Scores the answers of all rivals, for the tables of docs/benchmark.md.

    python examples/benchmark/record.py SET ANSWERS      # writes docs/figures/benchmark.json
    python examples/pages/refresh.py                    # the page from it

SET is what ``gtpin benchmark make`` wrote, ANSWERS has a folder for each rival.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gtpin.blind.benchmark.public_set import PublicSet
from gtpin.blind.benchmark.score import Scored, figures, score_answers

RECORD = Path(__file__).parents[2] / "docs" / "figures" / "benchmark.json"
RIVALS = (
    "diagnosis",
    "best_single",
    "largest_score",
    "lasso",
    "sindy",
    "ridge",
    "classifier",
    "gaussian_process",
    "geometry_only",
)
"""Those that answer all cases."""
GEOMETRIES = ("geometry_only", "mujoco_sysid", "figaroh", "gaussian_process", "ridge", "diagnosis")
"""Those that are compared on serial arms alone."""
ARMS = "ur5-tracker"


def record(public: PublicSet, folder: Path, answers: Path) -> dict[str, Any]:
    """The figures of all rivals that have answered."""
    scored = {
        rival: score_answers(public, folder, answers / rival)
        for rival in (*RIVALS, *GEOMETRIES)
        if (answers / rival).is_dir()
    }
    arms = {rival: {n: c for n, c in found.items() if n.startswith(ARMS)} for rival, found in scored.items()}
    blocks = {block.name: block.cases for block in public.blocks}
    return {
        "plant": public.plant,
        "blocks": blocks,
        "rivals": {rival: _figures(scored[rival]) for rival in RIVALS if rival in scored},
        "by_block": {
            rival: {b: _figures({n: c for n, c in found.items() if n.startswith(f"{b}-")}) for b in blocks}
            for rival, found in scored.items()
            if rival in RIVALS
        },
        "named": {
            rival: {name: list(case.judged.said.names) if case.judged.said else None for name, case in found.items()}
            for rival, found in scored.items()
            if rival in RIVALS
        },
        "arms": {rival: _figures(arms[rival]) for rival in GEOMETRIES if rival in arms},
    }


def _figures(scored: Mapping[str, Scored]) -> dict[str, Any]:
    return {name: rate.to_json() for name, rate in figures(scored.values()).items()}


def main(folder: Path, answers: Path) -> None:
    found = record(PublicSet.read(), folder, answers)
    RECORD.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit("give the folder of the set and that of the answers: python record.py SET ANSWERS")
    main(Path(sys.argv[1]), Path(sys.argv[2]))
