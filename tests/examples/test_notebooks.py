"""The notebooks are kept with what they show, they show the same today, and their text is true."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "pages"))

nbformat = pytest.importorskip("nbformat")
for needed in ("nbclient", "ipykernel", "plotly"):
    pytest.importorskip(needed)
from notebooks import NOTEBOOKS, PLOTLY, PNG, code_cells, executed  # noqa: E402  (scripts of examples are no package)

LARGEST = 2_000
"""Letters of the text that a notebook has beside a table or figure."""
NUMBER = re.compile(r"[−-]?\d+(?:\.\d+)?(?:e[+-]\d+)?")
CLAIMS = {
    "calibrate_and_diagnose": """
        assert [(cause.effect, cause.site) for cause in diagnosis.causes] == [("backlash", "cart1")]
        assert error(diagnosis.model) < error(calibration.model)""",
    "arm": """
        assert diagnosis.causes[0].site == "shoulder_pan_joint"
        assert calibration.chi2_per_dof > 2.0
        assert error(diagnosis.model) < error(calibration.model)
        assert len(real) == 240 and real.instrument.frame == real.instrument.target == "free"
        assert 0.2 < off.mean() < 0.7""",
    "delta_with_probe": """
        assert calibration.by_instrument[0].after < 2e-5 and len(calibration.words) > 3
        shown = pd.DataFrame(rows).T
        assert (shown["true error, µm"] > 20.0 * shown["residual of the touches, µm"]).all()
        assert shown["directions not seen"].is_monotonic_decreasing
        assert [cause.site for cause in diagnosis.causes] == ["cart2"]""",
    "diagnosis_to_mujoco": """
        causes = [[(cause.effect, cause.site) for cause in found.causes] for found in (diagnosis, circle)]
        assert causes == [[("backlash", "cart1")]] * 2
        assert rows["MuJoCo is off the machine"].max() < 5e-6 and by_commands.max() < 2.0
        jumps = [np.linalg.norm(T[::2] - T[1::2], axis=1) for T in (expected, in_file, shown)]
        assert np.ptp(jumps[0]) > 1e-6 and np.abs(jumps[1] - jumps[0]).max() < 5e-6
        assert np.abs(jumps[2] - jumps[0]).max() < 1e-6
        assert "holds backlash@cart1" in str(said[0].message) and len(said) == 1
        assert spread["after the diagnosis"] < 0.1 * spread["tolerances"]""",
    "own_effect": """
        assert "cable_chain" not in [cause.effect for cause in plain.causes] and plain.verdict == "unknown"
        assert [(cause.effect, cause.site) for cause in diagnosis.causes] == [("cable_chain", "cart2")]
        low, high = diagnosis.causes[0].parameters["rate"].interval
        assert low < 1e-4 < high
        assert errors["with the cable chain"] < errors["without the cable chain"]""",
}
"""What the text of a notebook says of its results, asked in its own kernel."""
NEEDS = {"diagnosis_to_mujoco": "mujoco"}
"""Packages that a notebook needs and gtpin does not."""


def shown(cell: Any) -> Any:
    """What a cell shows: a figure, or a table with its text; and nothing else."""
    assert [output.output_type for output in cell.outputs if output.output_type == "stream"] == [], cell.source
    assert cell.outputs, cell.source
    return cell.outputs[-1].data


def test_every_notebook_makes_claims_that_are_tested() -> None:
    assert set(NOTEBOOKS) == set(CLAIMS)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_is_kept_with_what_each_of_its_cells_shows_and_is_small(name: str) -> None:
    assert NOTEBOOKS[name].stat().st_size < 1_000_000
    notebook = nbformat.read(NOTEBOOKS[name], as_version=4)
    cells = code_cells(notebook)
    assert len(cells) > 5
    assert len(notebook.cells) < 40
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    kinds = {PNG: 0, "text/html": 0}
    for cell in cells:
        data = shown(cell)
        assert PLOTLY not in data  # a code host does not draw it
        kinds[PNG if PNG in data else "text/html"] += 1
        if PNG not in data:  # a diagnosis without causes has a verdict alone
            assert "<table" in data["text/html"] or "<b>Diagnosis" in data["text/html"], cell.source
            assert len(data["text/plain"]) < LARGEST, cell.source
    assert min(kinds.values()) > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_shows_today_what_it_is_kept_with(name: str) -> None:
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    kept = code_cells(nbformat.read(NOTEBOOKS[name], as_version=4))
    claims = "\n".join(line.strip() for line in CLAIMS[name].splitlines())
    for cell, before in zip(code_cells(executed(NOTEBOOKS[name], claims)), kept, strict=True):
        now, then = shown(cell), shown(before)
        assert (PLOTLY in now) == (PNG in then), cell.source
        if PLOTLY in now:
            continue
        texts = [NUMBER.sub("#", " ".join(data["text/plain"].split())) for data in (now, then)]
        assert texts[0] == texts[1], "store it anew: python examples/pages/notebooks.py"
        printed = [NUMBER.findall(data["text/plain"]) for data in (now, then)]
        a, b = (np.array([float(n.replace("−", "-")) for n in some]) for some in printed)
        # Linear algebra differs between machines: 2 %, or one unit of the last digit.
        unit = np.array([10.0 ** -len(n.partition(".")[2]) if "." in n and "e" not in n else 0.0 for n in printed[0]])
        assert (np.abs(a - b) <= np.maximum(np.maximum(0.02 * np.abs(b), 2e-6), 1.001 * unit)).all()
