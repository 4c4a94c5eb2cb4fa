"""Registers the commands, and imports their modules: of all commands, or of the one that is called."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Annotated

import typer

from gtpin import __version__

COMMANDS = {
    "demo": ["gtpin demo -o first-try"],
    "diagnose": [
        "gtpin diagnose measurements -o diagnosis",
        "gtpin diagnose measurements -o second --exclude backlash --exclude linearity@cart2",
        "gtpin diagnose today --against calibrated -o check",
    ],
    "calibrate": ["gtpin calibrate measurements -o calibrated", "gtpin calibrate measurements -o paper3 --model 3"],
    "certify": [
        "gtpin certify measurements -o certificate",
        "gtpin certify new_poses -o certificate --model diagnosis",
    ],
    "compare": ["gtpin compare measurements -o compared"],
    "predict": [
        "gtpin predict diagnosis commands.csv -o predicted.csv",
        "gtpin predict gantry_tau commands.csv -o nominal.csv",
    ],
    "plan": [
        "gtpin plan calibrated --for health --poses 10 -o ten",
        "gtpin plan gantry_tau --for calibration --poses 40 --position-sigma 15e-6 --orientation-sigma 5e-5 -o forty",
    ],
    "sensitivity": ["gtpin sensitivity calibrated --poses commands.csv -o accuracy"],
    "export": ["gtpin export calibrated -o robot.xml", "gtpin export diagnosis -o corrections.csv"],
    "simulate": [
        "gtpin simulate -o virtual --poses 150 --seed 3",
        "gtpin simulate -o virtual --scenario examples/scenarios/backlash.toml",
    ],
    "view": ["gtpin view gantry_tau", "gtpin view calibrated measurements -o gap.png"],
    "robots": ["gtpin robots", "gtpin robots --json"],
    "blind": ["gtpin blind -o check --cases 100", "gtpin blind -o check --from cases"],
}
"""Examples of each command. A command is the function of its name in the module of its name."""

GROUPS = {
    "import": ("gtpin.commands.importing", "import_app"),
    "benchmark": ("gtpin.commands.benchmark", "benchmark_app"),
}
"""Module and name of each group of commands."""


def app_for(words: Sequence[str]) -> typer.Typer:
    """The command line for a call with these words. It has only the command that the first word names, because importing the
    modules of all commands takes longer; it has all commands where the first word names none, for help and error messages.
    """
    known = {*COMMANDS, *GROUPS}
    called = known.intersection(words[:1]) or known
    made = typer.Typer(
        name="gtpin",
        help="Calibration of parallel robots and arms, and diagnosis of the causes of their errors.",
        no_args_is_help=True,
        epilog="Example: gtpin demo -o first-try",
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    for name, examples in COMMANDS.items():
        if name in called:
            epilog = "\n\n".join(["Examples:" if examples[1:] else "Example:", *examples])
            made.command(epilog=epilog)(getattr(import_module(f"gtpin.commands.{name}"), name))
    for name, (module, group) in GROUPS.items():
        if name in called:
            made.add_typer(getattr(import_module(module), group))
    made.callback()(_options)
    return made


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"gtpin {__version__}")
        raise typer.Exit


def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass
