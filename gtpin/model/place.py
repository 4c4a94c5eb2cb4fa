"""Where a machine stands: the motions of the whole machine that no instrument shows, and errors without them."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh

from gtpin.data.instrument_tables import shows_place
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import frame_motions
from gtpin.model.model import Model
from gtpin.real import generator
from gtpin.typing import Floats, Mask

POSES = 30
"""Number of poses at which the tolerances are compared with motions of the whole machine."""
CLOSE = 1e-6
"""Standard deviation, m and rad, of what may be left of such a motion after parameters have imitated it. Assumed: as small as
the noise of instruments."""
ALMOST = 1e-3
"""Weight of rotations, 1/rad, beside that of positions, 1/m, if they shall decide only what positions leave open."""
SHARE_OF_WHOLE = 0.5
"""Share of a parameter's variance from which it is known relative to others alone."""


def free_motions(model: Model) -> Floats:
    """(6, k) independent motions of the whole machine that are no error: shift, m, and rotation about the base's origin, rad.

    They are those on which the declared places of all instruments together give less information than the tolerances of the
    geometry do. All six (k = 6) for free trackers alone; none (k = 0) where an instrument stands exactly where it is declared
    and shows all six.

    A motion g has from the instruments the information g' L g (`InstrumentTable.place_information`), and from the tolerances
    g' M g with M = F' (J S J' + s^2 I)^-1 F: F and J are the derivatives of poses by motions of the machine and by its
    parameters, S the prior covariance of these, and s = `CLOSE`. The free motions are the generalised eigenvectors of (L, M)
    whose eigenvalue is below 1.
    """
    places = _declared_places(model)
    if not places.any():
        return np.eye(6)
    if np.linalg.eigvalsh(places)[0] > CLOSE**-2:
        return np.zeros((6, 0))
    J, F = _derivatives(model)
    M = F.T @ np.linalg.solve(J @ J.T + CLOSE**2 * np.eye(len(J)), F)
    values, vectors = eigh(places, (M + M.T) / 2.0)
    return np.asarray(vectors[:, values < 1.0])


def movers(model: Model) -> tuple[str, ...]:
    """Effects, by name, that move a fixed frame: the base frame of the model is its mean over the measurements."""
    fixed = not free_motions(model).size
    return tuple(e.name for e in model.effects if fixed and e.site == "frame" and not e.effect.stretches_frame)


def relative_to_others(model: Model, covariance: Floats) -> Mask:
    """(p,) parameters that are known relative to others alone: most of their variance is that of motions of the whole machine.

    ``covariance``: (p, p) of the parameters. The free motions F V (see :func:`free_motions`) are imitated by the changes
    B = J' (J J' + s^2 I)^-1 F V, in units of the tolerances. With Q an orthonormal basis of their span, the part Q Q' of the
    parameters has the variances that are compared.
    """
    free, size = free_motions(model), model.geometry.tolerance
    if not free.shape[1]:
        return np.zeros(len(size), dtype=bool)
    J, F = _derivatives(model)
    Q = np.linalg.qr(J.T @ np.linalg.solve(J @ J.T + CLOSE**2 * np.eye(len(J)), F @ free))[0]
    own = covariance / np.outer(size, size)
    return np.asarray(((Q @ (Q.T @ own @ Q)) * Q).sum(axis=1) > SHARE_OF_WHOLE * own.diagonal())


def _derivatives(model: Model) -> tuple[Floats, Floats]:
    """(m, p) and (m, 6) derivatives of poses by the geometry, in units of its tolerances, and by motions of the machine."""
    kinematics, geometry = model.kinematics, model.geometry
    lower, upper = model.robot.ends
    home = model.robot.home_q
    # Half of the ranges, about home: there, most robots with loops reach most commands.
    q = home + 0.5 * (lower + generator(0).random((POSES, len(home))) * (upper - lower) - home)
    poses = kinematics.forward(q)
    q, poses = (q[poses.reached], poses[poses.reached]) if poses.reached.any() else (home[None], kinematics.home)
    c = 3 if geometry.positions_only else 6
    J = kinematics.geometry_jacobian(q, poses)[:, :c] * geometry.tolerance
    return J.reshape(len(q) * c, -1), frame_motions(poses.T)[:, :c].reshape(-1, 6)


def _declared_places(model: Model) -> Floats:
    """(6, 6) information of all instruments' declared places on motions of the machine: see :func:`free_motions`."""
    if not model.frame.is_base:
        return np.zeros((6, 6))
    if model.instruments:
        return np.asarray(sum(one.table.place_information(model.robot.up) for one in model.instruments))
    return shows_place(0.0, np.eye(6))


def without_place(motion: Floats, T: Floats, free: Floats, R: Floats | None = None) -> Floats:
    """Motions (N, c, ...) of poses, m and rad, each without the most that motions of the whole machine explain.

    T (N, 3): positions of the poses, base frame, m. ``free`` (6, k): the motions, as of :func:`free_motions`. For c = 3 they
    fit the positions best. For c = 6 positions and rotations count relative to what of each remains if the positions alone
    place the machine. R (N, 3, 3): rotations of the poses, where a shift of the TCP on its link is taken away too.
    """
    n, c = motion.shape[:2]
    F, moved = frame_motions(T)[:, :c] @ free, motion.reshape(n, c, -1)
    if R is not None:
        F = np.concatenate([F, np.concatenate([R, np.zeros_like(R)], axis=1)[:, :c]], axis=2)
    if not F.shape[2]:
        return motion
    weight, left = np.array([1.0, 1.0, 1.0, ALMOST, ALMOST, ALMOST])[:c], moved
    for _ in range(c // 3):
        flat = (F * weight[:, None]).reshape(n * c, -1)
        shift = np.linalg.lstsq(flat, (moved * weight[:, None]).reshape(n * c, -1), rcond=None)[0]
        left = moved - F @ shift
        size = np.sqrt([(left[:, part : part + 3] ** 2).sum() for part in range(0, c, 3)])
        weight = np.repeat(1.0 / np.maximum(size, ALMOST * max(float(size.max()), 1e-300)), 3)
    return np.asarray(left.reshape(motion.shape))


def without_free(model: Model, moved: Floats, poses: Poses) -> Floats:
    """Motions (N, 3 or 6) of the tool at N poses, m and rad: their positions' part (N, 3), without motions of the machine and
    of the tool that the instrument does not show. ``model``: the model of the measurements."""
    return without_place(moved[:, :3], poses.T, free_motions(model), poses.R if model.free_target else None)
