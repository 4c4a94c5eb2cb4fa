"""What is no dataset is refused with its place and a way out, and with nothing but a DatasetError."""

import contextlib
import warnings
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_dataset import HEADER, LINES, TOML

from gtpin.data import Commands, Dataset
from gtpin.data.csv_file import TOGETHER, read_csv
from gtpin.data.parquet_file import read_parquet
from gtpin.errors import DatasetError


def table(*lines):
    return "\n".join((HEADER, *lines, ""))


def with_cell(line, column, cell):
    cells = LINES[line - 2].split(",")
    cells[HEADER.split(",").index(column)] = cell
    return table(*(",".join(cells) if i == line - 2 else text for i, text in enumerate(LINES)))


@pytest.mark.parametrize("path", ["nowhere", "no/where", "set/poses.csv/deeper"])
def test_a_folder_that_does_not_exist_is_said_not_to(tmp_path, make, fails, path):
    make()
    assert "the folder does not exist" in fails(tmp_path / path, file="").what


def test_a_missing_table_is_named(make, fails):
    folder = make()
    (folder / "poses.csv").unlink()
    assert "missing" in fails(folder).what
    (folder / "poses.csv").mkdir()
    assert "folder" in fails(folder).what


@pytest.mark.parametrize("name", ["dataset.toml", "poses.csv"])
def test_a_file_in_place_of_the_folder_is_said_to_be_one(make, fails, name):
    error = fails(make() / name, file="")
    assert "this is a file" in error.what
    assert "folder that holds" in error.hint


def test_a_path_that_can_t_be_one_is_refused():
    for path in ("x" * 5000, "a\0b"):
        with pytest.raises(DatasetError, match="folder can't be read"):
            Dataset.read(path)


def test_both_a_csv_and_a_parquet_table_are_refused(make):
    folder = make()
    (folder / "poses.parquet").write_bytes(b"PAR1")
    with pytest.raises(DatasetError, match=r"both poses\.csv and poses\.parquet"):
        Dataset.read(folder)


@pytest.mark.parametrize("content", [b"", b"PAR1", b"PAR1" + bytes(100) + b"PAR1", b"pose,q1\n1,2\n"])
def test_a_parquet_file_that_is_none_is_refused(make, fails, content):
    folder = make()
    (folder / "poses.csv").unlink()
    (folder / "poses.parquet").write_bytes(content)
    assert "not a Parquet file" in fails(folder, file="poses.parquet").what


@pytest.mark.parametrize("column", ["pose", "q1", "x", "z"])
def test_a_missing_column_is_named(without_columns, fails, column):
    assert "missing" in fails(without_columns(column), row=1, column=column).what


def test_a_gap_in_the_commands_is_named(without_columns, fails):
    assert "q3" in fails(without_columns("q2"), row=1, column="q2").hint


def test_commands_counted_from_zero_are_refused(make, fails):
    text = table(*LINES).replace("q1,q2,q3", "q0,q1,q2")
    assert "q0" in fails(make(text), row=1, column="q3").hint


def test_some_columns_of_an_orientation_are_not_enough(without_columns, fails):
    assert "all of qw qx qy qz" in fails(without_columns("qy"), row=1, column="qy").hint


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize(("separator", "word"), [(";", "';'"), ("\t", "tabs"), (" ", "spaces")])
def test_another_separator_is_named_whatever_the_decimals(make, fails, separator, word, decimal):
    text = table(*LINES).replace(",", separator).replace(".", decimal)
    error = fails(make(text), row=1)
    assert error.what == f"the columns are separated by {word}"
    assert error.hint == "save with ',' between columns and '.' in numbers"


@pytest.mark.parametrize("name", ["air temperature near the track", "humidity; %", "a\tb"])
def test_other_separators_inside_a_column_s_name_are_let_pass(with_column, name):
    text = (with_column("humidity", "40", "41", "42", "43") / "poses.csv").read_text().replace("humidity", name)
    assert len(read_csv("f.csv", text.encode())) == 4


