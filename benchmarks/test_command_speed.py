"""CPU time of the commands that answer at once."""

from __future__ import annotations

import resource
import subprocess
import sys
from typing import Any

import pytest


def of_children() -> float:
    """CPU seconds of the processes that were started and have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


pytestmark = pytest.mark.benchmark(group="commands", timer=of_children)


def _run(word: str) -> None:
    subprocess.run([sys.executable, "-m", "gtpin", word], check=True, capture_output=True)


def test_the_version(benchmark: Any) -> None:
    benchmark.pedantic(_run, args=("--version",), rounds=5, warmup_rounds=1)
    assert benchmark.stats.stats.min < 0.15


def test_the_help(benchmark: Any) -> None:
    benchmark.pedantic(_run, args=("--help",), rounds=5, warmup_rounds=1)
    assert benchmark.stats.stats.min < 0.3
