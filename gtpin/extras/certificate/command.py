"""``gtpin certify``: a certificate of accuracy."""

from __future__ import annotations

from typing import Annotated

import typer

from gtpin.commands.terminal import (
    AsJson,
    DatasetFolder,
    Force,
    Output,
    Seed,
    TrustData,
    progress_of,
    read_dataset,
    result_in,
)
from gtpin.extras.certificate.certify import certify as run_certificate
from gtpin.extras.certificate.page import CERTIFICATE
from gtpin.model.model_folder import read_model


def certify(
    dataset: DatasetFolder,
    output: Output,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="MODEL",
            help="The model that corrects the machine, identified before; by default these data are diagnosed.",
        ),
    ] = None,
    instrument: Annotated[
        float | None,
        typer.Option(
            "--instrument-uncertainty",
            metavar="METRES",
            help="Standard uncertainty of the instrument's systematic error at the TCP, per axis, from its certificate.",
        ),
    ] = None,
    seed: Seed = 0,
    trust_data: TrustData = False,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Certify accuracy and repeatability (ISO 9283, ISO 230-2), with an uncertainty budget (GUM) of the corrected machine."""
    with result_in(output, CERTIFICATE, force=force, as_json=as_json) as take:
        corrects = None if model is None else read_model(model)
        read = read_dataset(dataset, trust=trust_data)
        with progress_of("certifying") as progress:
            found = run_certificate(read, corrects, instrument=instrument, seed=seed, progress=progress)
        take(found)
