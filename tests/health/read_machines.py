"""Machines of the plant, read on a later day by other instruments than a tracker. The readings are made here, by hand."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from checked_machines import commanded

import gtpin
from gtpin.bench.simulator import Case, measure_at

SIGMA = 1e-5
"""m: noise of every reading."""
STATIONS = {"A": (1.5, -2.0, 0.5), "B": (-1.0, 2.5, 0.3), "C": (2.0, 2.0, -0.8)}
"""Declared centres of draw wires, base frame, m; each is off by ``OFF``."""
OFF = np.array([0.05, -0.03, 0.02])
PLANES = {"X": 0, "Y": 1, "Z": 2}
"""Planes of dial gauges, each with an axis of the base frame as its normal; they are off by ``DOWN``, m."""
DOWN = 1e-3
HEAD = 'schema = "gtpin-dataset/2"\nrobot = "gantry_tau"\n[[instrument]]\nname = "{kind}s"\nkind = "{kind}"\n'


def later_read(
    folder: Path,
    case: Case,
    seed: int,
    kind: str,
    *,
    shift: dict[int, float] | None = None,
    reversal: dict[int, float] | None = None,
    poses: int = 30,
    sigma: bool = True,
) -> gtpin.Dataset:
    """The machine read again by ``range`` or ``plane``, three readings a pose; ``shift`` and ``reversal`` are by drive, m."""
    rng = np.random.default_rng([seed, 12])
    q, ways, commands = commanded(case, rng, poses, shift, reversal)
    silent = case.recipe.noise.model_copy(update={"position_sigma": 1e-9, "orientation_sigma": 1e-9})
    exact = replace(case, recipe=replace(case.recipe, noise=silent))
    T = measure_at(exact, commands, seed).position
    folder.mkdir(exist_ok=True)
    if kind == "range":
        seen = {name: np.linalg.norm(T - np.array(centre) - OFF, axis=1) for name, centre in STATIONS.items()}
        named, number = "station", "range"
        places = ", ".join(f"{name} = {list(centre)}" for name, centre in STATIONS.items())
        more = f"stations = {{ {places} }}\nstation_sigma = 0.1\n"
    else:
        seen = {name: T[:, axis] - DOWN for name, axis in PLANES.items()}
        named, number = "plane", "height"
        places = ", ".join(
            f"{name} = {{ point = [0, 0, 0], normal = {np.eye(3)[axis].tolist()} }}" for name, axis in PLANES.items()
        )
        more = f"planes = {{ {places} }}\n"
    lines = [f"pose,q1,q2,q3,{number},{named},approach1,approach2,approach3"]
    for name, values in seen.items():
        read = values + SIGMA * rng.standard_normal(poses)
        for i in range(poses):
            numbers = ",".join(repr(float(value)) for value in (*q[i], read[i]))
            lines.append(f"check{i},{numbers},{name},{','.join(repr(float(way)) for way in ways[i])}")
    (folder / f"{kind}s.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    declared = HEAD.format(kind=kind) + (f"sigma = {SIGMA}\n" if sigma else "") + more
    (folder / "dataset.toml").write_text(declared, encoding="utf-8")
    return gtpin.Dataset.read(folder)
