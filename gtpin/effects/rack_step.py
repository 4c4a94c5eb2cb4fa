"""A step where two rack segments meet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.effect import Effect, Floats, carts, unit
from gtpin.effects.situation import Situation
from gtpin.robot.robot import Robot


class RackStep(Effect):
    """dq = h where q is beyond the joint, else 0; a segment beyond a bad joint may also be inclined a little."""

    id = "rack_step"
    title = "step where two rack segments meet"
    coefficient = ("step", "m")

    def sites(self, robot: Robot) -> tuple[str, ...]:
        """Every actuator."""
        return carts(robot)

    def settings(self, at: Situation, site: str) -> Sequence[float]:
        """Places between neighbouring commands, away from the ends."""
        q = np.unique(at.q[:, at.robot.sites.index(site)])
        between = (q[1:] + q[:-1]) / 2.0
        edge = max(3, len(between) // 25)
        inner = between[edge:-edge]
        return [float(place) for place in inner[:: max(1, len(inner) // 100)]]

    def basis(self, at: Situation, site: str, setting: float | None = None) -> Basis:
        """The step, and a slope beyond it."""
        assert setting is not None
        j = at.robot.sites.index(site)
        beyond = (at.q[:, j] > setting).astype(float)
        span = at.robot.upper[j] - at.robot.lower[j]
        columns = np.stack([beyond, beyond * (at.q[:, j] - setting) / span], axis=1)
        return along_track(at, site, columns, unit([1.0, 0.3], 5e-5))

    def parameters(self, coefficients: Floats, setting: float | None) -> dict[str, tuple[float, str]]:
        """Place and height."""
        return {"place": (float(setting or 0.0), "m"), "step": (float(coefficients[0]), "m")}
