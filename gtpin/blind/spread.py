"""Work on many cases side by side: processes of this machine, or those of a dask cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky import get_reusable_executor
from joblib.externals.loky.process_executor import TerminatedWorkerError

from gtpin.errors import GtpinError

Result = TypeVar("Result")
CONNECT = 15
"""Seconds in which a cluster's scheduler must answer."""


def processes() -> int:
    """How many processes this machine has room for."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def cluster(address: str | None) -> Iterator[None]:
    """Where the work goes: processes of their own, started afresh, or the workers of a cluster.

    Raises
    ------
    GtpinError
        If dask is not installed, or no scheduler answers.
    """
    if address is None:
        try:
            with parallel_config(backend="loky", n_jobs=processes()):
                yield
        finally:  # the next work gets new processes, which know nothing of this one
            get_reusable_executor().shutdown(wait=True, kill_workers=True)
        return
    try:
        from distributed import Client
    except ImportError:
        raise GtpinError("dask is not installed", hint='pip install "gtpin[cluster]"') from None
    connect: Any = Client
    try:
        client = connect(address, timeout=CONNECT)
    except (OSError, ValueError, TimeoutError) as error:
        what = f"no dask scheduler at {address} ({str(error)[:80]})"
        raise GtpinError(what, hint="start one with: dask scheduler") from None
    with client, parallel_config(backend="dask"):
        yield


def spread(
    work: Callable[..., Result], tasks: Iterable[tuple[str, tuple[Any, ...]]], done: Callable[[str, Result], None]
) -> list[str]:
    """Do ``work(*arguments)`` for (name, arguments) tasks; call ``done(name, result)`` here as each ends.

    Returns
    -------
    lost
        Names of tasks that were not done because a process died (all that were not done by then).
    """
    tasks = list(tasks)
    waiting = dict.fromkeys(name for name, _ in tasks)
    try:
        for name, result in Parallel(return_as="generator_unordered", batch_size=1, pre_dispatch="3*n_jobs")(
            delayed(_named)(work, name, arguments) for name, arguments in tasks
        ):
            done(name, result)
            del waiting[name]
    except TerminatedWorkerError:
        return list(waiting)
    return []


def _named(work: Callable[..., Result], name: str, arguments: tuple[Any, ...]) -> tuple[str, Result]:
    return name, work(*arguments)
