"""Sockets: seats in which a ball of the platform is placed repeatedly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gtpin.bench.simulator.instruments.gauge import Gauge, Hidden
from gtpin.bench.simulator.instruments.layout import Layout
from gtpin.bench.simulator.instruments.targets import Targets, labels
from gtpin.bench.simulator.poses import Poses
from gtpin.data.table import Column
from gtpin.typing import Floats, Ints

SIGMA = 2e-5
"""Repeatability of a ball in its socket, per axis, m."""
SPREAD = 0.35
"""Distance of the sockets from the centre along each axis, in half extents of the workspace."""
CORNERS = ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))
"""Directions of the sockets from the centre, by axis of the layout."""
PLACED = 5e-3
"""Standard deviation of the sockets' positions about these corners, per axis, m."""
DISTANCE_SIGMA = 5e-5
"""Standard deviation of the known distance between two sockets, m."""


@dataclass(frozen=True, eq=False)
class Socket(Gauge):
    """z = p - s, with target p and socket s, m. A touch has z = 0.

    Parameters
    ----------
    targets
        The targets as the dataset declares them.
    sockets
        Ids of the sockets; their positions are unknown to the user.
    distance
        Declared distance between the first two sockets, m.
    socket, target
        (M,) indices of each row's socket and target.
    """

    kind: ClassVar[str] = "socket"
    touches: ClassVar[bool] = True

    targets: Targets
    sockets: tuple[str, ...]
    distance: float
    socket: Ints
    target: Ints

    @staticmethod
    def drawn(layout: Layout, stops: Ints, declared: bool, rng: np.random.Generator) -> Socket:
        """Four sockets in the workspace; three targets where the platform has fewer than six degrees of freedom, else one."""
        name, targets = "cup", Targets.one() if layout.freedoms >= 6 else Targets.three()
        sockets = tuple(f"S{i + 1}" for i in range(len(CORNERS)))
        shares = [[SPREAD * share for share in corner] for corner in CORNERS]
        places = np.array([layout.at(*share) for share in shares]) + PLACED * rng.standard_normal((len(CORNERS), 3))
        points = [
            Hidden(f"{name}.point[{socket}].{axis}", float(at), np.inf)
            for socket, place in zip(sockets, places, strict=True)
            for axis, at in zip("xyz", place, strict=True)
        ]
        true = float(np.linalg.norm(places[0] - places[1]))
        distance = round(true + DISTANCE_SIGMA * rng.standard_normal(), 7)
        hidden = (*targets.drawn(name, rng), *points)
        turn = np.arange(len(stops)) % (len(sockets) * len(targets))
        return Socket(
            name, stops, hidden, declared, targets, sockets, distance, turn % len(sockets), turn // len(sockets)
        )

    @property
    def sigma(self) -> Floats:
        """See :class:`Gauge`."""
        return np.full((len(self.stop), 3), SIGMA)

    def readings(self, poses: Poses, u: Floats) -> Floats:
        """See :class:`Gauge`."""
        places = u[3 * len(self.targets) :].reshape(-1, 3)
        return np.asarray(self.targets.positions(poses, u, self.target) - places[self.socket])

    def table(self) -> dict[str, Any]:
        """See :class:`Gauge`."""
        known = [*self.sockets[:2], self.distance, DISTANCE_SIGMA]
        return {**self.targets.table(), "distances": [known]}

    def columns(self, poses: Poses, errors: Floats) -> dict[str, Column]:
        """See :class:`Gauge`."""
        found: dict[str, Column] = {"socket": labels(self.sockets, self.socket)}
        return found if len(self.targets) == 1 else {**found, "target": labels(self.targets.names, self.target)}

    def ids(self) -> dict[str, tuple[str, ...]]:
        """See :class:`Gauge`."""
        return {"socket": self.sockets, "target": self.targets.names}

    @classmethod
    def by_row(cls) -> tuple[str, ...]:
        """See :class:`Gauge`."""
        return "stop", "socket", "target"
