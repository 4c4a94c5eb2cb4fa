"""What a valid dataset is read as, however it is spelt."""

import codecs

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_dataset import HEADER, LINES, with_column, without

from gtpin.data import CartMeasurements, Commands, Dataset
from gtpin.data.csv_file import TOGETHER, read_csv
from gtpin.data.ids import normal_id
from gtpin.errors import DatasetError, GtpinWarning


def test_a_dataset_has_what_its_files_say(make):
    dataset = Dataset.read(make())
    assert (dataset.robot, len(dataset), dataset.n_actuators) == ("gantry_tau", 4, 3)
    assert dataset.pose.tolist() == ["a", "b", "c", "a"]
    assert dataset.q[1].tolist() == [-0.1, 0.25, 0.5]
    assert dataset.position[2].tolist() == [1.125, -4.75, 0.5]
    assert dataset.orientation[1].tolist() == [0.6, 0.8, 0.0, 0.0]
    assert list(dataset.covariates) == ["time", "session", "payload", "approach1"]
    assert dataset.covariates["session"].tolist() == ["day1", "day1", "day2", "day2"]
    assert dataset.instrument.position_sigma == 1.5e-5
    assert dataset.instrument.orientation_sigma is None
    assert dataset.instrument.frame == "robot"
    assert dataset.conditions.reference_temperature == 20.0
    assert dataset.carts is None


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("mark", [b"", codecs.BOM_UTF8])
@pytest.mark.parametrize("tail", ["", "\n", "\n\n\n"])
def test_any_line_ending_mark_and_trailing_blank_lines_read_the_same(make, same, ending, mark, tail):
    reference = Dataset.read(make())
    text = "\n".join((HEADER, *LINES)) + tail
    dataset = Dataset.read(make(mark + text.replace("\n", ending).encode()))
    same(dataset, reference)
    assert dataset.row.tolist() == [2, 3, 4, 5]


def test_a_blank_line_between_rows_is_passed_over_and_counted(make):
    assert Dataset.read(make("\n".join((HEADER, LINES[0], "", *LINES[1:])))).row.tolist() == [2, 4, 5, 6]


def test_quoted_and_spaced_cells_read_like_plain_ones(make, same):
    reference = Dataset.read(make())
    quoted = "\n".join(",".join(f'"{cell}"' for cell in line.split(",")) for line in (HEADER, *LINES))
    spaced = "\n".join((HEADER, *(line.replace(",", " , ") for line in LINES)))
    for text in (quoted, spaced):
        same(Dataset.read(make(text)), reference)


def test_an_id_may_hold_commas_quotes_and_any_script(make):
    lines = (LINES[0], LINES[1].replace("b,", '"b, ""β""",', 1), *LINES[2:])
    assert Dataset.read(make("\n".join((HEADER, *lines)))).pose[1] == 'b, "β"'


@pytest.mark.parametrize("suffix", ["ints", "floats", "text", "decimals"])
def test_parquet_with_the_same_columns_reads_like_csv(make, same, suffix):
    folder = make()
    reference = Dataset.read(folder)
    frame = pd.read_csv(folder / "poses.csv")
    if suffix == "floats":
        frame = frame.astype({"qy": np.float32, "time": np.int16})
    elif suffix == "text":
        frame = frame.astype(str)
    elif suffix == "decimals":
        from decimal import Decimal

        frame["time"] = [Decimal(str(value)) for value in frame["time"]]
    frame.to_parquet(folder / "poses.parquet", index=False)
    (folder / "poses.csv").unlink()
    dataset = Dataset.read(folder)
    same(dataset, reference)
    assert dataset.row.tolist() == [2, 3, 4, 5]


def test_the_index_that_pandas_left_in_a_parquet_file_is_no_covariate(make):
    folder = make()
    pd.read_csv(folder / "poses.csv").set_index(np.array([5, 3, 9, 7])).to_parquet(folder / "poses.parquet")
    (folder / "poses.csv").unlink()
    assert list(Dataset.read(folder).covariates) == ["time", "session", "payload", "approach1"]


@pytest.mark.parametrize("spelling", ["2", "2.0", "2.000000000", "+2", "2.", "2.000e+00", 2, 2.0, np.float64(2), " 2 "])
def test_one_number_is_one_id_however_it_is_spelt(spelling):
    assert normal_id(spelling) == "2"


@pytest.mark.parametrize("name", ["day1", "007", "1e3", "2,5", "-", "2.5", "0.5", "1_0", "9" * 5000])
def test_a_name_stays_as_it_is(name):
    assert normal_id(name) == name


