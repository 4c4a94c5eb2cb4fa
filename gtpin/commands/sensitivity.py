"""``gtpin sensitivity``: Jacobian-based accuracy analysis."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from gtpin.accuracy.chain_sensitivity import chain_sensitivity
from gtpin.accuracy.files import FILES, write_sensitivity
from gtpin.commands.terminal import AsJson, Force, ModelReference, Output, Seed, Tcp, progress_of, tell
from gtpin.data import Commands
from gtpin.model.model_folder import read_model
from gtpin.model.predict import predict
from gtpin.output.results import results_folder
from gtpin.report.accuracy_text import accuracy_text, expected_text
from gtpin.report.sensitivity_page import sensitivity_page

WRITTEN = ("sensitivity.csv", "accuracy.json", "report.html")


def sensitivity(
    model: ModelReference,
    output: Output,
    poses: Annotated[
        Path | None, typer.Option("--poses", help="Table of commands; by default some that fill the workspace.")
    ] = None,
    tcp: Tcp = None,
    seed: Seed = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Show how each parameter moves the TCP, and the expected error over the workspace."""
    with (
        results_folder(output, (*FILES, "report.html"), force=force) as folder,
        progress_of("sensitivity") as progress,
    ):
        found = read_model(model, tcp=tcp)
        q = None
        if poses is not None:
            given = Commands.read(poses, found.robot.n_actuators)
            # Only for its errors, which name the row of a command that the robot can't reach. Effects are left out: the
            # analysis is of the geometry alone.
            predict(replace(found, effects=()), given)
            q = given.q
        progress("each parameter at each pose", 0, float("nan"))
        if not found.robot.rods:
            chain = chain_sensitivity(found, q, seed=seed)
            chain.write(folder)
            page, told, text = sensitivity_page(chain, seed=seed), chain.to_json(), expected_text(chain.to_json())
        else:
            accuracy = write_sensitivity(found, q, folder, seed=seed)
            page, told, text = sensitivity_page(accuracy, seed=seed), accuracy.to_json(), accuracy_text(accuracy)
        (folder / "report.html").write_text(page, encoding="utf-8")
    written = f"Written: {_named(output, WRITTEN)}\nOpen {output / 'report.html'}"
    tell(told, f"{text}\n{written}", as_json)


def _named(folder: Path, files: tuple[str, ...]) -> str:
    return ", ".join(str(folder / name) for name in files)
