"""``--trust-data``, and the warnings in the JSON files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from gtpin.bench.simulator import make_case

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def bumped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eighty poses in one session, the second half of them read 0.9 mm off."""
    data = make_case(671, n_effects=0, poses=80, held_out=1).dataset
    position = data.position.copy()
    position[len(data) // 2 :] += [0.0, 8e-4, -4e-4]
    order = {name: values for name, values in data.covariates.items() if name not in ("session", "time")}
    folder = tmp_path_factory.mktemp("bumped") / "set"
    replace(data, position=position, covariates=order).write(folder)
    return folder


def said(err: str) -> list[str]:
    return [line.removeprefix("gtpin: warning: ") for line in err.splitlines()]


@pytest.mark.parametrize(("command", "file"), [("calibrate", "calibration.json"), ("diagnose", "diagnosis.json")])
def test_trusted_data_are_used_and_the_json_has_all_warnings(
    run: Any, bumped: Path, tmp_path: Path, command: str, file: str
) -> None:
    assert "bumped" in run(command, bumped, "-o", tmp_path / "refused").failed()
    ran = run(command, bumped, "-o", tmp_path / "used", "--trust-data")
    assert ran.code == 0, ran.err
    told = json.loads((tmp_path / "used" / file).read_text(encoding="utf-8"))["warnings"]
    assert any("bumped" in text for text in told)
    assert [" ".join(text.replace(f"{bumped}/", "").split()) for text in said(ran.err)] == told
