"""Machines of the plant, measured on one day for a model and on a later day for a check, by a tracker or others."""

import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

import gtpin
from gtpin.bench.simulator import Case, make_case, measure_at
from gtpin.bench.simulator.recipe import SimulatedNoise

POSES = 10


@cache
def machine(seed: int, *, free: bool = False, robot: str = "gantry_tau") -> tuple[Case, gtpin.Model]:
    """A machine without an effect, and the model of its calibration; not to be changed."""
    noise = SimulatedNoise(free=free)
    case = make_case(seed, effects=[], poses=140, held_out=40, noise=noise, background=False, robot=robot)
    return case, gtpin.calibrate(case.dataset).model


def later(
    case: Case,
    seed: int,
    *,
    shift: dict[int, float] | None = None,
    reversal: dict[int, float] | None = None,
    poses: int = POSES,
) -> gtpin.Dataset:
    """The machine measured again at some of its poses, approached from both sides.

    The drives are off by what the controller does not know: a shift of the zero, m, or a reversal error, m, by actuator.
    """
    return _measured(case, seed, 11, poses, shift, reversal)


def _measured(
    case: Case, seed: int, stream: int, poses: int, shift: dict[int, float] | None, reversal: dict[int, float] | None
) -> gtpin.Dataset:
    rng = np.random.default_rng([seed, stream])
    q = case.dataset.q[rng.choice(len(case.dataset), poses, replace=False)]
    ways = np.column_stack([rng.permutation(np.resize([-1.0, 1.0], poses)) for _ in range(q.shape[1])])
    off = np.zeros_like(q)
    for actuator, size in (shift or {}).items():
        off[:, actuator] += size
    for actuator, size in (reversal or {}).items():
        off[:, actuator] -= size / 2.0 * ways[:, actuator]
    ids = np.array([f"check{i}" for i in range(poses)], dtype=object)
    commands = gtpin.Commands(ids, q + off, {f"approach{i + 1}": way for i, way in enumerate(ways.T)})
    return replace(measure_at(case, commands, seed), q=q)


SIGMA = 1e-5
"""m: noise of every reading of a later day by other instruments than a tracker."""
OFF = np.array([0.05, -0.03, 0.02])
"""m: by which each declared centre of a draw wire is off."""
DOWN = 1e-3
"""m: by which each plane of a dial gauge is off."""
SECTIONS = {
    "range": "station_sigma = 0.1\n[instrument.stations]\nA = [1.5, -2.0, 0.5]\nB = [-1.0, 2.5, 0.3]\nC = [2.0, 2.0, -0.8]\n",
    "plane": "[instrument.planes]\n"
    "X = { point = [0, 0, 0], normal = [1, 0, 0] }\n"
    "Y = { point = [0, 0, 0], normal = [0, 1, 0] }\n"
    "Z = { point = [0, 0, 0], normal = [0, 0, 1] }\n",
}
HEAD = 'schema = "gtpin-dataset/2"\nrobot = "gantry_tau"\n[[instrument]]\nname = "{kind}s"\nkind = "{kind}"\n'


def later_read(
    folder: Path,
    case: Case,
    seed: int,
    kind: str,
    *,
    shift: dict[int, float] | None = None,
    reversal: dict[int, float] | None = None,
    poses: int = 30,
    sigma: bool = True,
) -> gtpin.Dataset:
    """The machine read again by ``range`` or ``plane``, three readings a pose, made here by hand; see :func:`later`."""
    silent = case.recipe.noise.model_copy(update={"position_sigma": 1e-9, "orientation_sigma": 1e-9})
    exact = _measured(replace(case, recipe=replace(case.recipe, noise=silent)), seed, 12, poses, shift, reversal)
    declared = HEAD.format(kind=kind) + (f"sigma = {SIGMA}\n" if sigma else "") + SECTIONS[kind]
    (section,) = tomllib.loads(declared)["instrument"]
    rng, T, tables = np.random.default_rng([seed, 13]), exact.position, []
    for place, (name, centre) in enumerate(section["stations" if kind == "range" else "planes"].items()):
        seen = np.linalg.norm(T - centre - OFF, axis=1) if kind == "range" else T[:, place] - DOWN
        named, number = ("station", "range") if kind == "range" else ("plane", "height")
        columns = {"pose": exact.pose, **{f"q{i + 1}": q for i, q in enumerate(exact.q.T)}, named: name}
        approach = {column: values for column, values in exact.covariates.items() if column.startswith("approach")}
        tables.append(pd.DataFrame(columns | {number: seen + SIGMA * rng.standard_normal(poses)} | approach))
    folder.mkdir(exist_ok=True)
    pd.concat(tables).to_csv(folder / f"{kind}s.csv", index=False)
    (folder / "dataset.toml").write_text(declared, encoding="utf-8")
    return gtpin.Dataset.read(folder)


def classes(found: gtpin.HealthCheck) -> list[set[tuple[str, str]]]:
    """The classes of a check's causes."""
    return [{(m.effect, m.site) for m in cause.members} for cause in found.causes]
