"""Results are moved into place so that a kill at any moment loses neither the old nor the new; one run writes at a time."""

import contextlib
import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from writer import NAMES, write

import gtpin.output.work_folder
from gtpin.errors import GtpinError
from gtpin.output.results import result_file, results_folder

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


def program(code: str, *arguments: object, **more) -> subprocess.Popen:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join((str(ROOT), str(HERE)))}
    # A shell's background job ignores Ctrl-C, and so would what it starts.
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.Popen(command, env=environment, preexec_fn=_heeding_signals, **more)


def _heeding_signals() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def texts(folder: Path) -> dict[str, str]:
    """The results in a folder, with their texts."""
    names = ("a.txt", "b/d.txt", "c.txt")
    return {name: (folder / name).read_text() for name in names if (folder / name).exists()}


def hidden(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.name.startswith(".") and path.name != ".gtpin.json")


KILLED = """
import os
import sys
from writer import write

count = int(sys.argv[2])
real = os.replace

def replace(start, end):
    global count
    if count == 0:
        os._exit(9)  # nothing of Python's runs after this, as after a kill
    count -= 1
    real(start, end)

os.replace = replace
write(sys.argv[1], "new")
"""


@pytest.mark.slow
def test_a_kill_at_any_step_of_the_move_loses_nothing_and_the_next_run_mends_it(tmp_path):
    for step in range(100):
        folder = tmp_path / str(step)
        write(folder, "old")
        code = program(KILLED, folder, step).wait(60)
        for name in ("a.txt", "d.txt", "c.txt"):
            assert {path.read_text() for path in folder.rglob(name)} & {"old", "new"}, (step, name)
        if code == 0:
            break
        assert hidden(folder) == [".gtpin-work", ".gtpin-work-placing"]
        with result_file(folder / "other.txt") as new:  # the next run, whatever it writes
            new.write_text("other")
        assert set(texts(folder).values()) in ({"old"}, {"new"}), step
        assert len(texts(folder)) == 3
        write(folder, "newer")
        assert set(texts(folder).values()) == {"newer"}
        assert (folder / "other.txt").read_text() == "other"
        assert hidden(folder) == []
    assert step > 6  # two for each result, one for the start
    assert texts(folder) == dict.fromkeys(texts(folder), "new")


def outcome(folder: Path) -> str | None:
    """What went wrong with new results, or nothing."""
    try:
        write(folder, "new", force=True)
    except GtpinError as error:
        return str(error)
    return None


def test_a_move_that_fails_at_any_step_is_taken_back(tmp_path, monkeypatch):
    real, left = os.replace, [0]

    def replace(start, end):
        left[0] -= 1
        if left[0] == 0:
            raise OSError(errno.EIO, "Input/output error")
        real(start, end)

    for step in range(1, 100):
        folder = tmp_path / str(step)
        write(folder, "old")
        (folder / "c.txt").write_text("mine")
        left[0] = step
        with monkeypatch.context() as patch:
            patch.setattr(gtpin.output.work_folder.os, "replace", replace)
            said = outcome(folder)
        if said is None:
            break
        assert "Input/output error" in said
        assert texts(folder) == {"a.txt": "old", "b/d.txt": "old", "c.txt": "mine"}
        assert sorted(os.listdir(folder)) == [".gtpin.json", "a.txt", "b", "c.txt"]
    assert step > 6
    assert (folder / "c.txt.old-1").read_text() == "mine"


def test_what_a_user_puts_in_the_way_after_a_kill_stays(tmp_path):
    folder = tmp_path / "out"
    write(folder, "old")
    program(KILLED, folder, 3).wait(60)
    (folder / "c.txt").write_text("mine")
    with pytest.raises(GtpinError, match=r"c\.txt: gtpin has not written this"):
        write(folder, "newer")
    assert (folder / "c.txt").read_text() == "mine"


HOLDING = """
import sys
import time
from pathlib import Path
from gtpin.output.results import results_folder

with results_folder(Path(sys.argv[1]), ("a.txt",)) as new:
    (new / "a.txt").write_text("half")
    print("holding", flush=True)
    time.sleep(600)
"""


