"""Files of RepRapFirmware."""

from __future__ import annotations

import numpy as np
import pytest
from printed import BED_G, G32, HEIGHTMAP, Write

from gtpin.errors import DatasetError
from gtpin.extras.importers.rrf import read_rrf_delta, read_rrf_g32, read_rrf_heightmap

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
        (",3,3", ",3,4", "4 points 50 apart do not go from -50 to 50"),
        (",3,3", ",4,3", "4 points 100 apart do not go from -100 to 100"),
        ("120.00,100.00", "120.00,40.00", "3 points 40 apart do not go from -100 to 100"),
        ("120.00,100.00", "120.00,0.00", "a spacing of 0 can't be"),
        ("120.00,100.00", "120.00,-100.00", "a spacing of -100 can't be"),
        ("-100.00,100.00", "100.00,100.00", "x goes from 100 to 100"),
        ("-50.00,50.00,", "50.00,-50.00,", "y goes from 50 to -50"),
        ("      0,  0.000,      0\n", "", "2 lines of heights"),
        (" -0.054, ", "", "2 heights"),
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


def test_a_grid_that_ends_below_its_upper_bound_is_read(write: Write) -> None:
    """The firmware takes as many points as there is room for: three of 100 mm between -100 and 170."""
    for bounds in ("-100.00,170.00,-50.00,50.00,120.00,100.00,50.00", "0.00,133.33,-50.00,50.00,-1.00,66.67,50.00"):
        grid = THIRD.replace("-100.00,100.00,-50.00,50.00,120.00,100.00,50.00", bounds)
        assert len(read_rrf_heightmap(write("heightmap.csv", HEIGHTMAP.replace(THIRD, grid)))) == 5


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


@pytest.mark.parametrize("word", ["if global.probe", "while iterations < 3", "else"])
def test_a_point_that_only_the_firmware_knows_of_is_refused(write: Write, word: str) -> None:
    console = write("console.txt", G32)
    inside = BED_G.replace("G30 P1 X-86.6", f"{word}\n  G28\n  G30 P1 X-86.6")
    with pytest.raises(DatasetError, match=f"row 6: a command inside '{word.split()[0]}', which only the firmware"):
        read_rrf_g32(console, write("bed.g", inside))
    with pytest.raises(DatasetError, match="row 6: an expression"):
        read_rrf_g32(console, write("bed.g", BED_G + "G30 P{iterations} X{10*iterations} Y0 Z-99999\n"))
    around = f"{word} ; conditions of other commands\n  G28\n  ; below\n\n  M561\n{BED_G}"
    assert len(read_rrf_g32(console, write("bed.g", around))) == 5


def test_dimensions_that_only_the_firmware_knows_are_refused(write: Write) -> None:
    config = "M92 X80 Y80 Z80 ; steps\nM665 L360 R170 H300\n"
    assert read_rrf_delta(write("config.g", config))[0].radius == pytest.approx(0.170)
    with pytest.raises(DatasetError, match="row 3: a command inside 'if'"):
        read_rrf_delta(write("config.g", config.replace("M665", "if true\n\tM665")))
    with pytest.raises(DatasetError, match="row 2: an expression"):
        read_rrf_delta(write("config.g", config.replace("R170", "R{global.radius}")))


def test_a_point_that_bed_g_names_twice_at_one_place_is_one(write: Write) -> None:
    again = BED_G + "G30 P0 X0 Y100\n"
    assert len(read_rrf_g32(write("console.txt", G32), write("bed.g", again))) == 5
