"""Rotations in arrays: vectors, matrices and quaternions, for many at once."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gtpin.typing import Floats

LARGE_TURN = -0.9
"""Cosine of an angle of 154 degrees."""


def skew(vectors: Floats) -> Floats:
    """(..., 3, 3) matrices of the cross products with vectors (..., 3)."""
    matrices = np.zeros((*vectors.shape, 3))
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    matrices[..., 0, 1], matrices[..., 0, 2], matrices[..., 1, 2] = -z, y, -x
    matrices[..., 1, 0], matrices[..., 2, 0], matrices[..., 2, 1] = z, -y, x
    return matrices


def frame_motions(T: Floats) -> Floats:
    """(N, 6, 6) motions of poses at positions T (N, 3) by three shifts of their frame, and three turns about its origin."""
    motions = np.zeros((len(T), 6, 6))
    motions[:, :3, :3] = motions[:, 3:, 3:] = np.eye(3)
    motions[:, :3, 3:] = -skew(T)
    return motions


def exp(vectors: Floats) -> Floats:
    """(..., 3, 3) rotation matrices of rotation vectors (..., 3), rad."""
    return np.asarray(Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix()).reshape(*vectors.shape, 3)


def log(matrices: Floats) -> Floats:
    """(..., 3) rotation vectors, rad, of rotation matrices (..., 3, 3)."""
    R = matrices.reshape(-1, 3, 3)
    cosine = (np.einsum("nii->n", R) - 1.0) / 2.0
    vectors = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1) / 2.0
    sine = np.sqrt(np.einsum("ni,ni->n", vectors, vectors))
    small = sine < 1e-4
    factor = np.where(small, 1.0 + sine**2 / 6.0, np.arctan2(sine, cosine) / np.where(small, 1.0, sine))
    found: Floats = vectors * factor[:, None]
    large = ~(cosine > LARGE_TURN)  # there the difference says little of the axis
    if large.any():
        found[large] = Rotation.from_matrix(R[large]).as_rotvec()
    return found.reshape(matrices.shape[:-1])


def left_jacobian(vectors: Floats) -> Floats:
    """(..., 3, 3) matrices from changes of rotation vectors (..., 3) to rotation vectors of the changes, in the fixed frame."""
    return _integral(skew(vectors))


def twist_jacobian(twist: Floats) -> Floats:
    """(6, 6) matrix that takes a change of a twist (6,), m and rad, to the twist of the change, in the moved frame's axes."""
    ad = np.zeros((6, 6))
    ad[:3, :3] = ad[3:, 3:] = skew(twist[3:])
    ad[:3, 3:] = skew(twist[:3])
    return _integral(-ad)


def _integral(A: Floats) -> Floats:
    """The integrals of exp(s A) over s from 0 to 1, of matrices A (..., n, n).

    The series sum_k A^k / (k + 1)! (Lynch and Park, Modern Robotics, 2017, ch. 3). Closed forms lose half of the digits at
    rotations below a milliradian, which deviations of placements have.
    """
    term = total = np.broadcast_to(np.eye(A.shape[-1]), A.shape)
    k = 1
    while term.size and np.abs(term).max() > np.finfo(float).eps:
        term = term @ A / (k + 1)
        total, k = total + term, k + 1
    return np.asarray(total)


def from_quaternions(wxyz: Floats) -> Floats:
    """(N, 3, 3) rotation matrices of unit quaternions (N, 4), scalar first."""
    return np.asarray(Rotation.from_quat(wxyz, scalar_first=True).as_matrix())


def to_quaternions(matrices: Floats) -> Floats:
    """(N, 4) unit quaternions, scalar first and of one sign along the array, of rotation matrices (N, 3, 3)."""
    wxyz = np.asarray(Rotation.from_matrix(matrices).as_quat(scalar_first=True))
    if len(wxyz):
        # q and -q are one rotation; a table in which the sign jumps can't be plotted or interpolated.
        lead = wxyz[0] if abs(wxyz[0] @ wxyz[0]) > 0 else np.array([1.0, 0.0, 0.0, 0.0])
        wxyz[wxyz @ lead < 0.0] *= -1.0
    return wxyz


LEAST_TILT = 0.02
"""Sine of beta below which alpha and gamma are angles about nearly the same axis, and not well defined. Assumed."""


def well_defined(R: Floats) -> bool:
    """Whether ZYZ angles are well defined for all rotations (N, 3, 3): no z axis is along that of the fixed frame."""
    return bool((np.hypot(R[:, 0, 2], R[:, 1, 2]) >= LEAST_TILT).all())


def zyz(R: Floats) -> Floats:
    """(N, 3) angles alpha, beta, gamma, rad, of rotations (N, 3, 3); beta lies in [0, pi]."""
    return np.asarray(Rotation.from_matrix(R).as_euler("ZYZ"))


def zyz_change(R: Floats, before: Floats) -> Floats:
    """(N, 3) change, rad, of the angles from rotations ``before`` to R, both (N, 3, 3), the short way round."""
    change = zyz(R) - zyz(before)
    return np.asarray((change + np.pi) % (2.0 * np.pi) - np.pi)


def zyz_rates(R: Floats) -> Floats:
    """(N, 3, 3) derivative of the angles by the rotation vector in the fixed frame.

    It is unbounded near beta = 0 and pi, where the angles are singular.
    """
    alpha = zyz(R)[:, 0]
    axes = np.zeros((len(R), 3, 3))  # columns: the axes of the rotations alpha, beta and gamma
    axes[:, 2, 0] = 1.0
    axes[:, 0, 1], axes[:, 1, 1] = -np.sin(alpha), np.cos(alpha)
    axes[:, :, 2] = R[:, :, 2]
    return np.asarray(np.linalg.inv(axes))
