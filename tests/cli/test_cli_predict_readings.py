"""``gtpin predict --instrument``: ids of stations and the like, and errors that name their line."""

import pytest

import gtpin
from gtpin.bench.simulator.instruments.build import simulate_measured
from gtpin.data import Dataset


@pytest.fixture(scope="module")
def wired(tmp_path_factory):
    """A model that four draw wires were read for."""
    folder = tmp_path_factory.mktemp("wired")
    robot = gtpin.load_robot("gantry_tau")
    made = simulate_measured(robot, "gantry_tau", ["range"], poses=20)
    made.write_dataset(folder / "set")
    gtpin.calibrate(Dataset.read(folder / "set")).save(folder / "out")
    return folder / "out"


def test_ids_of_stations_are_no_covariates_of_a_prediction(run, wired, tmp_path):
    commands = tmp_path / "commands.csv"
    commands.write_text("pose,q1,q2,q3,station\na,0.1,0.2,0.3,A\nb,0.1,0.2,0.3, B\n")
    ran = run("predict", wired, commands, "--instrument", "wire", "-o", tmp_path / "out.csv")
    assert (ran.code, ran.err) == (0, "")
    assert "2 readings of wire" in ran.out
    lines = (tmp_path / "out.csv").read_text().splitlines()
    assert [line.split(",")[:2] for line in lines] == [["pose", "station"], ["a", "A"], ["b", "B"]]


@pytest.mark.parametrize(
    ("header", "row", "told"),
    [("station", "Z", "row 3, column station: "), ("other", "1", "row 1, column station: "), ("station", "", "row 3")],
)
def test_a_station_that_can_t_be_is_named_by_its_line(run, wired, tmp_path, header, row, told):
    commands = tmp_path / "commands.csv"
    first = "A" if header == "station" else "2"
    commands.write_text(f"pose,q1,q2,q3,{header}\na,0.1,0.2,0.3,{first}\nb,0.1,0.2,0.3,{row}\n")
    ran = run("predict", wired, commands, "--instrument", "wire", "-o", tmp_path / "out.csv")
    assert f"commands.csv, {told}" in ran.failed()
    assert not (tmp_path / "out.csv").exists()
