"""Five-bars without ranges: a pose is in home's assembly, or there is none. The poses are those of two circles that cross."""

import pickle
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import label
from urdfs import crossing, joint, loop, own, robot_of, urdf

import gtpin
from gtpin.bench.simulator.simulate import TrueRobot
from gtpin.errors import GtpinWarning
from gtpin.kinematics.kinematics import Kinematics
from gtpin.robot.description import RobotDescription

Floats = np.ndarray
MARGIN = 1e-6
"""Distance from the limits of the closure, m, nearer than which a path may count as blocked."""


class FiveBar:
    """Links and base of random lengths, about 0.5 m, with the tip of the elbows' side ``side`` at home."""

    def __init__(self, seed: int, knees: tuple[int, int]) -> None:
        rng = np.random.default_rng(seed)
        self.base, self.cranks = rng.uniform(0.1, 0.5), rng.uniform(0.2, 0.6, 2)
        self.links, self.signs = rng.uniform(0.3, 0.7, 2), np.array(knees)
        while True:
            self.zero = rng.uniform(-np.pi, np.pi, 2)
            # The knees' angles at home, from a distance of the elbows well inside the limits.
            d = self.distance(np.zeros((1, 2)))[0]
            low, high = abs(self.links[0] - self.links[1]), self.links.sum()
            for side in (-1, 1):
                tip = self.tip(np.zeros((1, 2)), side)[0]
                bent = np.sign(self.knees(tip))
                if low + 0.1 < d < high - 0.1 and (bent == self.signs).all():
                    self.side, self.home_tip = side, tip
                    return

    def elbows(self, q: Floats) -> Floats:
        """(2, N, 2) elbows at commands q (N, 2), m."""
        angle = (q + self.zero).T
        at = np.array([[-self.base / 2, 0.0], [self.base / 2, 0.0]])
        return at[:, None] + self.cranks[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    def distance(self, q: Floats) -> Floats:
        one, two = self.elbows(q)
        return np.linalg.norm(two - one, axis=-1)

    def clearance(self, q: Floats) -> Floats:
        """(N,) distance of the elbows from the limits at which the loop opens, m; negative where it is open."""
        d = self.distance(q)
        return np.minimum(self.links.sum() - d, d - abs(self.links[0] - self.links[1]))

    def tip(self, q: Floats, side: int) -> Floats:
        """(N, 2) where the circles about the elbows cross, on one side of the line from the first to the second."""
        one, two = self.elbows(q)
        return crossing(one, self.links[0], two, self.links[1], side)

    def knees(self, tip: Floats) -> Floats:
        """(2,) angle from each crank to its link at home, rad."""
        elbows = self.elbows(np.zeros((1, 2)))[:, 0]
        to_tip = np.arctan2(*(tip - elbows).T[::-1])
        return (to_tip - self.zero + np.pi) % (2.0 * np.pi) - np.pi

    @property
    def robot(self) -> gtpin.Robot:
        turn = np.arctan2(*(self.home_tip - self.elbows(np.zeros((1, 2)))[0, 0])[::-1])

        parts = []
        for i, side in enumerate((-0.5, 0.5)):
            turned = {"kind": "continuous", "rpy": f"0 0 {float(self.zero[i])!r}"}
            parts.append(joint(f"m{i}", "base", f"crank{i}", f"{float(side * self.base)!r} 0 0", **turned))
            parts.append(joint(f"k{i}", f"crank{i}", f"link{i}", f"{float(self.cranks[i])!r} 0 0", kind="continuous"))
        x, y = self.home_tip
        ends = [f"{float(length)!r} 0 0" for length in self.links]
        home = f'<home q="0 0" tcp_xyz="{x} {y} 0" tcp_rotvec="0 0 {turn}"/>'
        tip, pin = joint("end", "link0", "tip", ends[0], kind="fixed"), loop("link0", ends[0], "link1", ends[1])
        return robot_of("five", *parts, tip, pin, own(["m0", "m1"], "tip", home))

    def straight(self, q: Floats) -> Floats:
        """(N,) smallest clearance, m, on the straight line of commands from home: on a grid, then refined about its minima."""
        s, step = np.linspace(0.0, 1.0, 401), 1.0 / 400
        found = np.empty(len(q))
        for i, row in enumerate(q):
            along = self.clearance(s[:, None] * row)
            inner = (along[1:-1] <= along[:-2]) & (along[1:-1] <= along[2:])
            spots = [s[k + 1] for k in np.flatnonzero(inner)]
            fine = [np.clip(spot + step * np.linspace(-1.0, 1.0, 2001), 0.0, 1.0) for spot in spots]
            found[i] = min([along.min()] + [self.clearance(f[:, None] * row).min() for f in fine])
        return found

    def connected(self, q: Floats, count: int = 300) -> Floats:
        """(N,) whether commands are in the part of all angles where the loop closes that has home, to a grid's resolution."""
        angles = np.linspace(-np.pi, np.pi, count, endpoint=False) + np.pi / count
        grid = np.stack(np.meshgrid(angles, angles, indexing="ij"), axis=-1).reshape(-1, 2)
        parts, _ = label((self.clearance(grid) > 0.0).reshape(count, count))
        join = {}  # both directions go round and round

        def root(part: int) -> int:
            while part in join:
                part = join[part]
            return part

        for one, other in (*zip(parts[0], parts[-1], strict=True), *zip(parts[:, 0], parts[:, -1], strict=True)):
            a, b = root(int(one)), root(int(other))
            if one and other and a != b:
                join[a] = b
        cell = (((q + np.pi) % (2.0 * np.pi)) / (2.0 * np.pi) * count).astype(int) % count
        home = root(int(parts[count // 2, count // 2]))
        return np.array([root(int(parts[i, j])) == home for i, j in cell])


ASSEMBLIES = [(seed, knees) for seed in (1, 2) for knees in ((1, 1), (1, -1), (-1, 1), (-1, -1))]


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "knees"), ASSEMBLIES)
def test_poses_are_in_home_s_assembly_and_all_straight_paths_are_followed(seed: int, knees: tuple[int, int]) -> None:
    made = FiveBar(100 * seed + 10 * knees[0] + knees[1], knees)
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (20, 2))
    poses = Kinematics(gtpin.Geometry.nominal(made.robot)).forward(q)
    there = poses.reached
    assert np.abs(poses.T[there, :2] - made.tip(q[there], made.side)).max() < 1e-8
    free = made.straight(q)
    assert not (~there & (free > MARGIN)).any()
    assert made.connected(q)[there & (made.clearance(q) > 0.01)].all()


@pytest.mark.parametrize(("seed", "knees"), ASSEMBLIES[:4])
def test_a_virtual_machine_is_in_home_s_assembly(seed: int, knees: tuple[int, int]) -> None:
    made = FiveBar(seed, knees)
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (30, 2))
    poses = TrueRobot(gtpin.Geometry.nominal(made.robot)).predict(q)
    there, free = poses.reached, made.straight(q)
    assert np.abs(poses.T[there, :2] - made.tip(q[there], made.side)).max() < 1e-8
    clear = np.abs(free) > 2e-3  # nearer to a limit the machine is not used
    np.testing.assert_array_equal(there[clear], free[clear] > 0.0)


