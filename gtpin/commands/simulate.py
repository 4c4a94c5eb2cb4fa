"""``gtpin simulate``: a dataset of a virtual machine."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from gtpin.commands.terminal import AsJson, Output, Seed, tell
from gtpin.output import results_folder
from gtpin.plant.simulate import Simulation
from gtpin.plant.simulate import simulate as run_simulation
from gtpin.predict import prediction_table
from gtpin.robot.library import load_robot


def simulate(
    output: Output,
    robot: Annotated[str, typer.Option("--robot", help="Name of a shipped robot, or path of a URDF.")] = "gantry_tau",
    poses: Annotated[int, typer.Option("--poses", help="Number of measured poses.", min=1)] = 200,
    seed: Seed = 0,
    truth: Annotated[
        bool, typer.Option("--truth", help="Also write truth.csv, the true poses at commands.csv.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Write a dataset of a virtual machine: a robot drawn from its tolerances, measured by a noisy tracker."""
    with results_folder(output) as folder:
        simulation = run_simulation(load_robot(robot), _seen_from(robot, output), poses=poses, seed=seed)
        write_simulation(simulation, folder, truth)
    result = {"dataset": str(output), "robot": robot, "rows": len(simulation.dataset), "seed": seed}
    tell(result, f"{len(simulation.dataset)} measured poses of a virtual {robot}. Written: {output}", as_json)


def write_simulation(simulation: Simulation, folder: Path, truth: bool) -> None:
    """Write ``dataset.toml``, ``poses.csv``, ``commands.csv`` and, if wanted, ``truth.csv``."""
    simulation.dataset.write(folder / "whole")
    for file in (folder / "whole").iterdir():
        file.rename(folder / file.name)
    (folder / "whole").rmdir()
    simulation.commands.write(folder / "commands.csv")
    if truth:
        table = prediction_table(simulation.commands, simulation.truth)
        table.to_csv(folder / "truth.csv", index=False, lineterminator="\n")


def _seen_from(robot: str, output: Path) -> str:
    """How a dataset in a folder names a robot: a path starts at the folder."""
    if robot.endswith(".urdf") or os.sep in robot:
        return Path(os.path.relpath(robot, output)).as_posix()
    return robot
