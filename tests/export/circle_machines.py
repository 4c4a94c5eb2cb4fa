"""Machines whose truth is known, measured by a tracker that stood anywhere with a target 71 mm off the tool.

The Gantry-Tau and the delta are the tests' own closures, the arm is Pinocchio's forward kinematics, the five-bar closed form.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import closures
import numpy as np
import pinocchio as pin
from by_pinocchio import placed
from scipy.spatial.transform import Rotation

import gtpin

Floats = np.ndarray
Poses = tuple[Floats, Floats]

TARGET = np.array([0.012, -0.034, 0.061])
"""The reflector in the frame of the tool, m."""
NOISE, TOLERANCE, POSES, NEW = 1.5e-5, 5e-4, 200, 400
STOOD = Rotation.from_rotvec([0.1, -0.2, 2.1]), np.array([2.3, -1.1, 0.4])
PLAY, WAVE, PERIOD = 6e-5, 8e-5, 0.05
"""Half width of a backlash, and amplitude of a periodic error, at the first drive, m and rad; its period, m."""
LOW, HIGH = np.array([-2.5, -2.4, 0.4, -2.5, 0.4, -2.5]), np.array([2.5, -0.3, 2.2, 2.5, 2.2, 2.5])
"""Commands of the arm: elbow and wrist are away from where they are straight."""
FIVE_BAR = (0.3, 0.4, 0.1, 0.45)
"""Links, half the distance of the drives, and the tool on the left far link of the five-bar of docs/own_machine.md, m."""


@dataclass(frozen=True)
class Machine:
    """Poses T (N, 3), R (N, 3, 3) of the tool at commands, base frame: of the machine and of the nominal robot."""

    name: str
    robot: str
    poses: Callable[[Floats], Poses]
    nominal: Callable[[Floats], Poses]
    commands: Callable[[np.random.Generator, int], Floats]
    effect: str
    rods: bool

    def actual(self, q: Floats, approach: Floats) -> Floats:
        """The commands at which a machine without effects has the same poses; ``approach`` (N,)."""
        q = q.copy()
        if self.effect == "backlash":
            q[:, 0] += PLAY * approach
        elif self.effect == "rack_periodic":
            q[:, 0] += WAVE * np.sin(2.0 * np.pi * q[:, 0] / PERIOD + 0.3)
        return q

    def tool(self, q: Floats, approach: Floats) -> Floats:
        """(N, 3) where the tool of the machine really is, base frame, m."""
        return self.poses(self.actual(q, approach))[0]

    def dataset(self, rng: np.random.Generator, folder: Path) -> gtpin.Dataset:
        """What the tracker read. Where the target sits is known of robots with rods alone, which can't identify it."""
        q, approach = self.commands(rng, POSES), rng.choice([-1.0, 1.0], POSES)
        T, R = self.poses(self.actual(q, approach))
        seen = STOOD[0].apply(T + R @ TARGET) + STOOD[1] + NOISE * rng.standard_normal(T.shape)
        n = q.shape[1]
        names = ["pose", *(f"q{i + 1}" for i in range(n)), "x", "y", "z", *(f"approach{i + 1}" for i in range(n))]
        rows = np.column_stack([q, seen, np.tile(approach[:, None], n)])
        lines = [",".join([f"p{i}", *map(repr, map(float, row))]) for i, row in enumerate(rows)]
        (folder / "poses.csv").write_text("\n".join([",".join(names), *lines]) + "\n", encoding="utf-8")
        common = f'position_sigma = {NOISE}\nframe = "free"\n'
        if self.rods:
            head = f'schema = "gtpin-dataset/2"\nrobot = "{self.robot}"\n[[instrument]]\nname = "tracker"\nkind = "tracker"\n'
            toml = f'{head}file = "poses.csv"\n{common}target = {TARGET.tolist()}\n'
        else:
            toml = f'schema = "gtpin-dataset/1"\nrobot = "{self.robot}"\n[instrument]\n{common}target = "free"\n'
        (folder / "dataset.toml").write_text(toml, encoding="utf-8")
        return gtpin.Dataset.read(folder)


def of_rods(name: str, effect: str, rng: np.random.Generator) -> Machine:
    plain = closures.nominal(name)
    real = plain.off({key: size * rng.standard_normal() for key, size in plain.parameters().items()})

    def follow(machine: closures.Closures) -> Callable[[Floats], Poses]:
        return lambda q: machine.follow(q, 0.02)

    def commands(rng: np.random.Generator, count: int) -> Floats:
        return plain.in_range(rng, count, 0.7)

    return Machine(name, name, follow(real), follow(plain), commands, effect, True)


