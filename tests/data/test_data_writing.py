"""What is written is read again bit by bit, and appears whole or not at all."""

import os
import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_dataset import TOML

from gtpin.data import CartMeasurements, Commands, Conditions, Dataset, InstrumentSection
from gtpin.data.ids import normal_id
from gtpin.errors import DatasetError

finite = st.floats(allow_nan=False, allow_infinity=False)
text = st.text(st.characters(categories=("L", "N", "P", "S", "Zs")), min_size=1, max_size=8).filter(
    lambda t: t.strip() and t.isprintable() and t.strip().lower() not in ("nan", "<na>", "nat")
)
names = text.filter(lambda name: name == name.strip()).map(lambda name: "c" + name)


countable = st.floats(-1e30, 1e30)
"""What a covariate may be."""


def array(draw, *shape, values=finite):
    size = int(np.prod(shape))
    return np.array(draw(st.lists(values, min_size=size, max_size=size))).reshape(shape)


def quaternions(draw, n):
    if draw(st.booleans()):
        return None
    values = np.random.default_rng(draw(st.integers(0, 99))).normal(size=(n, 4))
    return values / np.linalg.norm(values, axis=1, keepdims=True)


def covariates(draw, n):
    known = {
        "time": array(draw, n, values=countable),
        "payload": np.abs(array(draw, n, values=countable)),
        "approach1": np.where(array(draw, n) > 0, 1.0, -1.0),
    }
    others = {name: array(draw, n, values=countable) for name in draw(st.lists(names, max_size=2, unique=True))}
    session = {"session": draw(st.lists(st.one_of(text, st.integers()), min_size=n, max_size=n))}
    return {**known, **others, **session}


@st.composite
def datasets(draw):
    n, m, actuators = draw(st.integers(1, 5)), draw(st.integers(1, 3)), draw(st.integers(1, 4))
    # By their normal form: "2" and "2.0" are one pose, and drawn commands would differ.
    poses = draw(st.lists(st.one_of(text, st.integers(), st.floats(0, 9)), min_size=n, max_size=n, unique_by=normal_id))
    carts = CartMeasurements(
        draw(st.lists(st.integers(1, actuators), min_size=m, max_size=m)),
        array(draw, m),
        array(draw, m, 3),
        quaternions(draw, m),
        covariates(draw, m),
        actuators,
    )
    station = tuple(draw(st.lists(st.floats(-1e4, 1e4), min_size=3, max_size=3)))
    instrument = InstrumentSection(
        position_sigma=draw(st.none() | st.floats(1e-10, 1.0)),
        orientation_sigma=draw(st.none() | st.floats(1e-10, 1.0)),
        frame=draw(st.sampled_from(["robot", "free"])),
        station=draw(st.none() | st.just(station)),
    )
    q = array(draw, n, actuators)
    return Dataset(
        robot=draw(text.filter(lambda t: "/" not in t)),
        pose=poses,
        q=q,
        position=array(draw, n, 3),
        orientation=quaternions(draw, n),
        covariates=covariates(draw, n),
        instrument=instrument,
        conditions=Conditions(reference_temperature=draw(st.floats(-60.0, 150.0))),
        tolerance=draw(st.dictionaries(text, st.floats(1e-10, 10.0), max_size=2)),
        carts=draw(st.none() | st.just(carts)),
    )


