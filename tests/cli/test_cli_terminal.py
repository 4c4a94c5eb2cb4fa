"""What people see: help, versions, silence where nobody looks."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import typer

import gtpin
import gtpin.cli
from gtpin.commands.registry import OWN, LazyCommand

COMMANDS = ("calibrate", "diagnose", "predict", "simulate", "demo")


@pytest.mark.parametrize("command", [[], *([name] for name in COMMANDS)], ids=" ".join)
def test_help_shows_an_example(run, command):
    ran = run(*command, "--help")
    assert (ran.code, ran.err) == (0, "")
    assert "Example" in ran.out
    assert all(f"gtpin {name}" in ran.out or (not command and name in ran.out) for name in command or COMMANDS)


def leaves(group, *before):
    """All commands of a group and of the groups in it, by their words."""
    for name, listed in group.commands.items():
        command = listed.imported() if isinstance(listed, LazyCommand) else listed
        if hasattr(command, "commands"):
            yield from leaves(command, *before, name)
        else:
            yield (*before, name), command


ALL = dict(leaves(typer.main.get_command(gtpin.cli.app)))
BOUND = ("demo", "simulate", "calibrate", "compare", "sensitivity", "diagnose", "predict", "export", "blind", "view")
"""Commands that scripts of users call."""


@pytest.mark.parametrize("words", [(), ("lab",)], ids=" ".join)
def test_the_help_of_a_group_says_what_the_help_of_each_command_says(words):
    group = typer.main.get_command(gtpin.cli.app)
    for word in words:
        group = group.commands[word]
    listed = [command for command in group.commands.values() if isinstance(command, LazyCommand)]
    assert len(listed) >= 4
    for command in listed:
        assert command.imported().help.splitlines()[0] == command.help


def test_few_commands_are_listed_and_those_of_scripts_are_all_there(run):
    table = run("--help").out.split("Commands")[1].split("Example")[0]
    listed = {line.split()[1] for line in table.splitlines() if line[2:3].isalpha()}
    assert len(listed) <= 11
    assert listed >= {"demo", "diagnose", "calibrate", "export", "lab"}
    assert {words[0] for words in ALL} >= {*BOUND, *listed}
    for words, command in ALL.items():
        if words[0] == "lab":
            assert [p.opts for p in command.params] == [p.opts for p in ALL[words[1:]].params]


@pytest.mark.parametrize("words", ALL, ids=" ".join)
def test_a_first_help_has_at_most_ten_options_and_help_all_has_every_one(run, words):
    named = re.compile(r"^. [ *]*(--[\w-]{1,15})", re.MULTILINE)  # long names are broken
    first, whole = ({*named.findall(run(*words, option).out)} for option in ("--help", "--help-all"))
    assert len(first) <= 10
    own = {param.opts[-1][:17] for param in ALL[words].params if param.opts[-1].startswith("--")}
    assert whole == own | {"--help"}
    assert first <= whole


def test_without_a_command_help_is_shown_and_without_its_arguments_what_is_missing(run):
    ran = run()
    assert (ran.code, ran.err) == (2, "")
    assert ran.out.rstrip() == run("--help").out.rstrip()
    assert "Missing argument 'model'" in run("export").failed()


STARTS = (["-c", "import gtpin.cli; gtpin.cli.main()"], ["-m", "gtpin"])


def started(*arguments: object, start: int = 0, **more) -> subprocess.Popen:
    """A program of its own, whose standard error is read."""
    path = os.pathsep.join([*more.pop("paths", []), str(Path(gtpin.__file__).parents[1])])
    environment = {**os.environ, "PYTHONPATH": path, **more.pop("environment", {})}
    command = [sys.executable, *STARTS[start], *map(str, arguments)]
    # A shell's background job ignores Ctrl-C, and so would what it starts.
    more = {"stderr": subprocess.PIPE, **more}
    return subprocess.Popen(command, env=environment, preexec_fn=_heeding_signals, **more)


def _heeding_signals() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)


LONG = ("numpy", "scipy", "pinocchio", "pandas", "pydantic", "jinja2", "matplotlib", "plotly")
"""Libraries whose import takes longer than the help."""


def loaded(code: str) -> set[str]:
    """The modules that a program of its own has loaded at its end."""
    environment = {**os.environ, "PYTHONPATH": str(Path(gtpin.__file__).parents[1])}
    code = f"import sys\ntry:\n    {code}\nfinally:\n    print('loaded', *sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    return set(done.stdout.splitlines()[-1].split())


@pytest.mark.slow
@pytest.mark.parametrize("words", [["--help"], ["--version"], ["lab"], ["unknown"]], ids=" ".join)
def test_help_and_version_import_no_command_and_nothing_that_takes_long(words):
    modules = loaded(f"sys.argv = ['gtpin', *{words}]; from gtpin.cli import main; main()")
    assert "gtpin.commands.registry" in modules
    assert not modules.intersection(
        {*LONG, "gtpin.commands.terminal", "gtpin.commands.diagnose", "gtpin.bench.simulator"}
    )


@pytest.mark.slow
@pytest.mark.parametrize("entry", OWN, ids=lambda entry: entry.name)
def test_a_command_imports_only_what_it_needs(entry):
    """The report's templates, tables and plots are loaded when they are made, and nothing of extras or bench is."""
    modules = loaded(f"import {entry.function.partition(':')[0]}")
    assert entry.function.partition(":")[0] in modules
    unneeded = {"pandas", "pyarrow", "scipy.stats", "scipy.optimize", "jinja2", "matplotlib", "plotly", "joblib"}
    assert not modules & {*unneeded, "gtpin.extras", "gtpin.bench"}


