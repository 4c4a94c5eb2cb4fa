"""The provenance of a page's numbers: versions, seed, and digests of the files that were read."""

from __future__ import annotations

import hashlib
import platform
import tempfile
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path

import pinocchio as pin

from gtpin.data import Dataset
from gtpin.output.ownership import MARKER
from gtpin.report.page import Table
from gtpin.robot.chain import Chain

PACKAGES = ("numpy", "scipy")


def versions() -> list[list[str]]:
    """Name and version of gtpin, of the packages that it computes with, and of Python.

    The version of Pinocchio is that of its module, because the distribution is called ``pin`` on PyPI and can have another name
    elsewhere.
    """
    packages = [[name, version(name)] for name in PACKAGES]
    return [["gtpin", version("gtpin")], ["pin", pin.__version__], *packages, ["Python", platform.python_version()]]


def provenance(dataset: Dataset | None, robot: Chain, seed: int | None = None) -> Table:
    """Versions, seed and sha256 of the dataset's files and of the robot's URDF.

    A dataset that was not read from files is identified by the digests of the files that `Dataset.write` makes, so that it can
    be compared with a folder.
    """
    rows = versions()
    if seed is not None:
        rows.append(["seed", str(seed)])
    rows.append(["robot", robot.name])
    rows.append([Path(robot.description.source).name, f"sha256 {digest(robot.description.xml.encode())}"])
    if dataset is not None and dataset.path is None:
        where = "handed over in memory, not read from files; written as a folder, its files have these digests:"
        rows.append(["dataset", where])
        with tempfile.TemporaryDirectory() as folder:
            dataset.write(Path(folder) / "dataset")
            rows += _digests(sorted(f for f in (Path(folder) / "dataset").iterdir() if f.name != MARKER))
    elif dataset is not None and dataset.path is not None:
        carts = dataset.carts.file if dataset.carts is not None else None
        rows += _digests([dataset.path / "dataset.toml", *dataset.readings.files, carts])
    return Table(("what", "which"), rows)


def _digests(files: Iterable[Path | None]) -> list[list[str]]:
    return [[file.name, f"sha256 {digest(file.read_bytes())}"] for file in files if file is not None and file.is_file()]


def digest(content: bytes) -> str:
    """A content's sha256."""
    return hashlib.sha256(content).hexdigest()
