"""``gtpin diagnose``: where the gap lies, what causes it, how far it shrinks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gtpin.commands.terminal import AsJson, DatasetFolder, Force, Output, Seed, progress_of, rendered, tell, write_json
from gtpin.data import Dataset
from gtpin.diagnosis.diagnose import FALSE_ALARM
from gtpin.diagnosis.diagnose import diagnose as run_diagnosis
from gtpin.diagnosis.result import Diagnosis
from gtpin.model.model_folder import write_model
from gtpin.output.results import results_folder
from gtpin.report.corrected import sure_corrections
from gtpin.report.diagnosis_page import diagnosis_page
from gtpin.report.diagnosis_text import diagnosis_summary
from gtpin.report.experiments import FOLDER, write_experiments
from gtpin.threads import in_one_thread

FILES = ("baseline", "model", "diagnosis.json", "report.html", FOLDER)


def diagnose(
    dataset: DatasetFolder,
    output: Output,
    exclude: Annotated[
        list[str] | None,
        typer.Option(
            "--exclude",
            metavar="EFFECT[@SITE]",
            help="Takes an effect, or an effect at a site, out of the catalogue; may be given more than once.",
            show_default=False,
        ),
    ] = None,
    false_alarm: Annotated[
        float, typer.Option("--false-alarm", help="Chance of naming a cause where there is none.", min=1e-6, max=0.5)
    ] = FALSE_ALARM,
    seed: Seed = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Diagnose the gap between a calibrated geometry and measured poses: where it lies, what causes it, how far it shrinks."""
    with results_folder(output, FILES, force=force) as folder:
        read = Dataset.read(dataset)
        with progress_of("diagnosing") as progress:
            found = run_diagnosis(read, exclude=exclude or (), false_alarm=false_alarm, seed=seed, progress=progress)
        result = write_diagnosis(found, read, folder, seed)
    written = ", ".join(str(output / name) for name in ("diagnosis.json", "baseline", "model"))
    text = rendered(
        diagnosis_summary(found),
        *corrections_hint(found, output),
        f"Written: {written}",
        f"Open {output / 'report.html'}",
    )
    tell(result, text, as_json)


def corrections_hint(found: Diagnosis, output: Path) -> list[str]:
    """The command that writes what a controller can correct by itself, where there is something."""
    if not sure_corrections(found):
        return []
    return [
        f"Corrections for a controller with the calibrated geometry: gtpin export {output / 'model'} -o corrections.csv"
    ]


@in_one_thread
def write_diagnosis(found: Diagnosis, dataset: Dataset, folder: Path, seed: int = 0) -> dict[str, object]:
    """Write ``baseline/``, ``model/``, ``diagnosis.json``, ``report.html`` and the next experiments' commands.

    Gives what ``diagnosis.json`` holds.
    """
    result = found.to_json()
    write_model(found.baseline.model, folder / "baseline")
    write_model(found.model, folder / "model")
    write_json(folder / "diagnosis.json", result)
    write_experiments(found, dataset, folder)
    (folder / "report.html").write_text(diagnosis_page(found, dataset, seed=seed), encoding="utf-8")
    return result
