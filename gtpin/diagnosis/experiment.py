"""A proposal of what to measure next, as data; ``gtpin.report.next_experiment`` puts it into words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from gtpin.effects.operating_points import Column
from gtpin.effects.untestable import Untestable
from gtpin.output.shown import present
from gtpin.robot.chain import Chain
from gtpin.typing import Floats


@dataclass(frozen=True)
class Lacking:
    """Why effects can't be tested so far.

    ``covariates``: the covariates that are missing or do not vary; empty where the reason is another one. ``missing``: True:
    these covariates are missing. False: they do not vary. ``reason``: why the first of the effects can't be tested.
    """

    covariates: tuple[str, ...]
    missing: bool
    reason: Untestable | None


@dataclass(frozen=True, eq=False)
class Visits:
    """Visits along the coordinates that an unknown effect depends on, all else unchanged.

    ``site``, ``coordinates``: site and coordinates of the smooth nonparametric term that explains the unknown effect best.
    ``pattern``: ``line``: one actuator alone, there and back. ``net``: two actuators alone. ``spread``: poses all over the
    workspace. ``repeated``: the same few poses at each level of some covariates. ``again``: measured poses, each twice more.
    ``actuators``: for ``line`` and ``net``: sites of the actuators that move. ``stations``: for ``repeated``: number of poses
    that are visited at each level; for ``again``: number of poses. ``varied``, ``levels``: for ``repeated``: names of the
    covariates, all of one kind, and (R,) the value to which all of them are set in each round of visits.
    """

    site: str
    coordinates: str
    pattern: Literal["line", "net", "spread", "repeated", "again"]
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
        ``discriminate``: it distinguishes effects that the present data can't distinguish, or an effect from none.
        ``map_unknown``: it shows how an unknown effect depends on its coordinates. ``make_testable``: it makes effects
        testable.
    robot
        The machine to measure.
    effects
        Effect and site of each hypothesis that it distinguishes or makes testable, the leader first; empty for ``map_unknown``.
    poses
        (K, n) commands, m or rad, in the order of measurement; K = 0 where no poses help.
    covariates
        Measurement conditions to set at these commands: (K,) values of each covariate, by name.
    expected_gain
        Expected log Bayes factor, nats, between the effects that it distinguishes, or between an effect that it makes
        testable and no effect; None where not known.
    random_gain
        The same for as many poses and measurement conditions drawn at random.
    reference_temperature
        Temperature at which the geometry holds, degC: that of a cold machine.
    settles
        For ``discriminate``: probability that one of its effects is sure after this experiment; None where not known.
    rounds
        For ``discriminate``: number of such experiments after which the question is settled with a probability of 80 %; None
        where more than ten are needed.
    watch
        Sites whose motion should be measured directly, because poses show too little of it.
    lacking
        For ``make_testable``: why its effects can't be tested so far.
    visits
        For ``map_unknown``: what is visited.
    """

    kind: Literal["discriminate", "map_unknown", "make_testable"]
    robot: Chain
    effects: tuple[tuple[str, str], ...]
    poses: Floats
    covariates: Mapping[str, Column] = field(default_factory=dict)
    expected_gain: float | None = None
    random_gain: float | None = None
    reference_temperature: float = 20.0
    settles: float | None = None
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
        return str(present(self).short())

    def to_json(self) -> dict[str, Any]:
        """One entry of ``next_experiment`` in ``diagnosis.json``."""
        return {
            "measure": self.measure,
            "separates": list(self.separates),
            "poses": self.poses.tolist(),
            "covariates": {name: values.tolist() for name, values in self.covariates.items()},
            "expected_gain": self.expected_gain,
            "random_gain": self.random_gain,
            "settles": self.settles,
        }
