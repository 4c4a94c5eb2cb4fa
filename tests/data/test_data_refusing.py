"""What is no dataset is refused with its place and a way out, and with nothing but a DatasetError."""

import contextlib
import warnings
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_dataset import HEADER, LINES, TOML, table, with_column, without

from gtpin.data import Commands, Dataset
from gtpin.data.csv_file import TOGETHER, read_csv
from gtpin.data.parquet_file import read_parquet
from gtpin.errors import DatasetError


def with_cell(line, column, cell):
    cells = LINES[line - 2].split(",")
    cells[HEADER.split(",").index(column)] = cell
    return table(*(",".join(cells) if i == line - 2 else text for i, text in enumerate(LINES)))


def with_line(line, new):
    return table(*(new if i == line - 2 else text for i, text in enumerate(LINES)))


def many(count, **lines):
    rows = [f"{i},{i * 1e-6},0,0,{i},1,2" for i in range(count)]
    for index, text in lines.items():
        rows[int(index[1:])] = text
    return "\n".join(("pose,q1,q2,q3,x,y,z", *rows))


ALL = table(*LINES)
BAD_CELLS = {
    **dict.fromkeys(("", " "), "blank"),
    **dict.fromkeys(("NaN", "inf", "-Infinity", "1e999"), "not a finite"),
    **dict.fromkeys(("oops", "1_0", "٣", "1.5 mm", "0x10"), "not a number"),
}
SEPARATORS = {";": "';'", "\t": "tabs", " ": "spaces"}
QUOTED_COMMAS = table(*(",".join(f'"{cell}"'.replace(".", ",") for cell in line.split(",")) for line in LINES))
WRONG_TABLES = [  # text, row, column, what the error says
    *((without(name), 1, name, "missing") for name in ("pose", "q1", "x", "z")),
    (without("q2"), 1, "q2", "q3"),  # a gap in the commands
    (ALL.replace("q1,q2,q3", "q0,q1,q2"), 1, "q3", "q0"),
    (without("qy"), 1, "qy", "all of qw qx qy qz"),
    *(
        (
            ALL.replace(",", separator).replace(".", decimal),
            1,
            None,
            f"the columns are separated by {word}; save with ','",
        )
        for separator, word in SEPARATORS.items()
        for decimal in ".,"
    ),
    *((ALL.replace("q1", name, 1), 1, "q1", repr(name)) for name in ("Q1", " q1", "q 1")),
    ("1,0.1,0.2,1,2,3\n2,0.2,0.3,4,5,6\n", 1, None, "header"),
    (ALL.replace("time", "q2", 1), 1, "q2", "twice"),
    ("," + ALL, 1, None, "no name"),
    *(
        (with_line(line, new(LINES[line - 2])), line, None, "cells")
        for line in (2, 4, 5)
        for new in (lambda t: t + ",1", lambda t: t.rsplit(",", 1)[0], lambda t: t[:7])
    ),
    *(
        (with_cell(line, column, cell), line, column, said)
        for line in (2, 4, 5)
        for column in ("q2", "x", "qz", "time", "payload")
        for cell, said in BAD_CELLS.items()
    ),
    (with_cell(3, "x", '"1,25"'), 3, "x", "decimal point"),
    (QUOTED_COMMAS, 2, "q1", "decimal point"),  # no line of units
    (HEADER + "\na" + 14 * ",0.5D-01" + "\n", 2, "q1", "exponent with E"),
    (HEADER + "\na" + 14 * ",\u22120.5" + "\n", 2, "q1", "write minus as -"),
    (with_cell(3, "x", "1.2d+01"), 3, "x", "exponent with E"),
    ("# measured by Bob\n" + ALL, 1, None, "begins with #"),
    ("# " + ALL, 1, None, "begins with #"),
    (with_line(3, "# here the tool was changed"), 3, None, "begins with #"),
    *((f"{line}\n{ALL}", 1, None, "separator for Excel") for line in ("sep=,", "sep=;", '"sep=,"', "SEP=,,,,")),
    (HEADER + "\na" + 14 * ',"0,5"' + "\n", 2, "q1", "decimal point"),
    (table(*(line.replace(".", ",") for line in LINES)), 2, None, "decimal point"),
    (with_cell(4, "x", "oops").replace(LINES[0], "\n\n" + LINES[0], 1), 6, "x", "oops"),  # blank lines count
    (many(60_000, _54321="54321,0.054321,0,0,oops,1,2"), 54_323, "x", "oops"),
    # Of several bad rows the first is named, whatever is wrong with the others.
    (many(3 * TOGETHER, _40="40,0,0,0,1,2,oops", _41="41,0,oops,0,1,2,3", _50="50,0"), 42, "z", "oops"),
    (many(3 * TOGETHER, _30="30,0", _40="40,0,0,0,1,2,oops"), 32, None, "2 cells"),
    *(
        (with_cell(4, *at), 4, at[0], "")
        for at in (("pose", ""), ("pose", "nan"), ("session", " "), ("session", "NaN"))
    ),
    (with_column("humidity", "40", "41", "n.n.", "42"), 4, "humidity", "n.n."),
    (with_column("humidity", "40", "", "", ""), 3, "humidity", "blank"),
    (table(*LINES[:2], HEADER, *LINES[2:]), 4, None, "second header"),
    (table("-,m,m,m,m,m,m,-,-,-,-,s,-,kg,-", *LINES), 2, None, "units"),
    (table(*LINES, "," * HEADER.count(",")), 6, None, "blank"),
    *((empty, None, None, "empty") for empty in (b"", b"\n\n", b"\xef\xbb\xbf", b"  \r\n")),
    (HEADER + "\n\n", None, None, "no rows"),
    (ALL.encode("utf-16"), None, None, "UTF-16"),
    (ALL.replace("c,", "é,", 1).encode("latin-1"), 4, None, "UTF-8"),
    (ALL.replace("c,", "\0,", 1), 4, None, "not text"),
    (b"PK\x03\x04rest of a spreadsheet", None, None, "not text"),
    *((with_line(3, LINES[1].replace("b", cell, 1)), 3, None, "quote") for cell in ('"b', '"b"x', '"b\nb"')),
    (with_cell(5, "q2", "0.2000001"), 5, "q2", "pose a has other commands here than in row 2"),
    (with_cell(2, "qw", "1.0011"), 2, "qw qx qy qz", "norm is 1.0011"),
    (with_cell(2, "qw", "0"), 2, "qw qx qy qz", "norm is 0,"),
    (with_cell(3, "payload", "-0.5"), 3, "payload", "0 or more"),
    *((with_cell(4, "approach1", cell), 4, "approach1", "+1 or -1") for cell in ("0", "0.5", "2")),
    *(
        (with_column(name, "1", "-1", "1", "-1"), 1, name, "1 to 3")
        for name in ("approach4", "speed4", "speed0", "approach01")
    ),
]


