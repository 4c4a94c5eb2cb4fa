"""``gtpin diagnose``: where the gap is, its causes, and its explained fraction; or what has changed since a model."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import typer

from gtpin.commands.terminal import (
    DONE,
    AsJson,
    FewerPoses,
    Force,
    Output,
    Seed,
    Tcp,
    TrustData,
    progress_of,
    read_dataset,
    result_in,
)
from gtpin.diagnosis.diagnose import FALSE_ALARM
from gtpin.diagnosis.diagnose import diagnose as run_diagnosis
from gtpin.diagnosis.result import HoldOut
from gtpin.errors import GtpinError
from gtpin.extensions import extension
from gtpin.model.model_folder import read_model
from gtpin.report.diagnosis import DIAGNOSIS


def diagnose(
    datasets: Annotated[
        list[Path],
        typer.Argument(
            metavar="DATASET...", help="Folder that holds dataset.toml and poses.csv; or several, for a table."
        ),
    ],
    output: Output,
    exclude: Annotated[
        list[str] | None,
        typer.Option(
            metavar="EFFECT[@SITE]",
            help="Removes an effect, or an effect at a site, from the catalogue; may be given more than once.",
        ),
    ] = None,
    against: Annotated[
        str | None,
        typer.Option(metavar="MODEL", help="An earlier model: find what has changed since, from as few as ten poses."),
    ] = None,
    history: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.html|DIR",
            help="With --against: add this check to a log of checks, a page with a table and a plot over time.",
        ),
    ] = None,
    hold_out: Annotated[
        HoldOut, typer.Option(help="What is left out together to compute the gap on poses not fitted.")
    ] = "region",
    tcp: Tcp = None,
    why: Annotated[
        str | None,
        typer.Option(
            metavar="EFFECT@SITE", help="Say what stands for and against one cause, and which poses would tell."
        ),
    ] = None,
    false_alarm: Annotated[
        float, typer.Option(help="Probability of naming a cause if there is none.", min=1e-6, max=0.5)
    ] = FALSE_ALARM,
    seed: Seed = 0,
    poses: FewerPoses = None,
    trust_data: TrustData = False,
    jobs: Annotated[int, typer.Option(help="Several datasets: number of processes.", min=1)] = 1,
    cluster: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Several datasets: a dask scheduler, as tcp://host:8786.")
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Diagnose the gap between a calibrated geometry and measured poses: where it is, its causes, its explained fraction."""
    _refuse_alone(against is not None and tcp is not None, "--tcp", "the model has its own")
    _refuse_alone(against is not None and hold_out != "region", "--hold-out", "each pose is left out in turn")
    _refuse_alone(against is None and history is not None, "--history", "it needs --against MODEL")
    options: dict[str, Any] = {
        "exclude": exclude or (),
        "false_alarm": false_alarm,
        "hold_out": hold_out,
        "seed": seed,
        "poses": poses,
        "why": why,
    }
    if len(datasets) > 1:
        _refuse_alone(history is not None, "--history", "it is of one machine: add its checks one after the other")
        from gtpin.commands.fleet import diagnose_all  # imports joblib

        places: dict[str, Any] = {"against": against, "tcp": tcp, "trust": trust_data, "force": force}
        diagnose_all(datasets, output, options, jobs=jobs, cluster=cluster, as_json=as_json, **places)
        return
    _refuse_alone(jobs > 1 or cluster is not None, "--jobs or --cluster", "there is one dataset")
    with ExitStack() as stack:
        log: Any = None
        if history is not None:
            log = stack.enter_context(extension("gtpin.options", "history")(history, force=force))
        take = stack.enter_context(result_in(output, DIAGNOSIS, force=force, as_json=as_json))
        earlier: Any = None if against is None else read_model(against)
        read = read_dataset(datasets[0], tcp, trust=trust_data)
        if log is not None:
            log.refuse_readings(read)
        with progress_of("diagnosing", DONE) if against is None else progress_of("checking") as progress:
            found: Any = run_diagnosis(read, against=earlier, progress=progress, **options)
        take(found)
        if log is not None:
            log.add(found)
    if log is not None and not as_json:
        typer.echo(f"All checks: {log.page}")


def _refuse_alone(given: bool, option: str, why: str) -> None:
    """Refuse an option that has no meaning with the others."""
    if given:
        raise GtpinError(f"{option} can't be used here", hint=why)
