"""Pinocchio's answers for many poses: a model that holds K copies of a robot computes K poses in one call."""

from __future__ import annotations

import threading
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin
from numpy.lib.stride_tricks import as_strided

from gtpin.errors import GtpinError
from gtpin.robot.constrained_model import ConstrainedModel
from gtpin.typing import Floats

MOST_VELOCITIES = 256
"""Largest number of velocities of the model of copies. More save no time: a call takes far longer than Python's part of it."""
SE3_SIZE = 12
"""Numbers of a placement in memory: the rotation by columns, then the translation."""


class Copies:
    """K copies of a robot in one Pinocchio model, with data of their own: for one thread.

    A *placement* is 12 numbers: the columns of the rotation, then the translation, m. Placements of joints are of joints 1 to
    J: Pinocchio's "universe" is not counted. World twists have their linear part at the base frame's origin.
    """

    def __init__(self, model: Any, neutral: Floats, most: int = MOST_VELOCITIES) -> None:
        self.K = max(1, most // max(model.nv, 1))
        self._one = Copies(model, neutral, most=1) if self.K > 1 else self  # for one pose
        self.count, self.nv = model.njoints - 1, model.nv
        self.model: Any = pin.Model()
        self.model.gravity = model.gravity
        # Pinocchio's createData() has tensors of the cube of the velocities' number; these algorithms need none of them.
        self.data: Any = self.model.createData()
        for k in range(self.K):
            for j in range(1, model.njoints):
                parent = int(model.parents[j])
                place = parent + k * self.count if parent else 0
                index = self.model.addJoint(place, model.joints[j], model.jointPlacements[j], f"{k}/{j}")
                self.model.appendBodyToJoint(index, model.inertias[j], pin.SE3.Identity())
                self._append(index)
        self.data.J, self.data.tau = np.zeros((6, self.model.nv)), np.zeros(self.model.nv)
        placed = _placements_of(self.model.jointPlacements)
        self._placements = placed[1:].reshape(self.K, self.count, SE3_SIZE)
        self._moved: Floats | None = None
        self._oMi = _placements_of(self.data.oMi)[1:].reshape(self.K, self.count, SE3_SIZE)
        self._f = _view([f.linear for f in self.data.f], 6)[1:].reshape(self.K, self.count, 6)
        self._J = self.data.J.T.reshape(self.K, self.nv, 6)
        self._X, self._V = np.tile(neutral, (self.K, 1)), np.zeros((self.K, self.nv))
        self._check(model, neutral)

    def _append(self, index: int) -> None:
        """Make the data of one joint more."""
        data = self.data
        data.joints.append(self.model.joints[index].createData())
        for placements in (data.oMi, data.liMi):
            placements.append(pin.SE3.Identity())
        for motions in (data.v, data.a, data.a_gf):
            motions.append(pin.Motion.Zero())
        for forces in (data.h, data.f):
            forces.append(pin.Force.Zero())

    def joints(self, X: Floats, placements: Floats) -> tuple[Floats, Floats]:
        """Placements (N, J + 1, 12) of all joints in the base frame, and the world twists (N, nv, 6) of the velocities.

        ``X``: (N, nq) configurations. ``placements``: those of the joints on their parents, (J, 12) or (N, J, 12).
        """
        n = len(X)
        if n == 1 < self.K:
            return self._one.joints(X, placements)
        oMi, J = np.empty((n, self.count + 1, SE3_SIZE)), np.empty((n, self.nv, 6))
        oMi[:, 0] = IDENTITY
        flat, joints = self._X.reshape(-1), oMi[:, 1:]
        for rows, k in self._calls(n):
            self._place(placements, rows, k)
            self._X[:k] = X[rows]
            pin.computeJointJacobians(self.model, self.data, flat)
            joints[rows], J[rows] = self._oMi[:k], self._J[:k]
        return oMi, J

    def integrate(self, X: Floats, V: Floats) -> Floats:
        """(N, nq) configurations after velocities V (N, nv) for a unit of time."""
        if len(X) == 1 < self.K:
            return self._one.integrate(X, V)
        found = np.empty_like(X)
        for rows, k in self._calls(len(X)):
            self._X[:k], self._V[:k] = X[rows], V[rows]
            found[rows] = pin.integrate(self.model, self._X.reshape(-1), self._V.reshape(-1)).reshape(self.K, -1)[:k]
        return found

    def inverse_dynamics(
        self, X: Floats, V: Floats | None, A: Floats | None, placements: Floats
    ) -> tuple[Floats, Floats]:
        """Generalized forces (N, nv) of the tree, N or N m, and the forces (N, J, 6) that each joint carries, in its own axes.

        Pinocchio's ``rnea``, with gravity and without loops. ``V``, ``A``: (N, nv) velocities and accelerations; None: zero.
        """
        n = len(X)
        tau, carried = np.empty((n, self.nv)), np.empty((n, self.count, 6))
        still, speed = np.zeros(self.K * self.nv), np.zeros((self.K, self.nv))
        for rows, k in self._calls(n):
            self._place(placements, rows, k)
            self._X[:k] = X[rows]
            if V is not None and A is not None:
                self._V[:k], speed[:k] = V[rows], A[rows]
                given = self._V.reshape(-1), speed.reshape(-1)
            else:
                given = still, still
            tau[rows] = np.reshape(pin.rnea(self.model, self.data, self._X.reshape(-1), *given), (self.K, -1))[:k]
            carried[rows] = self._f[:k]
        return tau, carried

    def _calls(self, n: int) -> list[tuple[slice, int]]:
        return [(slice(a, min(a + self.K, n)), min(self.K, n - a)) for a in range(0, n, self.K)]

    def _place(self, placements: Floats, rows: slice, k: int) -> None:
        if placements.ndim == 3:
            self._placements[:k], self._moved = placements[rows], None
        elif self._moved is not placements:
            self._placements[:] = self._moved = placements

    def _check(self, model: Any, neutral: Floats) -> None:
        """Hold the views of Pinocchio's memory against its own answers, once.

        Raises `GtpinError` if this version of Pinocchio keeps its numbers in another order.
        """
        data, X = model.createData(), pin.integrate(model, neutral, np.linspace(0.1, 0.4, model.nv))
        J = pin.computeJointJacobians(model, data, X)
        oMi, columns = self.joints(np.tile(X, (self.K, 1)), self._placements[0].copy())
        expected = [np.concatenate([M.rotation.T.ravel(), M.translation]) for M in data.oMi]
        if not (np.abs(oMi - expected).max() < 1e-9 and np.abs(columns - np.reshape(J, (6, -1)).T).max() < 1e-9):
            raise _unread()


IDENTITY = np.concatenate([np.eye(3).ravel(), np.zeros(3)])
"""The placement that moves nothing."""


def _placements_of(placements: Any) -> Floats:
    """(length, 12) view of Pinocchio's vector of placements."""
    if placements[0].rotation.strides != (8, 24):
        raise _unread()
    return _view([M.rotation.T[0] for M in placements], SE3_SIZE)


def _view(first: list[Floats], width: int) -> Floats:
    """(length, width) view of Pinocchio's memory from the first numbers of each element; its vector must not grow later."""
    at = [int(numbers.__array_interface__["data"][0]) for numbers in first]
    step = at[1] - at[0]
    if step % 8 or at != [at[0] + i * step for i in range(len(at))]:
        raise _unread()
    return as_strided(first[0], (len(at), width), (step, 8))


def _unread() -> GtpinError:
    what = f"Pinocchio {pin.__version__} keeps its numbers in another order"
    return GtpinError(what, hint="install one that gtpin allows")


_OF_THREAD = threading.local()


def copies(robot: ConstrainedModel) -> Copies:
    """The copies of a robot for this thread; they are made at the first call, and go with the robot."""
    known: WeakKeyDictionary[ConstrainedModel, Copies] = _OF_THREAD.__dict__.setdefault("known", WeakKeyDictionary())
    found = known.get(robot)
    if found is None:
        found = known[robot] = Copies(robot.model, robot.neutral)
    return found
