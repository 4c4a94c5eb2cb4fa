"""The public set is made again bit for bit, solvers do not see truths, and the command makes and scores it."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

import gtpin
from gtpin.bench.benchmark.public_set import (
    CASES,
    FILE,
    TRUTHS,
    PublicSet,
    changed,
    make,
    round_table,
    rounded,
    rounded_energy,
)
from gtpin.bench.blind.truth import Truth
from gtpin.cli import app

ROOT = Path(__file__).parents[3]
SOME = ("tau-tracker-02", "tau-range-00", "ur5-tracker-01", "ur5-plane-02", "fivebar-tracker-03")


@pytest.fixture(scope="module")
def public() -> PublicSet:
    return PublicSet.read()


@pytest.fixture(scope="module")
def few(public: PublicSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A case of each machine and instrument."""
    folder = tmp_path_factory.mktemp("set")
    drafts = public.drafts()
    for name in SOME:
        make(drafts[name], folder)
    return folder


@pytest.mark.slow
def test_cases_are_made_again_bit_for_bit(public: PublicSet, few: Path) -> None:
    # Of 100 cases, another processor has a last digit of its own in one.
    other = list(changed(public, few, SOME))
    assert len(other) <= 1, f"the plant makes other cases than those that were published: {other}"


@pytest.mark.slow
def test_a_changed_digit_is_noticed(public: PublicSet, few: Path) -> None:
    file = few / CASES / SOME[0] / "commands.csv"
    text = file.read_text()
    file.write_text(text.replace("1", "2", 1))
    assert SOME[0] in changed(public, few, SOME)
    file.write_text(text)


def test_the_set_has_a_hundred_cases_of_three_machines_and_three_instruments(public: PublicSet) -> None:
    assert len(public.cases) == 100
    assert {block.robot for block in public.blocks} == {"gantry_tau", "ur5", "five_bar.urdf"}
    assert {block.instrument for block in public.blocks} == {"", "range", "plane"}
    assert list(public.drafts()) == list(public.cases)


def test_the_sets_five_bar_is_that_of_the_examples() -> None:
    assert (FILE.parent / "five_bar.urdf").read_bytes() == (ROOT / "examples/loops/five_bar.urdf").read_bytes()


@pytest.mark.slow
def test_a_solver_sees_no_truth(few: Path) -> None:
    for name in SOME:
        files = {file.name for file in (few / CASES / name).iterdir()}
        assert not [file for file in files if "truth" in file or file.startswith(".")]
        truth = Truth.model_validate_json((few / TRUTHS / f"{name}.json").read_bytes())
        said = "".join((few / CASES / name / file).read_text() for file in files)
        assert not [effect for effect in truth.effects if effect.effect in said]


@pytest.mark.slow
def test_a_truth_has_a_row_for_each_command_that_is_predicted(few: Path) -> None:
    for name in SOME:
        truth = Truth.model_validate_json((few / TRUTHS / f"{name}.json").read_bytes())
        if truth.poses is not None:
            assert len(truth.poses.T) == len(pd.read_csv(few / CASES / name / "commands.csv"))
        for one in truth.readings:
            assert len(one.values) == len(pd.read_csv(few / CASES / name / f"commands-{one.name}.csv"))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.GtpinWarning")  # commands-wire.csv is no table of the dataset
def test_stations_at_held_out_commands_are_those_of_the_truth(few: Path) -> None:
    """Stations are known to 0.1 m (1 sigma) or better; with another station in its place, a range is further off."""
    folder = few / CASES / "tau-range-00"
    truth = Truth.model_validate_json((few / TRUTHS / "tau-range-00.json").read_bytes())
    dataset = gtpin.Dataset.read(folder)
    (table,) = dataset.readings.tables
    held = pd.read_csv(folder / "commands-wire.csv")
    model = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau")))
    poses = model.predict(held[["q1", "q2", "q3"]].to_numpy())
    at = poses.T + poses.R @ np.array(table.target)
    stations = np.array([table.stations[name] for name in held["station"]])
    true = np.array(truth.readings[0].values)[:, 0]

    def off(turned: int) -> float:
        return float(np.sqrt(((np.linalg.norm(at - np.roll(stations, turned, axis=0), axis=1) - true) ** 2).mean()))

    assert off(0) < 0.2 < min(off(1), off(2), off(3))


def test_rounding_leaves_no_last_bits_and_no_negative_zero(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text("pose,x,session,temp_frame\n007,0.12345678912,3,20.00049\nb,-0.0,-1,1e-9\n")
    round_table(file)
    assert file.read_text() == "pose,x,session,temp_frame\n007,0.1234568,3,20.0\nb,0.0,-1,0.0\n"
    assert rounded(-1e-12) == 0.0
    assert str(rounded(-1e-12)) == "0.0"
    assert rounded_energy(2e-20) == 0.0
    assert rounded_energy(123.456) == 123.5


@pytest.mark.slow
def test_the_command_makes_a_case_and_scores_an_answer(tmp_path: Path) -> None:
    run = CliRunner()
    case = ["--case", "ur5-tracker-01"]
    made = run.invoke(app, ["benchmark", "make", "-o", str(tmp_path / "set"), *case, "--json"])
    assert made.exit_code == 0, made.output
    assert json.loads(made.stdout)["cases"] == 1
    (tmp_path / "answers").mkdir()
    (tmp_path / "answers" / "ur5-tracker-01.json").write_text('{"schema": "gtpin-answer/1", "unknown": true}')
    arguments = ["benchmark", "score", str(tmp_path / "set"), str(tmp_path / "answers"), "-o", str(tmp_path / "score")]
    assert run.invoke(app, [*arguments, *case]).exit_code == 0
    score = json.loads((tmp_path / "score" / "score.json").read_text())
    assert score["by_case"]["ur5-tracker-01"]["verdict"] == "unknown"


@pytest.mark.slow
def test_a_truth_that_was_edited_is_noticed(public: PublicSet, few: Path) -> None:
    file = few / TRUTHS / f"{SOME[1]}.json"
    content = file.read_bytes()
    file.write_bytes(content + b"\n")
    assert list(changed(public, few, SOME, truths_alone=True)) == [SOME[1]]
    file.write_bytes(content)


def test_a_case_that_is_not_in_the_set_is_refused(public: PublicSet) -> None:
    with pytest.raises(gtpin.GtpinError, match="no case is called 'tau-99'"):
        public.chosen(["tau-99"])
