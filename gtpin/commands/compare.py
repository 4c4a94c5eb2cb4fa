"""``gtpin compare``: errors of the paper's models 1 to 5 on held-out poses."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gtpin.commands.terminal import (
    AsJson,
    CartOrientation,
    DatasetFolder,
    Force,
    Output,
    Seed,
    TrustData,
    progress_of,
    read_dataset,
    result_in,
)
from gtpin.comparison.compare import compare as run_comparison
from gtpin.errors import GtpinError
from gtpin.report.comparison import ComparisonPresentation


def compare(
    dataset: DatasetFolder,
    output: Output,
    newer: Annotated[Path | None, typer.Argument(hidden=True)] = None,
    seed: Seed = 0,
    orientations: CartOrientation = False,
    trust_data: TrustData = False,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Compare models 1 to 5 of Dressler et al. 2010 on poses that were not fitted (2, 4 and 5 need carts.csv)."""
    if newer is not None:
        raise GtpinError(
            "compare takes one dataset",
            hint=f"what has changed since a model: gtpin diagnose {newer} --against {dataset} -o {output}",
        )
    with result_in(output, ComparisonPresentation.files, force=force, as_json=as_json) as take:
        read = read_dataset(dataset, trust=trust_data)
        with progress_of("comparing") as progress:
            found = run_comparison(read, orientations=orientations, seed=seed, progress=progress)
        take(found)
