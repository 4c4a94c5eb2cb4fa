"""``gtpin view``: the robot and its gap in 3-D."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Annotated

import typer

from gtpin.commands.terminal import (
    Actuators,
    AsJson,
    Force,
    Home,
    ModelReference,
    Tcp,
    chosen,
    output_option,
    tell,
)
from gtpin.data import Dataset
from gtpin.extras.view.gap import gap_with_instruments
from gtpin.extras.view.still import write_still
from gtpin.model.model_folder import read_model
from gtpin.output.results import check_file


def view(
    model: ModelReference,
    dataset: Annotated[
        Path | None, typer.Argument(help="Folder of measured poses or readings, whose gap is shown.")
    ] = None,
    output: Annotated[Path | None, output_option("Write a still image (PNG, SVG, PDF) instead.")] = None,
    host: Annotated[str, typer.Option(help="Address that the page is served at.")] = "localhost",
    port: Annotated[int, typer.Option(help="Port of the page; 0 takes any.", min=0, max=65535)] = 8080,
    tcp: Tcp = None,
    actuators: Actuators = "",
    home: Home = "",
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Show the robot and its instruments in 3-D in the browser: along the poses, errors magnified, rods by their share."""
    if output is not None:
        check_file(output, force=force)
    found = read_model(model, tcp=tcp, **chosen(actuators, home))
    gap, instruments = None, found.instruments
    if dataset is not None:
        gap, instruments = gap_with_instruments(found, Dataset.read(dataset))
    if output is not None:
        write_still(output, found, gap, force=force, instruments=instruments)
        tell({"written": str(output)}, f"Written: {output}", as_json)
        return
    from gtpin.extras.view.scene import Scene  # late: it needs an extra that a still image does not need

    scene = Scene(found, gap, host, port, instruments)
    tell({"address": scene.address}, f"Open {scene.address} (Ctrl-C ends)", as_json)
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        scene.stop()
