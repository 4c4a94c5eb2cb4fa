"""One thread for each worker, and the order of the tests: files that take long come first, so that no core waits at the end."""

from __future__ import annotations

import math
import os
import time
import zlib
from pathlib import Path

import pytest

os.environ.setdefault(
    "OMP_NUM_THREADS", "1"
)  # before numpy is imported: threads of several workers wait for each other
ROOT = Path(__file__).parent
LONG = (
    "docs/test_records_measured_again.py",
    "calibration/test_calibration_noise.py",
    "diagnosis/test_proxies.py",
    "calibration/test_readings_coverage.py",
    "calibration/test_recognise.py",
    "calibration/test_calibration_memory.py",
    "bench/blind/test_blind_readings.py",
    "sim/test_closed_circle.py",
    "fuzz/test_damaged_files.py",
    "calibration/test_calibration_coverage.py",
    "calibration/test_prior_conflict.py",
    "diagnosis/test_diagnosis_verdict.py",
    "health/test_check.py",
    "docs/test_code_in_the_documents.py",
    "examples/test_examples.py",
    "instruments/test_encoder_coverage.py",
    "examples/test_notebooks.py",
    "export/test_export_printers.py",
    "diagnosis/test_diagnosis_data.py",
    "certificate/test_certificate_of_machines.py",
)
"""Files that take about half a minute of CPU or more, the longest first. A worker takes whole files (``--dist loadfile``)."""
PLACE = {ROOT / name: place for place, name in enumerate(LONG)}


LAST = pytest.StashKey[float]()
"""The time by ``time.monotonic`` after which no test begins."""


def pytest_addoption(parser: pytest.Parser) -> None:
    what = (
        "each test with the first of its parameters alone, in a mixed order of files, as many as begin in these minutes"
    )
    parser.addoption("--minutes", type=float, help=what)


@pytest.hookimpl(trylast=True)  # after the choice by marks
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put the long files first; the others, and the tests of a file, stay in their order."""
    minutes = config.getoption("--minutes")
    if minutes is None:
        items.sort(key=lambda item: PLACE.get(item.path, len(PLACE)))
        return
    config.stash[LAST] = time.monotonic() + 60.0 * minutes
    chosen = set({item.nodeid.partition("[")[0]: item for item in reversed(items)}.values())
    config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
    # Of each folder some files, also where the time is short; the same order in each run.
    kept = [item for item in items if item in chosen]
    items[:] = sorted(kept, key=lambda item: zlib.crc32(str(item.path.relative_to(ROOT)).encode()))


@pytest.hookimpl(tryfirst=True)  # before the fixtures
def pytest_runtest_setup(item: pytest.Item) -> None:
    if time.monotonic() > item.config.stash.get(LAST, math.inf):
        pytest.skip("the minutes are over")
