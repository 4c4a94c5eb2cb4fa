"""Commands without root's power, in a home folder, onto a mount, on a full disk, and where nothing may be written."""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from ran import Ran, everything

ROOT = Path(__file__).parents[2]
NOBODY = 65534
pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform != "linux", reason="needs Linux's users and mounts")]
User = Callable[..., Ran]


def _start(power: str) -> list[str]:
    """How another user's process is started: with no power but, where needed, that of reading everything."""
    sets = [f"--{name}={power}" for name in ("bounding-set", "inh-caps", "ambient-caps")]
    return ["setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups", *sets]


@pytest.fixture(scope="module")
def user() -> User:
    """Run gtpin as an ordinary user; as nobody, where this process is root's.

    The interpreter may lie where only root may look. Then the process keeps the right to read everything, and no other.
    """
    start: list[str] = []
    if os.geteuid() == 0:
        if shutil.which("setpriv") is None:
            pytest.skip("root's power can't be dropped: there is no setpriv")
        probe = [sys.executable, "-c", "from gtpin.cli import app"]
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        for power in ("-all", "-all,+dac_read_search"):
            start = _start(power)
            if subprocess.run([*start, *probe], env=environment, capture_output=True, check=False).returncode == 0:
                break
        else:
            pytest.skip("another user can't run this interpreter")

    def run(*commands: list[str], cwd: Path) -> list[Ran]:
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "HOME": str(cwd), "MPLCONFIGDIR": str(cwd / ".mpl")}
        command = [*start, sys.executable, "-c", SEVERAL, json.dumps(commands)]
        done = subprocess.run(
            command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=600, check=False
        )
        assert done.returncode == 0, done.stderr
        return [Ran(*told) for told in json.loads(done.stdout)]

    return run


SEVERAL = """
import contextlib, io, json, sys, warnings
import gtpin.cli

ran = []
for arguments in json.loads(sys.argv[1]):
    sys.argv = ["gtpin", *arguments]
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
        try:
            gtpin.cli.main()
        except SystemExit as ended:
            ran.append((ended.code or 0, out.getvalue(), err.getvalue()))
print(json.dumps(ran))
"""
"""One command after the other in one process: imports take longer than the commands."""


@pytest.fixture
def home(source: Path) -> Iterator[Path]:
    """A home folder of that user's, with commands to predict, whose parent is not the user's."""
    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent) / "home"
        shutil.copytree(source, folder / "set")
        shutil.copy(source / "commands.csv", folder / "c.csv")
        (folder / ".mpl").mkdir()
        if os.geteuid() == 0:
            for path in (folder, *folder.rglob("*")):
                os.chown(path, NOBODY, NOBODY)
        Path(parent).chmod(0o555)
        yield folder
        Path(parent).chmod(0o755)


CHEAP = {
    "p.csv": ["predict", "gantry_tau", "c.csv", "-o", "p.csv"],
    "robot.xml": ["export", "gantry_tau", "-o", "robot.xml"],
    "machine/poses.csv": ["simulate", "-o", "machine", "--poses", "12"],
    "poses.csv": ["simulate", "-o", ".", "--poses", "12"],
    "set/calibration.json": ["calibrate", "set", "-o", "set"],
}


def test_an_ordinary_user_can_write_into_the_home_folder(user, home):
    commands = dict(CHEAP)
    if importlib.util.find_spec("matplotlib"):
        commands["v.png"] = ["view", "gantry_tau", "-o", "v.png"]
    for ran, written in zip(user(*commands.values(), cwd=home), commands, strict=True):
        assert (ran.code, ran.err) == (0, ""), written
        assert (home / written).stat().st_size > 0
        assert (home / written).stat().st_uid == (NOBODY if os.geteuid() == 0 else os.geteuid())


LOCKED = [
    ["predict", "gantry_tau", "c.csv", "-o", "locked/p.csv"],
    ["predict", "gantry_tau", "c.csv", "-o", "locked/deep/p.csv"],
    ["predict", "gantry_tau", "c.csv", "-o", "/p.csv"],
    ["export", "gantry_tau", "-o", "locked/robot.urdf"],
    ["simulate", "-o", "locked"],
    ["simulate", "-o", "locked/new"],
    ["calibrate", "set", "-o", "locked"],
    ["diagnose", "set", "-o", "locked"],
    ["compare", "set", "-o", "locked"],
    ["sensitivity", "gantry_tau", "-o", "locked/new"],
    ["demo", "-o", "locked"],
    ["blind", "-o", "locked", "--cases", "2"],
]


