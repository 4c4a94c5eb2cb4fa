"""Arms whose nominal model is far off: gtpin beside plain least squares: python far_nominal.py [--draws N] [--first SEED].

Each draw is a UR5 or UR10 whose placements are 0.1 to 20 times their tolerances off, 15 to 1,000 poses or positions, with
frames fixed or free and the noise declared or not. ``plain.py`` fits the same data without being told the noise. Printed is the
error of both at poses that were not measured, and the share of draws in which gtpin's is at most 1.15 times the plain one.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from plain import Plain
from scipy.spatial.transform import Rotation

import gtpin

Floats = npt.NDArray[np.float64]

OFF = (0.1, 0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0)
"""Standard deviation of a placement's error, in units of its tolerance, 0.5 mm and 0.5 mrad."""
COUNTS = (15, 20, 36, 60, 120, 300, 1000)
OTHERS = 150
"""Number of poses that are not measured, at which errors are compared."""


@dataclass(frozen=True)
class Draw:
    """A machine's measurement, and (M, n) other commands with the (M, 3) true positions there, m."""

    words: str
    dataset: gtpin.Dataset
    q: Floats
    T: Floats


def draw(seed: int, counts: tuple[int, ...] = COUNTS, least: float = 0.0, *, declared: bool | None = None) -> Draw:
    """A draw; ``least``: smallest error of the placements in tolerances."""
    rng = np.random.default_rng([seed, 7])
    robot = gtpin.load_robot(str(rng.choice(["ur5", "ur10"])))
    off, count = float(rng.choice([o for o in OFF if o >= least])), int(rng.choice(counts))
    known, turning, free = (bool(x) for x in rng.integers(2, size=3))
    known = known if declared is None else declared
    sigma, turn_sigma = 10.0 ** rng.uniform(-4.7, -3.7), 10.0 ** rng.uniform(-4.3, -3.5)
    model = robot.model.copy()
    for joint in robot.moving_joints:
        model.jointPlacements[joint] = model.jointPlacements[joint] * pin.exp6(off * 5e-4 * rng.standard_normal(6))
    frame, target = pin.SE3.Identity(), pin.SE3(pin.exp6(off * 5e-4 * rng.standard_normal(6)))
    if free:
        frame = pin.SE3(Rotation.random(random_state=seed).as_matrix(), rng.uniform(-3.0, 3.0, 3))
        target = pin.SE3(Rotation.random(random_state=seed + 1).as_matrix(), rng.uniform(-0.15, 0.15, 3))
    data, reach = model.createData(), rng.uniform(0.8, 1.6)
    lift = np.eye(robot.n_actuators)[1]

    def poses(q: Floats) -> tuple[Floats, Floats]:
        T, R = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
        for i, row in enumerate(q):
            pin.forwardKinematics(model, data, robot.with_commands(robot.neutral, row))
            at = frame * data.oMi[robot.tcp_joint] * robot.tcp_placement * target
            T[i], R[i] = at.translation, at.rotation
        return T, R

    q, others = (rng.uniform(-reach, reach, (n, robot.n_actuators)) - lift for n in (count, OTHERS))
    T, R = poses(q)
    turned = Rotation.from_rotvec(turn_sigma * rng.standard_normal((count, 3))) * Rotation.from_matrix(R)
    instrument = gtpin.data.InstrumentSection(
        position_sigma=sigma if known else None,
        orientation_sigma=turn_sigma if known and turning else None,
        frame="free" if free else "robot",
        target="free" if free else "tcp",
    )
    dataset = gtpin.Dataset(
        robot=robot.name.removesuffix("_robot"),
        pose=[str(i) for i in range(count)],
        q=q,
        position=T + sigma * rng.standard_normal(T.shape),
        orientation=turned.as_quat(scalar_first=True) if turning else None,
        instrument=instrument,
    )
    words = f"{robot.name} {off:4.1f} tolerances off, {count:4d} {'poses' if turning else 'positions'}, "
    words += f"frames {'free' if free else 'fixed'}, noise {'declared' if known else 'not declared'}"
    return Draw(words, dataset, others, poses(others)[0])


def errors(made: Draw, robot: gtpin.Robot) -> tuple[float, float]:
    """Root mean square position error of gtpin and of plain least squares at the other commands, m."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        mine = gtpin.calibrate(made.dataset, robot).model.predict(made.q).T
    plain = Plain(made.dataset, robot).predict(made.q)[0]
    found = [float(np.sqrt(((T - made.T) ** 2).sum(axis=1).mean())) for T in (mine, plain)]
    return found[0], found[1]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    ratios = []
    for number in range(given.first, given.first + given.draws):
        made = draw(number)
        mine, plain = errors(made, gtpin.load_robot(made.words.split("_")[0].split()[0]))
        ratios.append(mine / plain)
        print(f"{number:4d} {made.words}: {1e6 * mine:.1f} um, plain {1e6 * plain:.1f} um", flush=True)
    print(f"at most 1.15 times the plain error in {np.mean(np.array(ratios) <= 1.15):.3f} of {len(ratios)} draws")
