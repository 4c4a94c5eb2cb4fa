"""Files of Klipper: the commands are where the machine was when it touched; includes are read as Klipper reads them."""

from __future__ import annotations

import time
import warnings
from pathlib import Path

import numpy as np
import pytest
from printed import ANGLES, ARM, MESH, ORIGIN, PROBED, RADIUS, STEP, Write, carriages, mesh_cfg, places, printer_cfg

import gtpin
from gtpin.errors import DatasetError, GtpinWarning
from gtpin.extras.importers.klipper import read_klipper_delta, read_klipper_mesh, read_klipper_probe
from gtpin.extras.importers.klipper_config import read_config
from gtpin.extras.importers.touches import commands

KINEMATICS = gtpin.read_model("linear_delta").kinematics


@pytest.mark.parametrize(
    "printer", [{}, {"believed_radius": 1.01 * 524.25}, {"angles": (ANGLES[2], ANGLES[0], ANGLES[1])}]
)
def test_commands_are_the_recorded_travel_whatever_the_firmware_believed_and_the_order_of_its_drives(
    write: Write, printer: dict[str, object]
) -> None:
    xyz = places()
    touches = read_klipper_delta(write("printer.cfg", printer_cfg(xyz, **printer)))  # type: ignore[arg-type]
    q, poses = commands(touches, KINEMATICS, np.array(ORIGIN))
    np.testing.assert_allclose(np.diff(q, axis=0), 1e-3 * np.diff(carriages(xyz), axis=0), atol=1e-7)
    if not printer:
        np.testing.assert_allclose(poses.T, 1e-3 * xyz + ORIGIN, atol=1e-7)  # steps have three decimals


@pytest.mark.parametrize(
    "drive",
    [
        f"step_distance: {STEP}",
        "rotation_distance: 40\nmicrosteps: 16 ; fine",
        "rotation_distance: 80\nmicrosteps: 8\nfull_steps_per_rotation: 400\ngear_ratio: 2:1",
        "rotation_distance: 240\nmicrosteps: 16\ngear_ratio: 60:20, 2:1",
    ],
)
def test_a_step_is_as_long_as_klipper_s_options_say(write: Write, drive: str) -> None:
    xyz = places()
    touches = read_klipper_delta(write("printer.cfg", printer_cfg(xyz, drive=drive)))
    assert touches.travel is not None
    np.testing.assert_allclose(np.diff(touches.travel, axis=0), -1e-3 * np.diff(carriages(xyz), axis=0), atol=1e-7)


def test_the_probe_s_offset_is_the_height_of_the_nozzle_over_the_bed(write: Write) -> None:
    touches = read_klipper_delta(write("printer.cfg", printer_cfg(places(), height=2.5)))
    np.testing.assert_allclose(touches.height, 2.5e-3)


def test_a_printer_of_other_dimensions_is_refused(write: Write) -> None:
    touches = read_klipper_delta(write("printer.cfg", printer_cfg(places(), believed_radius=800.0)))
    with pytest.raises(DatasetError, match="travel otherwise"):
        commands(touches, KINEMATICS, np.array(ORIGIN))


def test_what_was_measured_by_hand_is_left_out_with_a_warning(write: Write) -> None:
    by_hand = "#*# manual_height0 = 250.1\n#*# manual_height0_pos = 1.0,2.0,3.0\n#*# distance0 = 64.82\n"
    with pytest.warns(GtpinWarning, match="distance0, manual_height0"):
        touches = read_klipper_delta(write("printer.cfg", printer_cfg(places(7)) + by_hand))
    assert len(touches) == 7


def test_options_of_included_files_count(write: Write) -> None:
    text = printer_cfg(places())
    drive = "rotation_distance: 40\nmicrosteps: 16"
    write("parts/steppers.cfg", "\n".join(f"[stepper_{tower}]\n{drive}" for tower in "abc"))
    split = write("printer.cfg", "[include parts/*.cfg]\n" + text.replace(drive, "endstop_pin: PE5"))
    whole = write("whole.cfg", text)
    np.testing.assert_array_equal(read_klipper_delta(split).travel, read_klipper_delta(whole).travel)


def test_corners_of_a_round_mesh_that_nobody_probed_are_left_out(write: Write) -> None:
    touches = read_klipper_mesh(write("printer.cfg", mesh_cfg(MESH)))
    expected = [[0, -100, 0.1], [-100, 0, 0.2], [0, 0, 0.0], [100, 0, -0.2], [0, 100, 0.3]]
    np.testing.assert_allclose(touches.position, 1e-3 * np.array(expected), atol=1e-15)
    assert len(read_klipper_mesh(write("square.cfg", mesh_cfg(MESH, round_=False)))) == 9