@pytest.mark.parametrize("spelling", ["Q1", " q1", "q 1"])
def test_a_column_that_differs_by_case_or_space_is_pointed_at(make, fails, spelling):
    hint = fails(make(table(*LINES).replace("q1", spelling, 1)), row=1, column="q1").hint
    assert repr(spelling) in hint


def test_data_without_a_header_is_recognised(make, fails):
    assert "header" in fails(make("1,0.1,0.2,1,2,3\n2,0.2,0.3,4,5,6\n"), row=1).hint


def test_a_doubled_column_is_named(make, fails):
    assert "twice" in fails(make(table(*LINES).replace("time", "q2", 1)), row=1, column="q2").what


def test_a_column_without_a_name_is_refused(make, fails):
    assert "no name" in fails(make("," + table(*LINES)), row=1).what


@pytest.mark.parametrize("line", [2, 4, 5])
@pytest.mark.parametrize("change", ["long", "short", "cut"])
def test_a_row_of_another_length_is_reported_with_its_line(make, fails, line, change):
    lines = list(LINES)
    old = lines[line - 2]
    lines[line - 2] = {"long": old + ",1", "short": old.rsplit(",", 1)[0], "cut": old[:7]}[change]
    assert "cells" in fails(make(table(*lines)), row=line).what


@pytest.mark.parametrize("column", ["q2", "x", "qz", "time", "payload"])
@pytest.mark.parametrize("line", [2, 4, 5])
@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ("", "blank"),
        (" ", "blank"),
        ("NaN", "not a finite"),
        ("inf", "not a finite"),
        ("-Infinity", "not a finite"),
        ("1e999", "not a finite"),
        ("oops", "not a number"),
        ("1_0", "not a number"),
        ("٣", "not a number"),
        ("1.5 mm", "not a number"),
        ("0x10", "not a number"),
    ],
)
def test_a_bad_cell_is_reported_with_its_line_and_column(make, fails, column, line, cell, said):
    assert said in fails(make(with_cell(line, column, cell)), row=line, column=column).what


def test_a_decimal_comma_is_recognised(make, fails):
    assert "decimal point" in fails(make(with_cell(3, "x", '"1,25"')), row=3, column="x").hint


def test_decimal_commas_in_every_number_are_no_line_of_units(make, fails):
    quoted = (",".join(f'"{cell}"'.replace(".", ",") for cell in line.split(",")) for line in LINES)
    assert "decimal point" in fails(make(table(*quoted)), row=2, column="q1").hint
    every = '"0,5",' * 14
    assert "decimal point" in fails(make(f"{HEADER}\na,{every[:-1]}\n"), row=2, column="q1").hint


def test_a_row_with_too_many_cells_is_asked_for_decimal_points(make, fails):
    text = table(*(line.replace(".", ",") for line in LINES))
    assert "decimal point" in fails(make(text), row=2).hint


def test_the_line_of_a_bad_cell_counts_blank_lines(make, fails):
    text = with_cell(4, "x", "oops").replace(LINES[0], "\n\n" + LINES[0], 1)
    fails(make(text), row=6, column="x")


def test_the_line_of_a_bad_cell_is_right_deep_in_a_long_file(make, fails):
    lines = [f"{i},{i * 1e-6},0,0,{i},1,2" for i in range(60_000)]
    lines[54_321] = "54321,0.054321,0,0,oops,1,2"
    fails(make("\n".join(("pose,q1,q2,q3,x,y,z", *lines))), row=54_323, column="x")


def test_the_first_bad_row_is_named_whatever_is_wrong_with_the_later_ones(make, fails):
    lines = [f"{i},{i * 1e-6},0,0,{i},1,2" for i in range(3 * TOGETHER)]
    lines[40] = "40,0,0,0,1,2,oops"
    lines[41] = "41,0,oops,0,1,2,3"
    lines[50] = "50,0"
    fails(make("\n".join(("pose,q1,q2,q3,x,y,z", *lines))), row=42, column="z")
    lines[30] = "30,0"
    assert "2 cells" in fails(make("\n".join(("pose,q1,q2,q3,x,y,z", *lines))), row=32).what


