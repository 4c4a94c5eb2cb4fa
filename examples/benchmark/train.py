"""Makes and measures the cases on which the classifier is trained: other seeds than those of the set.

    python examples/benchmark/train.py TRAINING [--cases N]

Writes TRAINING/BLOCK.npz for each machine and instrument: features, and the true effect, ``none`` or ``unknown``.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np

import gtpin
from gtpin.bench.benchmark.public_set import CASES, FILE, Block, PublicSet, make
from gtpin.threads import in_one_thread

HERE = Path(__file__).parent
for place in (HERE, HERE / "rivals"):
    if str(place) not in sys.path:
        sys.path.insert(0, str(place))

from classifier import NONE, UNKNOWN, features  # noqa: E402
from problem import Problem  # noqa: E402

OTHER = 1_000_003
"""Added to a block's seed."""
KINDS = ("one", "power", "none", "unlisted")


@in_one_thread
def measured(block: Block, count: int) -> tuple[list[dict[str, float]], list[str]]:
    """Features and labels of cases of a block; a case that can't be calibrated is left out."""
    other = block.model_copy(update={"seed": block.seed + OTHER, "cases": 2 * count})
    rows: list[dict[str, float]] = []
    labels: list[str] = []
    for draft in [draft for draft in other.drafts(FILE.parent, ()) if draft.kind in KINDS][:count]:
        with tempfile.TemporaryDirectory() as place, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            make(draft, Path(place))
            try:
                rows.append(features(Problem.of(Path(place) / CASES / draft.name)))
            except gtpin.GtpinError:
                continue
        labels.append(NONE if draft.kind == "none" else UNKNOWN if draft.kind == "unlisted" else draft.effects[0])
    return rows, labels


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("training", type=Path)
    parser.add_argument("--cases", type=int, default=100)
    chosen = parser.parse_args()
    chosen.training.mkdir(parents=True, exist_ok=True)
    for block in PublicSet.read().blocks:
        file = chosen.training / f"{block.name}.npz"
        if file.exists():
            continue
        rows, labels = measured(block, chosen.cases)
        names = sorted(set().union(*rows))
        X = np.array([[row.get(name, 0.0) for name in names] for row in rows])
        np.savez(file, X=X, names=np.array(names), labels=np.array(labels))
        print(block.name, len(rows), flush=True)


if __name__ == "__main__":
    main()
