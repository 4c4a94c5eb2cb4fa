"""Keeps the scores of finished blind checks of instruments for docs/blind.md: python instruments.py FOLDER...

Each FOLDER is what ``gtpin blind --instrument KIND -o FOLDER`` wrote. Keeps the scores in docs/figures/blind_instruments.json;
``python examples/pages/refresh.py`` makes the page's table of it.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

RECORD = Path(__file__).parents[2] / "docs" / "figures" / "blind_instruments.json"
KEPT = ("check", "cases", "failures", "figures", "by_instrument")


def score(folder: Path) -> tuple[str, dict[str, object]]:
    """The instruments' kinds, and what the page needs of the check's ``score.json``."""
    found = json.loads((folder / "score.json").read_text(encoding="utf-8"))
    return found["check"]["instruments"].replace(",", " + "), {key: found[key] for key in KEPT}


def main(folders: list[Path]) -> None:
    kept = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.exists() else {}
    RECORD.write_text(json.dumps(kept | dict(map(score, folders)), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("give the folders of finished blind checks: python instruments.py FOLDER...")
    main([Path(name) for name in sys.argv[1:]])
