"""Linear algebra in one thread: the matrices are small, so that waiting of threads for each other costs more than they save."""

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
    """Limit BLAS and OpenMP to one thread within a block; after it the previous limits hold again."""
    import scipy.linalg  # noqa: F401  (it loads its own BLAS; a library that is loaded later would not be limited)

    with threadpool_limits(limits=1):
        yield


def in_one_thread(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Decorator: the function runs within :func:`one_thread`."""

    @wraps(function)
    def limited(*arguments: Arguments.args, **options: Arguments.kwargs) -> Result:
        with one_thread():
            return function(*arguments, **options)

    return limited
