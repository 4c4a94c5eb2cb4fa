"""Touches of planes: commands at which a point of the platform is on a surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gtpin.bench.simulator.instruments.gauge import Gauge, Hidden
from gtpin.bench.simulator.instruments.layout import Layout
from gtpin.bench.simulator.instruments.targets import Targets, labels
from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.rotations import across, exp
from gtpin.data.table import Column
from gtpin.typing import Floats, Ints

SIGMA = 1e-5
"""Repeatability of a touch probe, m."""
HEIGHT_SIGMA, NORMAL_SIGMA = 5e-3, 5e-3
"""Standard deviations of planes' errors, m and rad: the prior sigmas that a dataset has by default."""
APART, TILTED = 0.5, 0.35
"""Heights of the level planes, in half heights of the workspace, and the tilt of the third, rad."""


@dataclass(frozen=True, eq=False)
class Plane(Gauge):
    """z = n . (p - point) - height, with target p, and the plane's normal n and a point of it. A touch has z = 0.

    Parameters
    ----------
    targets
        The targets as the dataset declares them.
    planes
        The declared planes by id: a point, m, and a unit normal, base frame.
    plane
        (M,) index of each row's plane.
    """

    kind: ClassVar[str] = "plane"
    touches: ClassVar[bool] = True

    targets: Targets
    planes: dict[str, tuple[tuple[float, float, float], Floats]]
    plane: Ints

    @staticmethod
    def drawn(layout: Layout, stops: Ints, declared: bool, rng: np.random.Generator) -> Plane:
        """Two level planes at different heights, and a tilted one, touched in turn."""
        name, targets = "bed", Targets.one()
        tilted = np.sin(TILTED) * layout.axes[0] + np.cos(TILTED) * layout.up
        planes = {
            "low": (layout.at(0.0, 0.0, -APART), layout.up),
            "high": (layout.at(0.0, 0.0, APART), layout.up),
            "tilted": (layout.at(0.0, 0.0, 0.0), tilted),
        }
        priors = {"height": HEIGHT_SIGMA, "a": NORMAL_SIGMA, "b": NORMAL_SIGMA}
        off = [
            Hidden(f"{name}.plane[{plane}].{what}", prior * rng.standard_normal(), prior)
            for plane in planes
            for what, prior in priors.items()
        ]
        hidden = (*targets.drawn(name, rng), *off)
        return Plane(name, stops, hidden, declared, targets, planes, np.arange(len(stops)) % len(planes))

    @property
    def sigma(self) -> Floats:
        """See :class:`Gauge`."""
        return np.full((len(self.stop), 1), SIGMA)

    def readings(self, poses: Poses, u: Floats) -> Floats:
        """See :class:`Gauge`."""
        height, a, b = u[3 * len(self.targets) :].reshape(-1, 3)[self.plane].T
        points = np.array([point for point, _ in self.planes.values()])[self.plane]
        normals = np.array([normal for _, normal in self.planes.values()])
        sideways = np.array([across(normal) for normal in normals])[self.plane]
        turned = exp(a[:, None] * sideways[:, 0] + b[:, None] * sideways[:, 1]) @ normals[self.plane][..., None]
        p = self.targets.positions(poses, u, np.zeros(len(poses), dtype=int))
        return np.asarray(np.einsum("ni,ni->n", turned[..., 0], p - points) - height)[:, None]

    def table(self) -> dict[str, Any]:
        """See :class:`Gauge`."""
        planes = {name: {"point": list(p), "normal": n.tolist()} for name, (p, n) in self.planes.items()}
        return {**self.targets.table(), "planes": planes}

    def columns(self, poses: Poses, errors: Floats) -> dict[str, Column]:
        """See :class:`Gauge`."""
        return {"plane": labels(tuple(self.planes), self.plane)}

    def ids(self) -> dict[str, tuple[str, ...]]:
        """See :class:`Gauge`."""
        return {"plane": tuple(self.planes)}

    @classmethod
    def by_row(cls) -> tuple[str, ...]:
        """See :class:`Gauge`."""
        return "stop", "plane"
