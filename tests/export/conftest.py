"""Every shipped robot, with a geometry drawn from its tolerances, and fifty commands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import gtpin
from gtpin.export import export
from gtpin.plant.simulate import draw_commands, draw_machine


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


@pytest.fixture(scope="session")
def drawn_of() -> Callable[[str], Drawn]:
    known: dict[str, Drawn] = {}

    def drawn(name: str) -> Drawn:
        if name not in known:
            rng = np.random.default_rng(len(name))
            model = without_scales(draw_machine(gtpin.load_robot(name), rng))
            q = draw_commands(model, 50, rng)
            known[name] = Drawn(model, q, model.predict(q))
        return known[name]

    return drawn


@pytest.fixture(params=gtpin.robot_names())
def drawn(request: pytest.FixtureRequest, drawn_of: Callable[[str], Drawn]) -> Drawn:
    return drawn_of(request.param)


@pytest.fixture
def exported(drawn: Drawn, tmp_path: Path) -> Callable[[str], Path]:
    """Writes the drawn model to a file with a suffix, in a folder of its own."""

    def write(suffix: str) -> Path:
        file = tmp_path / f"robot{suffix}"
        export(drawn.model, file)
        return file

    return write
