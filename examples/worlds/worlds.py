"""Draw the cases of a half and write them: ``python worlds.py FOLDER --seed N [--rods 40] [--arms 20] [--telescopes 0]``.

Each case is a folder NAME (a dataset of gtpin) and NAME.truth.json, of a tracker's cases NAME.truth.csv too: the poses without
noise at the commands that were left out (NAME/commands.csv). FOLDER/worlds.json tells mechanism, distance and energy, and
NAME.moved.npy, of a tracker's cases, how each effect moves the measured poses (for left.py).
"""

from __future__ import annotations

import argparse
import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import telescopes
from arms import ARMS, Arm
from energy import Absorption, Instrument, Ranges, Tracker
from mechanisms import MECHANISMS, Campaign, Machine, Mechanism
from motion import Array, Motion, Poses, seen
from numpy.typing import NDArray
from rods import GantryTau
from scipy.spatial.transform import Rotation

ENERGIES = (100.0, 300.0, 1000.0, 3000.0)
DISTANCES = (0.0, 0.3, 0.6, 1.0)
LARGEST = 1.5e-3  # m, rms at the TCP: no mechanism is made larger, whatever its energy
SEEN = 30.0  # an effect of less energy is in worlds.json only, not in the truth
LEFT_OUT = 15
Generator = np.random.Generator


@dataclass(frozen=True)
class Act:
    """One mechanism of a case."""

    mechanism: Mechanism
    distance: float
    energy: float


