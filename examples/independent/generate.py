"""Writes the datasets and, beside them, their truths: ``python generate.py FOLDER [--innocent 200] [--each 4] [--seed 1]``.

FOLDER/innocent/NNN and FOLDER/physics/NNN are datasets. FOLDER/truths.json says what is true of each: the kind, the answers
that count as true, and the size: RMS over the readings, in sigmas, of what a geometry within its tolerances can not follow.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import pinocchio
from machines import Array, Deviation, GantryTau, Tree, UnreachableError, machines
from measurement import (
    REGIONS,
    Instrument,
    Visits,
    difference,
    geometry_jacobian,
    instrument,
    true_poses,
    visible,
    visits,
    write,
)
from physics import KINDS, LARGEST, NEEDS_SESSIONS, UNLISTED, Case, Kind

SHARES = {"gantry_tau": 0.4, "ur5": 0.25, "five_bar": 0.15, "xarm7": 0.2}
GROUPS = ("time", "session", "temperature", "payload", "approach", "speed")


def drawn(rng: np.random.Generator, choices: dict[str, float]) -> str:
    p = np.array(list(choices.values()))
    return str(rng.choice(list(choices), p=p / p.sum()))


def measured(
    machine: GantryTau | Tree, rng: np.random.Generator, *, moving: bool, sessions: bool, whole: bool
) -> tuple[Visits, Array]:
    """Visits that the machine reaches, and its geometry, within twice the tolerances."""
    while True:
        poses = round(float(np.exp(rng.uniform(np.log(40), np.log(250)))))
        region = "whole" if whole else drawn(rng, REGIONS)
        geometry = machine.tolerance * np.clip(rng.normal(size=len(machine.tolerance)), -2, 2)
        try:
            v = visits(machine, rng, moving=moving, poses=poses, region=region)
            machine.poses(v.q, geometry, Deviation())
        except (UnreachableError, np.linalg.LinAlgError):
            continue
        if not sessions or v.session[-1] > 1:
            return v, geometry


def about(v: Visits, i: Instrument, columns: set[str]) -> dict[str, object]:
    return {
        "machine": v.machine.name, "region": v.region, "poses": len(set(v.pose.tolist())), "rows": len(v), "sigma": i.position,
        "orientation": i.orientation, "declared": i.declared, "frame": "free" if i.free else "robot",
        "target": i.offset is not None, "columns": sorted(columns),
    }  # fmt: skip


def case_of(v: Visits, rng: np.random.Generator) -> Case:
    nominal = np.zeros(len(v.machine.tolerance))
    T, R = v.machine.poses(v.q, nominal, Deviation())
    ahead, _ = v.machine.poses(v.q + 1e-6 * v.speed, nominal, Deviation())
    more = {"gantry_tau": 15.0, "five_bar": 1.5, "ur5": 4.0, "xarm7": 2.5}[v.machine.name]
    return Case(
        v, rng, v.machine.loads(v.q, v.payload), v.machine.loads(v.q, v.payload + more), T, R, (ahead - T) / 1e-6
    )


def innocent(
    folder: Path, known: dict[str, GantryTau | Tree], rng: np.random.Generator, number: int
) -> dict[str, object]:
    machine = known[drawn(rng, SHARES)]
    v, geometry = measured(machine, rng, moving=rng.random() < 0.15, sessions=False, whole=False)
    i = instrument(machine, rng, declared=number % 3 != 0)
    columns = {group for group in GROUPS if rng.random() < 0.75}
    write(folder, v, i, geometry, Deviation(), columns, rng)
    return {"kind": "innocent", "true": [], **about(v, i, columns)}


def faulty(
    folder: Path, known: dict[str, GantryTau | Tree], rng: np.random.Generator, kind: Kind, number: int
) -> dict[str, object]:
    while True:
        machine = known[drawn(rng, {name: SHARES[name] for name in KINDS[kind]})]
        moving = kind.__name__ == "wobbling_target" or rng.random() < 0.1
        v, geometry = measured(machine, rng, moving=moving, sessions=kind in NEEDS_SESSIONS, whole=rng.random() < 0.6)
        i = instrument(machine, rng, declared=number % 3 != 0)
        deviation, true = kind(case_of(v, rng))
        J, _ = geometry_jacobian(v, i, geometry)
        T0, R0 = true_poses(v, geometry, Deviation(), i.offset)
        size = float(np.exp(rng.uniform(np.log(1.2), np.log(30))))
        factor = 1e-7  # to the wanted size, in a few steps, as sizes may not be in proportion
        largest = 1.0 if true == ["target_shift@platform"] else LARGEST.get(kind, 1.0)
        try:
            for _ in range(4):
                T, R = true_poses(v, geometry, deviation.scaled(factor), i.offset)
                signal = difference(T0, R0, T, R, i)
                seen = visible(J, signal)
                if seen == 0.0 or factor > 1.0 or np.linalg.norm(T - T0, axis=1).max() > 0.03:
                    break
                size *= min(1.0, largest / (factor * size / seen))
                factor *= size / seen
            T, R = true_poses(v, geometry, deviation.scaled(factor), i.offset)
        except (UnreachableError, np.linalg.LinAlgError):
            continue
        moved = np.linalg.norm(T - T0, axis=1)
        if moved.max() < 0.02 and size > 1.0 and 0.9 < visible(J, difference(T0, R0, T, R, i)) / size < 1.1:
            break
    columns = {group for group in GROUPS if rng.random() < 0.85}
    write(folder, v, i, geometry, deviation.scaled(factor), columns, rng)
    return {
        "kind": kind.__name__, "listed": kind not in UNLISTED, "true": true, "size": size, "factor": factor,
        "position_rms": float(np.sqrt(np.mean(moved**2))), **about(v, i, columns),
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--innocent", type=int, default=200)
    parser.add_argument("--each", type=int, default=4, help="datasets of each kind of physics")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    share = Path(pinocchio.__file__).parents[4].joinpath("share/example-robot-data/robots")
    known = machines(share, Path(__file__).parents[2] / "urdf/gantry_tau.urdf")
    truths: dict[str, object] = {}
    jobs = [(f"innocent/{k:03}", None, k) for k in range(arguments.innocent)]
    for turn in range(
        arguments.each
    ):  # one of each kind, then the next of each: the first datasets already have every kind
        jobs += [(f"physics/{turn * len(KINDS) + k:03}", kind, turn * len(KINDS) + k) for k, kind in enumerate(KINDS)]
    for name, kind, number in jobs:
        rng = np.random.default_rng([arguments.seed, kind is not None, number])
        folder = arguments.folder / name
        truths[name] = (
            innocent(folder, known, rng, number) if kind is None else faulty(folder, known, rng, kind, number)
        )
    (arguments.folder / "truths.json").write_text(json.dumps(truths, indent=1))


if __name__ == "__main__":
    main()
