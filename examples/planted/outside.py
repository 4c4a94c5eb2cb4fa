"""Causes that are in no catalogue: deviations of one joint's travel, as effects that gtpin's kinematics can apply."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gtpin.effects import Effect, OperatingPoints, along_track
from gtpin.effects.displacement import Displacement
from gtpin.effects.smooth import loads_of
from gtpin.robot.chain import Chain

NAMES = ("gaussian_process", "product_of_joints", "load_cube_root", "pit")
LENGTH, WAVES = 0.2, 60
"""Length scale of the Gaussian process where the travel is from -1 to 1 (a tenth of it), and its number of random waves."""
PIT = 0.08
"""Half width of the pit, in the same unit."""


class Form(Effect):
    """A form drawn with a seed: the same for every call."""

    title = "a form outside the catalogue"
    coefficient = ("size", "")

    def __init__(self, name: str, seed: int) -> None:
        self.id, self.seed = name, seed

    def sites(self, robot: Chain) -> tuple[str, ...]:
        return robot.sites

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        return along_track(at, site, self._form(at, site)[:, None], np.array([1e-4]))

    def _form(self, at: OperatingPoints, site: str) -> NDArray[np.float64]:
        rng, x, j = np.random.default_rng(self.seed), at.travel, at.robot.sites.index(site)
        if self.id == "gaussian_process":  # squared exponential, by random Fourier features
            waves, phases = rng.normal(0.0, 1.0 / LENGTH, WAVES), rng.uniform(0.0, 2.0 * np.pi, WAVES)
            return np.asarray(np.cos(x[:, j, None] * waves + phases).sum(axis=1) * np.sqrt(2.0 / WAVES))
        if self.id == "product_of_joints":
            other = rng.choice([k for k in range(x.shape[1]) if k != j])
            return np.asarray(x[:, j] * x[:, other])
        if self.id == "load_cube_root":
            rods = at.robot.rod_sites
            load, usual = (at.force[:, j % len(rods)], 10.0) if rods else (loads_of(at, site)[0][:, 0], 1.0)
            return np.cbrt(load / usual)
        return np.asarray(1.0 / (1.0 + np.exp((np.abs(x[:, j] - rng.uniform(-0.6, 0.6)) - PIT) / 0.01)))