def campaign(machine: Machine, stops: int, rng: Generator) -> tuple[Campaign, list[str]]:
    """Stops in the order of time, eight of them at commands that were visited before, and their pose ids."""
    q = machine.draw(rng, stops)
    again = rng.choice(len(q), 8, replace=False)
    order = rng.permutation(len(q) + 8)
    q, ids = np.concatenate([q, q[again]])[order], np.concatenate([np.arange(len(q)), again])[order]
    N, n = q.shape
    time = np.cumsum(rng.uniform(50.0, 110.0, N))
    t = time / time[-1]
    heavy = (
        (0.0, 5.0, 12.0) if machine.sliding else (0.0, 1.0, 3.0) if machine.robot != "elbow_world" else (0.0, 3.0, 8.0)
    )
    payload = np.repeat(rng.choice(heavy, N // 9 + 1), 9)[:N]
    payload[:3] = heavy
    force = rng.normal(0.0, 60.0 if machine.sliding else 20.0, (N, 3)) if rng.uniform() < 0.5 else np.zeros((N, 3))
    warm = [20.0 + rng.uniform(2, 7) * (1 - np.exp(-5 * t)) + 2 * np.sin(7 * t + rng.uniform(0, 6)) for _ in range(2)]
    tension, wrench = machine.loads(q, payload, force)
    c = Campaign(
        q,
        rng.choice([-1.0, 1.0], (N, n)),
        rng.uniform(*machine.overrun, (N, n)),
        time,
        np.minimum((3 * t).astype(int), 2),
        np.round(warm[0] + rng.normal(0, 0.02, N), 3),
        np.round(warm[1] + rng.normal(0, 0.02, N), 3),
        payload,
        np.round(force, 2),
        tension,
        wrench,
    )
    return c, [f"p{k:03d}" for k in ids]


def instrument(machine: Machine, ranges: bool, rng: Generator) -> Instrument:
    if ranges:
        places = rng.uniform([0.3, -7.5, -1.2], [1.5, -1.0, 1.5], (4, 3))
        return Ranges(tuple(tuple(np.round(p, 4)) for p in places), float(np.round(rng.uniform(1e-5, 2e-5), 7)))
    sigma = float(np.exp(rng.uniform(np.log(1e-5), np.log(4e-5))))
    turning = float(np.round(rng.uniform(3e-5, 1e-4), 7)) if rng.uniform() < 0.75 else None
    free = bool(rng.uniform() < 0.3)
    turn = tuple(float(v) for v in rng.uniform(-1.5, 1.5, 3))
    return Tracker(machine.station, round(sigma, 7), turning, free, (turn[0], turn[1], turn[2]))


def site(machine: Machine, mechanism: Mechanism, rng: Generator) -> tuple[int, str]:
    if mechanism.sites == "each":
        k = int(rng.integers(len(machine.sites)))
        if mechanism.name == "joint_gives":
            k = int(rng.integers(1, 4))  # the first joint is vertical: nothing loads it
        if mechanism.name == "gaussian_cart":
            k = int(rng.integers(1, 3))  # the first cart has one rod: turning about its joint moves nothing
        return k, machine.sites[k]
    if mechanism.sites == "links":
        k = int(rng.integers(-1, len(machine.links)))
        return k, "arm" if k < 0 else machine.links[k]
    return -1, mechanism.sites


def covariates(c: Campaign, needed: set[str], rng: Generator) -> dict[str, Array]:
    """Recorded columns; each group that no mechanism of the case needs is left out once in seven times."""
    n = c.q.shape[1]
    groups: dict[str, dict[str, Array]] = {
        "time": {"time": np.round(c.time, 1)},
        "session": {"session": c.session + 1},
        "temp_frame": {"temp_frame": c.temp_frame},
        "temp_link": {"temp_link": c.temp_link},
        "payload": {"payload": c.payload},
        "approach": {f"approach{k + 1}": c.approach[:, k].astype(int) for k in range(n)},
        "speed": {f"speed{k + 1}": np.zeros(len(c.q)) for k in range(n)},
        "force": {f"f{axis}": c.force[:, k] for k, axis in enumerate("xyz")},
    }
    kept = {name: columns for name, columns in groups.items() if rng.uniform() > 1 / 7 or name in needed}
    return {name: values for columns in kept.values() for name, values in columns.items()}


def write(folder: Path, name: str, machine: Machine, acts: list[Act], ranges: bool, rng: Generator) -> dict[str, Any]:
    """Draw the case's machine, write the dataset and the truth; what worlds.json tells of it."""
    c, ids = campaign(machine, int(rng.integers(90, 121)), rng)
    gauge = instrument(machine, ranges, rng)
    absorption = Absorption(machine, gauge, c.q)
    found: list[tuple[str, str, Motion, float]] = []
    told: list[dict[str, Any]] = []
    for act in acts:
        k, where = site(machine, act.mechanism, rng)
        for effect, form, share in act.mechanism.forms(act.distance):
            shape = act.mechanism.shape(machine, c, k, form, rng)
            scaled, energy = absorption.scaled(shape, share * act.energy, LARGEST)
            found.append((effect, where, scaled, energy))
        told.append({"mechanism": act.mechanism.name, "distance": act.distance, "site": where, "asked": act.energy})
    needed = {need for act in acts for need in act.mechanism.needs}
    effects = save_case(folder, name, machine, c, ids, gauge, absorption, found, needed, rng)
    return {"robot": machine.robot, "instrument": type(gauge).__name__, "acts": told, "effects": effects}


def write_telescope(folder: Path, name: str, names: tuple[str, ...], rng: Generator) -> dict[str, Any]:
    """Draw and write an arm on a telescope, in which the parts that are named give way; what worlds.json tells of it.

    Each effect has its share of the energies; `noise` is how much larger rough joints make the variance of the readings.
    """
    machine = telescopes.machine(rng)
    c, ids = campaign(machine, 440 if rng.uniform() < 1 / 6 else 220, rng)
    c = telescopes.campaign(machine, c, rng)
    gauge = telescopes.instrument(machine, rng)
    absorption = Absorption(machine, gauge, c.q)
    found = telescopes.moved(machine, c, absorption, names, gauge.position_sigma, rng)
    needed = {need for part in names for need in telescopes.PARTS[part].needs}
    effects = save_case(folder, name, machine, c, ids, gauge, absorption, found, needed, rng)
    total = sum(effect["energy"] for effect in effects)
    for effect in effects:
        effect["share"] = round(effect["energy"] / total, 3)
    noise = 1.0 + sum(effect["energy"] for effect in effects if effect["effect"] == "unlisted_rough") / (3 * len(c.q))
    about = {"parts": names, "stages": len(machine.stages), "pseudo": machine.pseudo, "noise": round(noise, 3)}
    return {"robot": machine.robot, "instrument": type(gauge).__name__, "acts": [], "effects": effects} | about


def save_case(
    folder: Path,
    name: str,
    machine: Machine,
    c: Campaign,
    ids: list[str],
    gauge: Instrument,
    absorption: Absorption,
    moved: list[tuple[str, str, Motion, float]],
    needed: set[str],
    rng: Generator,
) -> list[dict[str, Any]]:
    """Draw geometry and noise, write dataset and truth; each effect, its site and energy."""
    found: list[dict[str, Any]] = []
    for effect, where, _, energy in moved:
        found.append({"effect": effect, "site": where, "energy": round(energy, 1)})
    truth = [t for t in found if t["energy"] >= SEEN]
    parts = [part for _, _, part, _ in moved]
    motion = absorption.still
    for part in parts:
        motion = motion.plus(part)
    g = np.clip(rng.standard_normal(len(machine.tolerance)), -2.5, 2.5) * 0.7 * machine.tolerance
    poses = machine.poses(c.q, g, motion)
    unknown = np.zeros(len(gauge.unknowns))
    if isinstance(gauge, Ranges):
        unknown = rng.normal(0.0, 2e-3, len(unknown))
    exact = gauge.read(poses, motion, unknown)
    data: dict[str, Any] = {"pose": ids}
    data |= {f"q{k + 1}": np.round(c.q[:, k], 6) for k in range(c.q.shape[1])}
    data |= covariates(c, needed, rng)
    table = pd.DataFrame(data)
    single = table["pose"].map(table["pose"].value_counts()) == 1
    out = np.zeros(len(table), bool)
    out[rng.choice(np.flatnonzero(single), LEFT_OUT, replace=False)] = True
    case = folder / name
    case.mkdir(parents=True)
    if isinstance(gauge, Ranges):
        head = write_ranges(case, gauge, table[~out], exact[0][~out], rng)
    else:
        head = write_tracker(case, gauge, table, exact, out, rng)
        save(exact_table(table[out], exact[0][out], exact[1][out]), folder / f"{name}.truth.csv", 10)
        station = np.array(machine.station)
        still = seen(machine.poses(c.q, g, absorption.still), absorption.still, station)
        away = [difference(seen(machine.poses(c.q, g, part), part, station), still) for part in parts]
        np.save(folder / f"{name}.moved.npy", np.array(away).reshape(-1, len(c.q), 6)[:, ~out])
    robot = machine.robot
    if isinstance(machine, Arm):
        robot = "robot.urdf"
        (case / robot).write_text(machine.urdf())
    (case / "dataset.toml").write_text(head.replace("ROBOT", robot))
    (folder / f"{name}.truth.json").write_text(json.dumps({"effects": truth}, indent=1) + "\n")
    return found


def difference(one: Poses, other: Poses) -> Array:
    """(N, 6) shifts, m, and rotation vectors, rad, of poses from others, base frame."""
    return np.hstack([one[0] - other[0], Rotation.from_matrix(one[1] @ other[1].transpose(0, 2, 1)).as_rotvec()])


def save(table: pd.DataFrame, file: Path, digits: int) -> None:
    table.to_csv(file, index=False, float_format=f"%.{digits}f", lineterminator="\n")


def exact_table(table: pd.DataFrame, p: Array, R: Array) -> pd.DataFrame:
    quaternion = Rotation.from_matrix(R).as_quat(scalar_first=True)
    result = pd.DataFrame({"pose": table["pose"].to_numpy()})
    result[["x", "y", "z"]], result[["qw", "qx", "qy", "qz"]] = p, quaternion
    return result


def write_tracker(
    case: Path, gauge: Tracker, table: pd.DataFrame, exact: tuple[Array, Array], out: NDArray[np.bool_], rng: Generator
) -> str:
    p = exact[0] + rng.normal(0.0, gauge.position_sigma, exact[0].shape)
    R = exact[1]
    if gauge.orientation_sigma is not None:
        R = Rotation.from_rotvec(rng.normal(0.0, gauge.orientation_sigma, p.shape)).as_matrix() @ R
    measured = exact_table(table, p, R).drop(columns="pose")
    if gauge.orientation_sigma is None:
        measured = measured[["x", "y", "z"]]
    save(pd.concat([table, measured], axis=1)[~out], case / "poses.csv", 9)
    save(table[out], case / "commands.csv", 9)
    sigma = f"orientation_sigma = {gauge.orientation_sigma!r}\n" if gauge.orientation_sigma is not None else ""
    place = "free" if gauge.free else "robot"
    if gauge.declared:
        sigma = f"position_sigma = {gauge.position_sigma!r}\n{sigma}"
    station = [0.0, 0.0, 0.0] if gauge.free else list(gauge.station)
    return (
        f'schema = "gtpin-dataset/1"\nrobot = "ROBOT"\n\n[instrument]\n{sigma}'
        f'frame = "{place}"\nstation = {station}\n\n[conditions]\nreference_temperature = 20.0\n'
    )


def write_ranges(case: Path, gauge: Ranges, table: pd.DataFrame, exact: Array, rng: Generator) -> str:
    read = exact + rng.normal(0.0, gauge.sigma, exact.shape)
    letters = "ABCD"[: len(gauge.stations)]
    rows = [table.assign(station=s, range=read[:, k]) for k, s in enumerate(letters)]
    save(pd.concat(rows), case / "ranges.csv", 9)
    places = ", ".join(f"{s} = {[float(v) for v in p]}" for s, p in zip(letters, gauge.stations, strict=True))
    return (
        'schema = "gtpin-dataset/2"\nrobot = "ROBOT"\n\n[[instrument]]\nname = "laser"\nkind = "range"\nfile = "ranges.csv"\n'
        f"sigma = {gauge.sigma!r}\nstations = {{ {places} }}\nstation_sigma = {gauge.station_sigma!r}\n\n"
        "[conditions]\nreference_temperature = 20.0\n"
    )


def deck(family: str, cases: int, rng: Generator) -> list[list[Act]]:
    """Acts of each case: all mechanisms in turn, distances and energies in turn; one in five has two, one in 15 none."""
    choices = [m for m in MECHANISMS if m.family in ("both", family)]
    order: list[Mechanism] = []
    while len(order) < 2 * cases:
        order += [choices[k] for k in rng.permutation(len(choices))]
    levels: dict[str, list[float]] = {m.name: [] for m in choices}

    def act(mechanism: Mechanism) -> Act:
        left = levels[mechanism.name]
        if not left:
            left += [float(d) for d in rng.permutation([d for d in DISTANCES if d >= mechanism.least])]
        return Act(mechanism, left.pop(), float(rng.choice(ENERGIES)))

    result = []
    for k in range(cases):
        count = 0 if k % 15 == 14 else 2 if k % 5 == 2 else 1
        chosen: list[Mechanism] = []
        while len(chosen) < count:
            nxt = order.pop()
            if nxt not in chosen:
                chosen.append(nxt)
        result.append([act(m) for m in chosen])
    return result


def make(folder: Path, seed: int, rods: int, arms: int, on_telescopes: int) -> None:
    """Write cases of the Gantry-Tau (one in eight with range readings), of arms, and of arms on telescopes."""
    folder.mkdir(parents=True)
    told: dict[str, dict[str, Any]] = {}
    for family, cases in (("rods", rods), ("arms", arms)):
        decked = deck(family, cases, np.random.default_rng([seed, len(family), cases, ord(family[0])]))
        for k, acts in enumerate(decked):
            rng = np.random.default_rng([seed, k, ord(family[0])])
            machine: Machine = GantryTau() if family == "rods" else ARMS[k % len(ARMS)]
            name = f"{family}{k:03d}"
            told[name] = write(folder, name, machine, acts, family == "rods" and k % 8 == 5, rng)
    for k in range(on_telescopes):
        name, names = f"telescopes{k:03d}", telescopes.ROUND[k % len(telescopes.ROUND)]
        told[name] = write_telescope(folder, name, names, np.random.default_rng([seed, k, ord("t")]))
    (folder / "worlds.json").write_text(json.dumps(told, indent=1) + "\n")


def digest(folder: Path, name: str) -> str:
    """First 12 digits of the SHA-256 of a case's files, of its truth too, in the order of their names."""
    files = sorted([*(folder / name).iterdir(), *folder.glob(f"{name}.truth.*")])
    return hashlib.sha256(b"".join(hashlib.sha256(f.read_bytes()).digest() for f in files)).hexdigest()[:12]


def main() -> None:
    parser = argparse.ArgumentParser(description="Draw and write cases of independent worlds.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--rods", type=int, default=40)
    parser.add_argument("--arms", type=int, default=20)
    parser.add_argument("--telescopes", type=int, default=0)
    given = parser.parse_args()
    make(given.folder, given.seed, given.rods, given.arms, given.telescopes)
    for case in sorted(p.name for p in given.folder.iterdir() if p.is_dir()):
        print(case, digest(given.folder, case))


if __name__ == "__main__":
    main()
