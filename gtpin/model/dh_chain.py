"""The poses of a table of Denavit and Hartenberg, and the table whose poses are those of a calibrated arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from gtpin.errors import ConvergenceError
from gtpin.model.model import Model, root_of
from gtpin.typing import Floats

X, Y, Z, RX, RY, RZ = map(pin.Motion, np.eye(6))
LOCAL = {"theta": RZ, "d": Z, "a": X, "alpha": RX, "beta": RY}
"""Twist of each parameter of a joint in the frame before it, in the order in which they follow each other."""
POSTURES = 12
"""Number of postures at which the poses are compared: six numbers each, of at most six parameters a joint and six of the
tool."""
STEPS, CLOSE, EQUAL, RANK = 20, 1e-12, 1e-8, 1e-9
"""Largest number of Newton steps; the step at which they end, and the largest last step of an equal table, m and rad; and the
relative singular value that counts as 0."""


@dataclass(frozen=True, eq=False)
class DhChain:
    """The motions of a table's rows, one after the other from the base to the TCP; the base and the tool are among them.

    ``motions``: each a fixed placement, or a twist (6,) with the index of its row (None: of no row) and of its command (None:
    of no command). ``nominal``: (r,) values of the rows.
    """

    motions: Sequence[tuple[Any, int | None, int | None]]
    nominal: Floats

    def at(self, values: Floats, q: Floats) -> tuple[Any, Floats]:
        """The TCP's pose at commands q (n,) with values (r,) of the rows; and (6, r) its derivative by these, in the base
        frame's axes."""
        at, twists = pin.SE3.Identity(), np.zeros((6, len(values)))
        for motion, row, command in self.motions:
            if row is None and command is None:
                at = at * motion
                continue
            size = (0.0 if row is None else values[row]) + (0.0 if command is None else q[command])
            at = at * pin.exp6(motion * size)
            if row is not None:
                twists[:, row] = at.act(motion).vector
        twists[:3] -= np.cross(at.translation, twists[3:], axisb=0, axisc=0)
        return at, twists

    def equal_to(self, model: Model, start: Floats, covariance: Floats, stands: Floats) -> Floats:
        """Corrections (r,) of the rows whose poses are those of a model, in all postures, but for motions of the whole machine.

        ``start``, ``covariance``: their estimate (r,) and its covariance (r, r). Of several tables with these poses it is the
        one that is nearest by this covariance. ``stands``: (6, k) motions of the whole machine that are no error.

        Raises `ConvergenceError` where the steps do not end.
        """
        x, half, r = start.copy(), root_of(covariance), len(start)
        q = np.random.default_rng(0).uniform(-1.0, 1.0, (POSTURES, model.robot.n_actuators))
        wanted = model.kinematics.forward(q)
        for _ in range(STEPS):
            errors, ways = [], []
            for row, T, R in zip(q, wanted.T, wanted.R, strict=True):
                at, twists = self.at(self.nominal + x, row)
                errors.append(np.concatenate([T - at.translation, pin.log3(R @ at.rotation.T)]))
                whole = np.concatenate([stands[:3] + np.cross(stands[3:], T, axisa=0, axisc=0), stands[3:]])
                ways.append(np.hstack([twists @ half, whole]))
            found = np.linalg.lstsq(np.concatenate(ways), np.concatenate(errors), rcond=RANK)[0]
            step, moved = half @ found[:r], pin.exp6(-stands @ found[r:])
            x, wanted = x + step, wanted.moved(moved.translation, moved.rotation)
            if np.abs(step).max() < CLOSE:
                break
        if np.abs(step).max() > EQUAL:
            what = f"a Denavit-Hartenberg table of {model.robot.name} has not converged in {STEPS} steps"
            raise ConvergenceError(what, hint="export a URDF")
        return x
