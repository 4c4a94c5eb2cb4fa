"""The command line: a table of commands. The module of a command is imported when the command is called.

Commands of ``gtpin lab`` make and judge virtual machines, or study a robot before it is built. They can be called
without ``lab`` too.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from gtpin.commands.entry import CommandEntry
from gtpin.extensions import extensions

GROUP = "gtpin.commands"
"""Entry-point group of the commands that are not in `OWN`; each is a :class:`~gtpin.commands.entry.CommandEntry`."""
OWN = (
    CommandEntry(
        "diagnose",
        "gtpin.commands.diagnose:diagnose",
        "Diagnose the gap between a calibrated geometry and measured poses: where it is, its causes, its explained fraction.",
        (
            "gtpin diagnose measurements -o diagnosis",
            "gtpin diagnose measurements -o second --exclude backlash --exclude linearity@cart2",
            "gtpin diagnose today --against calibrated -o check",
        ),
        place=20,
    ),
    CommandEntry(
        "calibrate",
        "gtpin.commands.calibrate:calibrate",
        "Identify the robot's geometry from measured poses.",
        ("gtpin calibrate measurements -o calibrated", "gtpin calibrate measurements -o paper3 --model 3"),
        place=30,
    ),
    CommandEntry(
        "compare",
        "gtpin.commands.compare:compare",
        "Compare models 1 to 5 of Dressler et al. 2010 on poses that were not fitted (2, 4 and 5 need carts.csv).",
        ("gtpin compare measurements -o compared",),
        place=50,
        hidden=True,
    ),
    CommandEntry(
        "predict",
        "gtpin.commands.predict:predict",
        "Predict what the instrument would read, without noise.",
        (
            "gtpin predict diagnosis commands.csv -o predicted.csv",
            "gtpin predict gantry_tau commands.csv -o nominal.csv",
        ),
        place=60,
    ),
    CommandEntry(
        "plan",
        "gtpin.commands.plan:plan",
        "Choose the poses to measure: for a calibration, to distinguish effects, or for a check of the machine's health.",
        (
            "gtpin plan calibrated --for health --poses 10 -o ten",
            "gtpin plan gantry_tau --for calibration --poses 40 --position-sigma 15e-6 --orientation-sigma 5e-5 -o forty",
        ),
        place=70,
    ),
    CommandEntry(
        "sensitivity",
        "gtpin.commands.sensitivity:sensitivity",
        "Show how each parameter moves the TCP, and the expected error over the workspace.",
        ("gtpin lab sensitivity calibrated --poses commands.csv -o accuracy",),
        place=80,
        hidden=True,
        lab=True,
    ),
    CommandEntry(
        "export",
        "gtpin.commands.export:export",
        "Write the model for other software: URDF, SDF, MJCF, tables of corrections, corrected commands.",
        ("gtpin export calibrated -o robot.xml", "gtpin export diagnosis -o corrections.csv"),
        place=90,
    ),
    CommandEntry(
        "robots",
        "gtpin.commands.robots:robots",
        "List the robots that can be given by name: those that gtpin ships, and the arms of example-robot-data.",
        ("gtpin robots", "gtpin robots --all"),
        place=110,
    ),
)
"""The commands of the core."""


def command_line() -> typer.Typer:
    """The command line with all commands."""
    made = typer.Typer(
        cls=_TopLevel,
        name="gtpin",
        help="Calibration of parallel robots and arms, and diagnosis of the causes of their errors.",
        epilog="Example: gtpin demo -o first-try",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    made.callback()(_options)
    return made


class LazyCommand(TyperCommand):
    """A command whose module is imported when it is called. The help of its group needs only its entry."""

    def __init__(self, entry: CommandEntry, *, hidden: bool) -> None:
        super().__init__(entry.name, help=entry.help, hidden=hidden)
        self._entry = entry

    def make_context(self, *args: Any, **more: Any) -> Any:
        """The context of a call, which has the imported command."""
        return self.imported().make_context(*args, **more)

    def imported(self) -> Any:
        """The command, or the group of commands."""
        entry = self._entry
        module, name = entry.function.split(":")
        found = getattr(import_module(module), name)
        if isinstance(found, typer.Typer):
            return typer.main.get_command(found)
        from gtpin.commands.terminal import Command

        app = typer.Typer(add_completion=False)
        epilog = "\n\n".join(["Examples:" if entry.examples[1:] else "Example:", *entry.examples])
        app.command(entry.name, cls=Command, help=None, epilog=epilog)(found)
        return typer.main.get_command(app)


class _TopLevel(TyperGroup):
    """``gtpin``: all commands, and the group ``lab``."""

    def __init__(self, **settings: Any) -> None:
        entries = sorted((*OWN, *extensions(GROUP).values()), key=lambda entry: entry.place)
        lab = TyperGroup(
            name="lab",
            help="Virtual machines, tests of the diagnosis on them, and the accuracy of a robot before it is built.",
            epilog="Example: gtpin lab simulate -o virtual --poses 150",
            no_args_is_help=True,
            commands=_commands((entry for entry in entries if entry.lab), listed=True),
        )
        super().__init__(**settings | {"commands": [*_commands(entries), lab]})


def _commands(entries: Iterable[CommandEntry], *, listed: bool = False) -> list[LazyCommand]:
    return [LazyCommand(entry, hidden=entry.hidden and not listed) for entry in entries]


def _version(wanted: bool) -> None:
    if wanted:
        from gtpin import __version__

        typer.echo(f"gtpin {__version__}")
        raise typer.Exit


def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass
