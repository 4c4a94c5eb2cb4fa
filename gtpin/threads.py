"""How many threads linear algebra takes: one, since the matrices are small and threads that wait for each other cost more."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit BLAS and OpenMP to one thread within a block, or within a function as the decorator ``@one_thread()``.

    What ``OMP_NUM_THREADS`` and its like allow comes back after the block.
    """
    import scipy.linalg  # noqa: F401  (it brings a BLAS of its own: only libraries that are loaded already are limited)

    with threadpool_limits(limits=1):
        yield
