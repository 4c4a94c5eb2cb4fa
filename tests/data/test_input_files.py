"""Whatever file an input names: a pipe or a device is refused at once, and so is a file of absurd size."""

import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import gtpin
from gtpin.bench.simulator.case import read_scenario
from gtpin.data.files import LARGEST_TEXT
from gtpin.errors import GtpinError
from gtpin.extras.history.history import HistoryFiles, read_history
from gtpin.extras.importers.klipper_config import read_config
from gtpin.extras.importers.lines import text_lines

if sys.platform == "win32":
    pytest.skip("needs pipes with names", allow_module_level=True)


def including(file: Path) -> object:
    scene = file.with_name("scene.xml")
    scene.write_text(f'<mujoco><include file="{file.name}"/></mujoco>', encoding="utf-8")
    return gtpin.load_robot(scene)


def configured(file: Path) -> object:
    config = file.with_name("printer.cfg")
    config.write_text(f"[include {file.name}]\n", encoding="utf-8")
    return read_config(config)


READERS: dict[str, Callable[[Path], object]] = {
    "robot.urdf": gtpin.load_robot,
    "arm.xml": including,
    "model.json": lambda file: gtpin.read_model(file.parent),
    "dataset.toml": lambda file: gtpin.Dataset.read(file.parent),
    "poses.csv": lambda file: gtpin.Dataset.read(file.parent),
    "commands.csv": gtpin.Commands.read,
    "scenario.toml": read_scenario,
    "export.txt": text_lines,
    "part.cfg": configured,
    "history.jsonl": lambda file: read_history(HistoryFiles(file.parent, file.name, "history.html")),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder whose description is sound."""
    (tmp_path / "dataset.toml").write_text(
        'schema = "gtpin-dataset/1"\nrobot = "gantry_tau"\n[instrument]\nframe = "robot"\n', encoding="utf-8"
    )
    return tmp_path


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_what_is_no_regular_file_is_refused_without_waiting(folder: Path, name: str, kind: str) -> None:
    (folder / name).unlink(missing_ok=True)
    if kind == "pipe":
        os.mkfifo(folder / name)
    else:
        (folder / name).symlink_to("/dev/zero")
    with pytest.raises(GtpinError, match="a pipe or a device") as caught:
        READERS[name](folder / name)
    assert name in str(caught.value)


@pytest.mark.parametrize("name", ["robot.urdf", "arm.xml", "model.json", "dataset.toml", "scenario.toml", "export.txt"])
def test_a_text_of_absurd_size_is_refused_unread(folder: Path, name: str) -> None:
    with (folder / name).open("wb") as file:
        file.truncate(int(LARGEST_TEXT) + 1)  # a sparse file: it takes no room on the disk
    with pytest.raises(GtpinError, match="larger than 100 MB"):
        READERS[name](folder / name)


def test_a_link_to_a_file_is_that_file(folder: Path) -> None:
    urdf = folder / "gantry.urdf"
    shutil.copy(gtpin.robot.library.urdf_path("gantry_tau"), urdf)
    (folder / "link.urdf").symlink_to(urdf)
    assert gtpin.load_robot(folder / "link.urdf").n_actuators == 3
