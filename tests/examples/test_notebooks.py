"""The notebooks of the examples run, each of their cells shows a table or a figure, and their text is true."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))
nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")
pytest.importorskip("plotly")
SHOWN = ("text/html", "application/vnd.plotly.v1+json")
LARGEST = 2_000
"""Letters of the text that a notebook has beside a table or figure."""
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


def executed(path: Path, folder: Path, claims: str) -> list[nbformat.NotebookNode]:
    """The code cells of a notebook after it ran in a folder, and its claims held."""
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    lines = [line.strip() for line in claims.splitlines()]
    notebook.cells.append(nbformat.v4.new_code_cell("\n".join(lines)))
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(folder)}}).execute()
    return cells


@pytest.fixture(autouse=True)
def _kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", ""))))
    monkeypatch.setenv("PYTHONPATH", path)


def test_every_notebook_makes_claims_that_are_tested() -> None:
    assert {notebook.stem for notebook in NOTEBOOKS} == set(CLAIMS)


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs(notebook: Path) -> None:
    cells = [cell for cell in nbformat.read(notebook, as_version=4).cells if cell.cell_type == "code"]
    assert not any(cell.outputs or cell.execution_count for cell in cells)


@pytest.mark.slow
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_each_cell_of_a_notebook_shows_a_table_or_a_figure(notebook: Path, tmp_path: Path) -> None:
    if notebook.stem in NEEDS:
        pytest.importorskip(NEEDS[notebook.stem])
    (tmp_path / "real").symlink_to(ROOT / "examples" / "real")
    folder = tmp_path / "notebooks"
    folder.mkdir()
    cells = executed(notebook, folder, CLAIMS[notebook.stem])
    assert len(cells) > 5
    kinds = []
    for cell in cells:
        assert not [output for output in cell.outputs if output.output_type == "stream"], cell.source
        shown = [output for output in cell.outputs if output.output_type in ("execute_result", "display_data")]
        assert shown, cell.source
        data = shown[-1].data
        kinds.append(next((kind for kind in reversed(SHOWN) if kind in data), None))
        assert kinds[-1], cell.source
        assert len(data.get("text/plain", "")) < LARGEST, cell.source
        if kinds[-1] == "text/html":  # a diagnosis without causes has a verdict alone
            assert "<table" in data["text/html"] or "<b>Diagnosis" in data["text/html"], cell.source
    assert set(kinds) == set(SHOWN)
