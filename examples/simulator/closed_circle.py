"""The circle of a diagnosis: measure a machine, diagnose it, export the model, measure it in MuJoCo, diagnose again.

Machines are the plant's, sealed: its causes share no code with gtpin's effects. The diagnosed model goes to MuJoCo in two ways:
as a file that holds the effects that MJCF has means for, brought to rest at the commands, approaches and loads of the dataset;
and by ``commands_for_simulator``, with the file of the nominal robot. MuJoCo's poses are read with a laser tracker's noise,
and diagnosed against the nominal robot and against the diagnosed model.

``python examples/pages/refresh.py --measure closed_circle`` measures the table of docs/export.md again.
"""

from __future__ import annotations

import re
import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

import gtpin
from gtpin.bench.simulator import Case, make_case
from gtpin.bench.simulator.recipe import SimulatedNoise
from gtpin.compensation import machine_of
from gtpin.effects.operating_points import Column
from gtpin.errors import ConvergenceError, GtpinWarning
from gtpin.export import export
from gtpin.sim import commands_for_simulator

Floats = npt.NDArray[np.float64]

POSES, HELD_OUT = 120, 40
ENERGY = 2000.0
SEEDS = 1795501059
"""The machines' first seed: the clock's seconds when the table was measured last, so that nothing was ever tuned on them."""
CAUSES = {
    "gantry_tau": ("backlash@cart1", "encoder_scale@cart2", "cart_compliance@cart3", "linearity@cart1"),
    "linear_delta": ("backlash@cart2", "link_compliance@arm", "straightness@cart1"),
    "ur5": ("backlash@elbow_joint", "joint_compliance@shoulder_lift_joint", "link_compliance@arm"),
}


def jobs(machines: int) -> list[dict[str, object]]:
    """Each cause on a few machines."""
    return [
        {"robot": robot, "cause": cause, "seed": SEEDS + machine}
        for robot, causes in CAUSES.items()
        for cause in causes
        for machine in range(machines)
    ]


def measured(robot: str, cause: str, seed: int) -> list[dict[str, object]]:
    """Once around the circle: errors in um, and what was named."""
    effects = [tuple(cause.split("@"))]
    case = make_case(
        seed, effects=effects, noncentrality=ENERGY, poses=POSES, robot=robot, background=False, held_out=HELD_OUT
    )
    dataset, nominal = case.dataset, gtpin.read_model(robot)
    first = diagnosis(dataset)
    row = {"found": named(first), "effects_um": 0.0, "printed_um": 0.0, "file_um": 0.0, "layer_um": 0.0}
    row |= {"said": "", "lower": "", "upper": "", "shrank": "", "again": "", "against_file": "", "against_layer": ""}
    if first is None or not first.causes:
        return [row]
    diagnosed = first.model
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        model = machine_of(diagnosed)
        predicted = model.predict(dataset.q, dataset.covariates)
        plain = model.without({active.name for active in model.effects}).predict(dataset.q)
        by_file, printed = in_a_file(model, dataset.q, dataset.covariates)
        by_layer = in_a_layer(model, nominal, dataset)
        shrank = explained_fraction(case, machine_of(first.baseline.model), model)
    row |= {"effects_um": rms(predicted, plain), "printed_um": printed}
    row |= {"file_um": rms(by_file, predicted), "layer_um": rms(by_layer, predicted)}
    row |= {
        "said": first.gap.explained_fraction,
        "lower": first.gap.interval[0],
        "upper": first.gap.interval[1],
        "shrank": shrank,
    }
    rng = np.random.default_rng(seed)
    read_file, read_layer = (SimulatedNoise().measured(poses, rng) for poses in (by_file, by_layer))
    row["again"] = named(diagnosis(with_readings(dataset, read_file)))
    # Against the diagnosed model: what it predicts takes the nominal robot's place.
    expected = nominal.predict(dataset.q)
    for name, seen in (("against_file", read_file), ("against_layer", read_layer)):
        turned = seen.R @ np.swapaxes(predicted.R, 1, 2) @ expected.R
        less = diagnosis(with_readings(dataset, gtpin.Poses(seen.T - predicted.T + expected.T, turned)))
        row[name] = "no convergence" if less is None else less.verdict
    return [row]


