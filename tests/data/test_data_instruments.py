"""Datasets of several instruments: read to the bit, written to the bit, and one tracker's are those of schema 1."""

import warnings

import numpy as np
import pandas as pd
import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_instruments import ALL, HEAD, RANGE, TABLES, TILT, TRACKER

import gtpin
from gtpin.data import Dataset
from gtpin.errors import GtpinWarning
from gtpin.instruments.readings import instruments_of
from gtpin.kinematics.rotations import exp, to_quaternions

number = st.floats(-1e6, 1e6)
word = st.text("ABab12_", min_size=1, max_size=3).map(lambda text: "s" + text)
positive = st.floats(1e-9, 1.0)
point = st.tuples(number, number, number)


@st.composite
def folders(draw):
    """What dataset.toml says, and each instrument's table: by name, columns of cells."""
    poses = draw(st.lists(word, min_size=1, max_size=5, unique=True))
    q = {pose: draw(point) for pose in poses}
    time = {pose: draw(number) for pose in poses}

    def table(**readings):
        count = draw(st.integers(1, 5))
        stops = draw(st.lists(st.sampled_from(poses), min_size=count, max_size=count))
        columns = {"pose": stops}
        columns |= {f"q{i + 1}": [q[pose][i] for pose in stops] for i in range(3)}
        for name, cells in readings.items():
            columns[name] = draw(st.lists(cells, min_size=count, max_size=count))
        return columns | {"time": [time[pose] for pose in stops]}

    stations, planes = (draw(st.lists(word, min_size=1, max_size=3, unique=True)) for _ in range(2))
    said = [
        {"name": "wire", "kind": "range", "stations": {name: draw(point) for name in stations}},
        {"name": "cup", "kind": "socket", "sigma": draw(positive)},
        {"name": "level", "kind": "tilt", "mount_sigma": draw(positive)},
        {"name": "laser", "kind": "tracker", "frame": "free", "target": draw(point), "target_sigma": draw(positive)},
        {
            "name": "bed",
            "kind": "plane",
            "normal_sigma": draw(positive),
            "planes": {name: {"point": draw(point), "normal": (0.0, 0.5, 1.0)} for name in planes},
        },
    ]
    tables = {
        "wire": table(station=st.sampled_from(stations), range=number),
        "cup": table(socket=word),
        "level": table(tilt_x=number, tilt_y=number),
        "laser": table(x=number, y=number, z=number, sx=positive, sy=positive, sz=positive),
        "bed": table(plane=st.sampled_from(planes), height=number),
    }
    kept = draw(st.lists(st.sampled_from(said), min_size=1, max_size=5, unique_by=lambda one: one["name"]))
    toml = {"schema": "gtpin-dataset/2", "robot": "gantry_tau", "instrument": kept}
    return toml, {one["name"]: tables[one["name"]] for one in kept}


def text(columns: dict) -> str:
    rows = zip(*columns.values(), strict=True)
    return "\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows)])


def bits(column):
    return column.tolist() if column.dtype == object else np.ascontiguousarray(column).tobytes()


@pytest.mark.slow
@settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(case=folders(), suffix=st.sampled_from(["csv", "parquet"]))
def test_readings_are_read_as_they_were_written(write, tmp_path, case, suffix):
    toml, tables = case
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)  # of times that do not vary
        first = Dataset.read(write(tomli_w.dumps(toml), **{name: text(columns) for name, columns in tables.items()}))
        first.write(tmp_path / "set", suffix)
        again = Dataset.read(tmp_path / "set")
    for index, (name, columns) in enumerate(tables.items()):
        mine = first.readings.rows_of(index)
        assert first.pose[mine].tolist() == columns["pose"]
        for cell, values in columns.items():
            if cell not in ("pose", "q1", "q2", "q3"):
                read = first.covariates[cell] if cell == "time" else first.readings.columns[cell]
                assert bits(read[mine]) == bits(np.array(values, dtype=read.dtype)), (name, cell)
        assert bits(first.q[mine]) == bits(np.column_stack([columns[f"q{i}"] for i in (1, 2, 3)]))
    assert again.readings.tables == first.readings.tables
    assert again.readings.known == first.readings.known
    for one, two in ((first.pose, again.pose), (first.q, again.q), (first.readings.of, again.readings.of)):
        assert bits(one) == bits(two)
    for mine, theirs in ((first.covariates, again.covariates), (first.readings.columns, again.readings.columns)):
        assert set(mine) == set(theirs)
        for column in mine:
            assert bits(mine[column]) == bits(theirs[column]), column


