"""Registers all commands. Imports all their modules, which takes seconds."""

from __future__ import annotations

from typing import Annotated

import typer

from gtpin import __version__
from gtpin.commands.benchmark import benchmark_app
from gtpin.commands.blind import blind
from gtpin.commands.calibrate import calibrate
from gtpin.commands.certify import certify
from gtpin.commands.compare import compare
from gtpin.commands.demo import demo
from gtpin.commands.diagnose import diagnose
from gtpin.commands.export import export
from gtpin.commands.importing.app import import_app
from gtpin.commands.plan import plan
from gtpin.commands.predict import predict
from gtpin.commands.robots import robots
from gtpin.commands.sensitivity import sensitivity
from gtpin.commands.simulate import simulate
from gtpin.commands.view import view

app = typer.Typer(
    name="gtpin",
    help="Calibration of parallel robots and arms, and diagnosis of the causes of their errors.",
    no_args_is_help=True,
    epilog="Example: gtpin demo -o first-try",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command, *examples in (
    (demo, "gtpin demo -o first-try"),
    (
        diagnose,
        "gtpin diagnose measurements -o diagnosis",
        "gtpin diagnose measurements -o second --exclude backlash --exclude linearity@cart2",
        "gtpin diagnose today --against calibrated -o check",
    ),
    (calibrate, "gtpin calibrate measurements -o calibrated", "gtpin calibrate measurements -o paper3 --model 3"),
    (certify, "gtpin certify measurements -o certificate", "gtpin certify new_poses -o certificate --model diagnosis"),
    (compare, "gtpin compare measurements -o compared"),
    (
        predict,
        "gtpin predict diagnosis commands.csv -o predicted.csv",
        "gtpin predict gantry_tau commands.csv -o nominal.csv",
    ),
    (
        plan,
        "gtpin plan calibrated --for health --poses 10 -o ten",
        "gtpin plan gantry_tau --for calibration --poses 40 --position-sigma 15e-6 --orientation-sigma 5e-5 -o forty",
    ),
    (sensitivity, "gtpin sensitivity calibrated --poses commands.csv -o accuracy"),
    (export, "gtpin export calibrated -o robot.xml", "gtpin export diagnosis -o corrections.csv"),
    (
        simulate,
        "gtpin simulate -o virtual --poses 150 --seed 3",
        "gtpin simulate -o virtual --scenario examples/scenarios/backlash.toml",
    ),
    (view, "gtpin view gantry_tau", "gtpin view calibrated measurements -o gap.png"),
    (robots, "gtpin robots", "gtpin robots --json"),
    (blind, "gtpin blind -o check --cases 100", "gtpin blind -o check --from cases"),
):
    app.command(epilog="\n\n".join(["Examples:" if examples[1:] else "Example:", *examples]))(command)
app.add_typer(import_app)
app.add_typer(benchmark_app)


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
