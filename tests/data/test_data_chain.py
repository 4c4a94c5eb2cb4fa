"""The keys of dataset.toml for robots of any kind: tcp, actuators, target, drivers."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from small_dataset import HEADER, LINES, TOML

from gtpin.data import Dataset, Driver, InstrumentSection
from gtpin.errors import DatasetError

Make = Callable[..., Path]

TILTED = "\n".join([f"{HEADER},tilt_x", *(f"{line},{0.001 * i}" for i, line in enumerate(LINES))])
CHAIN = f"""tcp = "tcp"
actuators = ["track2", "track1", "track3"]
{TOML}target = "free"
[[driver]]
column = "tilt_x"
site = "cart1"
motion = "rx"
size = 1e-3
[[driver]]
column = "payload"
site = "cart1"
motion = "q"
size = 1
"""


def test_they_are_read_as_frozen_values_and_written_again(make: Make, tmp_path: Path) -> None:
    dataset = Dataset.read(make(TILTED, CHAIN))
    assert dataset.tcp == "tcp"
    assert dataset.actuators == ("track2", "track1", "track3")
    assert dataset.instrument.target == "free"
    assert dataset.drivers == (Driver("tilt_x", "cart1", "rx", 1e-3), Driver("payload", "cart1", "q", 1.0))
    dataset.write(tmp_path / "again")
    again = Dataset.read(tmp_path / "again")
    for name in ("tcp", "actuators", "instrument", "drivers"):
        assert getattr(again, name) == getattr(dataset, name)
    dataset.write(tmp_path / "third")
    assert (tmp_path / "third" / "dataset.toml").read_bytes() == (tmp_path / "again" / "dataset.toml").read_bytes()


def test_without_them_nothing_is_written_of_them(make: Make, tmp_path: Path) -> None:
    dataset = Dataset.read(make())
    assert (dataset.tcp, dataset.actuators, dataset.drivers, dataset.instrument.target) == (None, (), (), "tcp")
    dataset.write(tmp_path / "again")
    text = (tmp_path / "again" / "dataset.toml").read_text(encoding="utf-8")
    assert not any(word in text for word in ("tcp", "actuators", "driver", "target"))


SPOILT = {
    "a tcp of nothing": ('tcp = "tcp"', 'tcp = ""', "tcp"),
    "a tcp that is a number": ('tcp = "tcp"', "tcp = 3", "tcp"),
    "one actuator as text": ('["track2", "track1", "track3"]', '"track2"', "actuators"),
    "an actuator that is a number": ('"track1"', "1", "actuators"),
    "fewer actuators than commands": (', "track3"]', "]", "q3"),
    "a target elsewhere": ('target = "free"', 'target = "loose"', "target"),
    "a tcp under the instrument": ('target = "free"', 'tcp = "tcp"', "instrument.tcp"),
    "one driver as a section": ("[[driver]]\ncolumn = \"payload\"", "[[drivers]]\ncolumn = \"payload\"", "drivers"),
    "a driver of no column": ('column = "tilt_x"', 'column = "tilt_y"', "driver.0.column"),
    "a driver of sessions": ('column = "tilt_x"', 'column = "session"', "driver.0.column"),
    "a driver without a column": ('column = "tilt_x"\n', "", "driver.0.column"),
    "a driver without a size": ("size = 1e-3\n", "", "driver.0.size"),
    "a driver of no size": ("size = 1e-3", "size = 0.0", "driver.0.size"),
    "a driver of a size in words": ("size = 1e-3", 'size = "large"', "driver.0.size"),
    "a motion that is none": ('motion = "rx"', 'motion = "yaw"', "driver.0.motion"),
    "a site that is a number": ('site = "cart1"\nmotion = "rx"', 'site = 1\nmotion = "rx"', "driver.0.site"),
    "a key that a driver has not": ("size = 1e-3", "size = 1e-3\nunit = \"m\"", "driver.0.unit"),
    "a driver twice": (
        'column = "payload"\nsite = "cart1"\nmotion = "q"',
        'column = "tilt_x"\nsite = "cart1"\nmotion = "rx"',
        "driver.1",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", SPOILT)
def test_what_they_can_not_be_is_refused_with_the_key_and_what_to_write(what: str, make: Make) -> None:
    old, new, key = SPOILT[what]
    assert old in CHAIN
    with pytest.raises(DatasetError) as caught:
        Dataset.read(make(TILTED, CHAIN.replace(old, new)))
    assert key in str(caught.value.column)
    assert caught.value.hint
    assert "\n" not in str(caught.value)


def test_a_dataset_made_in_python_is_checked_as_a_file_is(make: Make) -> None:
    dataset = Dataset.read(make())
    with pytest.raises(DatasetError, match="size"):
        replace(dataset, drivers=(Driver("payload", "cart1", "q", -1.0),))
    with pytest.raises(DatasetError, match="3 columns of commands for 2 actuators"):
        replace(dataset, actuators=("track1", "track2"))
    assert replace(dataset, instrument=InstrumentSection(target="free")).instrument.target == "free"