def test_sessions_written_as_numbers_and_as_text_are_the_same(make):
    dataset = Dataset.read(make(with_column("session", "2", "2.000000000", "3", "2.0")))
    assert dataset.covariates["session"].tolist() == ["2", "2", "3", "2"]


@given(st.one_of(st.text(max_size=12), st.integers(), st.floats()))
def test_the_normal_form_of_an_id_is_its_own_normal_form(value):
    try:
        once = normal_id(value)
    except ValueError:
        return
    assert normal_id(once) == once


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=20))
def test_every_float_is_read_to_its_last_bit(numbers):
    text = "pose,time\n" + "".join(f"{i},{value!r}\n" for i, value in enumerate(numbers))
    assert read_csv("f.csv", text.encode()).columns["time"].tobytes() == np.array(numbers).tobytes()


def test_rows_that_are_read_together_join_without_a_seam():
    count = 2 * TOGETHER + 3
    text = "pose,time,note,session\n" + "".join(f"{i},{i / 7!r},{i},s{i}\n" for i in range(count))
    table = read_csv("f.csv", text.encode())
    assert table.row.tolist() == list(range(2, count + 2))
    assert table.columns["time"].tolist() == [i / 7 for i in range(count)]
    assert table.columns["note"].tolist() == list(range(count))
    assert table.columns["session"].tolist() == [f"s{i}" for i in range(count)]


def test_row_order_means_nothing(make):
    one = Dataset.read(make())
    other = Dataset.read(make("\n".join((HEADER, *reversed(LINES)))))
    assert other.visits.tolist() == one.visits.tolist()[::-1]
    assert other.position.tolist() == one.position.tolist()[::-1]


def test_orientation_may_be_missing_as_a_whole_and_is_normalised_where_it_is_slightly_off(make):
    assert Dataset.read(make(without("qw", "qx", "qy", "qz"))).orientation is None
    orientation = Dataset.read(make(with_column("qw", "1.0009", "0.6", "0", "0.9991"))).orientation
    np.testing.assert_allclose(np.linalg.norm(orientation, axis=1), 1.0, rtol=0, atol=1e-15)


def test_any_other_numeric_column_is_kept_as_a_covariate_of_its_own_name(make):
    dataset = Dataset.read(make(with_column("approach_angle", "0.5", "1", "2", "3")))
    assert dataset.covariates["approach_angle"].tolist() == [0.5, 1.0, 2.0, 3.0]


@pytest.mark.parametrize("cells", [("ok", "fine", "poor", "ok"), ("", "", "", ""), ("7", "x", "y", "")])
def test_a_column_of_words_is_named_in_a_warning_and_ignored(make, cells):
    folder = make(with_column("remark", *cells))
    with pytest.warns(GtpinWarning, match="remark"):
        dataset = Dataset.read(folder)
    assert "remark" not in dataset.covariates


def test_covariates_that_do_not_vary_are_named_in_one_warning(make):
    rows = [line.split(",") for line in (HEADER, *LINES)]
    text = "\n".join(
        ",".join((*row, "temp_link" if i == 0 else "20", "note" if i == 0 else "4")) for i, row in enumerate(rows)
    )
    folder = make(text)
    with pytest.warns(GtpinWarning, match=r"do not vary.*: temp_link, note$") as caught:
        Dataset.read(folder)
    assert len(caught) == 1


@pytest.mark.parametrize("name", ["speed2", "fx"])
def test_a_covariate_of_zeros_tells_that_the_machine_stood_still_or_carried_nothing(make, name):
    dataset = Dataset.read(make(with_column(name, *"0000")))  # a warning would be an error here
    assert not dataset.covariates[name].any()


@pytest.mark.parametrize(
    ("name", "known"),
    [("Temp Link", "temp_link"), ("Approach2", "approach2"), ("approch3", "approach3"), ("speed", "speed1")],
)
def test_a_name_that_is_nearly_a_known_one_is_warned_of(make, name, known):
    folder = make(with_column(name, "20", "21", "22", "23"))
    with pytest.warns(GtpinWarning, match=f"'{name}' is not '{known}'"):
        dataset = Dataset.read(folder)
    assert name in dataset.covariates


@pytest.mark.parametrize("name", ["temp_room", "humidity", "tool", "approach2", "operator"])
def test_a_name_of_its_own_is_not_taken_for_a_misspelt_one(make, name, recwarn):
    Dataset.read(make(with_column(name, "1", "-1", "1", "-1")))
    assert not [w for w in recwarn if "is not" in str(w.message)]


