"""``gtpin simulate``: a dataset of a virtual machine."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from gtpin.bench.simulator.case import scenario_recipe, simulate_scenario
from gtpin.bench.simulator.instruments.build import KINDS, build_measured, simulate_measured
from gtpin.bench.simulator.simulate import simulate as run_simulation
from gtpin.bench.simulator.truth import Simulation, case_folders, truth_names
from gtpin.commands.terminal import AsJson, Force, Output, Tcp, tell
from gtpin.data.files import write_table
from gtpin.errors import GtpinError
from gtpin.kinematics.poses import Poses
from gtpin.model.predict import prediction_columns
from gtpin.references import seen_from
from gtpin.robot.library import load_robot

ROBOT, POSES, SEED = "gantry_tau", 200, 0
"""Defaults of the simulation."""
Instruments = Annotated[
    list[str] | None,
    typer.Option(
        help=f"What measures: {', '.join(KINDS)}. Can be given several times.", show_default="a tracker, schema 1"
    ),
]


def simulate(
    output: Output,
    robot: Annotated[
        str | None,
        typer.Option(
            help="Name of a robot, or path of a URDF or MJCF file.", show_default="the scenario's, or gantry_tau"
        ),
    ] = None,
    scenario: Annotated[Path | None, typer.Option(help="TOML file that says which effects the machine has.")] = None,
    poses: Annotated[
        int | None, typer.Option(help="Number of measured poses.", min=1, show_default="the scenario's, or 200")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Makes every random step repeatable.", min=0, show_default="the scenario's, or 0")
    ] = None,
    tcp: Tcp = None,
    instrument: Instruments = None,
    truth: Annotated[
        bool, typer.Option("--truth", help="Also write truth.csv, the true poses at commands.csv.")
    ] = False,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Write a dataset of a virtual machine: a robot drawn from its tolerances, measured by a noisy tracker.

    With a scenario the machine has the effects that it lists. They are written to DATASET.truth.json, and the true poses at
    commands.csv to DATASET.truth.csv, next to the dataset. Without a scenario, these two files are deleted if gtpin wrote
    them: they belong to the dataset that is replaced.

    With --instrument the dataset is of schema 2, with a table for each instrument, and DATASET.truth.json also has what is
    hidden of the instruments and of the geometry.
    """
    if scenario is not None and tcp is not None:
        raise GtpinError("--tcp with --scenario", hint="name the TCP in the robot's URDF: <platform link>")
    plain, place, name = scenario is None and not instrument, Path(os.path.abspath(output)), robot or ROBOT
    if not plain and not place.name:  # the files with the truth get names made from it
        raise GtpinError("there is no place for the truth next to it", file=output, hint="name another folder")
    with case_folders(output, force=force, truth=not plain) as (folder, truth_folder):
        options: dict[str, Any] = {"poses": poses or POSES, "seed": seed or SEED}
        case: Simulation
        if plain:
            case = run_simulation(load_robot(name, tcp), name, **options)
        elif scenario is None:
            case = simulate_measured(load_robot(name, tcp), name, instrument or (), **options)
        elif instrument:
            case = build_measured(scenario_recipe(scenario, seed=seed, poses=poses, robot=robot), instrument)
        else:
            case = simulate_scenario(scenario, seed=seed, poses=poses, robot=robot)
        seen = {"robot": seen_from(case.dataset.robot, output), **({} if scenario else {"tcp": tcp})}
        case = replace(case, dataset=replace(case.dataset, **seen))
        case.write_dataset(folder)
        if not plain:
            case.write_truth(truth_folder, place.name)
        if truth:
            write_table(folder / "truth.csv", prediction_columns(case.commands, Poses(case.truth.T, case.truth.R)))
    name, seed = (case.recipe.robot, case.recipe.seed) if case.recipe else (name, options["seed"])
    rows, also = len(case.dataset), "" if plain else f", truth: {output.parent / truth_names(place.name)[0]}"
    result = {"dataset": str(output), "robot": name, "rows": rows, "seed": seed}
    what = "readings" if instrument else "measured poses"
    tell(result, f"{rows} {what} of a virtual {name}. Written: {output}{also}", as_json)
