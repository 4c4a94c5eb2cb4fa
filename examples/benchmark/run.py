"""Lets rivals answer the cases of a set that ``gtpin benchmark make`` has made.

    python examples/benchmark/run.py SET/cases ANSWERS [RIVAL ...] [--first N] [--training TRAINING]

Writes ANSWERS/RIVAL/NAME.json. A rival sees a case's folder and nothing else. Answers that are there are kept; a rival that
fails on a case leaves no answer, which counts as wrong.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import warnings
from pathlib import Path

from joblib import parallel_config

import gtpin
from gtpin.threads import in_one_thread

HERE = Path(__file__).parent
for place in (HERE, HERE / "rivals"):
    if str(place) not in sys.path:
        sys.path.insert(0, str(place))

RIVALS = (
    "diagnosis",
    "geometry_only",
    "gaussian_process",
    "largest_score",
    "best_single",
    "ridge",
    "lasso",
    "sindy",
    "classifier",
)
"""Those that run in gtpin's own environment; `figaroh_fit.py` and `mujoco_sysid.py` have commands of their own."""


@in_one_thread
def let_answer(rival: str, case: Path, answers: Path) -> None:
    """Write a rival's answer to a case, unless it is there."""
    file = answers / rival / f"{case.name}.json"
    if file.exists():
        return
    file.parent.mkdir(parents=True, exist_ok=True)
    with warnings.catch_warnings(), parallel_config(n_jobs=1):
        warnings.simplefilter("ignore")
        try:
            importlib.import_module(rival).answer(case).write(file)
        except gtpin.GtpinError as error:
            print(f"{rival} {case.name}: {error}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", type=Path)
    parser.add_argument("answers", type=Path)
    parser.add_argument("rivals", nargs="*", default=RIVALS)
    parser.add_argument("--training", type=Path, help="what train.py wrote, for the classifier")
    parser.add_argument("--first", type=int, help="only the first cases of each machine and instrument")
    chosen = parser.parse_args()
    if chosen.training:
        importlib.import_module("classifier").TRAINED = chosen.training
    cases = sorted(case for case in chosen.cases.iterdir() if case.is_dir())
    if chosen.first:
        cases = [case for case in cases if int(case.name.rsplit("-", 1)[1]) < chosen.first]
    for case in cases:
        for rival in chosen.rivals:
            let_answer(rival, case, chosen.answers)
        print(case.name, flush=True)


if __name__ == "__main__":
    main()
