"""Parallel work on many cases: in processes of this machine, or of a dask cluster."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any, TypeVar

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky import BrokenProcessPool, get_reusable_executor
from joblib.externals.loky.process_executor import TerminatedWorkerError

from gtpin.errors import GtpinError

Result = TypeVar("Result")
WATCH = 1.0
"""Seconds between two checks whether the parent process is still there."""
CONNECT = 15
"""Seconds in which a cluster's scheduler must answer."""


def processes() -> int:
    """Number of processes for this machine; at least two, since joblib would run a single one in this process."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(cores, 2)


@contextmanager
def workers(cluster: str | None = None, jobs: int | None = None) -> Iterator[None]:
    """Context for parallel work: new processes of this machine, or the workers of a cluster, by its scheduler's address.

    ``jobs``: number of the processes, by default :func:`processes`; with 1 the work is done in this process.

    Raises GtpinError if dask is not installed, no scheduler answers, or it has no workers.
    """
    if cluster is not None:
        with _client(cluster), parallel_config(backend="dask"):
            yield
        return
    try:
        with parallel_config(backend="loky", n_jobs=jobs or processes()):
            yield
    finally:  # the next work gets new processes without data of this one
        get_reusable_executor().shutdown(wait=True, kill_workers=True)


def check_cluster(cluster: str | None) -> None:
    """Check before any work that a cluster has workers, by its scheduler's address; without one there is nothing to check.

    Raises GtpinError if dask is not installed, no scheduler answers, or it has no workers.
    """
    if cluster is not None:
        with _client(cluster):
            pass


@contextmanager
def _client(address: str) -> Iterator[None]:
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
    with client:
        if not client.scheduler_info()["workers"]:
            hint = f"start some with: dask worker {address}"
            raise GtpinError(f"the scheduler at {address} has no workers", hint=hint)
        yield


def spread(
    work: Callable[..., Result],
    names: Sequence[str],
    arguments: Callable[[str], tuple[Any, ...]],
    done: Callable[[str, Result], None],
) -> list[str]:
    """Do ``work(*arguments(name))`` for every name in the workers; call ``done(name, result)`` in this process after each.

    Returns ``lost``: names of the work that was not done because a process died; one of them ended the process.

    Raises GtpinError if the work can't be started in the workers.
    """
    waiting = dict.fromkeys(names)
    tasks = (delayed(_named)(work, name, arguments(name), os.getpid()) for name in names)
    try:
        for name, result in Parallel(return_as="generator_unordered", batch_size=1, pre_dispatch="3*n_jobs")(tasks):
            done(name, result)
            del waiting[name]
    except TerminatedWorkerError:
        return list(waiting)
    except BrokenProcessPool as error:
        reason = str(error.__cause__ or error).strip().splitlines()[-1]
        raise GtpinError(f"the processes can't start the work ({reason})", hint="install gtpin anew") from None
    except Exception as error:
        if type(error).__name__ == "KilledWorker":  # dask's; it has tried several times
            return list(waiting)
        raise
    return []


def _named(work: Callable[..., Result], name: str, arguments: tuple[Any, ...], parent: int) -> tuple[str, Result]:
    if os.getppid() == parent:  # a process of this machine, which was started for this work
        _end_with(parent)
    return name, work(*arguments)


@cache
def _end_with(parent: int) -> None:
    """End this process soon after its parent, which may be killed without a message."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(WATCH)
        os._exit(1)

    threading.Thread(target=watch, daemon=True, name="gtpin-parent-watch").start()
