"""What can't be a dataset of several instruments is refused in one line: file, row, column, and what to do."""

import warnings
from pathlib import Path

import pytest
from small_instruments import HEAD, PLANE, RANGE, SOCKET, TABLES, TILT, TRACKER

from gtpin.data import Dataset
from gtpin.errors import DatasetError, GtpinWarning

WIRE, BED, CUP, LASER = (TABLES[name] for name in ("wire", "bed", "cup", "laser"))
STATIONS = "{A = [2.0, 0.1, 0.3], B = [-1.0, 2.0, 0.5]}"
SIGMAS = LASER.replace(",time", ",sx,sy,sz,srx,sry,srz").replace(",10\n", ",{0},1,1,1,1,{1}\n")
SIGMAS = SIGMAS.replace(",20\n", ",1,1,1,1,1,1\n").replace(",40\n", ",1,1,1,1,1,1\n")


def refused(folder: Path) -> DatasetError:
    with pytest.raises(DatasetError) as caught:
        Dataset.read(folder)
    text = str(caught.value)
    assert "\n" not in text
    assert caught.value.hint, text
    return caught.value


MISTAKES = {
    "single brackets": (RANGE.replace("[[instrument]]", "[instrument]"), "instrument", "double brackets"),
    "no instrument": ("", "instrument", "write [[instrument]]"),
    "a list without one": ("instrument = []\n", "instrument", "write [[instrument]]"),
    "a text": ('instrument = "wire"\n', "instrument", "write [[instrument]]"),
    "no kind": (RANGE.replace('kind = "range"', ""), "instrument.0.kind", "tracker, range, plane"),
    "unknown kind": (RANGE.replace('"range"', '"ballbar"'), "instrument.0.kind", "tracker, range, plane"),
    "kind of another case": (RANGE.replace('"range"', '"Range"'), "instrument.0.kind", "did you mean range?"),
    "no name": (RANGE.replace('name = "wire"', ""), "instrument.0.name", "letters"),
    "a name of two words": (RANGE.replace('"wire"', '"my wire"'), "instrument.0.name", "letters"),
    "a name that leads elsewhere": (RANGE.replace('"wire"', '"../wire"'), "instrument.0.name", "letters"),
    "the name of another table": (RANGE.replace('"wire"', '"carts"'), "instrument.0.name", "carts"),
    "two of one name": (RANGE + RANGE, "instrument.1.name", "called wire"),
    "two of one file name": (RANGE + TILT.replace("level", "WIRE"), "instrument.1.name", "case"),
    "unknown key": (RANGE.replace("offset_s", "ofset_s"), "instrument.0.ofset_sigma", "did you mean offset_sigma?"),
    "another kind's key": (TILT + "offset_sigma = 1.0\n", "instrument.0.offset_sigma", "mount_sigma"),
    "no stations": (RANGE.replace("stations", "# "), "instrument.0.stations", "stations = {A = [x, y, z]}"),
    "stations without a name": (RANGE.replace(STATIONS, "{}"), "instrument.0.stations", "stations = {A = "),
    "stations in a list": (RANGE.replace(STATIONS, "[[2.0, 0.1, 0.3]]"), "instrument.0.stations", "stations = {A = "),
    "a station of two numbers": (
        RANGE.replace("[2.0, 0.1, 0.3]", "[2.0, 0.1]"),
        "instrument.0.stations.A.2",
        "[x, y, z]",
    ),
    "a station at NaN": (RANGE.replace("[2.0, 0.1, 0.3]", "[nan, 0, 0]"), "instrument.0.stations.A.0", "[x, y, z]"),
    "a plane without a normal": (
        PLANE.replace(", normal = [1.0, 0.0, 0.0]", ""),
        "instrument.0.planes.Q.normal",
        "normal = [x, y, z]",
    ),
    "a key that a plane has not": (
        PLANE.replace("1.0]}, Q", "1.0], up = 1}, Q"),
        "instrument.0.planes.P.up",
        "planes = {A",
    ),
    "a normal of no length": (PLANE.replace("[1.0, 0.0, 0.0]", "[0, 0, 0]"), "instrument.0.planes.Q.normal", "normal"),
    "sigma 0": (RANGE.replace("sigma = 2e-5", "sigma = 0"), "instrument.0.sigma", "above 0"),
    "sigma in words": (RANGE.replace("sigma = 2e-5", 'sigma = "20 um"'), "instrument.0.sigma", "m or rad"),
    "a sigma below 0": (RANGE.replace("1e-3", "-1e-3"), "instrument.0.offset_sigma", "0 or more"),
    "a distance without sigma": (SOCKET.replace(", 5e-5]]", "]]"), "instrument.0.distances.0.3", "1 sigma"),
    "a distance below 0": (SOCKET.replace("0.05,", "-0.05,"), "instrument.0.distances.0.2", "distances = "),
    "a distance to itself": (SOCKET.replace('"S2"', '"S1"'), "instrument.0.distances", "itself"),
    "a target in words": (TILT + 'target = "free"\n', "instrument.0.target", "[x, y, z]"),
    "a target of a tilt sensor": (TILT + "target = [0, 0, 0]\n", "instrument.0.target", "leave it out"),
    "targets of a tilt sensor": (TILT + "targets = {A = [0, 0, 0]}\n", "instrument.0.targets", "leave it out"),
    "sockets that nobody says how well they are known": (
        SOCKET.replace("socket_sigma = 1e-3\n", ""),
        "instrument.0.socket_sigma",
        "give both",
    ),
    "a socket's sigma without a socket": (
        SOCKET.replace("sockets = {S1 = [0.1, 0.2, 0.3]}\n", ""),
        "instrument.0.socket_sigma",
        "neither",
    ),
    "two sigmas of positions": (TRACKER + "sigma = 1e-5\n", "instrument.0.sigma", "one of the two"),
    "target and targets": (RANGE + "target = [0, 0, 0]\n", "instrument.0.targets", "one of the two"),
    "an encoder of no joint": (TILT.replace('"tilt"', '"encoder"'), "instrument.0.joint", "URDF"),
    "another frame": (TRACKER + 'frame = "world"\n', "instrument.0.frame", '"robot" or "free"'),
    "no table": (PLANE.replace('"bed"', '"probe"'), "instrument.0.file", "probe.csv"),
    "a table elsewhere": (RANGE + 'file = "../wire.csv"\n', "instrument.0.file", "move it in"),
    "a table that is not there": (RANGE + 'file = "wires.csv"\n', "instrument.0.file", "wires.csv"),
    "one table for two wires": (
        RANGE + RANGE.replace('"wire"', '"wire2"') + 'file = "wire.csv"\n',
        "instrument.1.file",
        "table of its own",
    ),
    "a driver of no column": (
        'driver = [{column = "tilt", site = "frame", motion = "rx", size = 1e-3}]\n' + RANGE,
        "driver.0.column",
        "recorded are: time",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_in_the_description_is_named_by_its_key(write, name):
    said, column, told = MISTAKES[name]
    tables = {name: text for name, text in TABLES.items() if name not in ("spare",)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)  # of tables without an instrument
        error = refused(write(HEAD + said, **tables))
    assert Path(str(error.file)).name == "dataset.toml"
    assert error.column == column
    assert told in f"{error.what}; {error.hint}"


@pytest.mark.parametrize("schema", ['"gtpin-dataset/3"', '"gtpin-dataset/02"', "2"])
def test_a_schema_of_another_number_is_refused(write, schema):
    error = refused(write(f'schema = {schema}\nrobot = "gantry_tau"\n{RANGE}', wire=WIRE))
    assert (Path(str(error.file)).name, error.column) == ("dataset.toml", "schema")
    assert "gtpin-dataset/2" in error.hint


def test_several_instruments_under_schema_1_are_sent_to_schema_2(write):
    error = refused(write(HEAD.replace("/2", "/1") + RANGE, wire=WIRE))
    assert error.column == "instrument"
    assert "gtpin-dataset/2" in error.hint


# One of each kind: what may be wrong in any table is in test_data_refusing.py.
BROKEN = {
    "NaN": (RANGE, "wire", WIRE.replace("1.75", "nan"), 3, "range"),
    "words alone": (RANGE, "wire", WIRE.replace("1.25", "a").replace("1.75", "b").replace("1.5,", "c,"), 1, "range"),
    "no column": (RANGE, "wire", WIRE.replace("range", "distance"), 1, "range"),
    "no station of a row": (RANGE, "wire", WIRE.replace("B,U", ",U"), 3, "station"),
    "no commands": (RANGE, "wire", WIRE.replace("q", "p"), 1, "q1"),
    "no pose": (RANGE, "wire", WIRE.replace("pose", "stop"), 1, "pose"),
    "no socket": (SOCKET, "cup", CUP.replace("socket", "hole"), 1, "socket"),
    "part of a quaternion": (TRACKER, "laser", LASER.replace(",qz", ",qq"), 1, "qz"),
    "a long quaternion": (TRACKER, "laser", LASER.replace("0.6,0.8", "0.7,0.8"), 3, "qw qx qy qz"),
    "sx of 0": (TRACKER, "laser", SIGMAS.format(0, 1), 2, "sx"),
    "srz below 0": (TRACKER, "laser", SIGMAS.format(1, -1), 2, "srz"),
    "sx alone": (TRACKER, "laser", LASER.replace("time", "sx"), 1, "sy"),
    "srx without orientations": (TRACKER, "laser", "pose,q1,q2,q3,x,y,z,srx\na,0,0,0,1,1,1,1\n", 1, "sx"),
    "two commands of one stop": (RANGE, "wire", WIRE.replace("a,0.1,0.2,0.3,B", "a,0.1,0.21,0.3,B"), 3, "q2"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_mistake_in_a_table_is_named_by_its_row_and_column(write, name):
    said, table, text, row, column = BROKEN[name]
    assert text != TABLES[table]
    error = refused(write(HEAD + said, **{table: text}))
    assert Path(str(error.file)).name == f"{table}.csv"
    assert (error.row, error.column) == (row, column)


def test_one_pose_of_two_commands_in_two_tables_is_refused_and_both_are_named(write):
    level = TABLES["level"].replace("a,0.1,0.2", "a,0.1,0.25")
    error = refused(write(HEAD + RANGE + TILT, wire=WIRE, level=level))
    assert (Path(str(error.file)).name, error.row, error.column) == ("level.csv", 2, "pose")
    assert "wire.csv" in error.what


def test_tables_of_other_numbers_of_commands_are_refused(write):
    error = refused(write(HEAD + RANGE + TILT, wire=WIRE, level="pose,q1,q2,tilt_x,tilt_y\na,0.1,0.2,0,0\n"))
    assert (Path(str(error.file)).name, error.row) == ("level.csv", 1)


def test_both_a_csv_and_a_parquet_table_of_an_instrument_are_refused(write):
    folder = write(HEAD + RANGE, wire=WIRE)
    (folder / "wire.parquet").write_bytes(b"PAR1")
    assert "both wire.csv and wire.parquet" in refused(folder).what


@pytest.mark.parametrize("name", ["other", "poses"])
def test_a_table_without_an_instrument_is_warned_of(write, name):
    with pytest.warns(GtpinWarning, match=rf"{name}\.csv: tables without an \[\[instrument\]\]"):
        Dataset.read(write(HEAD + RANGE, wire=WIRE, **{name: BED}))


def test_a_covariate_that_only_one_table_has_is_left_out_with_a_warning(write):
    wire = WIRE.replace("time", "temp_link")
    with pytest.warns(GtpinWarning, match=r"temp_link \(not in bed\.csv\), time \(not in wire\.csv\)"):
        dataset = Dataset.read(write(HEAD + RANGE + PLANE, wire=wire, bed=BED))
    assert not dataset.covariates