@pytest.mark.parametrize(
    ("kinematics", "radius", "warned"),
    [("delta", RADIUS, False), ("delta", RADIUS + 2.0, True), ("corexy", RADIUS, True), ("winch", RADIUS, False)],
)
def test_a_mesh_of_other_dimensions_than_the_robot_s_is_warned_of(
    write: Write, recwarn: pytest.WarningsRecorder, kinematics: str, radius: float, warned: bool
) -> None:
    warnings.simplefilter("always")
    printer = f"[printer]\nkinematics: {kinematics}\ndelta_radius: {radius}\n[stepper_a]\n"
    printer += f"arm_length: {ARM}\nposition_endstop: 900\n"
    touches = read_klipper_mesh(write("printer.cfg", printer + mesh_cfg(MESH, round_=False)))
    commands(touches, KINEMATICS, np.array(ORIGIN))
    assert any("otherwise than by the dimensions in this file" in str(one.message) for one in recwarn) is warned


def test_a_mesh_without_the_section_that_tells_its_form_is_refused(write: Write) -> None:
    text = mesh_cfg(MESH)
    with pytest.raises(DatasetError, match=r"\[bed_mesh\] is missing"):
        read_klipper_mesh(write("printer.cfg", text[text.index("#*#") :]))
    with pytest.raises(DatasetError, match="bed_mesh default"):
        read_klipper_mesh(write("printer.cfg", text), profile="other")


@pytest.mark.parametrize(
    ("changed", "column"),
    [(("max_x = 100.0", "max_x = -100.0"), "max_x"), (("min_y = -100.0", "min_y = 200.0"), "max_y")],
)
def test_a_mesh_whose_bounds_are_in_no_order_is_refused(write: Write, changed: tuple[str, str], column: str) -> None:
    with pytest.raises(DatasetError, match="is not above min") as refused:
        read_klipper_mesh(write("printer.cfg", mesh_cfg(MESH).replace(*changed)))
    assert refused.value.column == column
    assert refused.value.row is not None


def test_old_and_new_wording_of_a_touch_are_the_same_touch(write: Write) -> None:
    offset = (-25.0, 5.0, 1.25)
    old = read_klipper_probe(write("old.log", PROBED), offset)
    new = PROBED
    for x, y, z in ((10.0, -20.0, 1.525), (10.0, -20.0, 1.5275), (0.0, 120.5, 1.4025)):
        there = f"{x + offset[0]:.3f},{y + offset[1]:.3f} bed will contact at z={z - offset[2]:.6f}"
        new = new.replace(f"probe at {x:.3f},{y:.3f} is z={z:.6f}", f"probe: at {there}")
    found = read_klipper_probe(write("new.log", new), offset)
    assert old.position is not None
    np.testing.assert_allclose(found.position, old.position, atol=1e-12)
    np.testing.assert_allclose(old.position[0], [0.010, -0.020, 0.001525])
    assert list(old.row) == [1, 3, 5]


def test_tip_of_a_probe_beside_the_nozzle_is_on_the_bed_at_the_touch(write: Write) -> None:
    offset = (-25.0, 5.0, 1.25)
    for touches in (
        read_klipper_probe(write("log", PROBED.replace("1.5", "1.2").replace("1.4", "1.2")), offset),
        read_klipper_mesh(write("printer.cfg", mesh_cfg(MESH)), offset=offset),
    ):
        _, poses = commands(touches, KINEMATICS, np.array(ORIGIN))
        tips = poses.T + np.einsum("nij,j->ni", poses.R, touches.target) - ORIGIN
        assert (
            np.abs(tips[:, 2]).max() < 4e-4
        )  # the files' deviations from a flat bed; 1.25 mm if the offset were not used


def test_a_pattern_takes_the_files_that_fit_it_and_none_is_no_error(write: Write) -> None:
    write("parts/b.cfg", "[b]\nx: 2#comment\n")
    write("parts/a.cfg", "[a]\nx: 1 ; comment\n")
    found = read_config(write("printer.cfg", "[include parts/[ab].cfg]\n[include none*.cfg]\n[c]\nx: 3;5\n"))
    assert {name: options["x"].text for name, options in found.items()} == {"a": "1", "b": "2", "c": "3;5"}


@pytest.mark.parametrize("wanted", ["lost.cfg", "parts/lost.cfg", "./lost.cfg", "~"])
def test_a_named_file_that_is_missing_is_left_out_with_a_warning(write: Write, wanted: str) -> None:
    file = write("printer.cfg", f"[printer]\n[include {wanted}]\n[c]\nx: 3\n")
    with pytest.warns(GtpinWarning, match=f"row 2: the included file '{wanted}' is missing"):
        assert read_config(file)["c"]["x"].text == "3"


def test_an_included_file_may_be_empty(write: Write) -> None:
    write("macros.cfg", "\n")
    assert read_config(write("printer.cfg", "[include macros.cfg]\n[c]\nx: 3\n"))["c"]["x"].text == "3"
    with pytest.raises(DatasetError, match="empty"):
        read_config(write("printer.cfg", "\n"))


