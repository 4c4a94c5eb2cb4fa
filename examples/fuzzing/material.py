"""Sound files of every kind that gtpin reads, and the commands that read them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

import gtpin
from gtpin.bench.simulator import simulate
from gtpin.data import CartMeasurements, Dataset, InstrumentSection
from gtpin.effects.active import ActiveEffect
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.operating_points import OperatingPoints
from gtpin.model.model_folder import write_model
from gtpin.robot.library import urdf_path


@dataclass(frozen=True)
class Command:
    """A command line, run in the folder of the material, and the files that it reads."""

    line: str
    reads: tuple[str, ...]
    weight: float = 1.0

    @property
    def slow(self) -> bool:
        """Whether it takes more than a few seconds."""
        return self.line.startswith(("diagnose", "sensitivity"))


SET, WITH_PARQUET = ("set/dataset.toml", "set/poses.csv"), ("parquet/poses.parquet", "parquet/dataset.toml")
MODEL, BENT = ("calibrated/model/model.json", "calibrated/model/nominal.urdf"), ("bent/model.json", "bent/nominal.urdf")
COMMANDS = (
    Command("calibrate set -o out", SET, 4.0),
    Command("calibrate parquet -o out", WITH_PARQUET, 3.0),
    Command("calibrate set -o out --model 2", ("set/carts.csv", *SET), 2.0),
    Command("calibrate parquet -o out --model 4", ("parquet/carts.parquet", *WITH_PARQUET), 2.0),
    Command("calibrate own -o out", ("own/machine.urdf", "own/dataset.toml", "own/poses.csv"), 2.0),
    Command("calibrate plane -o out", ("plane/machine.urdf", "plane/dataset.toml", "plane/poses.csv"), 2.0),
    Command("diagnose set -o out", SET, 0.4),
    Command("diagnose own -o out", ("own/machine.urdf", "own/dataset.toml", "own/poses.csv"), 1.0),
    Command("predict gantry_tau commands.csv -o out.csv", ("commands.csv",), 1.0),
    Command("predict calibrated commands.parquet -o out.csv", (*MODEL, "commands.parquet"), 2.0),
    Command("predict bent commands.csv -o out.csv", (*BENT, "commands.csv"), 3.0),
    Command("predict own/machine.urdf commands.csv -o out.csv", ("own/machine.urdf", "commands.csv"), 3.0),
    Command("predict plane/machine.urdf one.csv -o out.csv", ("plane/machine.urdf", "one.csv"), 3.0),
    Command("sensitivity calibrated --poses commands.csv -o out", (*MODEL, "commands.csv"), 1.0),
    Command("sensitivity own/machine.urdf --poses commands.csv -o out", ("own/machine.urdf", "commands.csv"), 1.0),
    Command("export bent -o out.csv", BENT, 2.0),
    Command("export bent -o out.comp", BENT, 1.0),
    Command("export calibrated -o out.urdf", MODEL, 1.0),
    Command("export own/machine.urdf -o out.sdf", ("own/machine.urdf",), 1.0),
    Command("export bent -o out.xml", BENT, 1.0),
    Command("export bent -o out.yaml", BENT, 1.0),
    Command("export bent -o out.csv --commands commands.csv", (*BENT, "commands.csv"), 2.0),
    Command("export bent -o out.csv --commands commands.parquet", ("commands.parquet",), 1.0),
    Command("simulate -o out --scenario scenario.toml --poses 20", ("scenario.toml",), 3.0),
    Command("simulate -o out --robot own/machine.urdf --poses 20", ("own/machine.urdf",), 1.0),
    Command("simulate -o out --robot plane/machine.urdf --poses 20", ("plane/machine.urdf",), 1.0),
    Command("view bent set -o out.png", (*BENT, *SET), 0.3),
)

SCENARIO = """\
seed = 3
poses = 20
held_out = 10

[[effect]]
id = "rack_periodic"
site = "cart2"
energy = 300.0

[[effect]]
id = "backlash"
amplitude = 2.0

[noise]
position_sigma = 1.5e-5
orientation_sigma = 5e-5

[covariates]
payloads = [0.0, 5.0]
"""

FOUR_BAR = """\
<robot name="four_bar">
  <link name="base"/>{links}
  <joint name="crank" type="revolute">
    <parent link="base"/><child link="a"/><axis xyz="0 0 1"/><limit lower="0" upper="3" effort="1" velocity="1"/>
  </joint>
  <joint name="coupler" type="continuous">
    <parent link="a"/><child link="b"/><origin xyz="0.2 0 0"/><axis xyz="0 0 1"/>
  </joint>
  <joint name="rocker" type="continuous">
    <parent link="base"/><child link="c"/><origin xyz="0.5 0 0"/><axis xyz="0 0 1"/>
  </joint>
  <loop_joint name="tip" type="spherical"><link1 link="b" xyz="0.5 0 0"/><link2 link="c" xyz="0.4 0 0"/></loop_joint>
  <gtpin>
    <actuator joint="crank"/><platform link="b"/>
    <home q="0.9" tcp_xyz="0.12432199 0.15666538 0" tcp_rotvec="0 0 0.4966"/>
  </gtpin>
