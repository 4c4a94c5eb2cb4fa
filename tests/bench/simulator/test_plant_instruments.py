"""What other instruments read of a virtual machine: their equations hold, and what is hidden has the contract's names."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.bench.simulator.case import drawn_recipe
from gtpin.bench.simulator.instruments.build import KINDS, build_measured, simulate_measured
from gtpin.bench.simulator.recipe import Recipe, SimulatedConditions, SimulatedNoise
from gtpin.bench.simulator.rods import Rods
from gtpin.bench.simulator.truth import InstrumentCase
from gtpin.data import Dataset
from gtpin.errors import GtpinError
from gtpin.instruments.readings import Readings, single
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.poses import Poses

EXACT = 1e-9
ALL = tuple(kind for kind in KINDS if kind != "encoder")
TABLES = {"tracker": "tracker", "camera": "camera", "range": "wire", "plane": "bed", "socket": "cup", "tilt": "level"}
TABLES |= {"ballbar": "ballbar"}


def recipe(effects: list[tuple[str, str | None]], robot: str = "gantry_tau", **changed: object) -> Recipe:
    return drawn_recipe(
        2,
        effects=effects,
        poses=24,
        held_out=4,
        background=False,
        robot=robot,
        conditions=SimulatedConditions(),
        noise=SimulatedNoise(**changed),  # type: ignore[arg-type]
    )


class Written:
    """A dataset in its folder, with the truth: what a reader has, and nothing of the plant."""

    def __init__(self, case: InstrumentCase, folder: Path) -> None:
        case.write_dataset(folder / "it")
        case.write_truth(folder, "it")
        self.truth = json.loads((folder / "it.truth.json").read_text())
        described = tomllib.loads((folder / "it" / "dataset.toml").read_text())
        self.described = {one["name"]: one for one in described["instrument"]}
        self.table = {name: pd.read_csv(folder / "it" / f"{name}.csv") for name in self.described}

    def commands(self, name: str) -> np.ndarray:
        table = self.table[name]
        return table[[c for c in table.columns if c[0] == "q" and c[1:].isdecimal()]].to_numpy()

    def hidden(self, name: str) -> np.ndarray:
        return np.array([self.truth["instruments"][f"{name}.{axis}"] for axis in "xyz"])

    def turned(self, name: str) -> Rotation:
        return Rotation.from_rotvec([self.truth["instruments"].get(f"{name}.r{axis}", 0.0) for axis in "xyz"])

    def targets(self, name: str, poses: Poses) -> np.ndarray:
        table = self.table[name]
        ids = table["target"] if "target" in table else [""] * len(table)
        at = np.array([self.hidden(f"{name}.target[{one}]" if one else f"{name}.target") for one in ids])
        return poses.T + np.einsum("nij,nj->ni", poses.R, at)


def misses(written: Written, kind: str, poses: Poses, up: np.ndarray) -> np.ndarray:
    """By how much the equation of each row does not hold, by the formulas of the contract."""
    name = TABLES[kind]
    table, hidden = written.table[name], written.truth["instruments"]
    if kind == "tracker":
        seen = Rotation.from_quat(table[["qw", "qx", "qy", "qz"]].to_numpy(), scalar_first=True)
        turn = (seen * Rotation.from_matrix(poses.R).inv()).as_rotvec()
        return np.hstack([table[["x", "y", "z"]].to_numpy() - poses.T, turn])
    if kind == "tilt":
        sensor = Rotation.from_matrix(poses.R) * written.turned("level.mount")
        return np.asarray(table[["tilt_x", "tilt_y"]].to_numpy() - sensor.inv().apply(up)[:, :2])
    p = written.targets(name, poses)
    if kind == "camera":
        frame = written.turned("camera.frame").apply(p) + written.hidden("camera.frame")
        return np.asarray(table[["x", "y", "z"]].to_numpy() - frame)
    if kind in ("range", "ballbar"):
        centres = np.array([written.hidden(f"{name}.station[{one}]") for one in table["station"]])
        offsets = np.array([hidden[f"{name}.offset[{one}]"] for one in table["station"]])
        return np.asarray(table["range"] - np.linalg.norm(p - centres, axis=1) - offsets)
    if kind == "socket":
        return np.asarray(p - np.array([written.hidden(f"cup.point[{one}]") for one in table["socket"]]))
    found = np.empty(len(table))
    for i, plane in enumerate(table["plane"]):
        n = np.array(written.described["bed"]["planes"][plane]["normal"])
        point = np.array(written.described["bed"]["planes"][plane]["point"])
        axis = np.eye(3)[np.argmin(np.abs(n))]
        e_a = axis - (axis @ n) * n
        e_a /= np.linalg.norm(e_a)
        a, b, height = (hidden[f"bed.plane[{plane}].{what}"] for what in ("a", "b", "height"))
        tilted = Rotation.from_rotvec(a * e_a + b * np.cross(n, e_a)).apply(n)
        found[i] = tilted @ (p[i] - point) - height
    return found


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["gantry_tau", "linear_delta", "stewart", "ur5"])
def test_every_row_is_an_equation_that_pinocchio_s_kinematics_of_the_true_geometry_fulfil(
    robot: str, tmp_path: Path, exact: None
) -> None:
    nominal = gtpin.load_robot(robot)
    written = Written(simulate_measured(nominal, robot, ALL, poses=24, seed=5, held_out=3), tmp_path)
    geometry = gtpin.Geometry.nominal(nominal)
    off = np.array([written.truth["geometry"][name] for name in geometry.names])
    true = Kinematics(geometry.with_values(geometry.values + off))
    for kind in ALL:
        poses = true.forward(written.commands(TABLES[kind]))
        assert np.abs(misses(written, kind, poses, nominal.up)).max() < EXACT, kind
        assert len(poses) >= 8


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["gantry_tau", "ur5"])
@pytest.mark.parametrize("effect", ["backlash", "rack_periodic", "joint_clearance", "frame_shift"])
def test_what_touches_does_so_with_all_errors_of_the_machine(
    robot: str, effect: str, tmp_path: Path, exact: None
) -> None:
    case = build_measured(recipe([(effect, None)], robot), ["plane", "socket"])
    written = Written(case, tmp_path)
    bare = build_measured(recipe([], robot, repeatability=(0.0, 0.0)), ["plane", "socket"])
    assert not np.array_equal(case.dataset.q, bare.dataset.q)
    for kind, gauge in zip(("plane", "socket"), case.gauges, strict=True):
        true = case.true[gauge.stop]
        poses = Poses(true.T, true.R)
        assert len(poses) >= 20
        assert np.abs(misses(written, kind, poses, np.array([0.0, 0.0, 1.0]))).max() < EXACT


@pytest.mark.slow
def test_readings_scatter_by_their_sigma() -> None:
    case = build_measured(replace(recipe([]), poses=150), ALL)
    rows = {read.described["name"]: read for read in case.dataset.read}
    for gauge in case.gauges:
        here, read = case.true[gauge.stop], rows[gauge.name]
        if gauge.touches:
            errors = gauge.readings(here, gauge.truth)
        else:
            exact = gauge.recorded(here, np.zeros(gauge.sigma.shape))
            names = [n for n in ("x", "y", "z", "range", "tilt_x", "tilt_y") if n in exact]
            errors = np.column_stack([read.columns[n] - exact[n] for n in names])
        z = errors / gauge.sigma[:, : errors.shape[1]]
        # Five standard errors of a standard deviation.
        assert abs(float(np.std(z)) - 1.0) < 5.0 / np.sqrt(2.0 * z.size), gauge.name


@pytest.mark.slow
def test_energy_is_that_of_the_readings_past_geometry_and_the_instruments_unknowns() -> None:
    exact = recipe([("straightness", "cart3")], repeatability=(0.0, 0.0))
    case = build_measured(exact, ["range", "plane", "tilt"])
    (truth,) = case.effects
    machine, q = case.machine, case.dataset.q
    geometry = machine.geometry
    first = Rods(geometry).predict(q)
    rows, columns, d = 0, [], []
    for step in np.diag(1e-2 * geometry.tolerance):
        there, back = (Rods(geometry.with_values(geometry.values + s * step)).predict(q) for s in (1, -1))
        columns.append(
            np.concatenate(
                [
                    ((g.readings(there[g.stop], g.truth) - g.readings(back[g.stop], g.truth)) / 2e-2 / g.sigma).ravel()
                    for g in case.gauges
                ]
            )
        )
    total = len(columns[0])
    for g in case.gauges:
        here, size = first[g.stop], g.sigma.size
        for i, hidden in enumerate(g.hidden):
            step = np.zeros(len(g.hidden))
            step[i] = 1e-4 * hidden.prior
            pair = [g.readings(here, g.truth + s * step) for s in (1, -1)]
            column = np.zeros(total)
            column[rows : rows + size] = ((pair[0] - pair[1]) / 2e-4 / g.sigma).ravel()
            columns.append(column)
        moved = truth.displacement[sum(len(o.stop) for o in case.gauges[: case.gauges.index(g)]) :][: len(g.stop)]
        seen = type(first)(here.T + moved[:, :3], Rotation.from_rotvec(moved[:, 3:]).as_matrix() @ here.R)
        d.append(((g.readings(seen, g.truth) - g.readings(here, g.truth)) / g.sigma).ravel())
        rows += size
    B, change = np.array(columns).T, np.concatenate(d)
    whole = change @ np.linalg.solve(np.eye(total) + B @ B.T, change)
    assert truth.noncentrality == pytest.approx(whole, rel=1e-3)
    assert truth.noncentrality == pytest.approx(exact.wanted[0].noncentrality, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["gantry_tau", "ur5"])
def test_what_is_hidden_has_the_names_and_the_priors_that_a_reader_of_the_dataset_gives_it(
    robot: str, tmp_path: Path
) -> None:
    case = build_measured(recipe([], robot, free=True), ALL)
    case.write_dataset(tmp_path / "it")
    nominal = gtpin.load_robot(robot)
    unknowns = {one.name: one for one in Readings.of(single(Dataset.read(tmp_path / "it"), nominal), nominal).unknowns}
    assert set(unknowns) == set(case.hidden)
    for one in (one for gauge in case.gauges for one in gauge.hidden):
        assert unknowns[one.name].sigma == one.prior
        if np.isfinite(one.prior):
            assert abs(one.value - unknowns[one.name].nominal) < 5.0 * one.prior


@pytest.mark.slow
def test_same_seed_same_bytes_and_other_instruments_leave_what_is_hidden_as_it_is(tmp_path: Path) -> None:
    made = [build_measured(recipe([("linearity", None)]), kinds) for kinds in (["range", "plane"], ["range", "plane"])]
    for i, case in enumerate(made):
        case.write_dataset(tmp_path / str(i))
        case.write_truth(tmp_path, str(i))
    for name in ("dataset.toml", "wire.csv", "bed.csv", "commands.csv"):
        assert (tmp_path / "0" / name).read_bytes() == (tmp_path / "1" / name).read_bytes()
    assert (tmp_path / "0.truth.json").read_bytes() == (tmp_path / "1.truth.json").read_bytes()
    more = build_measured(recipe([("linearity", None)]), ["tilt", "range", "socket"])
    assert {k: v for k, v in more.hidden.items() if k.startswith("wire.offset")} == {
        k: v for k, v in made[0].hidden.items() if k.startswith("wire.offset")
    }


@pytest.mark.slow
def test_an_undeclared_sigma_is_not_written_and_gross_errors_are_there() -> None:
    case = build_measured(replace(recipe([], declared=False, gross=0.1), poses=100), ALL)
    for gauge in case.gauges:
        assert not {"sigma", "position_sigma", "orientation_sigma"} & set(gauge.described)
    (wire,) = (gauge for gauge in case.gauges if gauge.name == "wire")
    (read,) = (read for read in case.dataset.read if read.described["name"] == "wire")
    off = np.abs(read.columns["range"] - wire.readings(case.true[wire.stop], wire.truth)[:, 0]) > 6.0 * wire.sigma[:, 0]
    assert 0.05 < off.mean() < 0.15


@pytest.mark.slow
def test_held_out_readings_are_without_noise_and_have_their_ids_in_turn() -> None:
    case = simulate_measured(gtpin.load_robot("ur5"), "ur5", ALL, poses=8, seed=2, held_out=9)
    assert set(case.held) == {"tracker", "camera", "wire", "level", "ballbar"}
    geometry = gtpin.Geometry.nominal(gtpin.load_robot("ur5"))
    off = np.array([case.machine.parameters[name] for name in geometry.names])
    poses = Kinematics(geometry.with_values(geometry.values + off)).forward(case.commands.q)
    hidden = case.hidden
    target = np.array([hidden[f"wire.target.{axis}"] for axis in "xyz"])
    for i, station in enumerate("ABCDABCDA"):
        centre = np.array([hidden[f"wire.station[{station}].{axis}"] for axis in "xyz"])
        away = np.linalg.norm(poses.T[i] + poses.R[i] @ target - centre) + hidden[f"wire.offset[{station}]"]
        assert abs(case.held["wire"][0][i, 0] - away) < EXACT


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["gantry_tau", "linear_delta", "ur5"])
def test_a_ball_bar_goes_round_circles_both_ways_and_approach_and_speed_follow(robot: str) -> None:
    case = build_measured(replace(recipe([], robot), poses=96), ["ballbar"])
    (read,) = case.dataset.read
    assert np.ptp(read.columns["range"]) < 0.03  # the bar's length, but for where the pivot is and for the geometry
    q, covariates = case.dataset.q[read.stop], case.dataset.covariates
    names = [f"{{}}{i + 1}" for i in range(q.shape[1])]
    speed, approach = (
        np.column_stack([covariates[n.format(w)][read.stop] for n in names]) for w in ("speed", "approach")
    )
    moving = np.abs(speed) > 1e-4
    assert (np.sign(speed)[moving] == approach[moving]).all()
    assert (np.diff(covariates["time"][read.stop]) > 0.0).all()
    points = 16
    there, back = q[:points], q[points : 2 * points]
    np.testing.assert_allclose(there, back[::-1])
    np.testing.assert_allclose(speed[:points], -speed[points : 2 * points][::-1])
    # The nominal target stays at one distance from the pivot, and moves along the circle at the feed.
    nominal, step = Kinematics(gtpin.Geometry.nominal(gtpin.load_robot(robot))), 1e-3
    target, pivot = np.array(read.described["target"]), np.array(read.described["stations"]["pivot"])
    here, before, after = (nominal.forward(q + s * step * speed) for s in (0.0, -1.0, 1.0))
    arms, ways = here.T + here.R @ target - pivot, after.T + after.R @ target - before.T - before.R @ target
    np.testing.assert_allclose(np.linalg.norm(arms, axis=1), np.linalg.norm(arms[0]), atol=1e-8)
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1) / (2.0 * step), 0.02, rtol=1e-3)
    assert np.abs(np.einsum("ni,ni->n", ways, arms)).max() < 1e-3 * np.linalg.norm(ways[0]) * np.linalg.norm(arms[0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("instruments", "robot", "what"),
    [
        (["laser"], "gantry_tau", "no instrument is called 'laser'"),
        (["range", "range"], "gantry_tau", "comes twice"),
        (["encoder"], "ur5", "can be read by an encoder"),
        (["socket"], "asr_twodof", "does not get to all"),
        (["ballbar"], "double_pendulum", "go round a ball bar's circles"),
        ([], "gantry_tau", "0 instruments"),
    ],
)
def test_what_can_t_be_measured_is_refused(instruments: list[str], robot: str, what: str) -> None:
    with pytest.raises(GtpinError, match=what):
        simulate_measured(gtpin.load_robot(robot), robot, instruments, poses=8, held_out=2)
    with pytest.raises(GtpinError, match=what):
        build_measured(recipe([], robot), instruments)


def test_a_free_target_and_instruments_exclude_each_other() -> None:
    with pytest.raises(GtpinError, match="free target"):
        build_measured(recipe([], "ur5", free_target=True), ["range"])


@pytest.mark.slow
def test_instruments_other_than_a_tracker_measure_machines_with_loops_and_their_effects() -> None:
    robot = Path(__file__).parents[3] / "examples" / "loops" / "five_bar.urdf"
    recipe = drawn_recipe(2, effects=[("backlash", "drive_right")], poses=30, held_out=5, robot=str(robot))
    case = build_measured(recipe, ("range", "tilt"))
    assert case.effects[0].noncentrality > 1.0
    assert "placement[elbow_right].x" in case.machine.parameters
