"""Makes the figures of the pages in docs anew.

    python examples/pages/refresh.py                        # the pages from the records in docs/figures
    python examples/pages/refresh.py --measure false_alarms # first measure the records of a figure again (minutes)

A figure stands on a page between ``<!-- figures: NAME -->`` and ``<!-- end of figures -->``; what stands there is replaced.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from pathlib import Path

from benchmark_tables import TABLES as BENCHMARK
from figures import FIGURES, ROOT
from gallery import page as gallery
from installed import extras_table
from installed import table as installed_table
from scores import (
    blind_runs,
    chain_scores,
    instrument_scores,
    jugglebot,
    machine_scores,
    planted,
    planted_halves,
    real_causes,
    real_curves,
    real_kept,
    real_ladder,
    real_panda,
    real_plain,
    sealed_score,
    sealed_sentence,
    worlds,
)
from speed import arm_command_table, arm_table, command_table
from speed import table as speed_table

BLOCK = re.compile(r"(<!-- figures: (\w+) -->\n)(.*?)(<!-- end of figures -->)", re.DOTALL)
TABLES: dict[str, Callable[[], str]] = {
    **{figure.name: figure.table for figure in FIGURES},
    **BENCHMARK,
    "blind_runs": blind_runs,
    "gallery": gallery,
    "sealed_score": sealed_score,
    "sealed_sentence": sealed_sentence,
    "chain_scores": chain_scores,
    "machine_scores": machine_scores,
    "instrument_scores": instrument_scores,
    "jugglebot": jugglebot,
    "real_causes": real_causes,
    "real_curves": real_curves,
    "real_kept": real_kept,
    "real_ladder": real_ladder,
    "real_panda": real_panda,
    "real_plain": real_plain,
    "planted": planted,
    "planted_halves": planted_halves,
    "worlds": worlds,
    "installed": installed_table,
    "installed_extras": extras_table,
    "speed": speed_table,
    "speed_of_commands": command_table,
    "speed_of_arms": arm_table,
    "speed_of_arm_commands": arm_command_table,
}


def refreshed(page: str) -> str:
    """The text of a page with its figures as the records have them."""
    return BLOCK.sub(lambda found: f"{found[1]}{TABLES[found[2]]()}\n{found[4]}", page)


def pages() -> list[Path]:
    """The pages that have figures."""
    every = [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md"))]
    return [page for page in every if BLOCK.search(page.read_text(encoding="utf-8"))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--measure", choices=[figure.name for figure in FIGURES], help="measure this figure again first"
    )
    parser.add_argument("--machines", type=int, help="of each kind; as many as the page has where left out")
    chosen = parser.parse_args()
    for figure in FIGURES:
        if figure.name == chosen.measure:
            figure.measure(chosen.machines or figure.machines).to_csv(figure.record, index=False)
    for page in pages():
        text = page.read_text(encoding="utf-8")
        page.write_text(refreshed(text), encoding="utf-8")


if __name__ == "__main__":
    main()