@pytest.mark.parametrize(
    ("line", "row"), [('"b,0,0', 3), ('b,"0\n",0', 3), ('b,"0" ,0', 3), ('b,0,"0', 3), ('"b"x,0,0', 3)]
)
def test_a_quoted_cell_that_is_not_closed_is_reported_with_its_line(line, row):
    for after in ("", "\nc,0,0\nd,0,0"):
        with pytest.raises(DatasetError, match="quoted cell") as caught:
            read_csv("f.csv", f"pose,q1,q2\na,0,0\n{line}{after}\n".encode())
        assert caught.value.row == row


def test_a_quoted_header_that_is_not_closed_is_reported():
    with pytest.raises(DatasetError, match="quoted cell") as caught:
        read_csv("f.csv", b'pose,"q1,q2\na,0,0\n')
    assert caught.value.row == 1


def test_a_cell_as_long_as_a_book_is_refused():
    with pytest.raises(DatasetError, match="more than 131072 characters"):
        read_csv("f.csv", b"pose,q1\n" + b"a" * 200_000 + b",1\n")


@pytest.mark.parametrize(("column", "cell"), [("pose", ""), ("pose", "nan"), ("session", " "), ("session", "NaN")])
def test_a_blank_id_is_reported_with_its_line_and_column(make, fails, column, cell):
    fails(make(with_cell(4, column, cell)), row=4, column=column)


def test_a_mostly_numeric_column_with_a_bad_cell_is_refused(with_column, fails):
    fails(with_column("humidity", "40", "41", "n.n.", "42"), row=4, column="humidity")
    fails(with_column("humidity", "40", "", "", ""), row=3, column="humidity")


def test_a_second_header_is_recognised(make, fails):
    assert "header" in fails(make(table(*LINES[:2], HEADER, *LINES[2:])), row=4).what


def test_a_line_of_units_is_recognised(make, fails):
    units = "-,m,m,m,m,m,m,-,-,-,-,s,-,kg,-"
    assert "units" in fails(make(table(units, *LINES)), row=2).what


def test_a_row_of_commas_is_recognised(make, fails):
    assert "blank" in fails(make(table(*LINES, "," * HEADER.count(","))), row=6).what


@pytest.mark.parametrize("content", [b"", b"\n\n", b"\xef\xbb\xbf", b"  \r\n"])
def test_an_empty_file_is_refused(make, fails, content):
    assert "empty" in fails(make(content)).what


def test_a_header_alone_is_refused(make, fails):
    assert "no rows" in fails(make(HEADER + "\n\n")).what


def test_what_is_not_utf8_text_is_refused(make, fails):
    text = table(*LINES)
    assert "UTF-16" in fails(make(text.encode("utf-16"))).what
    assert "UTF-8" in fails(make(text.replace("c,", "é,", 1).encode("latin-1")), row=4).what
    assert "not text" in fails(make(text.replace("c,", "\0,", 1)), row=4).what
    assert "not text" in fails(make(b"PK\x03\x04rest of a spreadsheet")).what


@pytest.mark.parametrize("cell", ['"b', '"b"x', '"b\nb"'])
def test_a_quote_that_is_not_closed_on_its_line_is_refused(make, fails, cell):
    assert "quote" in fails(make(table(LINES[0], LINES[1].replace("b", cell, 1), *LINES[2:])), row=3).what


def test_one_pose_with_different_commands_names_both_rows(make, fails):
    error = fails(make(with_cell(5, "q2", "0.2000001")), row=5, column="q2")
    assert "row 2" in error.what
    assert "pose a" in error.what


