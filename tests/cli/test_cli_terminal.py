"""What people see: help, versions, silence where nobody looks."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import gtpin


@pytest.mark.parametrize("command", ["calibrate", "diagnose", "predict", "simulate", "demo"])
def test_help_shows_an_example(run, command):
    ran = run(command, "--help")
    assert ran.code == 0
    assert f"gtpin {command}" in ran.out
    assert "Example" in ran.out
    assert ran.err == ""


def test_help_lists_the_commands_and_shows_an_example(run):
    ran = run("--help")
    assert ran.code == 0
    assert all(command in ran.out for command in ("calibrate", "predict", "simulate", "demo"))
    assert "Example" in ran.out


def test_without_a_command_help_is_shown(run):
    ran = run()
    assert "calibrate" in ran.out + ran.err
    assert "Traceback" not in ran.err


def test_the_version_is_told(run):
    ran = run("--version")
    assert ran.code == 0
    assert ran.out.strip() == f"gtpin {gtpin.__version__}"


def test_piped_output_has_neither_colour_nor_progress(program, source, tmp_path):
    ran = program("calibrate", source, "-o", tmp_path / "out")
    assert ran.code == 0
    assert ran.err == ""
    assert "\x1b" not in ran.out
    assert "\r" not in ran.out


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_no_color_is_respected_on_a_terminal(source, tmp_path):
    import pty

    shown = {}
    for name, value in (("plain", "1"), ("coloured", None)):
        environment = {
            k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR", "CI", "GITHUB_ACTIONS")
        }
        environment |= {"TERM": "xterm-256color", "PYTHONPATH": str(Path(gtpin.__file__).parents[1])}
        environment |= {} if value is None else {"NO_COLOR": value}
        leader, follower = pty.openpty()
        code = "import gtpin.cli; gtpin.cli.main()"
        process = subprocess.Popen(
            [sys.executable, "-c", code, "calibrate", str(source), "-o", str(tmp_path / name)],
            stdout=subprocess.DEVNULL,
            stderr=follower,
            env=environment,
        )
        os.close(follower)
        said = b""
        while True:
            try:
                chunk = os.read(leader, 4096)
            except OSError:  # the other end is closed
                break
            if not chunk:
                break
            said += chunk
        os.close(leader)
        assert process.wait(60) == 0
        shown[name] = said.decode()
    # Progress may move the cursor, but its colours (SGR 3x) go where NO_COLOR is set.
    assert "\x1b[3" in shown["coloured"]
    assert "calibrating" in shown["plain"]
    assert "\x1b[3" not in shown["plain"].replace("\x1b[39", "")


def test_a_reader_that_closes_the_pipe_is_no_fault(source, tmp_path):
    code = "import gtpin.cli; gtpin.cli.main()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, "calibrate", str(source), "-o", str(tmp_path / "out"), "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(Path(gtpin.__file__).parents[1])},
    )
    process.stdout.close()
    said = process.stderr.read().decode()
    process.stderr.close()
    process.wait(60)
    assert "Traceback" not in said
    assert "gtpin: error" not in said
    assert (tmp_path / "out" / "calibration.json").is_file()
