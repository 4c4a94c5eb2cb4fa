"""Diagnoses of several datasets: each with a folder of its own, and one table of all."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from gtpin.commands.terminal import read_dataset, rendered, tell, write_json
from gtpin.diagnosis.diagnose import diagnose
from gtpin.errors import GtpinError, GtpinWarning
from gtpin.model.model_folder import read_model
from gtpin.output.results import results_folder
from gtpin.output.shown import present
from gtpin.report.diagnosis import DIAGNOSIS
from gtpin.report.page import Lead, Section, Table, report
from gtpin.report.phrases import known_as
from gtpin.report.words import chance, counted, length
from gtpin.spread import check_cluster, spread, workers

FLEET = ("fleet.json", "fleet.html")
"""Files of all diagnoses together."""
FAILED = 2
"""Exit code where a dataset could not be diagnosed, as for a single one."""


def diagnose_all(
    datasets: Sequence[Path],
    output: Path,
    options: Mapping[str, Any],
    *,
    jobs: int,
    cluster: str | None,
    against: str | None,
    tcp: str | None,
    trust: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Diagnose datasets into a folder each, and write the table of all; ends with exit code 2 where one can't be diagnosed.

    ``options``: of :func:`~gtpin.diagnosis.diagnose.diagnose`. The workers of a cluster must see the same paths.
    """
    places = dict(zip(_names(datasets), datasets, strict=True))
    check_cluster(cluster)
    here = Path.cwd() if cluster else Path()  # a cluster's workers may be in another folder
    work = partial(_diagnosed, options=options, against=against, tcp=tcp, trust=trust, force=force)
    found: dict[str, dict[str, Any]] = {}
    with results_folder(output, FLEET, force=force, key=FLEET[0]) as folder:
        with _bar(len(places)) as advance:

            def done(name: str, row: dict[str, Any]) -> None:
                found[name] = row
                advance()

            def arguments(name: str) -> tuple[Path, Path]:
                return here / places[name], here / output / name

            with workers(cluster, jobs):
                lost = spread(work, list(places), arguments, done)
            for name in lost:  # one of them ended a process, and the others with it: each in a process of its own
                with workers(cluster, 2):
                    if spread(work, [name], arguments, done):
                        done(name, {"error": "the process ended: there may be too little memory"})
        rows = [{"dataset": str(places[name]), "folder": name, "error": None, **found[name]} for name in places]
        content = {"schema": "gtpin-fleet/1", "datasets": rows}
        write_json(folder / FLEET[0], content)
        (folder / FLEET[1]).write_text(fleet_page(rows), encoding="utf-8")
    table = rendered(fleet_table(rows).printed(), f"Written: {output / FLEET[0]}\nOpen {output / FLEET[1]}")
    tell(content, table, as_json)
    if any(row["error"] for row in rows):
        raise typer.Exit(FAILED)


def _diagnosed(
    dataset: Path,
    output: Path,
    *,
    options: Mapping[str, Any],
    against: str | None,
    tcp: str | None,
    trust: bool,
    force: bool,
) -> dict[str, Any]:
    """Diagnose a dataset into its folder; gives its row of the table, with the error where there is one."""
    try:
        with warnings.catch_warnings(), results_folder(output, DIAGNOSIS, force=force) as folder:
            warnings.simplefilter("ignore", GtpinWarning)  # the result has them
            earlier: Any = None if against is None else read_model(against)
            found: Any = diagnose(read_dataset(dataset, tcp, trust=trust), against=earlier, **options)
            result = present(found).write(folder)
    except GtpinError as error:
        return {"error": str(error)}
    except Exception as error:  # one dataset must not end the others
        return {"error": f"a fault of gtpin's own: {type(error).__name__}: {error}"}
    causes = [{key: cause[key] for key in ("effect", "site", "probability")} for cause in result["causes"]]
    gap = {key: result["gap"][key] for key in ("position_rms_before", "position_rms_after", "noise_floor")}
    return {"verdict": result["verdict"], "causes": causes, "rows": result["rows"], **gap}


def _names(datasets: Sequence[Path]) -> list[str]:
    """A name for the folder of each dataset: the last parts of its path, as many as make them differ."""
    parts = [path.absolute().parts[1:] for path in datasets]
    if len(set(parts)) < len(parts):
        twice = next(path for path in datasets if parts.count(path.absolute().parts[1:]) > 1)
        raise GtpinError("this dataset is given twice", file=twice, hint="give each once")
    for count in range(1, max(map(len, parts)) + 1):
        names = ["-".join(own[-count:]) for own in parts]
        if len(set(names)) == len(names) and not {*names} & {*FLEET}:
            break
    return names


@contextmanager
def _bar(total: int) -> Iterator[Any]:
    """Show on standard error, if that is a terminal, how many are done; yields the function that counts one more."""
    console = Console(stderr=True)
    columns = (TextColumn("diagnosing"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bars:
        yield partial(bars.advance, bars.add_task("", total=total))


HEAD = ("dataset", "verdict", "causes", "error, RMS", "with the causes", "noise alone", "rows")


def fleet_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """A row for each dataset of ``fleet.json``: its diagnosis, or its error."""
    return Table(HEAD, [_cells(row) for row in rows], (3, 4, 5, 6), wide=(2,))


def fleet_page(rows: Sequence[Mapping[str, Any]]) -> str:
    """The table as one self-contained HTML file."""
    verdicts = Counter("failed" if row["error"] else row["verdict"] for row in rows)
    found = ", ".join(f"{count} {verdict}" for verdict, count in verdicts.most_common())
    lead = Lead(f"Diagnoses of {counted(len(rows), 'dataset')}", f"{found}.", tab="diagnoses")
    return report(lead, [Section("datasets", "Datasets", [fleet_table(rows)])])


def _cells(row: Mapping[str, Any]) -> list[str]:
    if row["error"]:
        return [row["folder"], "failed", row["error"], *[""] * 4]
    causes = "; ".join(f"{known_as(c['effect'], c['site'])} ({chance(c['probability'])})" for c in row["causes"])
    sizes = (row[key] for key in ("position_rms_before", "position_rms_after", "noise_floor"))
    return [
        row["folder"],
        row["verdict"],
        causes,
        *("" if s is None else length(s) for s in sizes),
        f"{row['rows']['used']:,}",
    ]
