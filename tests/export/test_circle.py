"""The circle of each export: a machine is measured, calibrated or diagnosed, and exported; its tool is where the file says.

The target was 71 mm off the tool and the tracker stood anywhere. Each file is used as its reader uses it; at 400 new poses the
tool of the machine is off by at most twice the error that the export states.
"""

from __future__ import annotations

import csv
import re
import warnings
from pathlib import Path

import closures
import numpy as np
import pandas as pd
import pinocchio as pin
import pytest
from by_pinocchio import placed
from circle_machines import Floats, Journey, journey, off
from drawn_machines import told
from printer_firmware import CONFIG_G, reprapfirmware
from scipy.interpolate import RegularGridInterpolator
from scipy.optimize import least_squares
from sdf_graph import Graph

import gtpin
from gtpin.data import Commands
from gtpin.errors import GtpinWarning
from gtpin.export import Box
from gtpin.extras.controllers.program import corrected_commands
from gtpin.model.departures import departures

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")]
JOURNEYS = [
    ("gantry_tau", ""),
    ("gantry_tau", "backlash"),
    ("linear_delta", ""),
    ("linear_delta", "rack_periodic"),
    ("ur10", ""),
    ("ur10", "backlash"),
    ("five_bar", ""),
    ("five_bar", "backlash"),
]


