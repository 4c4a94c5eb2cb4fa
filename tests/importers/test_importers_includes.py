"""``[include ...]`` in a configuration of Klipper: read as Klipper reads it, and never a file that is none of the printer's."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from printed import Write, places, printer_cfg

from gtpin.errors import DatasetError, GtpinWarning
from gtpin.importers.klipper import read_klipper_delta
from gtpin.importers.klipper_config import read_config


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
