"""The free memory, and an error before work that needs more."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from gtpin.errors import GtpinError

PROC = Path("/proc")
GROUPS = Path("/sys/fs/cgroup")
UNLIMITED = 1 << 60
"""Bytes from which a limit counts as no limit: version 1 of control groups writes a very large number."""


def require(what: str, needed: float) -> None:
    """Raise `GtpinError` where a piece of work needs more memory than is free.

    ``what``: the work, with the number of rows. ``needed``: bytes that it takes in addition to what the process has already
    allocated.
    """
    free = available()
    if needed > free:
        raise GtpinError(
            f"{what} needs about {amount(needed)} of memory, and {amount(free)} is free",
            hint="take fewer rows, or give it more memory (ulimit -v, the limit of a container)",
        )


def amount(size: float) -> str:
    """Bytes in words: ``1.9 GB`` or ``340 MB``."""
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{max(size, 0.0) / 1e6:.0f} MB"


def available() -> float:
    """Bytes that this process can still allocate: the smallest of what its limits, its control group and the machine leave.

    Infinite where the system does not report them (``/proc`` exists on Linux only).
    """
    return min([*_of_limits(), *_of_groups(), *_of_machine()], default=float("inf"))


def _of_limits() -> Iterator[float]:
    """Bytes that remain under the limits of ``ulimit -v`` and ``ulimit -d``."""
    with contextlib.suppress(ImportError, OSError, ValueError, IndexError):
        import resource  # Unix only

        pages = [int(field) for field in (PROC / "self" / "statm").read_text().split()]
        page = os.sysconf("SC_PAGE_SIZE")
        for limit, used in ((resource.RLIMIT_AS, pages[0]), (resource.RLIMIT_DATA, pages[5])):
            soft = resource.getrlimit(limit)[0]
            if soft != resource.RLIM_INFINITY:
                yield float(soft - used * page)


def _of_groups() -> Iterator[float]:
    """Bytes that remain in the process's control group (cgroup): of version 2, then of version 1.

    Cached files that are not in use count as free.
    """
    names = ("memory.max", "memory.current", "inactive_file")
    yield from _of_group(GROUPS, *names)
    with contextlib.suppress(OSError):
        for line in (PROC / "self" / "cgroup").read_text().splitlines():
            if line.startswith("0::/") and len(line) > 4:
                yield from _of_group(GROUPS / line[4:], *names)
    yield from _of_group(GROUPS / "memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")


def _of_group(folder: Path, limit: str, usage: str, files: str) -> Iterator[float]:
    with contextlib.suppress(OSError, ValueError):
        most, used = int((folder / limit).read_text()), int((folder / usage).read_text())
        if most < UNLIMITED:
            yield float(most - used + _field(folder / "memory.stat", files))


def _of_machine() -> Iterator[float]:
    with contextlib.suppress(OSError, ValueError):
        file = PROC / "meminfo"
        if free := _field(file, "MemAvailable:"):
            yield 1024.0 * (free + _field(file, "SwapFree:"))


def _field(file: Path, name: str) -> int:
    """The number after ``name`` in a file of names and numbers; zero where the name is not there."""
    found = [line.split()[1] for line in file.read_text().splitlines() if line.split()[:1] == [name]]
    return int(found[0]) if found else 0
