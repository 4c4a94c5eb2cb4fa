"""Poses of the TCP, many at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from gtpin.kinematics.rotations import log, to_quaternions
from gtpin.output.results import result_file
from gtpin.output.shown import Shown, present
from gtpin.typing import Floats

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


@dataclass(frozen=True, repr=False)
class Poses(Shown):
    """N poses of the TCP: positions and rotations in one frame, the base frame or the instrument's frame.

    The function that returns the poses states this frame. All numbers of a pose that could not be computed are NaN.

    Parameters
    ----------
    T, R
        (N, 3) positions of the TCP, m, and (N, 3, 3) rotations from the TCP frame to this frame.
    joints
        By name, (N,) coordinates, rad or m, of the robot's measured joints at these poses; empty where it has none: see
        :meth:`~gtpin.robot.chain.Chain.measuring`.
    configuration
        (N, nq) Pinocchio configurations, of the robot's own joints, of poses that kinematics computed; None where they are not
        known.
    links
        By name, (N, 3, 3) rotations, to the base frame, of the robot's measured links at these poses; empty where it has none.

    Examples
    --------
    >>> import gtpin
    >>> model = gtpin.read_model("gantry_tau")
    >>> poses = model.predict(model.robot.home_q[None])
    >>> poses.T.shape, poses.R.shape
    ((1, 3), (1, 3, 3))
    >>> poses.to_dataframe().columns.tolist()
    ['x', 'y', 'z', 'qw', 'qx', 'qy', 'qz']
    """

    T: Floats
    R: Floats
    joints: Mapping[str, Floats] = field(default_factory=dict)
    configuration: Floats | None = None
    links: Mapping[str, Floats] = field(default_factory=dict)

    @staticmethod
    def unknown(count: int, joints: Iterable[str] = ()) -> Poses:
        """``count`` poses whose numbers are all NaN, to be filled in; ``joints`` names the measured joints."""
        coordinates = {name: np.full(count, np.nan) for name in joints}
        return Poses(np.full((count, 3), np.nan), np.full((count, 3, 3), np.nan), coordinates)

    @staticmethod
    def merged(first: npt.NDArray[np.bool_], some: Poses, others: Poses) -> Poses:
        """N poses: ``some`` where the mask ``first`` (N,) is True, ``others`` elsewhere, each in their order."""

        def whole(a: Floats, b: Floats) -> Floats:
            found = np.empty((len(first), *a.shape[1:]))
            found[first], found[~first] = a, b
            return found

        return some._joined(others, whole)

    def __len__(self) -> int:
        return len(self.T)

    def __getitem__(self, rows: npt.NDArray[np.generic] | slice) -> Poses:
        """The poses that a mask, indices or a slice select."""
        return self._joined(self, lambda x, _: x[rows])

    def followed_by(self, others: Poses) -> Poses:
        """These poses, followed by the poses ``others``."""
        return self._joined(others, lambda x, y: np.concatenate([x, y]))

    def copy(self) -> Poses:
        """The same poses in arrays of their own."""
        return self._joined(self, lambda x, _: x.copy())

    def _joined(self, others: Poses, join: Callable[[Floats, Floats], Floats]) -> Poses:
        """The poses of which each array is ``join`` of these and others'."""
        one, two = self.configuration, others.configuration
        joints = {name: join(x, others.joints[name]) for name, x in self.joints.items()}
        configuration = None if one is None or two is None else join(one, two)
        links = {name: join(R, others.links[name]) for name, R in self.links.items()}
        return Poses(join(self.T, others.T), join(self.R, others.R), joints, configuration, links)

    def put(self, rows: npt.NDArray[np.generic] | slice, some: Poses) -> None:
        """Write other poses into some rows of these arrays."""
        self.T[rows], self.R[rows] = some.T, some.R
        for name, x in self.joints.items():
            x[rows] = some.joints[name]
        for name, R in self.links.items():
            R[rows] = some.links[name]
        if self.configuration is not None and some.configuration is not None:
            self.configuration[rows] = some.configuration

    @property
    def reached(self) -> npt.NDArray[np.bool_]:
        """(N,) True where the pose could be computed."""
        return np.isfinite(self.T[:, 0])

    @property
    def quaternions(self) -> Floats:
        """(N, 4) unit quaternions, scalar first; NaN where a pose could not be computed."""
        wxyz = np.full((len(self), 4), np.nan)
        wxyz[self.reached] = to_quaternions(self.R[self.reached])
        return wxyz

    def moved(self, T: Floats, R: Floats) -> Poses:
        """The same poses in another frame, in which the present frame has the position T (3,), m, and the rotation R (3, 3).

        A position p becomes R p + T, and a rotation Q becomes R Q. With T (N, 3) and R (N, 3, 3), each pose in a frame of its
        own.
        """
        turned = self.T @ R.T if R.ndim == 2 else np.einsum("nij,nj->ni", R, self.T)
        return replace(self, T=turned + T, R=R @ self.R)

    def minus(self, other: Poses) -> Floats:
        """(N, 6) these poses less the N poses ``other``: position (m) and rotation vector (rad), in the frame of the poses.

        Both must be in the same frame. NaN where one of the two poses could not be computed.
        """
        difference = np.full((len(self), 6), np.nan)
        for rows in chunks(len(self)):
            one, two, part = self[rows], other[rows], difference[rows]
            both = one.reached & two.reached
            part[both, :3] = one.T[both] - two.T[both]
            part[both, 3:] = log(one.R[both] @ np.swapaxes(two.R[both], 1, 2))
        return difference

    def save(self, file: Path | str, *, force: bool = False) -> None:
        """Write a CSV file with the columns ``pose x y z qw qx qy qz``, as ``gtpin predict`` does; poses count from 1.

        With ``force``, an existing file that gtpin has not written is renamed to ``NAME.old-1``. Without it, that is an error.
        """
        table = self.to_dataframe()
        table.insert(0, "pose", range(1, len(table) + 1))
        with result_file(Path(file), force=force) as new:
            table.to_csv(new, index=False, lineterminator="\n")

    def plot_workspace(self, view: str = "xy") -> Figure:
        """Plot the positions, m, in a plane of their frame: ``xy``, ``xz`` or ``yz``."""
        figure: Figure = present(self).workspace(view)
        return figure


CHUNK = 4096
"""Number of poses in a chunk: large enough that the loop takes little time, small enough for a processor's cache."""


def chunks(count: int) -> list[slice]:
    """Slices of at most ``CHUNK`` rows that cover ``count`` rows in order."""
    return [slice(i, min(i + CHUNK, count)) for i in range(0, count, CHUNK)]
