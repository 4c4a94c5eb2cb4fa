"""Measurement conditions of a machine: payloads, motion, number of sessions, columns that are recorded."""

from __future__ import annotations

from collections.abc import Collection
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

Finite = Annotated[float, Field(allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]


class Conditions(BaseModel):
    """Measurement conditions of a machine.

    Parameters
    ----------
    rest
        Share of the poses at which the machine stands still; it passes the others in motion.
    sessions
        Number of sessions. With two or more there is a column ``session``.
    payloads
        Payloads, kg, in ``payload_blocks`` blocks of time.
    push
        Standard deviation per axis, N, of forces on the tool. They act at half of the visits, drawn at random. Above 0 there
        are columns ``fx fy fz``.
    interval
        Mean time between visits, s.
    direct
        Share of the visits that are reached directly from the one before; the others through a point at some centimetres, so
        that each actuator approaches from a random side.
    order
        ``random``, or ``layers``: by the mean of the actuators' places in their ranges, in layers, and within a layer by the
        difference of the first two commands. The second visits follow after all first ones.
    warming
        Factor on the drawn changes of temperature.
    reference_temperature
        Temperature of everything when the day starts, degC.
    without
        Columns (or beginnings of their names, such as ``temp``) that the files lack.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    rest: Share = 0.5
    sessions: Annotated[int, Field(ge=1, le=20)] = 1
    payloads: Annotated[tuple[Annotated[float, Field(ge=0.0, le=200.0)], ...], Field(min_length=1)] = (0.0, 10.0, 20.0)
    payload_blocks: Annotated[int, Field(ge=1, le=100)] = 6
    push: Annotated[float, Field(ge=0.0, le=1000.0)] = 0.0
    interval: Annotated[float, Field(gt=0.0, le=3600.0)] = 25.0
    direct: Share = 0.3
    order: Literal["random", "layers"] = "random"
    warming: Annotated[float, Field(ge=0.0, le=10.0)] = 1.0
    reference_temperature: Finite = 20.0
    without: tuple[str, ...] = ()

    @staticmethod
    def draw(rng: np.random.Generator, needs: Collection[str] = (), capacity: float = 20.0) -> Conditions:
        """Random conditions; those that ``needs`` names (``session``, ``speed``, ``payload``, ``force``, ``heat``) vary.

        Payloads are up to ``capacity``, kg, and forces on the tool are proportional to it.
        """
        part = capacity / 20.0
        resting = rng.random() < 0.15 and "speed" not in needs
        sessions = int(rng.integers(2, 4)) if "session" in needs or rng.random() < 0.3 else 1
        constant = rng.random() < 0.15 and "payload" not in needs
        return Conditions(
            rest=1.0 if resting else round(float(rng.uniform(0.4, 0.65)), 2),
            sessions=sessions,
            payloads=(part * float(rng.choice([0.0, 10.0, 20.0])),) if constant else (0.0, 10.0 * part, 20.0 * part),
            payload_blocks=int(rng.integers(3, 13)),
            push=part
            * (round(float(rng.uniform(120.0, 250.0)), 0) if "force" in needs else 60.0 * bool(rng.random() < 0.3)),
            interval=round(float(rng.uniform(12.0, 45.0)), 1),
            direct=round(float(rng.uniform(0.0, 0.6)), 2),
            order="layers" if rng.random() < 0.1 else "random",
            warming=round(float(rng.uniform(1.0, 2.5) if "heat" in needs else rng.uniform(0.6, 1.8)), 2),
        )