def diagnosis(dataset: gtpin.Dataset) -> gtpin.Diagnosis | None:
    """A diagnosis with the nominal robot; None where the calibration does not converge."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        try:
            return gtpin.diagnose(dataset)
        except ConvergenceError:
            return None


def named(found: gtpin.Diagnosis | None) -> str:
    """The names of the causes; where there are none, the verdict."""
    if found is None:
        return "no convergence"
    return " ".join(sorted(f"{c.effect}@{c.site}" for c in found.causes)) or found.verdict


def explained_fraction(case: Case, before: gtpin.Model, after: gtpin.Model) -> float:
    """The explained fraction of the gap between MuJoCo and the machine, at commands that no diagnosis has used."""
    at, errors = case.commands, []
    for model in (before, after):
        poses, _ = in_a_file(model, at.q, at.covariates)
        errors.append(rms(poses, case.truth))
    return 1.0 - (errors[1] / errors[0]) ** 2


def in_a_file(model: gtpin.Model, q: Floats, covariates: Mapping[str, Column]) -> tuple[gtpin.Poses, float]:
    """Poses at rest in MuJoCo, and the root sum of squares of the errors that the export printed, um."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        (file,) = export(model, Path(folder) / "machine.xml")
        from mujoco_machine import MujocoMachine  # the table is made without MuJoCo

        machine = MujocoMachine(file, model.robot.tcp_frame)
    sizes = [float(s) for w in told for s in re.findall(r"(?:within |\()([\d.e+-]+) um", str(w.message))]
    return machine.poses(q, covariates), round(float(np.hypot.reduce([0.0, *sizes])), 2)


def in_a_layer(model: gtpin.Model, nominal: gtpin.Model, dataset: gtpin.Dataset) -> gtpin.Poses:
    """Poses of the nominal robot at rest in MuJoCo, with the commands and offsets of the machine."""
    given = commands_for_simulator(model, dataset.q, dataset.covariates)
    with tempfile.TemporaryDirectory() as folder:
        (file,) = export(nominal, Path(folder) / "nominal.xml")
        from mujoco_machine import MujocoMachine

        # At the ends of the ranges, the nominal robot may need commands a little beyond.
        poses = MujocoMachine(file, nominal.robot.tcp_frame, limits=False).poses(given.q, {})
    return gtpin.Poses(poses.T + np.einsum("nij,nj->ni", poses.R, given.offset.T), poses.R @ given.offset.R)


def with_readings(dataset: gtpin.Dataset, seen: gtpin.Poses) -> gtpin.Dataset:
    """The dataset with other readings, of an instrument in the base frame."""
    return replace(dataset, position=seen.T, orientation=seen.quaternions, instrument=SimulatedNoise().instrument)


def rms(one: gtpin.Poses, other: gtpin.Poses) -> float:
    """Root mean square distance of positions, um."""
    return round(1e6 * float(np.sqrt(((one.T - other.T) ** 2).sum(axis=1).mean())), 2)


def table(records: pd.DataFrame) -> str:
    """Largest errors over the machines of a cause, and how often the circle closed."""
    lines = ["| robot | cause | effects | printed | file off | layer off | same causes |", "|---" * 7 + "|"]
    for (robot, cause), all_rows in records.groupby(["robot", "cause"], sort=False):
        rows = all_rows[all_rows["again"] != ""]
        largest = [
            f"{rows[name].astype(float).max():.3g}" if len(rows) else "-"
            for name in ("effects_um", "printed_um", "file_um", "layer_um")
        ]
        same = f"{(rows['found'] == rows['again']).sum()} of {len(all_rows)}"
        lines.append(f"| {robot} | `{cause}` | {' | '.join([*largest, same])} |")
    of = len(records)
    same, file, layer = (
        sum(found)
        for found in (
            records["found"] == records["again"],
            records["against_file"] == "none",
            records["against_layer"] == "none",
        )
    )
    closed = (
        f"The same causes on {same} of {of} machines; verdict `none` against the diagnosed model on {file} (file) and "
    )
    closed += f"{layer} (layer); the explained fraction in MuJoCo is in the stated interval on {inside(records)}."
    return "\n".join([*lines, "", closed])


def inside(records: pd.DataFrame) -> int:
    """Number of machines whose explained fraction in MuJoCo lies in the 95 % interval that the diagnosis stated."""
    went = records[records["again"] != ""]
    lower, share, upper = (went[name].astype(float) for name in ("lower", "shrank", "upper"))
    return int(((lower <= share) & (share <= upper)).sum())
