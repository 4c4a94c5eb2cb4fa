"""Directions in which a planar loop can close at all: the others hold for an exact geometry alone, and are left to play.

A spherical ``<loop_joint>`` gives three equations. In a planar loop, whose joints turn about parallel axes, the passive joints
answer to two of them; the third, across the plane, holds by itself in the nominal geometry and can't be met by any other. Real
machines meet it by play in their bearings.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

Floats = npt.NDArray[np.float64]

POSTURES = 6
"""Postures at which the directions are compared; two differ wherever they are not constant."""
NOTHING = 1e-5
"""Share of the largest singular value below which a direction counts as one in which nothing moves: URDFs are written with
five digits or more."""


def closure_space(jacobians: Floats) -> Floats | None:
    """(p, m) unit directions of the gaps that passive coordinates can close, where these are fewer than the equations.

    Parameters
    ----------
    jacobians
        (K, m, p) derivative of the gaps by the passive coordinates at K postures of the nominal geometry, each gap in the
        frame of its first anchor.

    Returns
    -------
    space
        None where there are as many equations as coordinates, or where the directions change with the posture: then the
        equations must all hold.
    """
    _, equations, coordinates = jacobians.shape
    if coordinates == 0 or equations == coordinates:
        return None
    left, sizes, _ = np.linalg.svd(np.hstack(list(jacobians)), full_matrices=False)
    rank = int(np.count_nonzero(sizes > NOTHING * sizes[0]))
    return np.ascontiguousarray(left[:, :rank].T) if rank == coordinates else None


def postures(model: Any, neutral: Floats) -> list[Floats]:
    """Configurations (nq,) around neutral, the same ones each time, in general position. Their loops need not be closed."""
    rng = np.random.default_rng(0)
    return [pin.integrate(model, neutral, rng.uniform(-0.5, 0.5, model.nv)) for _ in range(POSTURES)]
