"""Targets: points on the platform, declared in the TCP frame, and their true positions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.bench.simulator.instruments.gauge import Hidden
from gtpin.bench.simulator.poses import Poses
from gtpin.typing import Floats, Ints

SIGMA = 1e-4
"""Standard deviation of a target's position, per axis, m: from a drawing and the errors of assembly."""
ONE = (0.02, -0.03, 0.05)
"""A single target, TCP frame, m."""
THREE = {"A": (0.06, 0.0, 0.01), "B": (-0.03, 0.05, 0.02), "C": (-0.03, -0.05, 0.06)}
"""Three targets, from which the platform's orientation can be determined, TCP frame, m."""


@dataclass(frozen=True, eq=False)
class Targets:
    """Declared targets of an instrument: a point (3,), TCP frame, m, by id; a single target has the id ""."""

    points: dict[str, tuple[float, float, float]]

    @staticmethod
    def one() -> Targets:
        """A single target."""
        return Targets({"": ONE})

    @staticmethod
    def three() -> Targets:
        """Three targets."""
        return Targets(THREE)

    def __len__(self) -> int:
        return len(self.points)

    @property
    def names(self) -> tuple[str, ...]:
        """Their ids."""
        return tuple(self.points)

    def table(self) -> dict[str, Any]:
        """The targets' keys in dataset.toml."""
        named = {name: list(point) for name, point in self.points.items()}
        return {"target_sigma": SIGMA, **({"target": named[""]} if "" in named else {"targets": named})}

    def drawn(self, instrument: str, rng: np.random.Generator) -> tuple[Hidden, ...]:
        """True positions of the targets, TCP frame: three unknowns each."""
        return tuple(
            Hidden(
                f"{instrument}.target{f'[{name}]' if name else ''}.{axis}", at + SIGMA * rng.standard_normal(), SIGMA
            )
            for name, point in self.points.items()
            for axis, at in zip("xyz", point, strict=True)
        )

    def positions(self, poses: Poses, u: Floats, which: Ints) -> Floats:
        """(M, 3) positions of the targets ``which`` (M,), m, base frame; the unknowns ``u`` begin with the targets'."""
        local = u[: 3 * len(self)].reshape(-1, 3)[which]
        return np.asarray(poses.T + np.einsum("nij,nj->ni", poses.R, local))


def labels(names: tuple[str, ...], which: Ints) -> npt.NDArray[np.object_]:
    """(M,) names by their indices."""
    return np.array(names, dtype=object)[which]