STRAIGHT_DOWN = urdf(
    "five",
    joint("m1", "base", "p1", "-0.15 0 0", kind="continuous"),
    joint("f1", "p1", "d1", "0 -0.45 0", kind="continuous"),
    joint("m2", "base", "p2", "0.15 0 0", kind="continuous"),
    joint("f2", "p2", "d2", "0 -0.45 0", kind="continuous"),
    joint("t", "d1", "tip", "0 -0.5 0", kind="fixed"),
    loop("d1", "0 -0.5 0", "d2", "0 -0.52 0", "l"),
    own(["m1", "m2"], "tip"),
)


def test_a_robot_without_home_says_its_assembly_and_how_to_choose_another(tmp_path: Path) -> None:
    file = tmp_path / "five.urdf"
    file.write_text(STRAIGHT_DOWN, encoding="utf-8")
    with pytest.warns(GtpinWarning, match="no <home>") as caught:
        robot = gtpin.load_robot(file)
    elbows = np.array([[-0.15, -0.45], [0.15, -0.45]])
    down, up = ([*crossing(elbows[0], 0.5, elbows[1], 0.52, side), 0.0] for side in (-1, 1))
    np.testing.assert_allclose(gtpin.home(robot).T, down, atol=1e-9)
    (said,) = {str(warning.message) for warning in caught}
    homes = re.findall("<home [^>]*/>", said)
    assert len(homes) == 2
    for element, wanted in zip(homes, (down, up), strict=True):
        file.write_text(STRAIGHT_DOWN.replace("</gtpin>", f"{element}</gtpin>"), encoding="utf-8")
        np.testing.assert_allclose(gtpin.home(gtpin.load_robot(file)).T, wanted, atol=1e-9)


def test_displaced_robots_and_their_files_keep_the_assembly_that_was_chosen(tmp_path: Path) -> None:
    robot = gtpin.Robot(RobotDescription.parse(STRAIGHT_DOWN))
    nominal = gtpin.Geometry.nominal(robot)
    # A first link that is longer by 50 mm opens the loop by as much with all joints at zero.
    values = nominal.values.copy()
    values[nominal.names.index("anchor[l.d1].y")] -= 0.05
    model = gtpin.Model(nominal.with_values(values))
    elbows = np.array([[-0.15, -0.45], [0.15, -0.45]])
    tip = elbows[0] + (crossing(elbows[0], 0.55, elbows[1], 0.52, -1) - elbows[0]) * 0.5 / 0.55
    gtpin.write_model(model, tmp_path)
    for again in (model, pickle.loads(pickle.dumps(model)), gtpin.read_model(tmp_path / "robot.urdf")):
        np.testing.assert_allclose(again.predict([[0.0, 0.0]]).T[0, :2], tip, atol=1e-9)