@pytest.mark.slow
def test_the_version_is_told_by_the_program_and_by_the_package(run):
    as_package = started("--version", start=1, stdout=subprocess.PIPE).communicate(timeout=600)[0].decode()
    for out in (run("--version").out, as_package):
        assert out.strip() == f"gtpin {gtpin.__version__}"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_no_color_is_respected_on_a_terminal(source, tmp_path, monkeypatch):
    import pty

    shown = {}
    for name, value in (("plain", "1"), ("coloured", None)):
        for variable in ("NO_COLOR", "FORCE_COLOR", "CI", "GITHUB_ACTIONS"):
            monkeypatch.delenv(variable, raising=False)
        environment = {"TERM": "xterm-256color", **({} if value is None else {"NO_COLOR": value})}
        leader, follower = pty.openpty()
        silent = {"stdout": subprocess.DEVNULL, "stderr": follower}
        process = started("calibrate", source, "-o", tmp_path / name, environment=environment, **silent)
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


@pytest.mark.slow
@pytest.mark.parametrize("words", ["calibrate SET -o OUT --json", "--help", "--version", "robots --json"])
def test_a_reader_that_closes_the_pipe_is_no_fault(source, tmp_path, words):
    words = words.replace("SET", str(source)).replace("OUT", str(tmp_path / "out")).split()
    process = started(*words, stdout=subprocess.PIPE)
    process.stdout.close()
    said = process.stderr.read().decode()
    process.stderr.close()
    assert (process.wait(60), said) == (141, "")  # 128 + SIGPIPE
    assert (tmp_path / "out" / "calibration.json").is_file() == (words[0] == "calibrate")


def test_a_still_image_is_told_as_json(run, tmp_path):
    target = tmp_path / "still.svg"
    ran = run("view", "gantry_tau", "-o", target, "--json")
    assert ran.code == 0
    assert json.loads(ran.out) == {"written": str(target)}
    assert target.stat().st_size > 0


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes can't be listed")
def test_a_program_that_is_told_to_end_leaves_no_processes(tmp_path):
    unread = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True}
    program = started("blind", "--cases", "10", "-o", tmp_path / "check", start=1, **unread)
    try:
        for _ in range(600):
            if list((tmp_path / "check").glob("sealed/*")) or program.poll() is not None:
                break
            time.sleep(0.1)
        program.send_signal(signal.SIGTERM)
        assert program.wait(timeout=60) != 0
        for _ in range(300):
            if not _members(program.pid):
                break
            time.sleep(0.1)
        assert _members(program.pid) == []
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(program.pid, signal.SIGKILL)