@pytest.fixture(scope="module", params=JOURNEYS, ids="-".join)
def way(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Journey:
    name, effect = request.param
    found = journey(name, effect, tmp_path_factory.mktemp(f"{name}{effect}"))
    assert [active.effect.id for active in found.model.effects] == [effect] * bool(effect)
    return found


def stated(notes: list[str]) -> float:
    """The expected error of the machine, m, of an export's messages."""
    (found,) = [m for m in (re.search(r"expected error of the machine's TCP of ([\d.]+)", note) for note in notes) if m]
    return 1e-6 * float(found[1])


def lost(notes: list[str]) -> float:
    """What an export says that its file does not hold, root sum square, m."""
    held = [note for note in notes if "does not hold" in note]
    return 1e-6 * float(np.linalg.norm([float(x) for note in held for x in re.findall(r"\(([\d.]+) um", note)]))


def program(way: Journey, folder: Path) -> tuple[Floats, list[str]]:
    """The corrected commands of a program of the new poses, and what the export says."""
    n = way.q.shape[1]
    around = {f"approach{i + 1}": way.approach for i in range(n)}
    Commands([f"n{i}" for i in range(len(way.q))], way.q, around).write(folder / "program.csv")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", GtpinWarning)
        corrected_commands(way.model, folder / "program.csv", None, folder / "corrected.csv", force=False)
    table = pd.read_csv(folder / "corrected.csv")
    return table[[f"q{i + 1}" for i in range(n)]].to_numpy(), [str(one.message) for one in said]


def test_a_corrected_program_brings_the_tool_to_where_it_was_meant(way: Journey, tmp_path: Path) -> None:
    q, notes = program(way, tmp_path)
    wanted = way.machine.nominal(way.q)[0]
    before, after = (off(way.machine.tool(one, way.approach), wanted) for one in (way.q, q))
    # Not far less either: where the tracker stood is no error of a machine.
    assert 0.1 * stated(notes) < after < 2.0 * stated(notes)
    assert after < before


def test_the_parameters_displace_the_tool_by_what_it_was_off(way: Journey) -> None:
    """Of first screens: where the machine stands is no part of it."""
    if not way.machine.rods or way.machine.effect:
        pytest.skip("the tool of a free target is no parameter")
    q, still = way.q[:300], np.zeros(300)
    moved = sum(one.displacement for one in departures(way.model, q))
    expected = off(way.machine.nominal(q)[0], way.machine.tool(q, still))
    assert np.sqrt((moved**2).sum(axis=1).mean()) == pytest.approx(expected, rel=0.1)


def tool_of(way: Journey, file: Path) -> Floats:
    """(N, 3) the tool of an exported robot at the new commands, as the geometry in the file has it."""
    robot, is_arm = way.model.robot, way.machine.name.startswith("ur")
    if file.suffix == ".sdf":
        graph = Graph(file)
        return graph.arm(robot, way.q) if is_arm else graph.closures(robot).follow(way.q - robot.home_q, 0.02)[0]
    if is_arm and not (file.suffix == ".xml" and way.machine.effect):  # with effects its joints are more than the arm's
        read = pin.buildModelFromUrdf if file.suffix == ".urdf" else pin.buildModelFromMJCF
        return placed(read(str(file)), way.q)[0]
    if file.suffix == ".urdf" and way.machine.rods:
        return closures.read(file.read_text(encoding="utf-8")).follow(way.q, 0.02)[0]
    return gtpin.read_model(file, tcp=robot.tcp_frame, actuators=[a.joint for a in robot.actuators]).predict(way.q).T


@pytest.mark.parametrize("suffix", ["urdf", "xml", "yaml", "sdf"])
def test_the_tool_of_an_exported_robot_is_the_machines(way: Journey, suffix: str, tmp_path: Path) -> None:
    if (suffix, way.machine.name) in (("yaml", "ur10"), ("sdf", "five_bar")):
        pytest.skip("of robots with loops" if suffix == "yaml" else "the reader of the tests knows rods and arms")
    notes = told(way.model, tmp_path / f"robot.{suffix}")
    expected = stated(program(way, tmp_path)[1])
    found = tool_of(way, tmp_path / f"robot.{suffix}")
    still = np.zeros(len(way.q))
    if way.machine.effect != "rack_periodic":  # the geometry alone
        assert off(found, way.machine.tool(way.q, still)) < 2.0 * expected
    if suffix != "xml":  # which holds effects that these readers do not read
        assert off(found, way.machine.tool(way.q, way.approach)) < 2.0 * np.hypot(expected, lost(notes))


def test_tables_of_actuators_bring_the_tool_to_where_the_calibrated_robot_is(way: Journey, tmp_path: Path) -> None:
    if not way.machine.effect:
        pytest.skip("there is nothing to correct")
    notes, wanted = told(way.model, tmp_path / "t.csv"), way.model.of_tool().kinematics.forward(way.q).T
    table, asked = pd.read_csv(tmp_path / "t.csv"), way.q.copy()
    for site, rows in table.groupby("actuator"):
        k = way.model.robot.sites.index(str(site))
        ways = (np.interp(way.q[:, k], rows.nominal, rows[name]) for name in ("forward", "reverse"))
        asked[:, k] = np.where(way.approach > 0.0, *ways)
    assert off(way.machine.tool(asked, way.approach), wanted) < 2.0 * stated(notes)
    notes, asked = told(way.model, tmp_path / "d.comp"), way.q.copy()
    for file in tmp_path.glob("*.comp"):
        k = way.model.robot.sites.index(file.stem.removeprefix("d_"))
        unit = 180.0 / np.pi if way.model.robot.revolute[k] else 1e3
        nominal, forward, reverse = np.loadtxt(file).T / unit
        trims = (np.interp(way.q[:, k], nominal, trim) for trim in (forward, reverse))
        asked[:, k] += np.where(way.approach > 0.0, *trims)
    assert off(way.machine.tool(asked, way.approach), wanted) < 2.0 * stated(notes)


def test_a_table_over_commands_brings_the_tool_to_where_it_was_meant(way: Journey, tmp_path: Path) -> None:
    n = way.q.shape[1]
    if n > 3 or not np.isfinite([way.model.robot.lower, way.model.robot.upper]).all():
        pytest.skip("a table over commands is of up to three actuators with ranges")
    notes = told(way.model, tmp_path / "g.csv", "grid")
    table = pd.read_csv(tmp_path / "g.csv")
    nodes = [np.unique(table[f"q{i + 1}"]) for i in range(n)]
    change = table[[f"dq{i + 1}" for i in range(n)]].to_numpy().reshape(*map(len, nodes), n)
    q = way.q + RegularGridInterpolator(nodes, change)(way.q)
    inside = np.isfinite(q).all(axis=1)
    assert inside.mean() > 0.9
    wanted = way.machine.nominal(way.q[inside])[0]
    assert off(way.machine.tool(q[inside], way.approach[inside]), wanted) < 2.0 * stated(notes)


def test_a_printers_tables_bring_the_tool_to_where_it_was_meant(way: Journey, tmp_path: Path) -> None:
    """RepRapFirmware's skew, offset and heights, with the nominal kinematics."""
    if not way.machine.rods:
        pytest.skip("a printer has three actuators")
    nominal = gtpin.read_model(way.machine.name)
    middle = nominal.kinematics.home.T[0]
    box = Box.of((-0.1, 0.1, -0.1, 0.1, -0.05, 0.05), middle)
    notes = told(way.model, tmp_path / "gtpin.g", box=box)
    (tmp_path / "config.g").write_text(CONFIG_G, encoding="utf-8")
    firmware = reprapfirmware(tmp_path)
    xyz = np.random.default_rng(0).uniform(box.low, box.high, (len(way.q), 3))
    q, _ = gtpin.commands_for(nominal.kinematics, 1e-3 * firmware.moves_to(1e3 * xyz) + middle)
    assert off(way.machine.tool(q, way.approach), xyz + middle) < 2.0 * stated(notes)


def chain(rows: list[dict[str, str]], q: Floats, *, corrected: bool) -> list[pin.SE3]:
    """The last frame of a table of Denavit and Hartenberg at commands, from the first axis on."""
    table: dict[str, dict[str, float]] = {}
    for row in rows:
        value = float(row["nominal"]) + corrected * float(row["correction"])
        table.setdefault(row["joint"], {})[row["parameter"]] = value
    x, y, z = np.eye(3)
    found = []
    for angles in q:
        at = pin.SE3.Identity()
        for own, angle in zip((table[joint] for joint in table if joint != "tool"), angles, strict=True):
            at *= pin.SE3(pin.exp3((own.get("theta", 0.0) + angle) * z), own.get("d", 0.0) * z)
            at *= pin.SE3(pin.exp3(own.get("alpha", 0.0) * x), own.get("a", 0.0) * x)
            at *= pin.SE3(pin.exp3(own.get("beta", 0.0) * y), np.zeros(3))
        found.append(at)
    return found


def test_the_table_of_an_arm_places_the_tool(way: Journey, tmp_path: Path) -> None:
    """Where the table stands in the base frame, and the tool in its last frame, follow from the nominal robot."""
    if not way.machine.name.startswith("ur"):
        pytest.skip("of a serial arm")
    told(way.model, tmp_path / "dh.csv", "dh")
    rows = list(csv.DictReader((tmp_path / "dh.csv").open(encoding="utf-8")))
    T, R = way.machine.nominal(way.q[:40])
    frames = chain(rows, way.q[:40], corrected=False)

    def gap(x: Floats) -> Floats:
        ends = [pin.exp6(x[:6]) * frame * pin.exp6(x[6:]) for frame in frames]
        turned = np.array([end.rotation for end in ends]) - R
        return np.concatenate([(np.array([end.translation for end in ends]) - T).ravel(), turned.ravel()])

    starts = (np.random.default_rng(seed).normal(0.0, 1.0, 12) for seed in range(10))
    best = min((least_squares(gap, start) for start in starts), key=lambda found: found.cost)
    assert np.abs(best.fun).max() < 1e-6
    tool = [(frame * pin.exp6(best.x[6:])).translation for frame in chain(rows, way.q, corrected=True)]
    expected = stated(program(way, tmp_path)[1])
    assert off(np.array(tool), way.machine.tool(way.q, np.zeros(len(way.q)))) < 2.0 * expected
