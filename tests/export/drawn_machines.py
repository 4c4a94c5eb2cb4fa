"""Shipped robots with geometries drawn from their tolerances."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import gtpin
from gtpin.bench.simulator.simulate import TrueRobot, draw_commands, draw_machine
from gtpin.errors import GtpinWarning
from gtpin.export import TablesFor, export


@dataclass(frozen=True)
class Drawn:
    """A model, commands (50, n) all over its range, and its poses there."""

    model: gtpin.Model
    q: np.ndarray
    poses: gtpin.Poses


def without_scales(model: gtpin.Model) -> gtpin.Model:
    """Drive scales have no place in most formats."""
    geometry = model.geometry
    kept = [p.nominal if p.kind == "scale" else v for p, v in zip(geometry.parameters, geometry.values, strict=True)]
    return gtpin.Model(geometry.with_values(np.array(kept)))


def draw(name: str) -> Drawn:
    """A shipped robot with a geometry of its own, and fifty commands."""
    rng = np.random.default_rng(len(name))
    machine = draw_machine(gtpin.load_robot(name), rng)
    model = without_scales(gtpin.Model(machine.geometry))
    q = draw_commands(TrueRobot(model.geometry), 50, rng)
    return Drawn(model, q, model.predict(q))


def told(model: gtpin.Model, file: Path, form: Any = None, session: str | None = None, **tables: Any) -> list[str]:
    """Write a file; what the export says in its warnings. ``tables``: options of ``TablesFor``."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", GtpinWarning)
        export(model, file, form, session=session, tables=TablesFor(**tables) if tables else None)
    return [str(warning.message) for warning in said]
