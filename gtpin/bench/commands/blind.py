"""``gtpin blind``: sealed cases, diagnosed, opened and scored."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from gtpin.bench.commands.simulate import Instruments
from gtpin.commands.terminal import AsJson, Force, Output, Seed, tell, write_json
from gtpin.errors import GtpinError
from gtpin.output.results import results_folder

CASES = 100


def blind(
    output: Output,
    cases: Annotated[int | None, typer.Option(help=f"Number of cases; default {CASES}.", min=1)] = None,
    seed: Seed = 0,
    robot: Annotated[
        str | None, typer.Option(help="Name of a robot, or the path of a URDF or MJCF file; default Gantry-Tau.")
    ] = None,
    instrument: Instruments = None,
    source: Annotated[
        Path | None,
        typer.Option("--from", help="Score cases that somebody else made: NAME/ and NAME.truth.json in a folder."),
    ] = None,
    cluster: Annotated[str | None, typer.Option(help="Address of a dask scheduler, such as tcp://host:8786.")] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Make machines with hidden effects, seal the truth, diagnose the data, open the seals, and score."""
    # Imported here, because the other commands need not wait for these modules.
    from gtpin.bench.blind.draw import ROBOT
    from gtpin.bench.blind.folder import SCORE_FILES
    from gtpin.bench.blind.page import score_page
    from gtpin.bench.blind.run import check, check_given
    from gtpin.bench.blind.score import score

    if source is not None and (cases is not None or robot is not None or instrument):
        one = "--cases" if cases is not None else "--robot" if robot is not None else "--instrument"
        raise GtpinError(f"{one} and --from", hint=f"--from takes all cases of its folder: leave {one} out")
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as bars:
        if source is not None:
            checked = check_given(output, source, bars, cluster, force=force)
        else:
            checked = check(output, cases or CASES, seed, bars, cluster, robot or ROBOT, instrument or (), force=force)
    result = score(checked.cases, checked.about)
    with results_folder(output, SCORE_FILES, force=force) as folder:
        write_json(folder / "judged.json", [case.model_dump(mode="json", exclude_none=True) for case in checked.cases])
        write_json(folder / "score.json", result)
        (folder / "score.html").write_text(score_page(result, checked.cases), encoding="utf-8")
    pace = f"{checked.seconds:.1f} s per diagnosis (median)" if checked.seconds else ""
    tell(result, f"{_text(result)}\n{pace}\nWritten: {output / 'score.json'}\nOpen {output / 'score.html'}", as_json)


def _text(result: dict[str, Any]) -> str:
    from gtpin.bench.blind.page import figure_table

    lines = [f"{result['cases']} cases, {len(result['failures'])} failed"]
    if changed := result["check"].get("changed"):
        lines.append(f"{len(changed)} files were changed since they were first sealed or diagnosed")
    rows = ((*row, figure["value"]) for row, figure in zip(figure_table(result).rows, result["figures"], strict=True))
    for name, value, within, of, target, mark, known in rows:
        if known is not None:
            lines.append(f"  {name:<70} {value:>7} {within:<16} of {of:<5}{target:<7} {mark}".rstrip())
    return "\n".join(lines)