@pytest.mark.parametrize("wanted", [".", "..", "**/x**y", "/etc/hostname", "../other.cfg", "[", "*", "//"])
def test_whatever_is_named_the_end_is_one_line(write: Write, wanted: str) -> None:
    write("other.cfg", "secret")
    file = write("inside/printer.cfg", f"[include {wanted}]\n{printer_cfg(places(4))}")
    if wanted in ("**/x**y", "["):  # patterns that fit no file
        assert len(read_klipper_delta(file)) == 4
        return
    with pytest.raises(DatasetError) as refused:
        read_klipper_delta(file)
    assert len(str(refused.value).splitlines()) == 1
    assert "secret" not in str(refused.value)


def test_nothing_outside_the_folder_is_read(write: Write, tmp_path: Path) -> None:
    outside = write("outside.cfg", "[stepper_a]\nposition_endstop: 12.5\n")
    for wanted in ("../outside.cfg", "../out*.cfg", str(outside), f"parts/../../{outside.name}"):
        (tmp_path / "in" / "parts").mkdir(parents=True, exist_ok=True)
        with pytest.raises(DatasetError, match="outside the folder of the configuration"):
            read_config(write("in/printer.cfg", f"[include {wanted}]\n"))
    (tmp_path / "in" / "link.cfg").symlink_to(outside)  # as installers place files: it is below the folder
    assert "stepper_a" in read_config(write("in/printer.cfg", "[include link.cfg]\n"))


def test_no_message_has_the_text_of_an_included_file(write: Write) -> None:
    write("password", "correct horse battery staple\n")
    with pytest.raises(DatasetError, match="this is no line of a Klipper configuration") as refused:
        read_config(write("printer.cfg", "[include password]\n"))
    assert "horse" not in str(refused.value)
    with pytest.raises(DatasetError, match="correct horse"):  # one's own file is shown
        read_config(write("password", "correct horse battery staple\n"))


def test_a_file_that_includes_itself_over_others_is_an_error(write: Write) -> None:
    write("a.cfg", "[include b.cfg]\n")
    write("b.cfg", "[include ./printer.cfg]\n")
    with pytest.raises(DatasetError, match="includes itself") as refused:
        read_config(write("printer.cfg", "[include a.cfg]\n"))
    assert refused.value.file is not None
    assert Path(refused.value.file).name == "b.cfg"
    write("twice.cfg", "[a]\nx: 1\n")
    read_config(write("printer.cfg", "[include twice.cfg]\n[include twice.cfg]\n"))  # a file may come twice


def test_includes_that_multiply_end_at_once(write: Write) -> None:
    for number in range(8):
        write(f"f{number}.cfg", f"[include f{number + 1}.cfg]\n" * 8)
    write("f8.cfg", "[a]\n")
    began = time.perf_counter()
    with pytest.raises(DatasetError, match="more than 1000 included files"):
        read_config(write("printer.cfg", "[include f0.cfg]\n"))
    assert time.perf_counter() - began < 5.0  # 8^8 files would take an hour
    for number in range(60):
        write(f"d{number}.cfg", f"[include d{number + 1}.cfg]\n")
    with pytest.raises(DatasetError, match="includes 50 deep"):
        read_config(write("printer.cfg", "[include d0.cfg]\n"))


def test_a_line_below_an_include_belongs_to_no_section(write: Write) -> None:
    write("a.cfg", "[a]\n")
    with pytest.raises(DatasetError, match="x: 1"):
        read_config(write("printer.cfg", "[b]\n[include a.cfg]\nx: 1\n"))


@pytest.mark.parametrize(
    ("kinematics", "told"),
    [("corexy", "kinematics are corexy, not delta"), ("rotary_delta", "rotary_delta: its drives turn the arms")],
)
def test_a_printer_of_other_kinematics_is_refused(write: Write, kinematics: str, told: str) -> None:
    text = printer_cfg(places()).replace("kinematics: delta", f"kinematics: {kinematics}")
    with pytest.raises(DatasetError, match=told) as refused:
        read_klipper_delta(write("printer.cfg", text))
    assert refused.value.row == 3
    assert refused.value.column == "kinematics"


def test_steps_do_not_depend_on_what_else_is_in_the_folder(write: Write) -> None:
    whole = read_klipper_delta(write("printer.cfg", printer_cfg(places())))
    write("macros/m.cfg", "[gcode_macro M]\ngcode:\n  G1 X{x}\n")
    other = read_klipper_delta(write("printer.cfg", f"[include macros/*.cfg]\n{printer_cfg(places())}"))
    assert whole.travel is not None
    assert other.travel is not None
    np.testing.assert_array_equal(whole.travel, other.travel)