@pytest.mark.parametrize(("text", "row", "column", "said"), WRONG_TABLES, ids=lambda value: str(value)[-30:])
def test_what_is_wrong_in_a_table_is_named_with_its_line_and_column(make, fails, text, row, column, said):
    assert said in str(fails(make(text), row=row, column=column))


@pytest.mark.parametrize("path", ["nowhere", "no/where", "set/poses.csv/deeper"])
def test_a_folder_that_does_not_exist_is_said_not_to(tmp_path, make, fails, path):
    make()
    assert "the folder does not exist" in fails(tmp_path / path, file="").what


def test_a_missing_table_is_named_and_so_are_a_folder_in_its_place_and_two_of_one_name(make, fails):
    folder = make()
    (folder / "poses.parquet").write_bytes(b"PAR1")
    with pytest.raises(DatasetError, match=r"both poses\.csv and poses\.parquet"):
        Dataset.read(folder)
    (folder / "poses.parquet").unlink()
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


@pytest.mark.parametrize("content", [b"", b"PAR1", b"PAR1" + bytes(100) + b"PAR1", b"pose,q1\n1,2\n"])
def test_a_parquet_file_that_is_none_is_refused(make, fails, content):
    folder = make()
    (folder / "poses.csv").unlink()
    (folder / "poses.parquet").write_bytes(content)
    assert "not a Parquet file" in fails(folder, file="poses.parquet").what


@pytest.mark.parametrize("name", ["air temperature near the track", "humidity; %", "a\tb"])
def test_other_separators_inside_a_column_s_name_are_let_pass(name):
    assert len(read_csv("f.csv", with_column(name, "40", "41", "42", "43").encode())) == 4


@pytest.mark.parametrize(
    ("text", "row", "said"),
    [
        *(
            (f"pose,q1,q2\na,0,0\n{line}{after}\n", 3, "quoted cell")
            for line in ('"b,0,0', 'b,"0\n",0', 'b,"0" ,0', 'b,0,"0', '"b"x,0,0')
            for after in ("", "\nc,0,0\nd,0,0")
        ),
        ('pose,"q1,q2\na,0,0\n', 1, "quoted cell"),
        ("pose,q1\n" + "a" * 200_000 + ",1\n", 2, "more than 131072 characters"),
    ],
    ids=range(12),
)
def test_a_quoted_cell_that_is_not_closed_and_a_cell_as_long_as_a_book_are_reported_with_their_line(text, row, said):
    with pytest.raises(DatasetError, match=said) as caught:
        read_csv("f.csv", text.encode())
    assert caught.value.row == row