def test_an_instrument_of_each_kind_is_read_and_written(write, tmp_path):
    dataset = Dataset.read(write("".join((HEAD, *ALL)), **TABLES))
    kinds = ["tracker", "range", "plane", "socket", "tilt", "encoder"]
    assert [table.kind for table in dataset.readings.tables] == kinds
    assert dataset.readings.tables[1].stations == {"A": (2.0, 0.1, 0.3), "B": (-1.0, 2.0, 0.5)}
    assert dataset.readings.tables[3].distances == (("S1", "S2", 0.05, 5e-5),)
    dataset.write(tmp_path / "new")
    assert Dataset.read(tmp_path / "new").readings.tables == dataset.readings.tables


def test_parquet_and_csv_give_the_same_readings(write):
    of_csv = Dataset.read(write("".join((HEAD, *ALL)), **TABLES))
    folder = write("".join((HEAD, *ALL)))
    for name in TABLES:
        text = folder / f"{name}.csv"
        text.write_text(TABLES[name])
        pd.read_csv(text).to_parquet(folder / f"{name}.parquet")
        text.unlink()
    of_parquet = Dataset.read(folder)
    assert bits(of_csv.q) == bits(of_parquet.q)
    assert bits(of_csv.pose) == bits(of_parquet.pose)
    for name, column in of_csv.readings.columns.items():
        assert bits(column) == bits(of_parquet.readings.columns[name]), name


def test_a_table_may_have_a_name_of_its_own_and_is_written_under_the_instrument_s(write, tmp_path):
    dataset = Dataset.read(write(HEAD + RANGE + 'file = "monday.csv"\n', monday=TABLES["wire"]))
    dataset.write(tmp_path / "new")
    assert (tmp_path / "new" / "wire.csv").exists()
    assert Dataset.read(tmp_path / "new").readings.columns["range"].tolist() == [1.25, 1.75, 1.5]


def test_a_dataset_takes_the_place_of_one_of_other_instruments(write, tmp_path):
    Dataset.read(write("".join((HEAD, *ALL)), **TABLES)).write(tmp_path / "new")
    Dataset.read(write(HEAD + RANGE, wire=TABLES["wire"])).write(tmp_path / "new")
    assert sorted(file.name for file in (tmp_path / "new").iterdir()) == [".gtpin.json", "dataset.toml", "wire.csv"]


def test_rows_of_some_instruments_alone_are_a_dataset_of_these(write, tmp_path):
    dataset = Dataset.read(write("".join((HEAD, *ALL)), **TABLES))
    dataset.take(np.flatnonzero(np.isin(dataset.readings.of, [1, 4]))).write(tmp_path / "new")
    again = Dataset.read(tmp_path / "new")
    assert [table.name for table in again.readings.tables] == ["wire", "level"]
    assert len(again) == 5


def test_a_table_of_two_instruments_gives_each_its_own_columns_and_neither_a_covariate(write):
    both = "pose,q1,q2,q3,station,target,range,tilt_x,tilt_y,time\n"
    rows = "a,0.1,0.2,0.3,A,T,1.25,0.01,0.02,1\nb,0.2,0.2,0.3,B,U,1.5,0.03,0.01,2\n"
    dataset = Dataset.read(write(HEAD + RANGE + TILT + 'file = "wire.csv"\n', wire=both + rows))
    assert list(dataset.covariates) == ["time"]
    assert dataset.readings.columns["range"][:2].tolist() == [1.25, 1.5]
    assert dataset.readings.columns["tilt_y"][2:].tolist() == [0.02, 0.01]


def test_a_covariate_that_one_table_lacks_comes_from_the_other_s_rows_at_the_same_poses(write):
    level = "pose,q1,q2,q3,tilt_x,tilt_y\na,0.1,0.2,0.3,0.01,-0.02\nc,0.3,0.2,0.3,0.03,0.0\n"
    dataset = Dataset.read(write(HEAD + RANGE + TILT, wire=TABLES["wire"], level=level))
    assert dataset.covariates["time"].tolist() == [10.0, 10.0, 30.0, 10.0, 30.0]


