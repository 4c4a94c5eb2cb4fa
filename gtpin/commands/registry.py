"""Registers the commands, and imports their modules: of all commands, or of the one that is called.

Commands of ``gtpin lab`` make and judge virtual machines, or study a robot before it is built. They can be called
without ``lab`` too.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from importlib import import_module
from typing import Annotated, Any

import typer

from gtpin import __version__
from gtpin.commands.terminal import Command

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
    "sensitivity": ["gtpin lab sensitivity calibrated --poses commands.csv -o accuracy"],
    "export": ["gtpin export calibrated -o robot.xml", "gtpin export diagnosis -o corrections.csv"],
    "simulate": [
        "gtpin lab simulate -o virtual --poses 150 --seed 3",
        "gtpin lab simulate -o virtual --scenario examples/scenarios/backlash.toml",
    ],
    "view": ["gtpin view gantry_tau", "gtpin view calibrated measurements -o gap.png"],
    "robots": ["gtpin robots", "gtpin robots --all"],
    "blind": ["gtpin lab blind -o check --cases 100", "gtpin lab blind -o check --from cases"],
}
"""Examples of each command. A command is the function of its name in the module of its name."""

GROUPS = {
    "import": ("gtpin.extras.importers.commands", "import_app"),
    "benchmark": ("gtpin.bench.commands.benchmark", "benchmark_app"),
}
"""Module and name of each group of commands."""
ELSEWHERE = {
    "certify": "gtpin.extras.certificate.command",
    "view": "gtpin.extras.view.command",
    "demo": "gtpin.bench.commands.demo",
    "simulate": "gtpin.bench.commands.simulate",
    "blind": "gtpin.bench.commands.blind",
}
"""Modules of the commands that are not in ``gtpin.commands``."""
LAB = ("simulate", "sensitivity", "blind", "benchmark")
HIDDEN = {*LAB, "compare"}
"""Commands that the first help does not list."""


def app_for(words: Sequence[str]) -> typer.Typer:
    """The command line for a call with these words. It has only the command that the first words name, because importing the
    modules of all commands takes longer; it has all commands where they name none, for help and error messages.
    """
    known = (*COMMANDS, *GROUPS)
    made = _app(
        "gtpin",
        "Calibration of parallel robots and arms, and diagnosis of the causes of their errors.",
        "Example: gtpin demo -o first-try",
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    if words[:1] != ["lab"]:
        _add(made, [name for name in known if name in words[:1]] or known, HIDDEN)
    if not set(known).intersection(words[:1]):
        help_ = "Virtual machines, tests of the diagnosis on them, and the accuracy of a robot before it is built."
        lab = _app("lab", help_, "Example: gtpin lab simulate -o virtual --poses 150")
        _add(lab, [name for name in LAB if name in words[1:2]] or LAB)
        made.add_typer(lab)
    made.callback()(_options)
    return made


def _app(name: str, text: str, epilog: str, **more: Any) -> typer.Typer:
    return typer.Typer(name=name, help=text, epilog=epilog, no_args_is_help=True, **more)


def _add(app: typer.Typer, names: Iterable[str], hidden: Collection[str] = ()) -> None:
    for name in names:
        if name in GROUPS:
            module, group = GROUPS[name]
            app.add_typer(getattr(import_module(module), group), hidden=name in hidden)
        else:
            epilog = "\n\n".join(["Examples:" if COMMANDS[name][1:] else "Example:", *COMMANDS[name]])
            function = getattr(import_module(ELSEWHERE.get(name, f"gtpin.commands.{name}")), name)
            app.command(cls=Command, epilog=epilog, hidden=name in hidden)(function)


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
