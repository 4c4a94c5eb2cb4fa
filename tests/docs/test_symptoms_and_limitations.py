"""The page of symptoms has commands that gtpin takes and every effect; each limitation names the page that shows it."""

import re
import shlex
from pathlib import Path
from typing import Any

import typer

import gtpin
import gtpin.cli
from gtpin.effects.rack import RackPeriodic

DOCS = Path(__file__).parents[2] / "docs"
SYMPTOMS = (DOCS / "symptoms.md").read_text(encoding="utf-8")
LIMITATIONS = (DOCS / "limitations.md").read_text(encoding="utf-8")
COMMANDS = [line for line in re.findall(r"`(gtpin [^`]+)`", SYMPTOMS) if " -o " in line or "view " in line]


def parsed(group: Any, words: list[str]) -> list[str]:
    """The commands and subcommands of a line; raises where an option or an argument is not known."""
    name, *arguments = words
    command = group.commands[name]
    if hasattr(command, "commands"):  # a group, such as import
        return [name, *parsed(command, arguments)]
    command.make_context(name, arguments)
    return [name]


def test_the_page_has_the_commands_of_a_calibration_engineer() -> None:
    assert len(COMMANDS) > 15
    group = typer.main.get_command(gtpin.cli.app)
    names = {parsed(group, shlex.split(line)[1:])[0] for line in COMMANDS}
    wanted = {
        "diagnose",
        "calibrate",
        "import",
        "plan",
        "sensitivity",
        "predict",
        "view",
        "export",
        "simulate",
        "blind",
    }
    assert names >= wanted
    assert {"--against", "--history", "--hold-out", "--exclude"} <= set(shlex.split(" ".join(COMMANDS)))


def test_every_effect_of_the_catalogue_has_a_symptom() -> None:
    linked = set(re.findall(r"\[`(\w+)`\]\(effects\.md#\1\)", SYMPTOMS))
    assert linked == {effect.id for effect in gtpin.catalogue()}


def test_every_limitation_names_the_page_that_shows_it() -> None:
    rows = [line for line in LIMITATIONS.splitlines() if line.startswith("| ") and not line.startswith("| limitation")]
    assert len(rows) > 20
    for row in rows:
        _, limitation, where, _ = row.split("|")
        assert limitation.strip()
        assert re.search(r"\]\((\w+/)*\w+\.md", where), row


def test_the_largest_number_of_lines_is_the_codes() -> None:
    assert f"at most {RackPeriodic.most_values} for each joint" in LIMITATIONS
