"""Write the URDFs of the shipped machines from their sketches: python examples/machines/write.py [FOLDER]."""

from __future__ import annotations

import sys
from pathlib import Path

import gantry_tau_6dof
import linear_delta
import stewart
import stewart_jugglebot
import tau
from machine_sketch import Sketch

URDF = Path(__file__).parents[2] / "urdf"


def sketches() -> tuple[Sketch, ...]:
    """All machines that are written from a sketch."""
    return tuple(module.sketch() for module in (tau, gantry_tau_6dof, stewart, linear_delta, stewart_jugglebot))


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else URDF
    for sketch in sketches():
        (folder / f"{sketch.name}.urdf").write_text(sketch.urdf(), encoding="utf-8")
