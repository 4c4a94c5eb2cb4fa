"""An arm measured from several stations: a laser tracker that was set up anew in each session, by Pinocchio and NumPy alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import tomli_w
from scipy.spatial.transform import Rotation
from serial_arm import SPREAD, write_urdf

Floats = np.ndarray
ERROR = 5e-4
"""1 sigma of the joints' placements and of the tool, m and rad: the tolerance where the URDF has none."""
SIGMA, TURN = 4e-5, 1e-4
"""Noise of positions, m, and orientations, rad."""
AXES = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True)
class Stations:
    """What was measured from K stations of an arm, and the truth.

    - ``urdf``: the nominal arm. ``errors``: (7, 6) shift, m, and rotation vector, rad, of each joint's placement and of the
      tool, in its own frame.
    - ``frames``: by session, the base frame in that station's frame. ``target``: the target in the frame of ``tool0``.
    - ``session``: (N,) of each row. ``q``: (N, 6) commands. ``T``: (N, 3) measured positions, m. ``wxyz``: (N, 4), or None.
    """

    urdf: Path
    errors: Floats
    frames: dict[str, pin.SE3]
    target: pin.SE3
    session: list[str]
    q: Floats
    T: Floats
    wxyz: Floats | None

    @property
    def columns(self) -> dict[str, list[Any]]:
        """The columns of a table, by name."""
        found: dict[str, Any] = {"pose": [f"p{i}" for i in range(len(self.q))]}
        found |= {f"q{i + 1}": list(self.q[:, i]) for i in range(6)} | dict(zip("xyz", self.T.T, strict=True))
        if self.wxyz is not None:
            found |= dict(zip(("qw", "qx", "qy", "qz"), self.wxyz.T, strict=True))
        return found | {"session": self.session}

    def write(self, folder: Path, **said: Any) -> Path:
        """A folder of schema 1; ``said``: keys of ``[instrument]``."""
        keys = {"stations": "session", "position_sigma": SIGMA} | said
        if self.wxyz is not None:
            keys["orientation_sigma"] = TURN
        toml = {"schema": "gtpin-dataset/1", "robot": str(self.urdf), "instrument": kept(keys)}
        return written(folder, toml, {"poses": self.columns})

    def write_second(self, folder: Path, **said: Any) -> Path:
        """A folder of schema 2, of one instrument with stations."""
        keys = {"name": "laser", "kind": "tracker", "stations": "session", "position_sigma": SIGMA} | said
        if self.wxyz is not None:
            keys["orientation_sigma"] = TURN
        toml = {"schema": "gtpin-dataset/2", "robot": str(self.urdf), "instrument": [kept(keys)]}
        return written(folder, toml, {"laser": self.columns})

    def write_one_each(self, folder: Path, **said: Any) -> Path:
        """A folder of schema 2, of one instrument for each station."""
        keys = {"kind": "tracker", "frame": "free", "position_sigma": SIGMA} | said
        each, tables = [], {}
        for name in self.frames:
            each.append({"name": f"of_{name}"} | kept(keys))
            own = [i for i, session in enumerate(self.session) if session == name]
            tables[f"of_{name}"] = {n: [values[i] for i in own] for n, values in self.columns.items()}
        toml = {"schema": "gtpin-dataset/2", "robot": str(self.urdf), "instrument": each}
        return written(folder, toml, tables)


def kept(keys: dict[str, Any]) -> dict[str, Any]:
    """The keys that have a value."""
    return {key: value for key, value in keys.items() if value is not None}


def written(folder: Path, toml: dict[str, Any], tables: dict[str, dict[str, Any]]) -> Path:
    """A dataset's folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "dataset.toml").write_text(tomli_w.dumps(toml))
    for name, columns in tables.items():
        rows = zip(*(map(str, column) for column in columns.values()), strict=True)
        (folder / f"{name}.csv").write_text("\n".join([",".join(columns), *(",".join(row) for row in rows)]) + "\n")
    return folder


def measured(
    folder: Path,
    seed: int,
    *,
    stations: int = 3,
    rows: int = 30,
    target: bool = False,
    orientations: bool = False,
    noise: float = 1.0,
) -> Stations:
    """An arm with drawn dimensions and errors, measured ``rows`` times from each of some stations, metres apart.

    ``target``: whether the target sits elsewhere than at ``tool0``. ``noise``: factor on the noise.
    """
    rng = np.random.default_rng(seed)
    urdf = folder / f"arm{seed}.urdf"
    write_urdf(urdf, rng)
    errors = rng.normal(0.0, ERROR, (7, 6))
    frames = {
        f"S{k + 1}": pin.SE3(Rotation.random(random_state=rng).as_matrix(), rng.normal(0.0, 2.0, 3))
        for k in range(stations)
    }
    X = (
        pin.SE3(Rotation.random(random_state=rng).as_matrix(), rng.normal(0.0, 0.08, 3))
        if target
        else pin.SE3.Identity()
    )
    q = rng.uniform(-1.0, 1.0, (stations * rows, 6)) * SPREAD
    session = [name for name in frames for _ in range(rows)]
    model, off = pin.buildModelFromUrdf(str(urdf)), [pin.exp6(error) for error in errors]
    for joint in range(1, 7):
        model.jointPlacements[joint] = model.jointPlacements[joint] * off[joint - 1]
    data, tool = model.createData(), model.getFrameId("tool0")
    T, R = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
    for i, row in enumerate(q):
        pin.framesForwardKinematics(model, data, row)
        seen = frames[session[i]] * data.oMf[tool] * off[6] * X
        T[i] = seen.translation + noise * rng.normal(0.0, SIGMA, 3)
        R[i] = seen.rotation @ pin.exp3(noise * rng.normal(0.0, TURN, 3))
    wxyz = Rotation.from_matrix(R).as_quat(scalar_first=True) if orientations else None
    return Stations(urdf, errors, frames, X, session, q, T, wxyz)