def test_one_pose_may_differ_by_rounding_in_its_commands(make):
    assert len(Dataset.read(make(with_cell(5, "q2", "0.2000000000001")))) == 4


POSITION = ("instrument.position_sigma", "above 0")
STATION = "station = [1, 2"


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
        *((TOML.replace("1.5e-5", bad), *POSITION) for bad in ("0.0", "-1", "nan", "inf", "true", '"1.5e-5"')),
        (TOML + "orientation_sigma = 0", "instrument.orientation_sigma", "above 0"),
        (TOML + 'frame = "base"', "instrument.frame", '"robot" or "free"'),
        (TOML + STATION + "]", "instrument.station.2", "three"),
        (TOML + STATION + ", 3, 4]", "instrument.station", "three"),
        (TOML + STATION + ", inf]", "instrument.station.2", "three"),
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


def test_dataset_toml_that_is_none_is_refused(make, fails):
    assert "not TOML" in fails(make(toml=TOML + "frame = robot\n"), row=6, file="dataset.toml").what
    assert "UTF-8" in fails(make(toml=TOML.replace("tau", "é").encode("latin-1")), file="dataset.toml").what
    folder = make()
    (folder / "dataset.toml").unlink()
    assert "missing" in fails(folder, file="dataset.toml").what


def test_what_dataset_toml_says_is_read(make):
    more = 'orientation_sigma = 5e-5\nframe = "free"\nstation = [1.5, -7, 0.25]\n'
    more += "[conditions]\nreference_temperature = 22\n[tolerance]\nlength = 1e-3\n"
    dataset = Dataset.read(make(toml=TOML + more))
    assert (dataset.instrument.frame, dataset.instrument.station) == ("free", (1.5, -7.0, 0.25))
    assert dataset.instrument.orientation_sigma == 5e-5
    assert dataset.conditions.reference_temperature == 22.0
    assert dataset.tolerance == {"length": 1e-3}


JUNK = [b"", b",", b"\n", b"\r", b'"', b"\0", b"\xff", b"nan", b"1e999", b";", b"-", b"x", b"\xef\xbb\xbf"]
corruption = st.tuples(st.integers(0, 400), st.integers(0, 30), st.one_of(st.sampled_from(JUNK), st.binary(max_size=6)))
no_deadline = settings(
    max_examples=400, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def spoil(data, corruptions):
    for at, length, new in corruptions:
        at = min(at, len(data))
        data = data[:at] + new + data[at + length :]
    return data


def read_all(*readers):
    """Nothing but a DatasetError is raised."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for read in readers:
            with contextlib.suppress(DatasetError):
                read()


@pytest.mark.slow
@no_deadline
@given(corruptions=st.lists(corruption, min_size=1, max_size=4))
def test_a_corrupted_table_or_dataset_toml_never_raises_anything_but_a_dataset_error(make, corruptions):
    folder = make(spoil(ALL.encode(), corruptions))
    read_all(lambda: Dataset.read(folder), lambda: Commands.read(folder / "poses.csv"))
    toml = spoil(TOML.encode(), [(at % len(TOML), length, new) for at, length, new in corruptions])
    read_all(lambda: Dataset.read(make(toml=toml)))


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
    read_all(lambda: Dataset.read(folder))
    (folder / "poses.parquet").unlink()


def test_damaged_names_in_a_parquet_file_are_one_line(tmp_path: Path) -> None:
    good = tmp_path / "poses.parquet"
    pd.DataFrame({"pose": ["a", "b"], "q1": [0.0, 1.0], "remark": [1.0, 2.0]}).to_parquet(good)
    damaged = good.read_bytes().replace(b"remark", b"\xff\xfe\xff\xfe\xff\xfe")
    with pytest.raises(DatasetError, match="not a Parquet file that can be read"):
        read_parquet(good, damaged)


def test_a_key_of_thousands_of_parts_is_named_with_its_line(make, fails) -> None:
    toml = TOML + "\n" + "a." * 5000 + "b = 1\n"
    assert "20 parts" in fails(make(toml=toml), row=toml.count("\n"), file="dataset.toml").what


def test_a_column_whose_name_is_a_book_is_refused(make, fails) -> None:
    name = "t" * 100_000
    assert "100,000 letters" in fails(make(with_column(name, *["1"] * len(LINES))), 1, name[:40]).what