TRACKED = 'position_sigma = 1.5e-5\norientation_sigma = 5e-5\nframe = "free"\nstation = [1.5, -7.0, 0.3]\n'


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """One tracker's poses, in schema 1 and in schema 2."""
    folder = tmp_path_factory.mktemp("both")
    robot = gtpin.load_robot("gantry_tau")
    rng = np.random.default_rng(0)
    geometry = gtpin.Geometry.nominal(robot)
    off = geometry.with_values(geometry.values + geometry.tolerance * rng.standard_normal(len(geometry.values)))
    q = rng.uniform(-0.3, 0.3, (40, 3))
    poses = gtpin.Model(off).predict(q)
    dataset = Dataset(
        "gantry_tau",
        np.array([f"p{i // 2}" for i in range(40)], dtype=object),
        np.repeat(q[::2], 2, axis=0),
        poses.T[::2].repeat(2, axis=0) + rng.normal(0.0, 1.5e-5, (40, 3)),
        to_quaternions(exp(rng.normal(0.0, 5e-5, (40, 3))) @ np.repeat(poses.R[::2], 2, axis=0)),
        {"time": np.arange(40.0)},
    )
    found = []
    for name, toml in (
        ("one", f'schema = "gtpin-dataset/1"\nrobot = "gantry_tau"\n[instrument]\n{TRACKED}'),
        ("two", f'{HEAD}[[instrument]]\nname = "poses"\nkind = "tracker"\n{TRACKED}'),
    ):
        dataset.write(folder / name)
        (folder / name / "dataset.toml").write_text(toml)
        found.append(Dataset.read(folder / name))
    return found


def test_one_tracker_of_schema_2_is_the_dataset_of_schema_1(both):
    one, two = both
    assert two.readings.tracked
    for name in ("robot", "instrument", "conditions", "tolerance"):
        assert getattr(one, name) == getattr(two, name)
    for name in ("pose", "q", "position", "orientation", "row"):
        assert bits(getattr(one, name)) == bits(getattr(two, name)), name
    assert bits(one.covariates["time"]) == bits(two.covariates["time"])


def test_a_station_in_a_mixture_is_not_used_and_said_so(write):
    stands = TRACKER + "station = [2.0, 0.0, 1.0]\n"
    tables = {name: TABLES[name] for name in ("laser", "level")}
    with pytest.warns(GtpinWarning, match="that of laser is not used"):
        mixed = Dataset.read(write("".join((HEAD, stands, TILT)), **tables))
    assert not mixed.readings.tracked
    assert Dataset.read(write(HEAD + stands, laser=TABLES["laser"])).instrument.station == (2.0, 0.0, 1.0)


def socket_rows(sockets):
    visits = enumerate(sockets)
    return "pose,q1,q2,q3,socket\n" + "".join(f"p{i},{0.1 + i / 100},0.2,0.3,{name}\n" for i, name in visits)


@pytest.mark.parametrize(
    ("kept", "names", "pairs"),
    [
        ([0, 1, 2, 3], ("A", "B"), [("A", "B")]),
        ([0, 4, 5], ("A", "C", "D"), [("C", "D"), ("A", "D")]),
        ([0, 2, 6, 7], ("A", "E"), [("E", "N")]),  # N has a declared point with a sigma, and no visit
        ([4, 6], ("C", "E"), [("E", "N")]),
    ],
)
def test_a_part_of_the_rows_of_sockets_has_the_distances_between_the_sockets_that_it_visits(
    tmp_path, kept, names, pairs
):
    pairs_of_all = [("A", "B"), ("C", "D"), ("E", "N"), ("A", "D"), ("B", "C")]
    cup = {
        "name": "cup",
        "kind": "socket",
        "sockets": {"N": [0.1, 0.2, 0.3]},
        "socket_sigma": 1e-3,
        "distances": [[*pair, 0.05, 5e-5] for pair in pairs_of_all],
    }
    toml = {"schema": "gtpin-dataset/2", "robot": "gantry_tau", "instrument": [cup]}
    (tmp_path / "dataset.toml").write_text(tomli_w.dumps(toml))
    (tmp_path / "cup.csv").write_text(socket_rows("ABABCDEE"))
    part = Dataset.read(tmp_path).take(kept)
    assert [one[:2] for one in part.readings.tables[0].distances] == pairs
    assert part.readings.known[0]["socket"] == names
    (socket,) = instruments_of(part.readings, gtpin.load_robot("gantry_tau"))
    assert set(socket.link[socket.link >= 0]) == set(range(len(pairs)))
    part.write(tmp_path / "part")
    again = Dataset.read(tmp_path / "part").readings
    assert again.tables[0].distances == part.readings.tables[0].distances
    assert again.known[0]["socket"] == names
