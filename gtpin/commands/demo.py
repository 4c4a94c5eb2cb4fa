"""``gtpin demo``: the main job on a virtual machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from gtpin.calibration.calibrate import calibrate
from gtpin.commands.calibrate import write_calibration
from gtpin.commands.simulate import write_simulation
from gtpin.commands.terminal import AsJson, Seed, progress_of, tell
from gtpin.model import Model
from gtpin.model_folder import read_model
from gtpin.output import results_folder
from gtpin.plant.simulate import Simulation, simulate
from gtpin.predict import predict
from gtpin.robot.library import load_robot


def demo(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the results; created.")] = Path(
        "gtpin-demo"
    ),
    seed: Seed = 0,
    as_json: AsJson = False,
) -> None:
    """The main job on a virtual Gantry-Tau: simulate, calibrate, check on held-out poses, report."""
    with results_folder(output) as folder:
        simulation = simulate(load_robot("gantry_tau"), "gantry_tau", seed=seed)
        write_simulation(simulation, folder / "dataset", truth=True)
        with progress_of("calibrating") as progress:
            calibration = calibrate(simulation.dataset, progress=progress)
        before, after = _error(read_model("gantry_tau"), simulation), _error(calibration.model, simulation)
        verdict = (
            f"On {len(simulation.commands)} held-out poses the true position error falls from {before * 1e6:.0f} um (nominal) "
            f"to {after * 1e6:.1f} um (calibrated), RMS."
        )
        result = write_calibration(calibration, folder, verdict=verdict)
    result |= {"held_out_rms_before": before, "held_out_rms_after": after}
    tell(result, f"{verdict}\nOpen {output / 'report.txt'}", as_json)


def _error(model: Model, simulation: Simulation) -> float:
    """Root mean square length of a model's true position error on the held-out poses, m."""
    left = predict(model, simulation.commands).minus(simulation.truth)[:, :3]
    return float(np.sqrt((left**2).sum(axis=1).mean()))
