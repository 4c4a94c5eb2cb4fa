"""Where a page's numbers come from: versions, seed, and digests of the files that were read."""

from __future__ import annotations

import hashlib
import platform
from importlib.metadata import version
from pathlib import Path

from gtpin.data import Dataset
from gtpin.report.page import Table
from gtpin.robot.robot import Robot

PACKAGES = ("gtpin", "pin", "numpy", "scipy")


def provenance(dataset: Dataset | None, robot: Robot, seed: int | None = None) -> Table:
    """Versions, seed and sha256 of the dataset's files and of the robot's URDF."""
    rows = [[name, version(name)] for name in PACKAGES]
    rows.append(["Python", platform.python_version()])
    if seed is not None:
        rows.append(["seed", str(seed)])
    rows.append(["robot", robot.name])
    rows.append([Path(robot.description.source).name, f"sha256 {_digest(robot.description.xml.encode())}"])
    for file in _files(dataset) if dataset else []:
        if file is not None and file.is_file():
            rows.append([file.name, f"sha256 {_digest(file.read_bytes())}"])
    if dataset is not None and dataset.path is None:
        rows.append(["dataset", "made in memory, from no file"])
    return Table(("what", "which"), rows)


def _files(dataset: Dataset) -> list[Path | None]:
    carts = dataset.carts.file if dataset.carts is not None else None
    return [dataset.path / "dataset.toml" if dataset.path else None, dataset.file, carts]


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
