"""Which sign the differences in Jacobi's files have: python signs.py CSV... (the files that tsinghua.py reads).

Of target + difference and target - difference: the share that has no more than six decimals, and what a fitted geometry leaves.
Writes docs/figures/real_signs.json; docs/real_arms.md says what it shows.
"""

from __future__ import annotations

import json
import sys
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import tsinghua

import gtpin

RECORD = Path(__file__).parents[2] / "docs" / "figures" / "real_signs.json"
ROUNDED = 2e-10
"""What rounding of doubles of a metre leaves of a number in mm that has six decimals."""


def explained(table: pd.DataFrame, sign: float) -> dict[str, float]:
    """Share of readings with at most six decimals, and the root mean square error, mm, that a geometry leaves."""
    dataset = tsinghua.dataset_of(table, sign=sign)
    reading = 1e3 * dataset.position
    predicted = gtpin.calibrate(dataset).model.predict(dataset.q)
    return {
        "digits": float((np.abs(reading - reading.round(6)) < ROUNDED).mean()),
        "rms": float(1e3 * np.sqrt(((dataset.position - predicted.T) ** 2).sum(axis=1).mean())),
    }


def main(files: list[str]) -> None:
    found = {}
    for file in files:
        table = pd.read_csv(file)
        found[f"`{Path(file).stem}`"] = {
            "rows": len(table),
            "plus": explained(table, 1.0),
            "minus": explained(table, -1.0),
        }
    RECORD.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("give the files of the repository: python signs.py CSV...")
    warnings.simplefilter("ignore", gtpin.GtpinWarning)
    main(sys.argv[1:])
