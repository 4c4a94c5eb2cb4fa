"""A proposal of what to measure next, and its words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.diagnosis.planning.measurement_conditions import kind
from gtpin.effects.situation import Column

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Experiment:
    """What to measure next.

    Parameters
    ----------
    measure
        What to do, in a sentence or two.
    separates
        The effects (``effect@site``) that it parts from each other, or that it reveals.
    poses
        (K, n) commands in the order in which they are best measured; none where no poses help.
    covariates
        By name, (K,) each: what to set beside the commands.
    expected_gain
        Expected log Bayes factor, nats, between the effects it separates (or for one that it reveals); None where not known.
    random_gain
        The same for as many poses and circumstances drawn at random.
    """

    measure: str
    separates: tuple[str, ...]
    poses: Floats
    covariates: Mapping[str, Column] = field(default_factory=dict)
    expected_gain: float | None = None
    random_gain: float | None = None

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


def settings(covariates: Mapping[str, Column], sites: Sequence[str], reference: float) -> str:
    """What to set of covariates (K,) beside the commands, as the end of a sentence; empty where nothing is to be set.

    Parameters
    ----------
    sites
        Names of the actuators.
    reference
        degC at which the geometry holds.
    """
    kinds: dict[str, dict[str, Column]] = {}
    for name, values in covariates.items():
        kinds.setdefault(kind(name), {})[name] = values
    return "".join(f"; {_setting(what, values, sites, reference)}" for what, values in kinds.items())


def _setting(what: str, covariates: Mapping[str, Column], sites: Sequence[str], reference: float) -> str:
    """Covariates of one kind."""
    if what == "session":
        return "in a session of their own"
    values = np.stack([np.asarray(v, dtype=float) for v in covariates.values()], axis=1)
    if what == "time":
        return f"spread over {np.ptp(values) / 3600.0:.1g} hours"
    if what in ("approach", "speed"):
        moved = listed([sites[int(name.removeprefix(what)) - 1] for name in covariates])
        if what == "approach":
            return f"come to about half of them with {moved} moving up, to the others moving down, as listed"
        passed = np.count_nonzero(values.any(axis=1))
        return f"pass {passed} of them with {moved} at up to {np.abs(values).max():.2g} per second, as listed"
    if what == "force":
        size = np.linalg.norm(values, axis=1)
        return (
            f"push on the tool with up to {size.max():.0f} N at {np.count_nonzero(size)} of them, along the base frame's axes "
            "as listed, and never harder than the machine is rated for"
        )
    if what == "temperature":
        cold = int((values[:, 0] == reference).sum())
        return f"{cold} with the machine cold, {len(values) - cold} with it warm"
    levels, counts = np.unique(values, return_counts=True)
    if what == "payload":
        return f"with {listed([f'{v:g} kg at {n}' for v, n in zip(levels, counts, strict=True)])} of them"
    return f"{what} from {levels[0]:g} to {levels[-1]:g}"


def listed(words: Sequence[str]) -> str:
    """``a``, ``a and b``, ``a, b and c``."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
