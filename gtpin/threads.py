"""How many threads linear algebra takes: one, since the matrices are small and threads that wait for each other cost more."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit BLAS and OpenMP to one thread within a block; what was allowed before comes back after it."""
    import scipy.linalg  # noqa: F401  (it brings a BLAS of its own: only libraries that are loaded already are limited)

    with threadpool_limits(limits=1):
        yield


def in_one_thread(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """The function within :func:`one_thread`."""

    @wraps(function)
    def limited(*arguments: Arguments.args, **options: Arguments.kwargs) -> Result:
        with one_thread():
            return function(*arguments, **options)

    return limited
