"""Keeps the scores of finished blind checks of arms and loops for docs/blind.md: python chains.py FOLDER...

Each FOLDER is what ``gtpin blind --robot ROBOT -o FOLDER`` wrote. Keeps the scores in docs/figures/chains.json;
``python examples/pages/refresh.py`` makes the page's table of it.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

RECORD = Path(__file__).parents[2] / "docs" / "figures" / "chains.json"
KEPT = ("cases", "failures", "figures")


def score(folder: Path) -> tuple[str, dict[str, object]]:
    """The robot's name, and what the page needs of its ``score.json``."""
    found = json.loads((folder / "score.json").read_text(encoding="utf-8"))
    return Path(found["check"]["robot"]).stem, {**{key: found[key] for key in KEPT}, "seed": found["check"]["seed"]}


def main(folders: list[Path]) -> None:
    kept = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.exists() else {}
    RECORD.write_text(json.dumps(kept | dict(map(score, folders)), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("give the folders of finished blind checks: python chains.py FOLDER...")
    main([Path(name) for name in sys.argv[1:]])