@contextlib.contextmanager
def holding(folder: Path):
    """Another process that writes to a folder."""
    other = program(HOLDING, folder, stdout=subprocess.PIPE, text=True)
    try:
        assert other.stdout.readline() == "holding\n"
        yield other
    finally:
        other.kill()
        other.wait()
        other.stdout.close()


def test_of_two_runs_into_a_folder_one_stops_and_a_killed_one_is_cleared(tmp_path):
    with holding(tmp_path / "out") as other:
        with pytest.raises(GtpinError, match="another run of gtpin is writing here"):
            write(tmp_path / "out", "second")
        with result_file(tmp_path / "out" / "other.txt") as new:  # something else in the folder can be written
            new.write_text("other")
        assert (tmp_path / "out" / ".gtpin-work" / "new" / "a.txt").read_text() == "half"
        other.kill()
        other.wait()
        assert hidden(tmp_path / "out") == [".gtpin-work"]
        write(tmp_path / "out", "second")
    assert set(texts(tmp_path / "out").values()) == {"second"}
    assert hidden(tmp_path / "out") == []
    assert json.loads((tmp_path / "out" / ".gtpin.json").read_text())["entries"].keys() == {*NAMES, "other.txt"}


def test_a_run_that_is_stopped_leaves_nothing(tmp_path):
    with holding(tmp_path / "deep" / "out") as other:
        other.send_signal(signal.SIGINT)
        assert other.wait(30) != 0
    assert list(tmp_path.iterdir()) == []


def test_what_only_looks_like_a_work_folder_stays(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "mine").write_text("mine")
    names = [".gtpin-work-0123abcd", ".gtpin-work-notes", ".gtpin-work.txt", ".gtpin-works"]
    for name in names:
        (tmp_path / name).mkdir()
        (tmp_path / name / "mine").write_text("mine")
    write(tmp_path, "new")
    assert hidden(tmp_path) == names
    assert [os.listdir(tmp_path / name) for name in names] == [["mine"]] * 4
    (tmp_path / ".gtpin-work").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(GtpinError, match="in the way"):
        write(tmp_path, "new")
    (tmp_path / ".gtpin-work").unlink()
    (tmp_path / ".gtpin-work").mkdir()
    (tmp_path / ".gtpin-work" / "mine").write_text("mine")
    with pytest.raises(GtpinError, match="in the way"):
        write(tmp_path, "new")
    assert os.listdir(tmp_path / ".gtpin-work") == ["mine"]
    assert [path.name for path in (tmp_path / "elsewhere").iterdir()] == ["mine"]


MANY = """
import sys
from pathlib import Path
from gtpin.output.results import result_file

for k in range(20):
    with result_file(Path(sys.argv[1]) / f"{sys.argv[2]}-{k}.txt") as new:
        new.write_text(sys.argv[2])
"""


@pytest.mark.slow
def test_single_files_can_be_written_into_one_folder_at_once(tmp_path):
    others = [program(MANY, tmp_path, name) for name in "xyz"]
    assert [other.wait(60) for other in others] == [0, 0, 0]
    expected = {f"{name}-{k}.txt" for name in "xyz" for k in range(20)}
    assert {path.name for path in tmp_path.iterdir()} == expected | {".gtpin.json"}
    assert json.loads((tmp_path / ".gtpin.json").read_text())["entries"].keys() == expected


def test_results_that_are_no_longer_made_go_with_the_old_ones(tmp_path):
    write(tmp_path, "old")
    with results_folder(tmp_path, NAMES) as new:
        (new / "a.txt").write_text("new")
    assert texts(tmp_path) == {"a.txt": "new"}


def test_a_lock_that_another_user_holds_is_a_line_and_not_a_wait_without_end(tmp_path, monkeypatch):
    monkeypatch.setattr(
        "gtpin.output.work_folder.os.open", lambda *_: (_ for _ in ()).throw(PermissionError(13, "denied"))
    )
    (tmp_path / ".gtpin-work").mkdir()
    with pytest.raises(GtpinError, match="another run of gtpin"):
        write(tmp_path, "new")
