"""``gtpin plan``: which poses to measure."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gtpin.commands.terminal import (
    Actuators,
    AsJson,
    Force,
    Home,
    ModelReference,
    Output,
    Seed,
    Tcp,
    chosen,
    progress_of,
    result_in,
)
from gtpin.data import Commands
from gtpin.diagnosis.diagnose import FALSE_ALARM
from gtpin.errors import ModelError
from gtpin.model.model import Model
from gtpin.model.model_folder import read_model
from gtpin.noise.noise import Noise
from gtpin.planning.plan import Place, Purpose
from gtpin.planning.plan import plan as run_plan
from gtpin.report.plan import PosePlanPresentation


def plan(
    model: ModelReference,
    purpose: Annotated[Purpose, typer.Option("--for", help="What the poses are for.")],
    poses: Annotated[int, typer.Option(help="Number of poses.", min=1)],
    output: Output,
    candidates: Annotated[
        Path | None,
        typer.Option(
            help="Table of commands to choose from, such as a dataset's poses.csv; by default some that fill the workspace."
        ),
    ] = None,
    position_sigma: Annotated[
        float | None, typer.Option(help="1 sigma per axis, m; by default that of the model's fit.")
    ] = None,
    orientation_sigma: Annotated[
        float | None, typer.Option(help="1 sigma, rad; by default that of the model's fit.")
    ] = None,
    positions_only: Annotated[bool, typer.Option("--positions-only", help="Orientations are not measured.")] = False,
    between: Annotated[
        list[str] | None,
        typer.Option(
            metavar="EFFECT[@SITE]",
            help="For discrimination: effects to distinguish; may be given more than once. By default all.",
        ),
    ] = None,
    tcp: Tcp = None,
    actuators: Actuators = "",
    home: Home = "",
    frame: Annotated[
        Place | None, typer.Option(help="free: the instrument may stand anywhere. By default, as it was for the model.")
    ] = None,
    false_alarm: Annotated[
        float, typer.Option(help="For health: chance of an alarm without a change.", min=1e-4, max=0.5)
    ] = FALSE_ALARM,
    seed: Seed = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Choose the poses to measure: for a calibration, to distinguish effects, or for a check of the machine's health."""
    with result_in(output, PosePlanPresentation.files, force=force, as_json=as_json) as take:
        known = read_model(model, tcp=tcp, **chosen(actuators, home))
        noise = _noise(known, position_sigma, orientation_sigma, positions_only)
        q = None if candidates is None else Commands.read(candidates, known.robot.n_actuators).q
        with progress_of("choosing poses"):
            found = run_plan(
                known,
                purpose,
                poses,
                noise=noise,
                q=q,
                frame=frame,
                orientation=not positions_only,
                between=between or (),
                false_alarm=false_alarm,
                seed=seed,
            )
        take(found)


def _noise(model: Model, position: float | None, orientation: float | None, positions_only: bool) -> Noise | None:
    """The noise from the options; for an option that is not given, that of the model's fit. None: that of the fit."""
    for name, value in (("--position-sigma", position), ("--orientation-sigma", orientation)):
        if value is not None and not 0.0 < value < 1.0:
            raise ModelError(f"{name} {value:g}", hint="give metres or radians, above 0")
    if position is None and orientation is None and model.fit is not None:
        return None
    fit = model.fit
    position = position if position is not None else (None if fit is None else fit.position_sigma)
    orientation = orientation if orientation is not None else (None if fit is None else fit.orientation_sigma)
    if position is None or (orientation is None and not positions_only):
        hint = "give --position-sigma, and --orientation-sigma or --positions-only"
        raise ModelError("the model does not say how well its poses were measured", hint=hint)
    return Noise(position, orientation or 1.0, 0.0 if fit is None else fit.drives)
