"""Every shipped robot, with a geometry drawn from its tolerances, and fifty commands."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
from drawn_machines import Drawn, draw

import gtpin
from gtpin.export import export


@pytest.fixture(scope="session")
def drawn_of() -> Callable[[str], Drawn]:
    """Draws a robot, once."""
    return cache(draw)


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
