"""Reading a dataset of a million rows."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gtpin

pytestmark = pytest.mark.benchmark(group="reading", timer=time.process_time)


def test_a_million_rows_of_csv(benchmark: Any, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    count = 1_000_000
    quaternions = rng.standard_normal((count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    gtpin.Dataset(
        robot="gantry_tau",
        pose=np.arange(count).astype(str).astype(object),
        q=rng.uniform(-0.6, 0.6, (count, 3)),
        position=rng.standard_normal((count, 3)),
        orientation=quaternions,
        covariates={"time": np.arange(count, dtype=float)},
    ).write(tmp_path / "million")
    dataset = benchmark.pedantic(lambda: gtpin.Dataset.read(tmp_path / "million"), rounds=1)
    assert len(dataset) == count
