"""Where a machine is measured, in which order, under which conditions; and the dataset's files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio as pin
from machines import Array, Deviation, GantryTau, Tree, UnreachableError, rotations

REGIONS = {"whole": 0.5, "clusters": 0.17, "small": 0.13, "line": 0.1, "plane": 0.1}


@dataclass(frozen=True)
class Visits:
    """N visits in the order of time; ``travel`` (N, n): of each drive since it last turned round."""

    machine: GantryTau | Tree
    region: str
    pose: Array  # ids
    q: Array
    time: Array
    session: Array
    temp_frame: Array
    temp_link: Array
    payload: Array
    approach: Array
    travel: Array
    speed: Array
    station: Array  # of the instrument, base frame

    def __len__(self) -> int:
        return len(self.q)


@dataclass(frozen=True)
class Instrument:
    """Noise (1 sigma) and what is said of it."""

    position: float
    orientation: float | None
    declared: bool
    free: bool
    states_station: bool
    offset: Array | None  # of the target from the TCP, tool axes; the dataset then says target = "free"


def reaching(machine: GantryTau | Tree, q: Array, T: Array) -> Array:
    """Commands near ``q`` whose tool is at ``T``: damped Newton steps with differences."""
    nominal = np.zeros(len(machine.tolerance))
    for _ in range(12):
        around = np.concatenate([q[None], q + 1e-6 * np.eye(machine.n)])
        here, _ = machine.poses(around, nominal, Deviation())
        miss = T - here[0]
        J = (here[1:] - here[0]).T / 1e-6
        q = q + J.T @ np.linalg.solve(J @ J.T + 1e-7 * np.eye(3), miss)
    if np.any(q < machine.lower - 0.1) or np.any(q > machine.upper + 0.1):
        raise UnreachableError
    return q


def somewhere(
    machine: GantryTau | Tree, rng: np.random.Generator, count: int, share: float = 1.0, about: Array | None = None
) -> Array:
    """Random commands in a share of the travel about a middle; carts stay within the reach of their rods."""
    middle, half = 0.5 * (machine.lower + machine.upper), 0.5 * share * (machine.upper - machine.lower)
    if isinstance(machine, GantryTau):
        together = (middle if about is None else about) + half.mean() * rng.uniform(-1, 1, (count, 1))
        return np.clip(together + 0.25 * share * rng.uniform(-1, 1, (count, 3)), machine.lower, machine.upper)
    return np.clip(
        (middle if about is None else about) + half * rng.uniform(-1, 1, (count, machine.n)),
        machine.lower,
        machine.upper,
    )


def commands(machine: GantryTau | Tree, region: str, count: int, rng: np.random.Generator) -> Array:
    if region == "whole":
        return somewhere(machine, rng, count)
    if region == "clusters":
        middles = somewhere(machine, rng, max(4, count // 10))
        return np.concatenate([somewhere(machine, rng, 1, 0.03, middles[i % len(middles)]) for i in range(count)])
    about = somewhere(machine, rng, 1, 0.5)[0]
    if region == "small":
        return somewhere(machine, rng, count, 0.12, about)
    nominal = np.zeros(len(machine.tolerance))
    T = machine.poses(about[None], nominal, Deviation())[0][0]
    directions = np.linalg.qr(rng.normal(size=(3, 3)))[0][: 1 if region == "line" else 2]
    if machine.name == "five_bar":
        directions = np.array([[1.0, 0, 0], [0, 0, 1.0]])[: len(directions)]
    length = 0.1 if machine.name == "five_bar" else 0.25
    found = []
    for _ in range(20 * count):
        try:
            found.append(reaching(machine, about, T + length * rng.uniform(-1, 1, len(directions)) @ directions))
        except (UnreachableError, np.linalg.LinAlgError):
            continue
        if len(found) == count:
            return np.array(found)
    raise UnreachableError


def visits(machine: GantryTau | Tree, rng: np.random.Generator, *, moving: bool, poses: int, region: str) -> Visits:
    q = np.round(commands(machine, region, poses, rng), 9)
    nominal = np.zeros(len(machine.tolerance))
    T, _ = machine.poses(q, nominal, Deviation())
    again = int(poses * rng.choice([0.0, 0.1, 0.25], p=[0.35, 0.4, 0.25]))
    order = np.concatenate([rng.permutation(poses), rng.choice(poses, again, replace=False)])
    if again:
        order = rng.permutation(order)
    q, n = q[order], len(order)
    steps = np.diff(q, axis=0, prepend=machine.lower[None])
    approach = np.where(steps == 0, 1.0, np.sign(steps))
    travel = np.abs(steps)
    for k in range(1, n):
        travel[k] += np.where(approach[k] == approach[k - 1], travel[k - 1], 0.0)
    sessions = int(rng.choice([1, 2, 3, 4]))
    session = 1 + (np.arange(n) * sessions) // n
    time = np.cumsum(rng.uniform(20, 60, n)) + 5400.0 * (session - 1)
    hours = time / 3600.0
    temp_frame = (
        20
        + rng.uniform(-1, 2)
        + rng.uniform(0.3, 2.5) * np.sin(2 * np.pi * hours / rng.uniform(3, 9) + rng.uniform(0, 6))
    )
    temp_link = (
        temp_frame
        + rng.uniform(0.5, 4) * (1 - np.exp(-hours / rng.uniform(0.4, 1.5)))
        + 0.3 * np.sin(2 * np.pi * hours / 0.8)
    )
    most = {"gantry_tau": 20.0, "ur5": 5.0, "xarm7": 3.0, "five_bar": 2.0}[machine.name]
    payload = most * rng.choice([0.0, 0.5, 1.0], n) if rng.random() < 0.6 else np.zeros(n)
    speed = approach * rng.uniform(0.05, 0.3, (n, machine.n)) if moving else np.zeros((n, machine.n))
    away = np.array([*rng.normal(size=2), 0.0])
    station = T.mean(axis=0) + rng.uniform(2.5, 6) * away / np.linalg.norm(away) + [0, 0, rng.uniform(-0.5, 1)]
    return Visits(
        machine, region, order, q, time, session, temp_frame, temp_link, payload, approach, travel, speed, station
    )


def instrument(machine: GantryTau | Tree, rng: np.random.Generator, *, declared: bool) -> Instrument:
    position = float(np.exp(rng.uniform(np.log(1e-5), np.log(1e-4))))
    orientation = float(position / rng.uniform(0.15, 0.6)) if rng.random() < 0.6 else None
    offset = (
        rng.uniform(-0.03, 0.03, 3)
        if orientation is None and machine.name in ("ur5", "xarm7") and rng.random() < 0.25
        else None
    )
    return Instrument(position, orientation, declared, bool(rng.random() < 0.5), bool(rng.random() < 0.5), offset)


def true_poses(v: Visits, geometry: Array, deviation: Deviation, offset: Array | None) -> tuple[Array, Array]:
    if offset is not None:
        mounted = np.zeros((len(v), 6)) if deviation.tool is None else deviation.tool.copy()
        mounted[:, :3] += offset
        deviation = replace(deviation, tool=mounted)
    return v.machine.poses(v.q, geometry, deviation)


def write(
    folder: Path,
    v: Visits,
    i: Instrument,
    geometry: Array,
    deviation: Deviation,
    columns: set[str],
    rng: np.random.Generator,
) -> None:
    """The dataset; ``columns``: which groups of covariates were recorded."""
    T, R = true_poses(v, geometry, deviation, i.offset)
    F, f = np.eye(3), np.zeros(3)
    if i.free:  # the instrument's own frame: its origin is its station
        F = rotations(rng.normal(0, 1, (1, 3)) * [[0.02, 0.02, 1.5]])[0].T
        f = -F @ v.station
    T = T @ F.T + f + rng.normal(0, i.position, T.shape)
    header, table = ["pose", *(f"q{k + 1}" for k in range(v.machine.n)), "x", "y", "z"], [v.pose, *v.q.T, *T.T]
    if i.orientation is not None:
        R = rotations(rng.normal(0, i.orientation, (len(v), 3))) @ F @ R
        quaternions = np.array([pin.Quaternion(r).coeffs() for r in R])[:, [3, 0, 1, 2]]
        header += ["qw", "qx", "qy", "qz"]
        table += list((quaternions * np.where(quaternions[:, :1] < 0, -1, 1)).T)
    for name, values in (
        ("time", {"time": v.time}), ("session", {"session": v.session}), ("payload", {"payload": v.payload}),
        ("temperature", {"temp_frame": v.temp_frame, "temp_link": v.temp_link}),
        ("approach", {f"approach{k + 1}": v.approach[:, k] for k in range(v.machine.n)}),
        ("speed", {f"speed{k + 1}": v.speed[:, k] for k in range(v.machine.n)}),
    ):  # fmt: skip
        if name in columns:
            header += list(values)
            table += list(values.values())
    folder.mkdir(parents=True)
    rows = np.array(table).T[rng.permutation(len(v))]
    lines = [",".join([f"p{int(row[0])}", *(f"{x:.10g}" for x in row[1:])]) for row in rows]
    (folder / "poses.csv").write_text(",".join(header) + "\n" + "\n".join(lines) + "\n")
    text = 'schema = "gtpin-dataset/1"\n' + v.machine.dataset + "\n[instrument]\n"
    if i.declared:
        text += f"position_sigma = {i.position:.6g}\n" + (
            f"orientation_sigma = {i.orientation:.6g}\n" if i.orientation else ""
        )
    text += f'frame = "{"free" if i.free else "robot"}"\n' + ('target = "free"\n' if i.offset is not None else "")
    if i.states_station:
        text += f"station = {[round(float(x), 4) for x in F @ v.station + f]}\n"
    if "temperature" in columns:
        text += "\n[conditions]\nreference_temperature = 20.0\n"
    (folder / "dataset.toml").write_text(text)
    if isinstance(v.machine, Tree) and v.machine.text:
        (folder.parent / f"{v.machine.name}.urdf").write_text(v.machine.text)


def geometry_jacobian(v: Visits, i: Instrument, geometry: Array) -> tuple[Array, Array]:
    """Derivatives of the whitened readings by geometry (in tolerances), frame and target; the positions."""

    def read(g: Array) -> tuple[Array, Array]:
        return true_poses(v, g, Deviation(), i.offset)

    T0, R0 = read(geometry)
    columns = []
    for j, tolerance in enumerate(v.machine.tolerance):
        change = geometry.copy()
        change[j] += 0.01 * tolerance
        columns.append(difference(T0, R0, *read(change), i) / 0.01)
    if i.free:
        for axis in np.eye(3):
            columns.append(difference(T0, R0, T0 + 0.1 * axis, R0, i))
            turn = rotations(1e-5 * axis[None])[0]
            columns.append(difference(T0, R0, T0 @ turn.T, turn @ R0, i) * 1e4)
    if i.offset is not None:
        columns += [difference(T0, R0, T0 + 0.1 * R0[:, :, a], R0, i) for a in range(3)]
    return np.array(columns).T, T0


def difference(T0: Array, R0: Array, T: Array, R: Array, i: Instrument) -> Array:
    """Whitened change of the readings, flat."""
    rows = (T - T0) / i.position
    if i.orientation is not None:
        turns = np.array([pin.log3(b @ a.T) for a, b in zip(R0, R, strict=True)])
        rows = np.concatenate([rows, turns / i.orientation], axis=1)
    return rows.ravel()


def visible(J: Array, signal: Array) -> float:
    """RMS over the readings, in sigmas, of what a geometry within its tolerances leaves of a whitened signal."""
    reduced = signal - J @ np.linalg.solve(J.T @ J + np.eye(J.shape[1]), J.T @ signal)
    return float(np.sqrt(np.mean(reduced**2)))
