"""Scores the answers of all rivals, for the tables of docs/benchmark.md.

    python examples/benchmark/record.py SET ANSWERS      # writes docs/figures/benchmark.json
    python examples/pages/refresh.py                    # the page from it

SET is what ``gtpin benchmark make`` wrote, ANSWERS has a folder for each rival.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from gtpin.bench.benchmark.answer import Scored, figures, geometric_mean, score_answers
from gtpin.bench.benchmark.public_set import PublicSet

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
ERROR = "error of prediction, units of the noise"


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
        "paired": {rival: _paired(scored[rival], scored["diagnosis"]) for rival in RIVALS if rival in scored},
        "by_block": {
            rival: {b: _figures({n: c for n, c in found.items() if n.startswith(f"{b}-")})[ERROR] for b in blocks}
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


def _paired(scored: Mapping[str, Scored], diagnosis: Mapping[str, Scored]) -> dict[str, Any]:
    """Geometric mean over cases of the ratio of two errors of prediction, with its bounds."""
    pairs = [(scored[name].error, diagnosis[name].error) for name in scored]
    return asdict(geometric_mean([a / b for a, b in pairs if a is not None and b is not None]))


def _figures(scored: Mapping[str, Scored]) -> dict[str, Any]:
    return {name: asdict(rate) for name, rate in figures(scored.values()).items()}


def main(folder: Path, answers: Path) -> None:
    found = record(PublicSet.read(), folder, answers)
    lines = (f" {json.dumps(key)}: {json.dumps(value)}" for key, value in found.items())
    RECORD.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit("give the folder of the set and that of the answers: python record.py SET ANSWERS")
    main(Path(sys.argv[1]), Path(sys.argv[2]))
