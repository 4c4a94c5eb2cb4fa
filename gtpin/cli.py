"""The command line."""

from __future__ import annotations

import json
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import Progress as RichProgress
from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

from gtpin import __version__
from gtpin.calibration.calibrate import calibrate as run_calibration
from gtpin.calibration.result import Calibration
from gtpin.calibration.rounds import Progress
from gtpin.data import Commands, Dataset
from gtpin.errors import ConvergenceError, GtpinError, GtpinWarning
from gtpin.model_folder import read_model, write_model
from gtpin.output import results_folder
from gtpin.plant.simulate import Simulation
from gtpin.plant.simulate import simulate as run_simulation
from gtpin.predict import predict as run_prediction
from gtpin.predict import prediction_table
from gtpin.report.calibration_text import calibration_text
from gtpin.robot.library import load_robot

INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""

app = typer.Typer(
    name="gtpin",
    help="Closed-chain kinematics, calibration and diagnosis of the Gantry-Tau parallel robot and its kin.",
    no_args_is_help=True,
    epilog="Example: gtpin demo -o first-try",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Output = Annotated[Path, typer.Option("-o", "--output", help="Folder for the results; created.", show_default=False)]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON on standard output.")]
Seed = Annotated[int, typer.Option("--seed", help="Makes every random step repeatable.", min=0)]


@app.command(epilog="Example: gtpin calibrate measurements -o calibrated")
def calibrate(
    dataset: Annotated[Path, typer.Argument(help="Folder that holds dataset.toml and poses.csv.")],
    output: Output,
    as_json: AsJson = False,
) -> None:
    """Identify the robot's geometry from measured poses."""
    with results_folder(output) as folder:
        with _progress("calibrating") as progress:
            calibration = run_calibration(Dataset.read(dataset), progress=progress)
        _write_calibration(calibration, folder)
    _tell(calibration.to_json(), calibration_text(calibration), as_json)
    if not as_json:
        typer.echo(f"\nWritten: {output / 'calibration.json'}, {output / 'report.txt'}, {output / 'model'}")


@app.command(epilog="Example: gtpin predict calibrated commands.csv -o predicted.csv")
def predict(
    model: Annotated[str, typer.Argument(help="Folder of a model, name of a shipped robot, or path of a URDF.")],
    commands: Annotated[Path, typer.Argument(help="CSV or Parquet table with the columns pose, q1 .. qn.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="CSV file for the poses.", show_default=False)],
    as_json: AsJson = False,
) -> None:
    """Predict what the instrument would read, without noise."""
    found = read_model(model)
    asked = Commands.read(commands, found.robot.n_actuators)
    table = prediction_table(asked, run_prediction(found, asked))
    if output.is_dir():
        raise GtpinError("this is a folder", file=output, hint="name a CSV file")
    with results_folder(output.parent) as folder:
        table.to_csv(folder / output.name, index=False, lineterminator="\n")
    _tell(table.to_dict(orient="records"), f"{len(table)} poses predicted. Written: {output}", as_json)


@app.command(epilog="Example: gtpin simulate -o virtual --poses 150 --seed 3")
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
        _write_simulation(simulation, folder, truth)
    result = {"dataset": str(output), "robot": robot, "rows": len(simulation.dataset), "seed": seed}
    _tell(result, f"{len(simulation.dataset)} measured poses of a virtual {robot}. Written: {output}", as_json)


@app.command(epilog="Example: gtpin demo -o first-try")
def demo(
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the results; created.")] = Path(
        "gtpin-demo"
    ),
    seed: Seed = 0,
    as_json: AsJson = False,
) -> None:
    """The main job on a virtual Gantry-Tau: simulate, calibrate, check on held-out poses, report."""
    with results_folder(output) as folder:
        simulation = run_simulation(load_robot("gantry_tau"), "gantry_tau", seed=seed)
        _write_simulation(simulation, folder / "dataset", truth=True)
        with _progress("calibrating") as progress:
            calibration = run_calibration(simulation.dataset, progress=progress)
        left = run_prediction(calibration.model, simulation.commands).minus(simulation.truth)[:, :3]
        off = run_prediction(read_model("gantry_tau"), simulation.commands).minus(simulation.truth)[:, :3]
        rms, nominal_rms = (float((e**2).sum(axis=1).mean() ** 0.5) for e in (left, off))
        verdict = (
            f"On {len(left)} held-out poses the true position error falls from {nominal_rms * 1e6:.0f} um (nominal) "
            f"to {rms * 1e6:.1f} um (calibrated), RMS."
        )
        _write_calibration(calibration, folder, verdict)
    result = calibration.to_json() | {"held_out_rms_before": nominal_rms, "held_out_rms_after": rms}
    _tell(result, f"{verdict}\nOpen {output / 'report.txt'}", as_json)


def _seen_from(robot: str, output: Path) -> str:
    """How a dataset in a folder names a robot: a path starts at the folder."""
    if robot.endswith(".urdf") or os.sep in robot:
        return Path(os.path.relpath(robot, output)).as_posix()
    return robot


def _write_calibration(calibration: Calibration, folder: Path, verdict: str = "") -> None:
    write_model(calibration.model, folder / "model")
    _write_json(folder / "calibration.json", calibration.to_json())
    text = calibration_text(calibration)
    (folder / "report.txt").write_text(f"{verdict}\n\n{text}" if verdict else text, encoding="utf-8")


def _write_simulation(simulation: Simulation, folder: Path, truth: bool) -> None:
    simulation.dataset.write(folder / "whole")
    for file in (folder / "whole").iterdir():
        file.rename(folder / file.name)
    (folder / "whole").rmdir()
    simulation.commands.write(folder / "commands.csv")
    if truth:
        table = prediction_table(simulation.commands, simulation.truth)
        table.to_csv(folder / "truth.csv", index=False, lineterminator="\n")


def _write_json(file: Path, content: object) -> None:
    file.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _tell(result: object, text: str, as_json: bool) -> None:
    typer.echo(json.dumps(result, indent=1, allow_nan=False) if as_json else text.rstrip("\n"))


@contextmanager
def _progress(what: str) -> Iterator[Progress]:
    """Progress of long work, for people: nothing where standard error is not a terminal."""
    console = Console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with RichProgress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what)

        def report(step: str, iteration: int, size: float) -> None:
            bar.update(task, description=f"{what}: {step}, iteration {iteration}, residuals {size:.3g} times the noise")

        yield report


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"gtpin {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


def _say(kind: str, text: Any) -> None:
    typer.echo(" ".join(f"gtpin: {kind}: {text}".split()), err=True)


def main() -> None:
    """Run the command line: exit 2 with one line on standard error for bad input, 1 where a solver did not converge."""
    warnings.showwarning = lambda message, *_, **__: _say("warning", message)
    warnings.simplefilter("ignore")
    warnings.simplefilter("always", GtpinWarning)
    sys.exit(_run())


def _run() -> int:
    try:
        code = app(standalone_mode=False) or 0
        if code == INTERRUPTED:  # typer makes a code of the exception
            raise KeyboardInterrupt
        return code
    except typer.TyperException as error:  # wrong options, missing arguments
        _say("error", f"{getattr(error, 'format_message', error.__str__)()} (gtpin --help tells more)")
        return 2
    except ConvergenceError as error:
        _say("error", error)
        return 1
    except GtpinError as error:
        _say("error", error)
        return 2
    except (KeyboardInterrupt, typer.Abort):
        _say("error", "interrupted")
        return INTERRUPTED
    except BrokenPipeError:
        return 0
    except Exception as error:
        if os.environ.get("GTPIN_TRACEBACK"):
            raise
        _say("error", f"a fault of gtpin's own: {type(error).__name__}: {error} (GTPIN_TRACEBACK=1 shows where)")
        return 3
