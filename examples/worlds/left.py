"""What the catalogue leaves of each true effect: ``python left.py FOLDER``, of a tracker's cases, added to FOLDER/worlds.json.

``left``: the least energy that another effect of gtpin, at any site, leaves of the effect's displacement; ``rival``: that one.
An unlisted effect of which the others leave little is nearly one of them.
"""

from __future__ import annotations

import argparse
import json
import warnings
from pathlib import Path

import numpy as np

import gtpin
from gtpin.bench.blind.difficulty import Difficulty


def main() -> None:
    parser = argparse.ArgumentParser(description="What the catalogue leaves of each true effect.")
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    warnings.simplefilter("ignore", gtpin.GtpinWarning)
    worlds = json.loads((folder / "worlds.json").read_text())
    for name, case in worlds.items():
        if not case["effects"] or not (file := folder / f"{name}.moved.npy").exists():
            continue
        dataset = gtpin.Dataset.read(folder / name)
        position, orientation = dataset.instrument.position_sigma, dataset.instrument.orientation_sigma
        sigma = np.array([position] * 3 + [orientation or np.inf] * 3, dtype=float)
        difficulty = Difficulty.of(dataset, sigma, gtpin.calibrate(dataset).model.geometry)
        for effect, moved in zip(case["effects"], np.load(file), strict=True):
            own = f"{effect['effect']}@{effect['site']}"
            others = {rival: best.left for rival, best in difficulty.left(moved).items() if rival != own}
            effect["rival"] = min(others, key=lambda rival: others[rival])
            effect["left"] = round(others[effect["rival"]], 1)
        print(name, case["effects"], flush=True)
    (folder / "worlds.json").write_text(json.dumps(worlds, indent=1) + "\n")


if __name__ == "__main__":
    main()