</robot>
"""


def make(folder: Path) -> None:
    """Write sound files of every kind into a folder."""
    drawn = simulate(gtpin.load_robot("gantry_tau"), "gantry_tau", poses=40, seed=5).dataset
    rows = np.arange(len(drawn))
    covariates = {
        "time": 20.0 * rows,
        "session": np.array([f"day{i // 20}" for i in rows], dtype=object),
        "payload": np.where(rows % 3 == 0, 5.0, 0.0),
        "temp_link": 21.0 + 0.1 * rows,
        "temp_frame": 22.0 - 0.1 * rows,
        "approach2": np.where(rows % 2 == 0, 1.0, -1.0),
        "speed1": np.where(rows % 2 == 0, 0.1, -0.05),
    }
    backlash = np.array([0.0, 1e-4, 0.0]) * covariates["approach2"][:, None]
    nominal = gtpin.read_model("gantry_tau")
    moved = nominal.predict(drawn.q + backlash).T - nominal.predict(drawn.q).T
    dataset = replace(drawn, position=drawn.position + moved, covariates=covariates)
    instrument = InstrumentSection(position_sigma=1.5e-5, orientation_sigma=5e-5, station=(1.5, -7.0, 0.3))
    whole = replace(dataset, instrument=instrument, tolerance={"link_length": 5e-4}, carts=_carts())
    whole.write(folder / "set")
    whole.write(folder / "parquet", table="parquet")
    replace(drawn, robot="machine.urdf", path=folder / "own").write(folder / "own")
    (folder / "own/machine.urdf").write_bytes(urdf_path("gantry_tau").read_bytes())
    commands = whole.take(np.unique(whole.pose, return_index=True)[1][:10]).commands
    for suffix in ("csv", "parquet"):
        commands.write(folder / f"commands.{suffix}")
    model = gtpin.calibrate(drawn).model
    write_model(model, folder / "calibrated/model")
    write_model(replace(model, effects=_effects(model, dataset)), folder / "bent")
    (folder / "scenario.toml").write_text(SCENARIO, encoding="utf-8")
    _write_four_bar(folder / "plane")
    pd.DataFrame({"pose": ["a", "b", "c"], "q1": [0.5, 0.9, 1.4]}).to_csv(folder / "one.csv", index=False)


def _effects(model: gtpin.Model, dataset: Dataset) -> tuple[ActiveEffect, ...]:
    """Some effects of a third of their typical size, with and without covariates and a nonlinear parameter."""
    at = OperatingPoints(model.kinematics, dataset.q, model.kinematics.forward(dataset.q), dataset.covariates)
    found = []
    for name, site, shape_parameter in (
        ("backlash", "cart2", None),
        ("rack_periodic", "cart1", 0.03),
        ("thermal_links", "arm", None),
        ("link_compliance", "arm", None),
        ("tracker_drift", "frame", None),
    ):
        effect = effects_by_id()[name]
        size = 0.3 * effect.basis(at, site, shape_parameter).sigma
        found.append(ActiveEffect(effect, site, shape_parameter, size, np.diag(0.01 * size**2), at.references))
    return tuple(found)


def _carts() -> CartMeasurements:
    cart, q = np.repeat([1, 2, 3], 12), np.tile(np.linspace(-0.8, 0.8, 12), 3)
    position = np.column_stack([q, 0.1 * cart + 1e-5 * np.sin(9.0 * q), 1e-5 * np.cos(7.0 * q)])
    orientation = np.tile([1.0, 0.0, 0.0, 0.0], (36, 1))
    return CartMeasurements(cart, q, position, orientation)


def _write_four_bar(folder: Path) -> None:
    inertia = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    links = "".join(f'\n  <link name="{name}">{inertia}</link>' for name in "abc")
    folder.mkdir()
    (folder / "machine.urdf").write_text(FOUR_BAR.format(links=links), encoding="utf-8")
    model = gtpin.read_model(folder / "machine.urdf")
    q = np.linspace(0.5, 1.5, 30)[:, None]
    poses = model.predict(q)
    ids = np.array([str(i) for i in range(30)], dtype=object)
    noise = np.random.default_rng(0).normal(0.0, 1e-5, (30, 3))
    Dataset("machine.urdf", ids, q, poses.T + noise, path=folder / "whole").write(folder / "whole")
    for file in (folder / "whole").iterdir():
        file.rename(folder / file.name)
    (folder / "whole").rmdir()