def _members(group: int) -> list[int]:
    """Processes of a group that have not ended."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = status.read_text().rpartition(")")[2].split()
            if int(fields[2]) == group and fields[0] != "Z":
                found.append(int(status.parent.name))
    return found


# ------------------------------------------------------------------------------ outputs that do not take what is said


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("arguments", [["predict"], ["--help"]], ids=" ".join)
def test_a_full_standard_output_is_one_line_and_results_are_written(source, tmp_path, arguments):
    command, *options = arguments
    written = [] if command == "--help" else ["gantry_tau", source / "commands.csv", "-o", tmp_path / "p.csv"]
    with open("/dev/full", "w") as full:
        process = started(command, *written, *options, stdout=full)
    said = process.communicate(timeout=600)[1].decode()
    assert process.returncode == 2
    assert len(said.splitlines()) == 1
    assert "No space left on device" in said
    assert not written or (tmp_path / "p.csv").stat().st_size > 0


@pytest.mark.slow
def test_a_terminal_of_few_letters_is_told_everything_it_can_show(tmp_path):
    folder = tmp_path / "Μessung µ"  # the first letter is Greek
    environment = {"PYTHONIOENCODING": "latin-1", "LC_ALL": "C"}
    process = started("simulate", "-o", folder, "--poses", "10", environment=environment, stdout=subprocess.PIPE)
    out, err = process.communicate(timeout=600)
    assert (process.returncode, err) == (0, b"")
    assert "\\u039cessung µ" in out.decode("latin-1")
    assert (folder / "poses.csv").is_file()


LONG = "x" * 300


@pytest.mark.parametrize(
    "arguments",
    [
        ["calibrate", LONG, "-o", "o"],
        ["diagnose", "SET", "-o", LONG],
        ["predict", LONG, "SET/commands.csv", "-o", "p.csv"],
        ["predict", "gantry_tau", f"{LONG}.csv", "-o", "p.csv"],
        ["predict", "gantry_tau", "SET/commands.csv", "-o", f"{LONG}.csv"],
        ["export", LONG, "-o", "r.xml"],
        ["export", "gantry_tau", "-o", f"{LONG}.xml"],
        ["simulate", "-o", LONG],
        ["simulate", "-o", "s", "--scenario", LONG],
        ["simulate", "-o", "s", "--robot", f"{LONG}.urdf"],
        ["sensitivity", "gantry_tau", "--poses", LONG, "-o", "o"],
        ["compare", LONG, "-o", "o"],
        ["demo", "-o", LONG],
        ["blind", "-o", LONG, "--cases", "1"],
        ["blind", "-o", "b", "--from", LONG],
        ["view", "gantry_tau", LONG, "-o", "v.png"],
    ],
    ids=lambda arguments: " ".join(arguments).replace(LONG, "LONG"),
)
def test_a_name_that_is_too_long_is_one_line_that_names_it(run, source, tmp_path, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    assert LONG in run(*(word.replace("SET", str(source)) for word in arguments)).failed()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(("start", "number"), [(0, signal.SIGINT), (1, signal.SIGTERM), (1, signal.SIGHUP)])
@pytest.mark.parametrize("module", ["typer", "pydantic", "jinja2"])  # jinja2 is imported amid the work, for the report
def test_an_interruption_of_an_import_is_one_line_and_leaves_nothing(source, tmp_path, start, number, module):
    code = f"import os, time\nos.kill(os.getpid(), {int(number)})\ntime.sleep(600)\n"
    (tmp_path / f"{module}.py").write_text(code)  # stands in for one of the many that are imported
    process = started("calibrate", source, "-o", tmp_path / "out", start=start, paths=[str(tmp_path)])
    said = process.communicate(timeout=600)[1].decode()
    assert (process.returncode, said) == (130, "gtpin: error: interrupted\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"{module}.py"]


def test_what_answers_to_an_interruption_is_there_before_anything_heavy():
    code = (
        "import sys, gtpin.cli; print(sorted({'numpy', 'pandas', 'pinocchio', 'typer', 'pydantic'} & set(sys.modules)))"
    )
    environment = {**os.environ, "PYTHONPATH": str(Path(gtpin.__file__).parents[1])}
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert ran.stdout == "[]\n"
