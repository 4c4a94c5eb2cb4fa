"""Linear algebra runs in one thread inside gtpin, and in as many as before outside."""

from __future__ import annotations

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import gtpin
from gtpin.threads import one_thread


def threads() -> set[int]:
    """Of the BLAS libraries."""
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


@pytest.fixture(autouse=True)
def two_threads():
    with threadpool_limits(limits=2, user_api="blas"):
        if threads() != {2}:
            pytest.skip("this BLAS has one thread")
        yield


def test_a_block_is_limited_and_what_was_allowed_comes_back():
    with one_thread():
        assert threads() == {1}
        with one_thread():
            assert threads() == {1}
        assert threads() == {1}
    assert threads() == {2}


def test_what_was_allowed_comes_back_after_an_error():
    with pytest.raises(ValueError, match="no"), one_thread():
        raise ValueError("no")
    assert threads() == {2}


@pytest.mark.slow
@pytest.mark.parametrize("work", [gtpin.calibrate, gtpin.diagnose])
def test_a_fit_is_limited(work):
    model = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau")))
    rng = np.random.default_rng(0)
    q = rng.uniform(-0.5, 0.5, (40, 3))
    poses = model.predict(q)
    position = poses.T + 1e-5 * rng.standard_normal((40, 3))
    dataset = gtpin.Dataset("gantry_tau", np.arange(40), q, position)
    seen = []
    work(dataset, progress=lambda *_: seen.append(threads()))
    assert seen
    assert all(found == {1} for found in seen)
    assert threads() == {2}
