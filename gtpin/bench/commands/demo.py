"""``gtpin demo``: the complete workflow on a virtual machine."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from gtpin.bench.simulator.case import simulate_scenario
from gtpin.bench.simulator.truth import truth_names
from gtpin.commands.terminal import AsJson, Force, Seed, output_option, progress_of, rendered, tell
from gtpin.diagnosis.diagnose import diagnose
from gtpin.model.model_folder import read_model
from gtpin.model.predict import predict
from gtpin.output.results import results_folder
from gtpin.report.calibration import CalibrationPresentation
from gtpin.report.diagnosis import DIAGNOSIS, DiagnosisPresentation
from gtpin.report.words import length


class DemoRobot(StrEnum):
    """Robots for which the demo has a scenario: the machine's effects and the measurement conditions."""

    GANTRY_TAU = "gantry_tau"
    UR5 = "ur5"

    @property
    def scenario(self) -> Path:
        """The scenario file."""
        return Path(__file__).with_name("scenarios") / f"{self}.toml"


SPOKEN = {DemoRobot.GANTRY_TAU: "Gantry-Tau", DemoRobot.UR5: "UR5"}
FILES = ("dataset", *truth_names("dataset"), "calibration", *DIAGNOSIS)


def demo(
    output: Annotated[Path, output_option("Folder for the results; created.", show_default=True)] = Path("gtpin-demo"),
    robot: Annotated[
        DemoRobot, typer.Option(help="The virtual machine: a parallel robot or an arm.")
    ] = DemoRobot.GANTRY_TAU,
    seed: Seed = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """The complete workflow on a virtual machine with hidden effects: simulate, calibrate, diagnose, report.

    Writes dataset/ as simulate does, calibration/ as calibrate does, and the files that diagnose writes.
    """
    with results_folder(output, FILES, force=force) as folder:
        with progress_of("demo") as progress:
            progress("simulating a machine and its measurement", 0, float("nan"))
            case = simulate_scenario(robot.scenario, seed=seed)
            case.write(folder, "dataset")
            found = diagnose(case.dataset, seed=seed, progress=progress)
            progress("writing reports", 0, float("nan"))
            shown = DiagnosisPresentation(found)
            result = shown.write(folder)
            CalibrationPresentation(replace(found.baseline, dataset=case.dataset)).write(folder / "calibration")
        models = {
            "nominal": read_model(case.dataset.robot),
            "calibrated": found.baseline.model,
            "diagnosed": found.model,
        }
        # Root mean square length of each model's true position error on the poses that were never measured, m.
        left = {name: predict(model, case.commands).T - case.truth.T for name, model in models.items()}
        held_out = {name: float(np.sqrt((off**2).sum(axis=1).mean())) for name, off in left.items()}
    has = ", ".join(f"{truth.effect} at {truth.site}" for truth in case.effects)
    errors = " -> ".join(f"{length(error)} {name}" for name, error in held_out.items())
    text = rendered(
        f"A virtual {SPOKEN[robot]}, {len(case.dataset)} measured poses. The diagnosis, from the measurements alone:\n",
        shown.terminal(output),
        f"\nWhat was hidden (dataset.truth.json): the machine has {has}.",
        f"True position error on {len(case.commands)} poses that were never measured, RMS: {errors}.",
        f"Also written: {', '.join(str(output / name) for name in ('dataset', 'calibration', 'diagnosis.json', 'model'))}",
        f"Open {output / 'report.html'}",
    )
    truths = {"effects": [{"effect": truth.effect, "site": truth.site} for truth in case.effects], "true_rms": held_out}
    tell(result | {"truth": truths}, text, as_json)
