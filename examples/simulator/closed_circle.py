"""The circle of a diagnosis: measure a machine, diagnose it, export the model, measure it in MuJoCo, diagnose again.

Machines are the plant's, sealed: its causes share no code with gtpin's effects. The diagnosed model goes to MuJoCo in two ways:
as a file that holds the effects that MJCF has means for, brought to rest at the commands, approaches and loads of the dataset;
and by ``commands_for_simulator``, with the file of the nominal robot. MuJoCo's poses are read with a laser tracker's noise,
and diagnosed against the nominal robot and against the diagnosed model.

``python examples/pages/refresh.py --measure closed_circle`` measures the table of docs/simulator.md again.
"""

from __future__ import annotations

import re
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

import gtpin
from gtpin.compensation import machine_of
from gtpin.errors import ConvergenceError, GtpinWarning
from gtpin.export import export
from gtpin.plant import make_case
from gtpin.plant.tracker import Noise
from gtpin.sim import commands_for_simulator

POSES = 120
ENERGY = 2000.0
CAUSES = {
    "gantry_tau": ("backlash@cart1", "encoder_scale@cart2", "cart_compliance@cart3", "linearity@cart1"),
    "linear_delta": ("backlash@cart2", "link_compliance@arm", "straightness@cart1"),
    "ur5": ("backlash@elbow_joint", "joint_compliance@shoulder_lift_joint", "link_compliance@arm"),
}


def jobs(machines: int) -> list[dict[str, object]]:
    """Each cause on a few machines."""
    return [
        {"robot": robot, "cause": cause, "seed": seed}
        for robot, causes in CAUSES.items()
        for cause in causes
        for seed in range(machines)
    ]


def measured(robot: str, cause: str, seed: int) -> list[dict[str, object]]:
    """Once around the circle: errors in um, and what was named."""
    effects = [tuple(cause.split("@"))]
    case = make_case(seed + 1, effects=effects, energy=ENERGY, poses=POSES, robot=robot, background=False, held_out=1)
    dataset, nominal = case.dataset, gtpin.read_model(robot)
    found, verdict, diagnosed = diagnosis(dataset)
    row = {"found": found or verdict, "effects_um": 0.0, "printed_um": 0.0, "file_um": 0.0, "layer_um": 0.0}
    row |= {"again": "", "against_file": "", "against_layer": ""}
    if diagnosed is None:
        return [row]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        model = machine_of(diagnosed)
        predicted = model.predict(dataset.q, dataset.covariates)
        plain = model.without({active.name for active in model.effects}).predict(dataset.q)
        by_file, printed = in_a_file(model, dataset)
        by_layer = in_a_layer(model, nominal, dataset)
    row |= {"effects_um": rms(predicted, plain), "printed_um": printed}
    row |= {"file_um": rms(by_file, predicted), "layer_um": rms(by_layer, predicted)}
    rng = np.random.default_rng(seed)
    read_file, read_layer = (Noise().measured(poses, rng) for poses in (by_file, by_layer))
    row["again"], _, _ = diagnosis(with_readings(dataset, read_file))
    # Against the diagnosed model: what it predicts takes the nominal robot's place.
    expected = nominal.predict(dataset.q)
    for name, seen in (("against_file", read_file), ("against_layer", read_layer)):
        turned = seen.R @ np.swapaxes(predicted.R, 1, 2) @ expected.R
        _, row[name], _ = diagnosis(with_readings(dataset, gtpin.Poses(seen.T - predicted.T + expected.T, turned)))
    return [row]


def diagnosis(dataset: gtpin.Dataset) -> tuple[str, str, gtpin.Model | None]:
    """The causes' names, the verdict, and the model."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        try:
            found = gtpin.diagnose(dataset)
        except ConvergenceError:
            return "", "no convergence", None
    return " ".join(sorted(f"{c.effect}@{c.site}" for c in found.causes)), found.verdict, found.model


def in_a_file(model: gtpin.Model, dataset: gtpin.Dataset) -> tuple[gtpin.Poses, float]:
    """Poses at rest in MuJoCo, and the root sum of squares of the errors that the export printed, um."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        (file,) = export(model, Path(folder) / "machine.xml")
        from mujoco_machine import MujocoMachine  # the table is made without MuJoCo

        machine = MujocoMachine(file, model.robot.tcp_frame)
    sizes = [float(s) for w in told for s in re.findall(r"(?:within |\()([\d.e+-]+) um", str(w.message))]
    return machine.poses(dataset.q, dataset.covariates), round(float(np.hypot.reduce([0.0, *sizes])), 2)


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
    return replace(dataset, position=seen.T, orientation=seen.quaternions, instrument=Noise().instrument)


def rms(one: gtpin.Poses, other: gtpin.Poses) -> float:
    """Root mean square distance of positions, um."""
    return round(1e6 * float(np.sqrt(((one.T - other.T) ** 2).sum(axis=1).mean())), 2)


def table(records: pd.DataFrame) -> str:
    """Largest errors over the machines of a cause, and how often the circle closed."""
    head = ["robot", "cause", "effects", "printed", "file off", "layer off", "same causes", "against: file", "layer"]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for (robot, cause), all_rows in records.groupby(["robot", "cause"], sort=False):
        rows = all_rows[all_rows["again"] != ""]
        largest = [
            f"{rows[name].astype(float).max():.3g} um" if len(rows) else "-"
            for name in ("effects_um", "printed_um", "file_um", "layer_um")
        ]
        same = f"{(rows['found'] == rows['again']).sum()} of {len(all_rows)}"
        verdicts = [", ".join(rows[name]) or "-" for name in ("against_file", "against_layer")]
        lines.append(f"| {robot} | `{cause}` | {' | '.join([*largest, same, *verdicts])} |")
    closed = [f"none in {(records[name] == 'none').sum()}" for name in ("against_file", "against_layer")]
    same = f"{(records['found'] == records['again']).sum()} of {len(records)}"
    lines.append(f"| all | | | | | | {' | '.join([same, *closed])} |")
    return "\n".join(lines)
