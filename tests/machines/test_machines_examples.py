"""The machines' examples do what they say."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
import pytest
from family import nominal

import gtpin
from gtpin.plant import simulate

EXAMPLES = Path(__file__).parents[2] / "examples"


def load(path: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(Path(path).stem, EXAMPLES / path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_tolerances_of_a_stewart_platform_spoil_what_its_jacobian_says() -> None:
    """Rms errors of 400 machines are known to 1 / sqrt(2 * 400 * 2) or 2.5 % at a pose; 4 of that."""
    example = load("stewart_tolerances.py")
    robot = gtpin.load_robot("stewart")
    q = example.workspace(robot)
    assert ((q >= robot.lower) & (q <= robot.upper)).all()
    drawn, predicted = example.accuracy(robot, q, machines=400)
    assert np.abs(predicted / drawn - 1.0).max() < 0.1
    assert len((EXAMPLES / "stewart_tolerances.py").read_text().splitlines()) < 60


def test_a_log_of_jugglebot_becomes_the_dataset_that_it_says(tmp_path: Path) -> None:
    example, closures = load("jugglebot/convert.py"), nominal("stewart_jugglebot")
    rng = np.random.default_rng(0)
    q = closures.commands(rng, 60)
    made = closures.measured(q, rng)
    table = {f"rev{i + 1}": q[:, i] / example.METRES_PER_REVOLUTION[i] for i in range(6)}
    table |= {f"{axis}_mm": 1000.0 * made.position[:, i] for i, axis in enumerate("xyz")}
    table |= {name: made.orientation[:, i] for i, name in enumerate(("qw", "qx", "qy", "qz"))}
    table |= {"session": np.repeat(["day1", "day2"], 30)}
    example.dataset_of(pd.DataFrame(table)).write(tmp_path / "dataset")
    dataset = gtpin.Dataset.read(tmp_path / "dataset")
    np.testing.assert_allclose(dataset.q, q, rtol=1e-12)
    np.testing.assert_allclose(dataset.position, made.position, rtol=1e-12)
    assert dataset.robot == "stewart_jugglebot"
    assert dataset.instrument.position_sigma is None
    assert sorted(set(dataset.covariates["session"])) == ["day1", "day2"]


@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")  # a machine off nominal reaches more than nominal
@pytest.mark.parametrize("name", ["tau", "stewart"])
def test_any_machine_can_be_simulated_and_calibrated(name: str) -> None:
    made = simulate(gtpin.load_robot(name), name, poses=60, held_out=20)
    model = gtpin.calibrate(made.dataset).model
    off = np.linalg.norm(model.predict(made.commands.q).T - made.truth.T, axis=1)
    assert np.sqrt((off**2).mean()) < np.sqrt(3.0) * 15e-6
