"""Files of RepRapFirmware."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from printed import BED_G, G32, HEIGHTMAP

from gtpin.errors import DatasetError
from gtpin.importers.rrf_g32 import read_rrf_g32
from gtpin.importers.rrf_heightmap import read_rrf_heightmap

Write = Callable[[str, str], Path]
SECOND, THIRD = HEIGHTMAP.splitlines()[1:3]


@pytest.mark.parametrize(
    ("names", "grid"),
    [
        (SECOND, THIRD),
        (
            "xmin,xmax,ymin,ymax,radius,xspacing,yspacing,xnum,ynum",
            "-100.00,100.00,-50.00,50.00,120.00,100.00,50.00,3,3",
        ),
    ],
)
def test_points_of_a_height_map_are_where_its_grid_puts_them(write: Write, names: str, grid: str) -> None:
    file = write("heightmap.csv", HEIGHTMAP.replace(SECOND, names).replace(THIRD, grid))
    expected = [[0, -50, 0.109], [-100, 0, -0.054], [0, 0, -0.045], [100, 0, -0.107], [0, 50, 0.0]]
    np.testing.assert_allclose(read_rrf_heightmap(file).position, 1e-3 * np.array(expected), atol=1e-15)


def test_a_height_map_with_one_spacing_has_it_along_both_axes(write: Write) -> None:
    grid = "-100.00,100.00,-100.00,100.00,120.00,100.00,3,3"
    text = HEIGHTMAP.replace(SECOND, "xmin,xmax,ymin,ymax,radius,spacing,xnum,ynum").replace(THIRD, grid)
    found = read_rrf_heightmap(write("heightmap.csv", text)).position
    assert found is not None
    np.testing.assert_allclose(found[[0, 4], 1], [-0.1, 0.1])


def test_the_probe_touches_at_the_trigger_height_beside_the_nozzle(write: Write) -> None:
    touches = read_rrf_heightmap(write("heightmap.csv", HEIGHTMAP), (16.0, -4.0, 2.5))
    assert touches.position is not None
    np.testing.assert_allclose(touches.position[2], [-0.016, 0.004, 2.5e-3 - 0.045e-3])
    np.testing.assert_allclose(touches.target, [0.016, -0.004, -0.0025])


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("X,Y,-100", "X,A,-100", "X and A"),
        (",3,3", ",3,4", "3 lines of heights"),
        (",3,3", ",4,3", "3 heights"),
        (",3,3", ",3", "10 values"),
        (",3,3", ",1e9,1e9", "points can't be"),
        ("file v2", "v2", "does not begin"),
        ("axis0,axis1,", "", "line of names"),
        ("-0.107\n", "-0.1o7\n", "'-0.1o7' is not a number"),
    ],
)
def test_a_damaged_height_map_is_refused(write: Write, old: str, new: str, told: str) -> None:
    with pytest.raises(DatasetError, match=told):
        read_rrf_heightmap(write("heightmap.csv", HEIGHTMAP.replace(old, new)))


def test_heights_of_g32_are_at_the_points_of_bed_g(write: Write) -> None:
    touches = read_rrf_g32(write("console.txt", G32), write("bed.g", BED_G))
    expected = [[0, 100, 0.085], [-86.6, -50, -0.031], [86.6, -50, 0.0], [0, 100, 0.083], [86.6, -50, 0.002]]
    np.testing.assert_allclose(touches.position, 1e-3 * np.array(expected), atol=1e-15)
    assert list(touches.row) == [1, 1, 1, 3, 3]


def test_a_bed_g_that_was_not_run_is_refused(write: Write) -> None:
    console = write("console.txt", G32)
    for text, told in (
        (BED_G + "G30 P3 X0 Y0\n", "3 heights for the 4 points"),
        (BED_G.replace("P1", "P4"), "no G30 P1"),
        (BED_G + "G30 P0 X0 Y50\n", "row 6, column P: point P0 is at another place above"),
        (BED_G.replace("X-86.6", "X{-global.radius}"), "row 4: an expression"),
        (BED_G.replace("Y-50 ", ""), "without Y"),
        ("G28\n", "no G30 P0"),
    ):
        with pytest.raises(DatasetError, match=told):
            read_rrf_g32(console, write("bed.g", text))


def test_a_point_that_bed_g_names_twice_at_one_place_is_one(write: Write) -> None:
    again = BED_G + "G30 P0 X0 Y100\n"
    assert len(read_rrf_g32(write("console.txt", G32), write("bed.g", again))) == 5