def test_one_pose_may_differ_by_rounding_in_its_commands(make):
    assert len(Dataset.read(make(with_cell(5, "q2", "0.2000000000001")))) == 4


def test_a_quaternion_that_is_far_from_unit_is_reported_with_its_row(make, fails):
    assert "norm is 1.0011" in fails(make(with_cell(2, "qw", "1.0011")), row=2, column="qw qx qy qz").what
    assert "norm is 0," in fails(make(with_cell(2, "qw", "0")), row=2, column="qw qx qy qz").what


def test_a_negative_payload_is_refused(make, fails):
    fails(make(with_cell(3, "payload", "-0.5")), row=3, column="payload")


@pytest.mark.parametrize("cell", ["0", "0.5", "2"])
def test_an_approach_that_is_no_direction_is_refused(make, fails, cell):
    assert "+1 or -1" in fails(make(with_cell(4, "approach1", cell)), row=4, column="approach1").hint


@pytest.mark.parametrize("name", ["approach4", "speed4", "speed0", "approach01"])
def test_a_covariate_of_an_actuator_that_is_not_there_is_refused(with_column, fails, name):
    assert "1 to 3" in fails(with_column(name, "1", "-1", "1", "-1"), row=1, column=name).hint


@pytest.mark.parametrize(
    ("toml", "column", "said"),
    [
        (TOML.replace("dataset/1", "dataset/3"), "schema", "gtpin-dataset/1"),
        (TOML.replace("schema", "shema"), "schema", "gtpin-dataset/1"),
        (TOML.replace('"gantry_tau"', '" "'), "robot", "URDF"),
        (TOML.replace('"gantry_tau"', "5"), "robot", "URDF"),
        ("schema = 'gtpin-dataset/1'", "robot", "write robot"),
        (TOML.replace("position_sigma", "positon_sigma"), "instrument.positon_sigma", "did you mean position_sigma"),
        (TOML.replace("[instrument]", ""), "position_sigma", "under [instrument]"),
        (TOML.replace("[instrument]", "[instruments]"), "instruments", "did you mean instrument"),
        (TOML.replace("1.5e-5", "0.0"), "instrument.position_sigma", "above 0"),
        (TOML.replace("1.5e-5", "-1"), "instrument.position_sigma", "above 0"),
        (TOML.replace("1.5e-5", "nan"), "instrument.position_sigma", "above 0"),
        (TOML.replace("1.5e-5", "inf"), "instrument.position_sigma", "above 0"),
        (TOML.replace("1.5e-5", "true"), "instrument.position_sigma", "above 0"),
        (TOML.replace("1.5e-5", '"1.5e-5"'), "instrument.position_sigma", "above 0"),
        (TOML + "orientation_sigma = 0", "instrument.orientation_sigma", "above 0"),
        (TOML + 'frame = "base"', "instrument.frame", '"robot" or "free"'),
        (TOML + "station = [1, 2]", "instrument.station.2", "three"),
        (TOML + "station = [1, 2, 3, 4]", "instrument.station", "three"),
        (TOML + "station = [1, 2, inf]", "instrument.station.2", "three"),
        (TOML + "station = 5", "instrument.station", "three"),
        (TOML + "[conditions]\nhumidity = 40", "conditions.humidity", "reference_temperature"),
        (TOML + "[conditions]\nreference_temperature = nan", "conditions.reference_temperature", "degC"),
        (TOML + "[tolerance]\nlength = 0", "tolerance.length", "above 0"),
        (TOML + "[tolerance]\nlength = 'wide'", "tolerance.length", "above 0"),
        ("instrument = 5\n" + TOML.split("[")[0], "instrument", "section"),
        ("tolerance = 5\n" + TOML.split("[")[0], "tolerance", "section"),
    ],
)
def test_a_wrong_key_or_value_of_dataset_toml_is_named_with_a_way_out(make, fails, toml, column, said):
    assert said in fails(make(toml=toml), column=column, file="dataset.toml").hint


