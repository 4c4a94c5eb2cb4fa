"""Pieces of work that tell about the process they run in; they import nothing of gtpin themselves."""

import os
import sys
import time
from pathlib import Path


def plant_imported() -> tuple[int, bool]:
    """Import the plant; give the process, and whether it had been there."""
    before = any(name.startswith("gtpin.bench.simulator") for name in sys.modules)
    import gtpin.bench.simulator.case  # noqa: F401

    return os.getpid(), before


def known_modules() -> tuple[int, list[str]]:
    """The process, and the modules of gtpin that it knows."""
    return os.getpid(), sorted(name for name in sys.modules if name.startswith("gtpin"))


def dying(files: dict[str, bytes], exclude: tuple[str, ...] = ()) -> tuple[object, float]:
    """Ends its process at a fatal case."""
    if "fatal" in files:
        os._exit(1)
    from gtpin.bench.blind.worker import Outcome

    return Outcome(error="alive"), 0.0


def waiting(folder: str, name: str) -> None:
    """Say which process this is, and take an hour."""
    file = Path(folder) / name
    file.with_suffix(".part").write_text(str(os.getpid()))
    file.with_suffix(".part").rename(file)
    time.sleep(3600)
