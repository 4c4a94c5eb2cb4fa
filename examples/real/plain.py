"""Plain least squares with soft priors, for comparison with gtpin: python plain.py DATASET [--folds N].

The placements of all joints, the pose of the instrument's frame and the place of the target on the flange are fitted at once
by ``scipy.optimize.least_squares``. Deviations of a placement have priors of 2 mm and 5 mrad; a free frame and target
have none. Noise is not estimated: a residual counts in units of ``UNIT``. Prints the error of positions, mm, of poses left out
in turn.
"""

from __future__ import annotations

import argparse

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.data import random
from gtpin.model.measured_robot import robot_of

Floats = npt.NDArray[np.float64]

PRIOR = np.array([2e-3, 2e-3, 2e-3, 5e-3, 5e-3, 5e-3])
UNIT = np.array([2e-4, 2e-4, 2e-4, 5e-4, 5e-4, 5e-4])


class Plain:
    """A fitted arm: the deviations of its joints' placements, the instrument's frame, and the target on the flange."""

    def __init__(self, dataset: gtpin.Dataset, robot: gtpin.Robot, *, turns: bool = True) -> None:
        """Fit; ``turns``: whether measured orientations are used too."""
        self.model, self.data = robot.model.copy(), robot.model.createData()
        self.nominal = {j: self.model.jointPlacements[j].copy() for j in robot.moving_joints}
        self.robot, self.free = robot, dataset.instrument.frame == "free"
        R = None if dataset.orientation is None or not turns else self._rotations(dataset.orientation)
        poses = self._flange(dataset.q, np.zeros(6 * len(self.nominal)))
        starts = [self._started(poses, dataset.position, R, np.array(t)) for t in _guesses(dataset.instrument.target)]
        self.x = min((self._fitted(dataset, R, x) for x in starts), key=lambda found: found.cost).x

    def predict(self, q: Floats, x: Floats | None = None) -> tuple[Floats, Floats]:
        """Positions (N, 3), m, and rotations (N, 3, 3) of the target at commands q (N, n), in the instrument's frame."""
        x = self.x if x is None else x
        T, R = self._flange(q, x[12:])
        F, X = pin.exp6(x[:6]), pin.exp6(x[6:12])
        return (T + R @ X.translation) @ F.rotation.T + F.translation, F.rotation @ R @ X.rotation

    def _fitted(self, dataset: gtpin.Dataset, R: Floats | None, start: Floats):  # type: ignore[no-untyped-def]
        fixed = np.zeros(len(start), dtype=bool)
        fixed[:6] = not self.free
        known = dataset.instrument.target != "free"  # then the tool is as good as any other placement
        fixed[9:12] = R is None and not known

        def residual(some: Floats) -> Floats:
            x = start.copy()
            x[~fixed] = some
            T, turned = self.predict(dataset.q, x)
            soft = x[6:] if known else x[12:]
            parts = [((dataset.position - T) / UNIT[:3]).ravel(), soft / np.tile(PRIOR, len(soft) // 6)]
            if R is not None:
                turn = Rotation.from_matrix(R @ np.swapaxes(turned, 1, 2)).as_rotvec()
                parts.append((turn / UNIT[3:]).ravel())
            return np.concatenate(parts)

        found = least_squares(residual, start[~fixed], x_scale="jac", max_nfev=50)
        whole = start.copy()
        whole[~fixed] = found.x
        found.x = whole
        return found

    def _started(self, poses: tuple[Floats, Floats], T: Floats, R: Floats | None, t: Floats) -> Floats:
        """Frame and target by alternating closed forms from a first guess t of the target's place, m."""
        x = np.zeros(12 + 6 * len(self.nominal))
        if not self.free:
            return x
        for _ in range(100 if t.any() else 1):
            at = poses[0] + poses[1] @ t
            F, _ = Rotation.align_vectors(T - T.mean(axis=0), at - at.mean(axis=0))
            A = (F.as_matrix() @ poses[1]) - (F.as_matrix() @ poses[1]).mean(axis=0)
            left = (T - T.mean(axis=0)) - F.apply(poses[0] - poses[0].mean(axis=0))
            if t.any():
                t = np.linalg.lstsq(A.reshape(-1, 3), left.ravel(), rcond=None)[0]
        X = np.eye(3)
        if R is not None and t.any():
            X = Rotation.from_matrix(np.swapaxes(F.as_matrix() @ poses[1], 1, 2) @ R).mean().as_matrix()
        shift = T.mean(axis=0) - F.apply((poses[0] + poses[1] @ t).mean(axis=0))
        x[:6] = pin.log6(pin.SE3(F.as_matrix(), shift)).vector
        x[6:12] = pin.log6(pin.SE3(X, t)).vector
        return x

    def _flange(self, q: Floats, x: Floats) -> tuple[Floats, Floats]:
        for i, (j, placement) in enumerate(self.nominal.items()):
            self.model.jointPlacements[j] = placement * pin.exp6(x[6 * i : 6 * i + 6])
        T, R = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
        for i, row in enumerate(q):
            pin.forwardKinematics(self.model, self.data, self.robot.with_commands(self.robot.neutral, row))
            tcp = self.data.oMi[self.robot.tcp_joint] * self.robot.tcp_placement
            T[i], R[i] = tcp.translation, tcp.rotation
        return T, R

    @staticmethod
    def _rotations(quaternion: Floats) -> Floats:
        return Rotation.from_quat(quaternion, scalar_first=True).as_matrix()


def _guesses(target: str) -> list[list[float]]:
    if target != "free":
        return [[0.0, 0.0, 0.0]]
    return [[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, -0.1, 0.0], [0.0, 0.0, 0.1], [0.0, 0.0, -0.1]]


def left_out(dataset: gtpin.Dataset, robot: gtpin.Robot, folds: int, *, turns: bool = True) -> float:
    """Root mean square position error, m, of poses that were left out in turn."""
    errors = []
    for held in random(dataset, folds):
        predicted, _ = Plain(dataset.take(~held), robot, turns=turns).predict(dataset.take(held).q)
        errors.append(dataset.take(held).position - predicted)
    return float(np.sqrt((np.concatenate(errors) ** 2).sum(axis=1).mean()))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset")
    parser.add_argument("--folds", type=int, default=4)
    parser.add_argument("--positions", action="store_true", help="use positions alone")
    given = parser.parse_args()
    read = gtpin.Dataset.read(given.dataset)
    found = left_out(read, robot_of(read), given.folds, turns=not given.positions)
    print(f"{1e3 * found:.3f} mm on left-out poses")
