"""Instruments without noise."""

import numpy as np
import pytest

from gtpin.bench.simulator.instruments import build


@pytest.fixture
def exact(monkeypatch: pytest.MonkeyPatch) -> None:
    """Instruments read without errors."""
    monkeypatch.setattr(build, "errors", lambda gauge, noise, seed: np.zeros(gauge.sigma.shape))
