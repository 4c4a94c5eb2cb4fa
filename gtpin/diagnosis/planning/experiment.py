"""A proposal of what to measure next, as data; ``gtpin.report.measurements`` makes sentences of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from gtpin.effects.situation import Column
from gtpin.effects.untestable import Untestable
from gtpin.robot.robot import Robot

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Lacking:
    """Why effects can't be tested so far.

    Parameters
    ----------
    covariates
        Those that are missing or do not vary; none where something else is the matter.
    missing
        Whether they are missing.
    reason
        Why the first of the effects can't be tested.
    """

    covariates: tuple[str, ...]
    missing: bool
    reason: Untestable | None


@dataclass(frozen=True, eq=False)
class Visits:
    """Visits along the coordinates that an unknown effect depends on, all else unchanged.

    Parameters
    ----------
    site, coordinates
        Of the smooth nonparametric term that explains the unknown effect best.
    pattern
        ``line``: one actuator alone, there and back. ``net``: two actuators alone. ``spread``: poses all over the workspace.
        ``repeated``: the same few poses under one level of some covariates after the other.
    actuators
        Of ``line`` and ``net``: sites of the actuators that move.
    stations
        Of ``repeated``: number of poses that are visited at each level.
    varied, levels
        Of ``repeated``: names of the covariates, all of one kind, and (R,) what all of them are set to in each round.
    """

    site: str
    coordinates: str
    pattern: Literal["line", "net", "spread", "repeated"]
    actuators: tuple[str, ...] = ()
    stations: int = 0
    varied: tuple[str, ...] = ()
    levels: Column = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, eq=False)
class Experiment:
    """What to measure next.

    Parameters
    ----------
    kind
        ``discriminate``: it tells effects that the data can't tell apart from each other, or one from no effect.
        ``map_unknown``: it shows an unknown effect along its coordinates. ``make_testable``: it lets effects be tested.
    robot
        The machine to measure.
    effects
        Effect and site of all that it separates or makes testable, the leading one first; none where the effect is unknown.
    poses
        (K, n) commands in the order in which they are best measured; none where no poses help.
    covariates
        By name, (K,) each: what to set in addition to the commands.
    expected_gain
        Expected log Bayes factor, nats, between the effects it separates (or for one that it makes testable); None where not
        known.
    random_gain
        The same for as many poses and measurement conditions drawn at random.
    reference_temperature
        degC of a cold machine, at which the geometry holds.
    rounds
        How many such experiments it takes to settle the question, where one does not.
    watch
        Sites to measure by themselves, where poses alone tell too little.
    lacking
        Of ``make_testable``: why its effects can't be tested so far.
    visits
        Of ``map_unknown``: what is visited.
    """

    kind: Literal["discriminate", "map_unknown", "make_testable"]
    robot: Robot
    effects: tuple[tuple[str, str], ...]
    poses: Floats
    covariates: Mapping[str, Column] = field(default_factory=dict)
    expected_gain: float | None = None
    random_gain: float | None = None
    reference_temperature: float = 20.0
    rounds: int | None = None
    watch: tuple[str, ...] = ()
    lacking: Lacking | None = None
    visits: Visits | None = None

    @property
    def separates(self) -> tuple[str, ...]:
        """Its effects as ``effect@site``; ``unknown`` where it maps an unknown one."""
        return ("unknown",) if self.kind == "map_unknown" else tuple(f"{e}@{site}" for e, site in self.effects)

    @property
    def measure(self) -> str:
        """What to do, in a sentence or two."""
        from gtpin.report.measurements import measure_words  # sentences are made in the report

        return measure_words(self)

    def to_json(self) -> dict[str, Any]:
        """One entry of ``next_experiment`` in ``diagnosis.json``."""
        return {
            "measure": self.measure,
            "separates": list(self.separates),
            "poses": self.poses.tolist(),
            "covariates": {name: values.tolist() for name, values in self.covariates.items()},
            "expected_gain": self.expected_gain,
            "random_gain": self.random_gain,
        }