def test_a_folder_of_robot_files_is_referred_to_from_dataset_toml(make):
    for text, expected in (("../robots/my.urdf", "robots/my.urdf"), ("my.URDF", "set/my.URDF")):
        folder = make(toml=f'schema = "gtpin-dataset/1"\nrobot = "{text}"\n')
        assert Dataset.read(folder).robot_reference == folder.parent / expected
    assert Dataset.read(make()).robot_reference == "gantry_tau"


CARTS = "cart,q,x,y,z,qw,qx,qy,qz,temp_frame\n1,0.5,0.25,1,2,1,0,0,0,20\n3,-0.5,0.5,3,4,0.6,0.8,0,0,21\n"


def test_cart_poses_are_read_with_their_covariates(make):
    carts = Dataset.read(make(carts=CARTS)).carts
    assert isinstance(carts, CartMeasurements)
    assert carts.cart.tolist() == [1, 3]
    assert carts.q.tolist() == [0.5, -0.5]
    assert carts.position.tolist() == [[0.25, 1.0, 2.0], [0.5, 3.0, 4.0]]
    assert carts.orientation[1].tolist() == [0.6, 0.8, 0.0, 0.0]
    assert carts.covariates["temp_frame"].tolist() == [20.0, 21.0]
    assert carts.row.tolist() == [2, 3]


NO_CARTS = [("\n3,", f"\n{cart},", 3, "cart") for cart in ("0", "4", "1.5", "-1")]
NO_CARTS += [(f"{column},", "other,", 1, column) for column in ("cart", "q", "x", "qz")]


@pytest.mark.parametrize(("old", "new", "row", "column"), NO_CARTS)
def test_a_cart_that_the_robot_does_not_have_or_a_column_that_is_missing_is_named(make, fails, old, new, row, column):
    fails(make(carts=CARTS.replace(old, new, 1)), row=row, column=column, file="carts.csv")


def test_arrays_of_a_dataset_can_not_be_written_to(make):
    dataset = Dataset.read(make(carts=CARTS))
    arrays = [dataset.pose, dataset.q, dataset.position, dataset.orientation, dataset.row, dataset.carts.position]
    for array in (*arrays, *dataset.covariates.values(), *dataset.carts.covariates.values()):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = array[0]


def test_rows_can_be_taken_by_mask_and_by_index(make):
    dataset = Dataset.read(make())
    for rows in (np.array([False, True, False, True]), np.array([1, 3]), [1, 3], slice(1, None, 2)):
        part = dataset.take(rows)
        assert part.pose.tolist() == ["b", "a"]
        assert part.row.tolist() == [3, 5]
        assert part.covariates["time"].tolist() == [20.0, 40.0]
        assert part.orientation[0].tolist() == [0.6, 0.8, 0.0, 0.0]
    with pytest.raises(DatasetError, match="no rows"):
        dataset.take(np.zeros(4, dtype=bool))


def test_a_dataset_made_in_memory_is_checked_like_one_that_was_read():
    good = {"robot": "r", "pose": [1, 2.0], "q": [[0.0], [1.0]], "position": np.zeros((2, 3))}
    assert Dataset(**good).pose.tolist() == ["1", "2"]
    assert Dataset(**good).row.tolist() == [2, 3]
    for spoilt in (
        {"robot": ""},
        {"q": [0.0, 1.0]},
        {"q": [[0.0], [np.nan]]},
        {"q": [["a"], ["b"]]},
        {"q": np.zeros((2, 0))},
        {"pose": [1, 1]},
        {"pose": [1]},
        {"pose": []},
        {"position": np.zeros((2, 2))},
        {"orientation": np.zeros((2, 4))},
        {"covariates": {"time": [1.0]}},
        {"covariates": {"payload": [1.0, -1.0]}},
        {"covariates": {"approach1": [1.0, 0.5]}},
        {"covariates": {"approach2": [1.0, -1.0]}},
        {"covariates": {"q2": [1.0, 2.0]}},
        {"covariates": {"a\nb": [1.0, 2.0]}},
        {"tolerance": {"length": -1.0}},
        {"row": np.array([7])},
    ):
        with pytest.raises(DatasetError):
            Dataset(**(good | spoilt))


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


def test_another_number_of_actuators_and_missing_commands_are_refused(file):
    assert Commands.read(file, 2).n_actuators == 2
    with pytest.raises(DatasetError, match="2 columns of commands, the robot 3 actuators"):
        Commands.read(file, 3)
    with pytest.raises(DatasetError, match="missing"):
        Commands.read(file.with_name("none.csv"))


def test_parquet_stands_in_for_a_csv_that_is_not_there(file):
    Commands.read(file).write(file.with_suffix(".parquet"))
    file.unlink()
    assert Commands.read(file).q.tolist() == [[0.1, 0.2], [0.3, 0.4]]
