"""Damaged files: refused in one line, or read to finite numbers; never a traceback, never a NaN."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from printed import BED_G, G32, HEIGHTMAP, MESH, POINTS, PROBE_LOG, PROBED, ROS, ROS2, mesh_cfg, places, printer_cfg

from gtpin.data import Commands, Dataset
from gtpin.errors import DatasetError, GtpinWarning
from gtpin.extras.importers.klipper import read_klipper_delta, read_klipper_mesh, read_klipper_probe
from gtpin.extras.importers.linuxcnc_probe import read_linuxcnc_probe
from gtpin.extras.importers.points import read_points
from gtpin.extras.importers.ros_poses import read_ros_poses
from gtpin.extras.importers.rrf import read_rrf_g32, read_rrf_heightmap
from gtpin.extras.importers.touches import Touches

Read = Callable[[Path], Touches | Dataset]
COMMANDS = Commands(np.array(["p1", "p2", "p3"], dtype=object), np.zeros((3, 6)), {"time": np.full(3, 175.5)})


def _g32(file: Path) -> Touches:
    bed = file.with_name("bed.g")
    bed.write_text(BED_G, encoding="utf-8")
    return read_rrf_g32(file, bed)


def _bed(file: Path) -> Touches:
    console = file.with_name("console.txt")
    console.write_text(G32, encoding="utf-8")
    return read_rrf_g32(console, file)


POINT_COLUMNS = ["-", "-", "pose", "x", "y", "z"]
FORMATS: dict[str, tuple[str, str, Read]] = {
    "klipper-delta": (printer_cfg(places(4)), "height2_pos = ", read_klipper_delta),
    "klipper-probe": (PROBED, "is z=", read_klipper_probe),
    "klipper-mesh": (mesh_cfg(MESH), "#*# \t  0.2, ", read_klipper_mesh),
    "rrf-heightmap": (HEIGHTMAP, " -0.054, ", read_rrf_heightmap),
    "rrf-g32": (G32, "heights: 0.085 ", _g32),
    "rrf-g32 bed.g": (BED_G, "P1 X", _bed),
    "linuxcnc-probe": (PROBE_LOG, "-25.000000 -50.000000 ", lambda file: read_linuxcnc_probe(file, "mm", "XYZAB")),
    "points": (
        POINTS,
        "p2 1198.0021 ",
        lambda file: read_points(file, "ur5", POINT_COLUMNS, "space", "mm", commands=COMMANDS, match="pose"),
    ),
    "ros-poses": (ROS, "tag,0.41,", lambda file: read_ros_poses(file, "ur5", COMMANDS, "time", within=1.0)),
    "ros-poses of 2": (ROS2, "tag,0.41,", lambda file: read_ros_poses(file, "ur5", COMMANDS, "time", within=1.0)),
}
"""A file, what stands in it before a number that is read, and its reader."""


def with_number(name: str, word: str, file: Path) -> int:
    """Write a file with a word for a number that is read; the row of the number."""
    text, before, _ = FORMATS[name]
    at = text.index(before) + len(before)
    file.write_text(text[:at] + re.sub(r"^[-0-9.]+", word, text[at:]), encoding="utf-8")
    return text[:at].count("\n") + 1


def check(read: Read, file: Path) -> None:
    """Refused in one line that names what, or read to finite numbers."""
    refused, found = None, None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        try:
            found = read(file)
        except DatasetError as error:
            refused = error
    if found is None:
        assert refused is not None
        assert refused.what
        assert len(str(refused).splitlines()) == 1
        return
    values = [found.position, found.q] + ([found.travel, found.height] if isinstance(found, Touches) else [])
    assert len(found) > 0
    for value in values:
        assert value is None or np.isfinite(value).all()


@pytest.mark.parametrize("name", FORMATS)
def test_the_whole_file_is_read(name: str, tmp_path: Path) -> None:
    text, _, read = FORMATS[name]
    file = tmp_path / "file"
    file.write_text(text, encoding="utf-8")
    assert len(read(file)) >= 3


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("word", ["nan", "NaN", "inf", "-Infinity", "1e999", "1_0", "x", "--", "٣"])
def test_a_number_that_is_none_is_refused_with_its_row(name: str, word: str, tmp_path: Path) -> None:
    file = tmp_path / "file"
    row = with_number(name, word, file)
    with pytest.raises(DatasetError) as refused:
        FORMATS[name][2](file)
    assert refused.value.row == row
    assert refused.value.file == file


@pytest.mark.parametrize("name", [name for name in FORMATS if not name.startswith(("points", "ros"))])
@pytest.mark.parametrize("size", ["1e300", "-9e15", "1234567890"])
def test_a_touch_kilometres_away_is_refused(name: str, size: str, tmp_path: Path) -> None:
    file = tmp_path / "file"
    with_number(name, size, file)
    with pytest.raises(DatasetError, match=r"beyond|do not reach|G30 has no E"):
        FORMATS[name][2](file)


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_that_is_missing_empty_or_no_text_is_refused(name: str, tmp_path: Path) -> None:
    read = FORMATS[name][2]
    texts = (b"", b"\xef\xbb\xbf \n\n", b"\0\1\2", b"\xff\xfea\0", b"PK\x03\x04\0\0", b"\xc3\x28\n", b"\n\nhello\n")
    for content in (None, *texts):
        file = tmp_path / "file"
        if content is not None:
            file.write_bytes(content)
        with pytest.raises(DatasetError) as refused:
            read(file)
        assert len(str(refused.value).splitlines()) == 1
    with pytest.raises(DatasetError, match="folder"):
        read(tmp_path)


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_of_another_format_is_refused(name: str, tmp_path: Path) -> None:
    file = tmp_path / "file"
    for other, (text, _, _) in FORMATS.items():
        if other.split()[0] == name.split()[0]:
            continue
        file.write_text(text, encoding="utf-8")
        with pytest.raises(DatasetError):
            FORMATS[name][2](file)


@pytest.mark.parametrize("name", FORMATS)
@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cut=st.tuples(st.floats(0.0, 1.0), st.integers(0, 40)), put=st.binary(max_size=12))
@example(cut=(0.5, 10_000), put=b"")
@example(cut=(0.0, 100), put=b"")
@example(cut=(0.6, 0), put=b"\n")
@example(cut=(0.6, 0), put=b"[include *]\n")
def test_whatever_is_cut_out_or_put_in_the_end_is_one_line_or_finite_numbers(
    name: str, cut: tuple[float, int], put: bytes, tmp_path: Path
) -> None:
    text, _, read = FORMATS[name]
    data = text.encode()
    at = int(cut[0] * len(data))
    file = tmp_path / "file"
    file.write_bytes(data[:at] + put + data[at + cut[1] :])
    check(read, file)


@pytest.mark.parametrize("name", FORMATS)
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(order=st.randoms(use_true_random=False), line=st.text(st.characters(codec="utf-8"), max_size=30))
def test_lines_may_come_in_any_order_and_any_text_among_them(
    name: str, order: object, line: str, tmp_path: Path
) -> None:
    text, _, read = FORMATS[name]
    lines = [*text.splitlines(), line]
    order.shuffle(lines)  # type: ignore[attr-defined]
    file = tmp_path / "file"
    file.write_bytes("\n".join(lines).encode("utf-8", "surrogatepass"))
    check(read, file)
