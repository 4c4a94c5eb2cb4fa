"""Running a command of gtpin on damaged files, in a forked child, and what is wrong with how it ended."""

from __future__ import annotations

import json
import os
import resource
import shlex
import signal
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import gtpin.cli
from gtpin.output.ownership import MARKER

MEMORY = 4 * 2**30
"""Bytes of memory that a command on these small files may map."""

LONGEST = 3000
"""Letters of an error that people read."""


@dataclass(frozen=True)
class Run:
    """How a command ended: exit code (negative: the signal that ended it), standard output and error, CPU seconds."""

    code: int
    out: str
    err: str
    seconds: float

    @property
    def last(self) -> str:
        """The last line of standard error."""
        return self.err.strip().rpartition("\n")[2]


def contents(folder: Path) -> dict[str, bytes | None]:
    """All files under a folder with their bytes, and all folders with None."""
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else None for p in sorted(folder.rglob("*"))}


def run(line: str, folder: Path, limit: int) -> Run:
    """Run a command line of gtpin's in a folder, in a child of this process, for so many CPU seconds at most."""
    out, err = folder.parent / "stdout", folder.parent / "stderr"
    child = os.fork()
    if child == 0:
        _become(line, folder, out, err, limit)
    status, usage = _wait(child, 20.0 * limit)
    code = os.waitstatus_to_exitcode(status)
    texts = (file.read_text(encoding="utf-8", errors="replace") if file.exists() else "" for file in (out, err))
    return Run(code, *texts, usage)


def _wait(child: int, patience: float) -> tuple[int, float]:
    """Status and CPU seconds of a child that is ended after so many seconds by the clock."""
    end = time.monotonic() + patience
    while True:
        pid, status, usage = os.wait4(child, os.WNOHANG)
        if pid:
            return status, usage.ru_utime + usage.ru_stime
        if time.monotonic() > end:
            os.kill(child, signal.SIGKILL)
        time.sleep(0.005)


def _become(line: str, folder: Path, out: Path, err: Path, limit: int) -> None:
    """Be the command, and end with its exit code."""
    code = 70  # of a fault of the fuzzer's own
    try:
        for number, file in ((1, out), (2, err)):
            os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), number)
        sys.stdout, sys.stderr = (open(number, "w", encoding="utf-8", closefd=False) for number in (1, 2))  # noqa: SIM115
        os.chdir(folder)
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        sys.argv = ["gtpin", *shlex.split(line)]
        try:
            gtpin.cli.main()
            code = 0
        except SystemExit as ended:
            code = int(ended.code or 0)
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)


def faults(ran: Run, before: dict[str, bytes | None], after: dict[str, bytes | None]) -> list[str]:
    """What is wrong with a run: an exit code or an output that it must not have, files lost, changed or left."""
    found = []
    if ran.code not in (0, 1, 2):
        signals = {-signal.SIGXCPU: "hung", -signal.SIGKILL: "hung or was killed"}
        found.append(signals.get(ran.code, f"exit code {ran.code}: {ran.last[:300]}"))
    if "Traceback" in ran.err + ran.out:
        found.append("traceback")
    lines = ran.err.splitlines()
    if ran.code in (1, 2) and (len(lines) != 1 or not lines[0].startswith("gtpin: error: ") or ran.out):
        found.append(f"not one line of error: {len(lines)} lines, {ran.err[:200]!r}")
    if ran.code == 0 and not all(text.startswith("gtpin: warning: ") for text in lines):
        found.append(f"not a warning: {ran.err[:200]!r}")
    if ran.code != 0 and len(ran.last) > LONGEST:
        found.append("an error of more than a page")
    own = {MARKER} if ran.code == 0 else set()  # what is written is entered there
    changed = [name for name, content in before.items() if name not in own and after.get(name, b"lost") != content]
    found += [f"changed {name}" for name in changed]
    new = [name for name in after if name not in before]
    if ran.code != 0 and new:
        found.append(f"left {', '.join(new[:5])}")
    found += [f"not finite: {name}" for name in new if ran.code == 0 and not _finite(name, after[name])]
    return found


def _finite(name: str, content: bytes | None) -> bool:
    """Whether a JSON or a CSV file that was written holds finite numbers alone."""
    if content is None:
        return True
    if name.endswith(".json"):
        wrong: list[str] = []
        json.loads(content, parse_constant=wrong.append)
        return not wrong
    lines = content.lower().splitlines() if name.endswith(".csv") else []
    named = bool(lines) and lines[0].startswith(b"pose,")  # by whatever name the user gave: "inf" is one
    words = {word for line in lines for word in line.split(b",")[named:]}
    return not {b"nan", b"inf", b"-inf"} & words