def test_a_folder_that_may_not_be_written_is_one_line_and_stays(user, home):
    locked = home / "locked"
    locked.mkdir()
    (locked / "mine").write_text("mine")
    locked.chmod(0o555)
    before = everything(home)
    for command, ran in zip(LOCKED, user(*LOCKED, cwd=home), strict=True):
        assert "can't be written (Permission denied)" in ran.failed(), command
    assert everything(home) == before
    locked.chmod(0o755)


READ_ONLY = {
    "out/model": ["calibrate", "set", "-o", "out"],
    "locked": ["simulate", "-o", "locked/new/deep"],
    "set": ["predict", "gantry_tau", "c.csv", "-o", "set/new/p.csv"],
}


def test_the_folder_that_is_read_only_is_named_not_the_one_around_it(user, home):
    made, other = user(READ_ONLY["out/model"], ["simulate", "-o", "locked", "--poses", "12"], cwd=home)
    assert (made.code, other.code) == (0, 0)
    for folder in READ_ONLY:
        (home / folder).chmod(0o555)
    before = everything(home)
    for folder, ran in zip(READ_ONLY, user(*READ_ONLY.values(), cwd=home), strict=True):
        assert f"the folder {folder} is read-only" in ran.failed()
    assert everything(home) == before
    for folder in READ_ONLY:
        (home / folder).chmod(0o755)


@pytest.fixture
def mount(home: Path) -> Iterator[Callable[[str], Path]]:
    """Mount a small file system of its own in the home folder."""
    place = home / "stick"
    place.mkdir()
    made = []

    def mounted(options: str) -> Path:
        owned = f"{options},uid={NOBODY},gid={NOBODY},mode=755"
        command = ["mount", "-t", "tmpfs", "-o", owned, "tmpfs", str(place)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            pytest.skip(f"nothing can be mounted here: {done.stderr.strip()}")
        made.append(place)
        return place

    if os.geteuid() != 0 or shutil.which("mount") is None:
        pytest.skip("only root can mount")
    yield mounted
    for place in made:
        subprocess.run(["umount", str(place)], check=True)


def test_an_output_folder_can_be_a_mount_of_its_own(user, home, mount):
    place = mount("size=16m")
    commands = [
        ["simulate", "-o", "stick", "--poses", "12"],
        ["predict", "gantry_tau", "c.csv", "-o", "stick/p.csv"],
        ["calibrate", "set", "-o", "stick"],
    ]
    for ran in user(*commands, *commands, cwd=home):
        assert (ran.code, ran.err) == (0, "")
    for written in ("poses.csv", "p.csv", "model/model.json"):
        assert (place / written).stat().st_size > 0
    assert [path.name for path in place.iterdir() if path.name.startswith(".")] == [".gtpin.json"]


@pytest.mark.parametrize("size", ["4k", "32k"])
def test_a_full_disk_is_one_line_and_nothing_is_left_on_it(user, home, mount, size):
    place = mount(f"size={size}")
    rows = "".join(f"{k},{0.001 * k},0,0\n" for k in range(300))
    (home / "many.csv").write_text(f"pose,q1,q2,q3\n{rows}")
    commands = [
        ["simulate", "-o", "stick", "--poses", "400"],
        ["predict", "gantry_tau", "many.csv", "-o", "stick/p.csv"],
        ["calibrate", "set", "-o", "stick"],
    ]
    for ran in user(*commands, cwd=home):
        assert "No space left on device" in ran.failed()
    assert list(place.iterdir()) == []


def test_what_was_there_stays_where_the_disk_fills(user, home, mount):
    place = mount("size=64k")
    (made,) = user(["simulate", "-o", "stick", "--poses", "12"], cwd=home)
    assert made.code == 0
    before = everything(place)
    (full,) = user(["simulate", "-o", "stick", "--poses", "400"], cwd=home)
    assert "No space" in full.failed()
    assert everything(place) == before
    subprocess.run(["mount", "-o", "remount,ro", str(place)], check=True)
    for ran in user(["simulate", "-o", "stick"], ["export", "gantry_tau", "-o", "stick/r.xml"], cwd=home):
        assert "Read-only file system" in ran.failed()
    assert everything(place) == before
