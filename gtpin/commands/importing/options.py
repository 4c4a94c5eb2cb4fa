"""Options that several formats share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gtpin.commands.terminal import output_path, tell

SourceFile = Annotated[Path, typer.Argument(metavar="FILE", help="The file to read.", show_default=False)]
Folder = Annotated[
    Path,
    typer.Option(
        "-o",
        "--output",
        help="Folder of the dataset; created.",
        show_default=False,
        parser=output_path,
        metavar="<path>",
    ),
]
RobotName = Annotated[
    str,
    typer.Option("--robot", help="Name of the robot, or path of its URDF or MJCF file.", show_default=False),
]
Vector = tuple[float, float, float]
ProbeOffset = Annotated[
    Vector,
    typer.Option(
        "--probe-offset",
        metavar="X Y Z",
        help="The probe's offset as the firmware's configuration has it, mm.",
    ),
]
Origin = Annotated[
    Vector,
    typer.Option("--origin", metavar="X Y Z", help="The controller's zero in the robot's base frame, m."),
]
Normal = Annotated[
    Vector,
    typer.Option("--normal", metavar="X Y Z", help="Of the surface, towards the side that was touched, base frame."),
]
Sigma = Annotated[
    float | None,
    typer.Option("--sigma", help="1 sigma of a touch along the normal, m.", show_default="estimated"),
]
Name = Annotated[str, typer.Option("--name", help="Of the instrument, and of its table.")]


def written(rows: int, what: str, robot: str, dataset: Path, as_json: bool) -> None:
    """Print what was written."""
    result = {"dataset": str(dataset), "robot": robot, "rows": rows}
    tell(result, f"{rows} {what} of {robot}. Written: {dataset}", as_json)
