"""A command of the command line before its module is imported."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CommandEntry:
    """A command, or a group of commands, as the help of ``gtpin`` shows it.

    Parameters
    ----------
    name
        Its name on the command line.
    function
        ``MODULE:NAME`` of its function, or of the ``typer.Typer`` of a group. It is imported when the command is called.
    help
        What it does: the first line of the function's docstring.
    examples
        Calls of it; a group has those of its own commands.
    place
        Its place in the help: smaller numbers come first.
    hidden
        Whether the first help leaves it out.
    lab
        Whether it is a command of ``gtpin lab`` too.
    """

    name: str
    function: str
    help: str
    examples: tuple[str, ...] = ()
    place: float = 1000.0
    hidden: bool = False
    lab: bool = False