def test_a_syntax_error_of_dataset_toml_is_reported_with_its_line(make, fails):
    assert "not TOML" in fails(make(toml=TOML + "frame = robot\n"), row=6, file="dataset.toml").what


def test_dataset_toml_that_is_not_utf8_or_is_missing_is_refused(make, fails):
    assert "UTF-8" in fails(make(toml=TOML.replace("tau", "é").encode("latin-1")), file="dataset.toml").what
    folder = make()
    (folder / "dataset.toml").unlink()
    assert "missing" in fails(folder, file="dataset.toml").what


def test_what_dataset_toml_says_is_read(make):
    more = 'orientation_sigma = 5e-5\nframe = "free"\nstation = [1.5, -7, 0.25]\n'
    more += "[conditions]\nreference_temperature = 22\n[tolerance]\nlength = 1e-3\n"
    dataset = Dataset.read(make(toml=TOML + more))
    assert dataset.instrument.frame == "free"
    assert dataset.instrument.station == (1.5, -7.0, 0.25)
    assert dataset.instrument.orientation_sigma == 5e-5
    assert dataset.conditions.reference_temperature == 22.0
    assert dataset.tolerance == {"length": 1e-3}


junk = st.sampled_from(
    [b"", b",", b"\n", b"\r", b'"', b"\0", b"\xff", b"nan", b"1e999", b";", b"-", b"x", b"\xef\xbb\xbf"]
)
corruption = st.tuples(st.integers(0, 400), st.integers(0, 30), st.one_of(junk, st.binary(max_size=6)))
no_deadline = settings(
    max_examples=400, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def spoil(data, corruptions):
    for at, length, new in corruptions:
        at = min(at, len(data))
        data = data[:at] + new + data[at + length :]
    return data


@pytest.mark.slow
@no_deadline
@given(corruptions=st.lists(corruption, min_size=1, max_size=4))
def test_a_corrupted_table_never_raises_anything_but_a_dataset_error(make, corruptions):
    folder = make(spoil(table(*LINES).encode(), corruptions))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for read in (lambda: Dataset.read(folder), lambda: Commands.read(folder / "poses.csv")):
            with contextlib.suppress(DatasetError):
                read()


@pytest.mark.slow
@no_deadline
@given(corruptions=st.lists(corruption, min_size=1, max_size=4))
def test_a_corrupted_dataset_toml_never_raises_anything_but_a_dataset_error(make, corruptions):
    folder = make(toml=spoil(TOML.encode(), [(at % len(TOML), length, new) for at, length, new in corruptions]))
    with contextlib.suppress(DatasetError):
        Dataset.read(folder)


@pytest.mark.slow
@no_deadline
@given(corruptions=st.lists(st.tuples(st.integers(0, 9000), st.integers(0, 30), st.binary(max_size=6)), max_size=3))
def test_a_corrupted_parquet_table_never_raises_anything_but_a_dataset_error(make, corruptions):
    folder = make()
    clean = folder.parent / "clean"
    if not clean.exists():
        Dataset.read(folder).write(clean, table="parquet")
    (folder / "poses.csv").unlink()
    (folder / "poses.parquet").write_bytes(spoil((clean / "poses.parquet").read_bytes(), corruptions))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with contextlib.suppress(DatasetError):
            Dataset.read(folder)
    (folder / "poses.parquet").unlink()


def test_damaged_names_in_a_parquet_file_are_one_line(tmp_path: Path) -> None:
    good = tmp_path / "poses.parquet"
    pd.DataFrame({"pose": ["a", "b"], "q1": [0.0, 1.0], "remark": [1.0, 2.0]}).to_parquet(good)
    damaged = good.read_bytes().replace(b"remark", b"\xff\xfe\xff\xfe\xff\xfe")
    with pytest.raises(DatasetError, match="not a Parquet file that can be read"):
        read_parquet(good, damaged)