@pytest.mark.slow
@settings(
    max_examples=150, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(dataset=datasets(), table=st.sampled_from(["csv", "parquet"]))
def test_a_dataset_is_read_as_it_was_written(tmp_path, same, dataset, table):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        dataset.write(tmp_path / "set", table)
        again = Dataset.read(tmp_path / "set")
        same(again, dataset)
        again.commands.write(tmp_path / f"commands.{table}")
        commands = Commands.read(tmp_path / f"commands.{table}", dataset.n_actuators)
    assert commands.pose.tolist() == dataset.pose.tolist()
    assert commands.q.tobytes() == dataset.q.tobytes()
    assert list(commands.covariates) == list(dataset.covariates)


def test_normal_quaternions_keep_their_bits_however_often_they_are_written(tmp_path, same):
    values = np.random.default_rng(0).normal(size=(2000, 4))
    values /= np.linalg.norm(values, axis=1, keepdims=True)
    dataset = Dataset("r", np.arange(2000), np.linspace(0, 1, 2000)[:, None], np.zeros((2000, 3)), values)
    assert dataset.orientation.tobytes() == values.tobytes()
    dataset.write(tmp_path / "set")
    same(Dataset.read(tmp_path / "set"), dataset)


def test_the_same_dataset_gives_the_same_bytes(make, tmp_path):
    dataset = Dataset.read(make())
    dataset.write(tmp_path / "one")
    dataset.write(tmp_path / "two")
    for name in ("dataset.toml", "poses.csv"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_writing_replaces_a_dataset_of_gtpin_s_and_leaves_nothing_beside_it(make, tmp_path):
    dataset = Dataset.read(make(carts="cart,q,x,y,z\n1,0,0,0,0\n"))
    folder = tmp_path / "new"
    dataset.write(folder)
    dataset.take([0, 1, 2]).write(folder, table="parquet")
    assert sorted(os.listdir(folder)) == [".gtpin.json", "carts.parquet", "dataset.toml", "poses.parquet"]
    assert sorted(os.listdir(tmp_path)) == ["new", "set"]
    assert len(Dataset.read(folder)) == 3


def test_a_dataset_that_gtpin_has_not_written_is_replaced_only_by_force_and_kept(make, tmp_path):
    folder = make(carts="cart,q,x,y,z\n1,0,0,0,0\n")
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    dataset = Dataset.read(folder)
    with pytest.raises(DatasetError, match=r"carts\.csv: gtpin has not written this"):
        dataset.take([0, 1, 2]).write(folder)
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before
    dataset.take([0, 1, 2]).write(folder, "parquet", force=True)
    assert len(Dataset.read(folder)) == 3
    assert {name: (folder / f"{name}.old-1").read_bytes() for name in before} == before


def test_a_folder_with_other_files_is_left_as_it_is(make, tmp_path):
    dataset = Dataset.read(make())
    other = tmp_path / "other"
    other.mkdir()
    (other / "thesis.tex").write_text("precious")
    with pytest.raises(DatasetError, match=r"thesis\.tex"):
        dataset.write(other)
    assert os.listdir(other) == ["thesis.tex"]
    assert sorted(os.listdir(tmp_path)) == ["other", "set"]


def test_a_target_that_can_not_be_written_is_a_dataset_error_and_leaves_nothing(make, tmp_path):
    dataset = Dataset.read(make())
    (tmp_path / "file").write_text("precious")
    for target in (tmp_path / "file", tmp_path / "file" / "set"):
        with pytest.raises(DatasetError, match="can't be written"):
            dataset.write(target)
        with pytest.raises(DatasetError, match="can't be written"):
            dataset.commands.write(target / "commands.csv")
    assert (tmp_path / "file").read_text() == "precious"
    assert sorted(os.listdir(tmp_path)) == ["file", "set"]


def test_a_write_that_breaks_off_leaves_what_was_there(make, tmp_path, monkeypatch):
    dataset = Dataset.read(make())
    folder = tmp_path / "new"
    dataset.write(folder)
    before = {file.name: file.read_bytes() for file in folder.iterdir()}

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("gtpin.data.folder.write_table", full)
    with pytest.raises(DatasetError, match="No space left"):
        dataset.write(folder)
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before
    assert sorted(os.listdir(tmp_path)) == ["new", "set"]


def test_a_relative_path_to_a_robot_still_leads_there_from_another_folder(make, tmp_path):
    dataset = Dataset.read(make(toml=TOML.replace("gantry_tau", "../robots/my.urdf")))
    dataset.write(tmp_path / "deep" / "down")
    assert Dataset.read(tmp_path / "deep" / "down").robot_reference == tmp_path / "robots" / "my.urdf"