def arm(name: str, effect: str, rng: np.random.Generator) -> Machine:
    plain = pin.buildModelFromXML(gtpin.load_robot(name).description.xml)
    real, tool = plain.copy(), plain.getFrameId("tool0")

    def drawn() -> pin.SE3:
        return pin.SE3(pin.exp3(rng.normal(0.0, TOLERANCE, 3)), rng.normal(0.0, TOLERANCE, 3))

    for joint in range(1, real.njoints):
        real.jointPlacements[joint] = real.jointPlacements[joint] * drawn()
    real.frames[tool].placement = real.frames[tool].placement * drawn()

    def commands(rng: np.random.Generator, count: int) -> Floats:
        found: list[Floats] = []
        while len(found) < count:
            row = rng.uniform(LOW, HIGH)
            J = pin.computeFrameJacobian(plain, plain.createData(), row, tool)
            if np.linalg.svd(J, compute_uv=False)[-1] > 0.03:  # next to a singular posture a program can't be corrected
                found.append(row)
        return np.array(found)

    return Machine(name, name, lambda q: placed(real, q), lambda q: placed(plain, q), commands, effect, False)


def in_plane(q: Floats, far: Floats, near: Floats, tool: Floats) -> Poses:
    """Poses of a point on the left far link, by where two circles meet; ``tool``: along the link and across it."""
    angles = q + np.array([2.2, 0.9416])
    elbows = np.array([[-FIVE_BAR[2], 0.0], [FIVE_BAR[2], 0.0]]) + near[:, None] * np.stack(
        [np.cos(angles), np.sin(angles)], axis=2
    )
    between = elbows[:, 1] - elbows[:, 0]
    apart = np.linalg.norm(between, axis=1, keepdims=True)
    ahead, along = between / apart, (far[0] ** 2 - far[1] ** 2 + apart**2) / (2.0 * apart)
    up = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    link = (along * ahead + np.sqrt(far[0] ** 2 - along**2) * up) / far[0]
    across = np.stack([-link[:, 1], link[:, 0]], axis=1)
    at = elbows[:, 0] + tool[0] * link + tool[1] * across
    o = np.zeros(len(q))
    R = np.stack(
        [np.stack([v[:, 0], w, v[:, 1]], axis=1) for v, w in ((link, o), (0.0 * link, o + 1.0), (across, o))], 2
    )
    return np.stack([at[:, 0], o, at[:, 1]], axis=1), R


def five_bar(file: Path, effect: str, rng: np.random.Generator) -> Machine:
    """The dimensions in the plane were drawn; the tool's place on its link too."""
    page = (Path(__file__).parents[2] / "docs" / "own_machine.md").read_text(encoding="utf-8")
    (text,) = re.findall(r'f"""(<robot name="five_bar">.*?</robot>)"""', page, re.DOTALL)
    for name, size in zip(("LENGTH", "FAR", "HALF_BASE", "TOOL"), FIVE_BAR, strict=True):
        text = text.replace("{-" + name + "}", str(-size)).replace("{" + name + "}", str(size))
    file.write_text(text, encoding="utf-8")
    near, far, _, out = FIVE_BAR
    drawn = [np.array([size, size]) + rng.normal(0.0, TOLERANCE, 2) for size in (far, near)]
    tool = np.array([out, 0.0]) + rng.normal(0.0, TOLERANCE, 2)

    def commands(rng: np.random.Generator, count: int) -> Floats:
        return rng.uniform(-0.6, 0.6, (count, 2))

    plain = (np.array([far, far]), np.array([near, near]), np.array([out, 0.0]))
    return Machine(
        "five_bar",
        str(file),
        lambda q: in_plane(q, *drawn, tool),
        lambda q: in_plane(q, *plain),
        commands,
        effect,
        False,
    )


def off(found: Floats, true: Floats) -> float:
    """Root mean square distance (N, 3), m, after the best rigid motion: where the tracker stood was not known."""
    a, b = found - found.mean(axis=0), true - true.mean(axis=0)
    turn, _ = Rotation.align_vectors(b, a)
    return float(np.sqrt(((turn.apply(a) - b) ** 2).sum(axis=1).mean()))


@dataclass(frozen=True)
class Journey:
    """A machine, the model that its data led to, and new commands with directions of approach."""

    machine: Machine
    model: gtpin.Model
    q: Floats
    approach: Floats


@cache
def journey(name: str, effect: str, folder: Path) -> Journey:
    """The way of a user: a measured machine, calibrated, or diagnosed where it has an effect."""
    rng = np.random.default_rng([len(name), len(effect)])
    if name == "five_bar":
        machine = five_bar(folder / "five_bar.urdf", effect, rng)
    else:
        machine = (arm if name.startswith("ur") else of_rods)(name, effect, rng)
    dataset = machine.dataset(rng, folder)
    model = gtpin.diagnose(dataset).model if effect else gtpin.calibrate(dataset).model
    return Journey(machine, model, machine.commands(rng, NEW), rng.choice([-1.0, 1.0], NEW))
