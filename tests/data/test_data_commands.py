"""Commands: poses without measurements."""

import pytest

from gtpin.data import Commands, Dataset
from gtpin.errors import DatasetError

TEXT = "pose,q1,q2,temp_link,session\n7,0.1,0.2,20,1\n8,0.3,0.4,21,2.0\n"


@pytest.fixture
def file(tmp_path):
    (tmp_path / "commands.csv").write_text(TEXT)
    return tmp_path / "commands.csv"


def test_commands_have_what_their_file_says(file):
    commands = Commands.read(file)
    assert (len(commands), commands.n_actuators) == (2, 2)
    assert commands.pose.tolist() == ["7", "8"]
    assert commands.q.tolist() == [[0.1, 0.2], [0.3, 0.4]]
    assert commands.covariates["temp_link"].tolist() == [20.0, 21.0]
    assert commands.covariates["session"].tolist() == ["1", "2"]
    assert commands.row.tolist() == [2, 3]


def test_measured_columns_are_passed_over_even_where_they_are_empty(file):
    file.write_text("pose,x,y,z,qw,q1\na,,,oops,nan,0.5\n")
    commands = Commands.read(file)
    assert commands.q.tolist() == [[0.5]]
    assert commands.covariates == {}


def test_the_table_of_a_dataset_will_do_as_commands(make):
    folder = make()
    mine, its = Commands.read(folder / "poses.csv"), Dataset.read(folder).commands
    assert mine.pose.tolist() == its.pose.tolist()
    assert mine.q.tobytes() == its.q.tobytes()
    assert list(mine.covariates) == list(its.covariates)


def test_another_number_of_actuators_is_refused(file):
    assert Commands.read(file, 2).n_actuators == 2
    with pytest.raises(DatasetError, match="2 columns of commands, the robot 3 actuators"):
        Commands.read(file, 3)


def test_parquet_stands_in_for_a_csv_that_is_not_there(file):
    Commands.read(file).write(file.with_suffix(".parquet"))
    file.unlink()
    assert Commands.read(file).q.tolist() == [[0.1, 0.2], [0.3, 0.4]]


def test_missing_commands_are_refused(tmp_path):
    with pytest.raises(DatasetError, match="missing"):
        Commands.read(tmp_path / "commands.csv")
