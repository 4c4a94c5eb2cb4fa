"""The order of the tests: files that take long come first, so that no core waits for one of them at the end."""

from __future__ import annotations

from pathlib import Path

import pytest

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


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--one-of-each", action="store_true", help="each test with the first of its parameters alone")


@pytest.hookimpl(trylast=True)  # after the choice by marks
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put the long files first; the others, and the tests of a file, stay in their order."""
    items.sort(key=lambda item: PLACE.get(item.path, len(PLACE)))
    if config.getoption("--one-of-each"):
        chosen = {item.nodeid.partition("[")[0]: item for item in reversed(items)}.values()
        config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
        items[:] = reversed(chosen)
