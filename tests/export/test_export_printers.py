"""Corrections for printers: read and used as the firmwares do, they leave as much as the command says."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn_machines import Drawn, told
from printer_firmware import ARM, BED, CONFIG_G, END, PRINTER_CFG, RADIUS, ROTATION, Firmware, klipper, reprapfirmware
from with_effects import active

import gtpin
from gtpin.errors import GtpinError
from gtpin.export import Box, TablesFor, export
from gtpin.extras.controllers.plane_tables import PlaneTables
from gtpin.extras.controllers.printer_files import klipper_config, rrf_heightmap, rrf_macro
from gtpin.extras.importers.klipper import read_klipper_mesh
from gtpin.extras.importers.rrf import read_rrf_heightmap

BOX = Box.of((-0.15, 0.15, -0.12, 0.12, 0.0, 0.2), (0.0, 0.0, 1e-3 * BED))
READERS = {"gtpin.cfg": klipper, "gtpin.g": reprapfirmware}
FILES = {"gtpin.cfg": "printer.cfg", "gtpin.g": "config.g"}
AT_TEMPERATURE = {"gtpin.cfg": "gtpin_{}", "gtpin.g": "gtpin_{}.g"}
"""A macro of Klipper, and a file of RepRapFirmware."""


@pytest.fixture
def printer(drawn_of: Callable[[str], Drawn]) -> gtpin.Model:
    """A delta with errors of geometry, drives and temperature."""
    drawn = drawn_of("linear_delta")
    model, q, count = drawn.model, drawn.q, len(drawn.q)
    around = {f"approach{k}": np.ones(count) for k in (1, 2, 3)} | {"temp_link": np.linspace(18.0, 26.0, count)}
    return replace(
        model,
        effects=(
            active(model, q, "linearity", "cart1", first=8e-5),
            active(model, q, "encoder_scale", "cart2", covariates=around, first=3e-4),
            active(model, q, "backlash", "cart3", covariates=around, first=2e-5),
            active(model, q, "thermal_links", "arm", covariates=around, first=1.2e-5),
        ),
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "printer.cfg").write_text(PRINTER_CFG, encoding="utf-8")
    (tmp_path / "config.g").write_text(CONFIG_G, encoding="utf-8")
    return tmp_path


def commands(firmware: Firmware, present: Firmware, xyz: np.ndarray) -> np.ndarray:
    """(N, 3) gtpin's commands q, m, of positions of a program, m: where the steps of a firmware bring the carriages.

    On the shipped robot q is how far a carriage is above where the nominal geometry has it at home.
    """
    robot = gtpin.load_robot("linear_delta")
    home = 1e3 * gtpin.home(robot).T - [0.0, 0.0, BED]
    at_home = np.sqrt(ARM**2 - RADIUS**2) + home[2]
    top = END + np.sqrt(ARM**2 - RADIUS**2)
    return 1e-3 * (top - firmware.steps(firmware.moves_to(1e3 * xyz)) * present.step - at_home)


def fresh(count: int = 2000) -> np.ndarray:
    return np.random.default_rng(0).uniform(BOX.low, BOX.high, (count, 3))


def rms(off: np.ndarray) -> float:
    return 1e6 * float(np.sqrt((off**2).sum(axis=1).mean()))


def left(model: gtpin.Model, firmware: Firmware, present: Firmware, temperature: float = 20.0) -> tuple[float, float]:
    """What is between the TCP and where it was wanted, in all and in z, um; half of the places are approached from below."""
    wanted = fresh()
    way = np.where(np.random.default_rng(1).permutation(len(wanted)) % 2, 1.0, -1.0)
    around = {f"approach{k}": way for k in (1, 2, 3)} | {"temp_link": np.full(len(wanted), temperature)}
    off = model.predict(commands(firmware, present, wanted), around).T - wanted - BOX.origin
    return rms(off), rms(off[:, 2:])


def printed(words: list[str]) -> list[tuple[float, ...]]:
    """What was said to be left, and of how much; then the same of z, micrometres."""
    pattern = r"leaves (\S+) of (\S+) um of the TCP's error in .* \(z: (\S+) of (\S+) um\)"
    return [tuple(map(float, match.groups())) for word in words if (match := re.search(pattern, word))]


def test_the_firmware_without_corrections_is_the_nominal_robot(folder: Path) -> None:
    xyz = fresh(50)
    nominal = gtpin.read_model("linear_delta")
    for read in READERS.values():
        there = nominal.predict(commands(read(folder), read(folder), xyz)).T
        np.testing.assert_allclose(there - BOX.origin, xyz, rtol=0, atol=1e-9)


def test_firmwares_do_what_the_tables_say(folder: Path) -> None:
    """Signs and places, with skews and offsets far larger than those of a machine."""
    rng = np.random.default_rng(3)
    x, y = np.linspace(-0.1, 0.1, 5), np.linspace(-0.05, 0.15, 4)
    table = PlaneTables(rng.normal(0.0, 2e-3, 2), rng.normal(0.0, 2e-2, 3), x, y, rng.normal(0.0, 1e-3, (4, 5)))
    (folder / "gtpin.cfg").write_text(klipper_config("a printer", [(None, table)]), encoding="utf-8")
    (folder / "gtpin.g").write_text(rrf_macro("a printer", table, "heights.csv"), encoding="utf-8")
    (folder / "heights.csv").write_text(rrf_heightmap(table), encoding="utf-8")
    xyz = rng.uniform(-0.2, 0.2, (200, 3))
    for read in READERS.values():
        np.testing.assert_allclose(1e-3 * read(folder).moves_to(1e3 * xyz), table.applied(xyz), rtol=0, atol=2e-8)


@pytest.mark.slow
@pytest.mark.parametrize("file", READERS)
@pytest.mark.parametrize("dimensions", [True, False])
@pytest.mark.study
def test_a_delta_is_as_near_as_the_command_says(
    printer: gtpin.Model, folder: Path, file: str, dimensions: bool
) -> None:
    present = READERS[file](folder)
    words = told(printer, folder / file, box=BOX, firmware=folder / FILES[file] if dimensions else None)
    ((after, before, after_z, before_z),) = printed(words)
    found, found_z = left(printer, READERS[file](folder), present)
    # Places differ, so the means over them do, by some per cent.
    assert left(printer, present, present) == pytest.approx((before, before_z), rel=0.05)
    assert found == pytest.approx(after, rel=0.05)
    assert found_z == pytest.approx(after_z, rel=0.1)
    assert after < 0.3 * before
    assert after_z < 0.1 * before_z


@pytest.mark.slow
def test_lengths_of_parts_are_told_for_each_axis(printer: gtpin.Model, folder: Path) -> None:
    """A drive of three with a wrong scale stretches x and presses y."""
    text = " ".join(told(replace(printer, effects=printer.effects[1:2]), folder / "gtpin.cfg", box=BOX))
    said = re.findall(r"in [xy] off by (\S+) % \(before (\S+) %\)", text)
    wanted, present = fresh(), klipper(folder)
    (folder / "bare").mkdir()
    (folder / "bare" / "printer.cfg").write_text(PRINTER_CFG, encoding="utf-8")
    for way, firmware in enumerate((present, klipper(folder / "bare"))):
        there = replace(printer, effects=printer.effects[1:2]).predict(
            commands(firmware, klipper(folder / "bare"), wanted), {"temp_link": np.full(len(wanted), 20.0)}
        )
        off = there.T - wanted - BOX.origin
        true = [100.0 * np.polyfit(wanted[:, k], off[:, k], 1)[0] for k in (0, 1)]
        assert [float(one[way]) for one in said] == pytest.approx(true, abs=0.03)
    assert abs(true[0] - true[1]) > 0.02


@pytest.mark.slow
def test_dimensions_hold_what_is_one(drawn_of: Callable[[str], Drawn], folder: Path) -> None:
    """A scale of a drive is a rotation_distance: it is taken away whole, and only where it belongs."""
    drawn = drawn_of("linear_delta")
    nominal = gtpin.read_model("linear_delta")
    scale = active(nominal, drawn.q, "encoder_scale", "cart2", first=3e-4)
    scaled = replace(nominal, effects=(scale,))
    words = told(scaled, folder / "gtpin.cfg", box=BOX, firmware=folder / "printer.cfg")
    assert "leaves under 0.01 of" in words[0]
    new = klipper(folder)
    np.testing.assert_allclose(new.step * 3200.0, [ROTATION, ROTATION * (1.0 + 3e-4), ROTATION], rtol=1e-7)
    np.testing.assert_allclose(new.arms, ARM, rtol=0, atol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("file", READERS)
def test_each_temperature_has_tables_of_its_own(printer: gtpin.Model, folder: Path, file: str) -> None:
    present = READERS[file](folder)
    words = told(printer, folder / file, temperatures=(20.0, 35.0), box=BOX, firmware=folder / FILES[file])
    cold, warm = (READERS[file](folder, AT_TEMPERATURE[file].format(t)) for t in (20, 35))
    for firmware, t, (after, _, after_z, _) in zip((cold, warm), (20.0, 35.0), printed(words), strict=True):
        found, found_z = left(printer, firmware, present, t)
        assert found == pytest.approx(after, rel=0.05)
        assert found_z == pytest.approx(after_z, rel=0.1)
    assert left(printer, cold, present, 35.0)[1] > 3.0 * after_z
    if file == "gtpin.cfg":
        macros = re.findall(r"\[gcode_macro (\S+)\]", (folder / file).read_text())
        assert not re.search(r"\d[A-Z_]", " ".join(macros))


@pytest.mark.slow
@pytest.mark.study
def test_temperatures_are_whole_degrees(printer: gtpin.Model, folder: Path) -> None:
    """Klipper takes GTPIN_22C and GTPIN_22_5 for the command GTPIN_22 (docs/Command_Templates.md)."""
    for temperature in (22.5, -3.0):
        with pytest.raises(GtpinError, match="whole degrees"):
            export(printer, folder / "gtpin.cfg", tables=TablesFor(temperatures=(temperature,), box=BOX))


@pytest.mark.slow
def test_a_gantry_tau_has_tables_beside_its_own_kinematics(drawn_of: Callable[[str], Drawn], tmp_path: Path) -> None:
    """Offset, skew and heights need no delta; the controller has the nominal geometry."""
    model, nominal = drawn_of("gantry_tau").model, gtpin.read_model("gantry_tau")
    middle = nominal.kinematics.home.T[0]
    box = Box.of((-0.2, 0.2, -0.2, 0.2, -0.1, 0.1), middle)
    ((after, before, after_z, before_z),) = printed(told(model, tmp_path / "gtpin.g", box=box))
    (tmp_path / "config.g").write_text(CONFIG_G)
    firmware = reprapfirmware(tmp_path)
    xyz = np.random.default_rng(0).uniform(box.low, box.high, (500, 3))
    off = []
    for asked in (xyz, 1e-3 * firmware.moves_to(1e3 * xyz)):
        q, _ = gtpin.commands_for(nominal.kinematics, asked + middle)
        off.append(model.predict(q).T - xyz - middle)
    assert [rms(off[0]), rms(off[1])] == pytest.approx([before, after], rel=0.06)
    assert [rms(off[0][:, 2:]), rms(off[1][:, 2:])] == pytest.approx([before_z, after_z], rel=0.1)
    assert after < before
    assert after_z < before_z


@pytest.mark.slow
@pytest.mark.study
def test_a_controller_with_the_calibrated_geometry_is_left_with_the_effects(printer: gtpin.Model, folder: Path) -> None:
    calibrated = replace(printer, effects=())
    words = told(printer, folder / "gtpin.cfg", controller=calibrated, box=BOX)
    ((after, before, _, _),) = printed(words)
    assert after < before < 100.0
    assert not any("geometry" in word for word in words)


@pytest.mark.slow
def test_what_is_left_of_each_part_is_named(printer: gtpin.Model, folder: Path) -> None:
    words = "\n".join(told(printer, folder / "gtpin.cfg", box=BOX, firmware=folder / "printer.cfg"))
    assert re.search(r"gtpin.cfg does not hold thermal_links@arm \(\S+ um for each K off the file's 20 degC\)", words)
    parts = re.search(r"leaves of each part alone: (.*)", words)
    assert parts
    found = {
        m[1]: (float(m[2]), float(m[3]))
        for m in re.finditer(r"(\S+) (\S+) of (\S+) um", parts[1].replace("under ", ""))
    }
    assert set(found) == {"geometry", "linearity@cart1", "encoder_scale@cart2", "backlash@cart3"}
    # A table has one number for both directions.
    assert found["backlash@cart3"][0] == pytest.approx(found["backlash@cart3"][1], rel=0.02)
    assert found["linearity@cart1"][0] < 0.2 * found["linearity@cart1"][1]


@pytest.mark.slow
@pytest.mark.study
def test_importers_read_the_tables_back(printer: gtpin.Model, folder: Path) -> None:
    for file in READERS:
        assert told(printer, folder / file, box=BOX)
    mesh = read_klipper_mesh(folder / "printer.cfg", "gtpin")
    heights = read_rrf_heightmap(folder / "gtpin_heightmap.csv")
    assert mesh.position is not None
    assert heights.position is not None
    assert len(mesh.position) == 441
    np.testing.assert_allclose(mesh.position, heights.position, rtol=0, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "tables", "message"),
    [
        ("stewart", TablesFor(box=BOX), "stewart has 6 actuators"),
        ("linear_delta", None, "need --box"),
        ("linear_delta", TablesFor(box=BOX, temperatures=(20.0,)), "no effect of the model depends on a temperature"),
        ("linear_delta", TablesFor(box=Box.of((-2, 2, -2, 2, 0, 1))), "can't bring its TCP to"),
        ("linear_delta", TablesFor(gtpin.read_model("stewart"), box=BOX), "is of another robot"),
        ("linear_delta", TablesFor(box=BOX), "nothing to correct: the model is what the controller has"),
    ],
)
def test_what_a_printer_can_not_be_told_is_one_error(
    robot: str, tables: TablesFor | None, message: str, tmp_path: Path
) -> None:
    for file in READERS:
        with pytest.raises(GtpinError, match=message):
            export(gtpin.read_model(robot), tmp_path / file, tables=tables)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("printer.cfg", f"arm_length: {ARM}", "arm_length: 990", r"by these dimensions, by \d"),
        (
            "printer.cfg",
            f"rotation_distance: {ROTATION}\nmicrosteps: 16\n[bed_mesh]",
            "[bed_mesh]",
            "rotation_distance",
        ),
        ("printer.cfg", "[stepper_a]", "[stepper_x]", "arm_length"),
        ("config.g", f"R{RADIUS}", "R600", r"by these dimensions, by \d"),
        ("config.g", f"H{END}", "", "M665 has no H"),
        ("config.g", "Y80.00", "", "M92 has no Y"),
        ("config.g", "A0.0", "A0.5", "M666 tilts the bed"),
        ("config.g", f"L{ARM}", "L400", "a dimension can't be"),
        ("config.g", f"L{ARM}", "L9.9.9", "is not a number"),
    ],
)
def test_a_firmware_of_another_printer_is_refused(folder: Path, file: str, old: str, new: str, message: str) -> None:
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))
    target = next(key for key, value in FILES.items() if value == file)
    with pytest.raises(GtpinError, match=message):
        export(gtpin.read_model("linear_delta"), folder / target, tables=TablesFor(box=BOX, firmware=folder / file))
    assert not (folder / target).exists()


def test_a_box_is_a_box() -> None:
    for ends in ((0, 0, 0, 1, 0, 1), (0, 1, 1, 0, 0, 1), (0, 1, 0, 1, 0, np.nan), (0, 1, 0, 1, 0)):
        with pytest.raises(GtpinError, match="this is no box"):
            Box.of(ends)
    with pytest.raises(GtpinError, match="looks like millimetres"):
        Box.of((-80, 80, -80, 80, 0, 150))
