"""Instruments in the drawing on a page."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import gtpin
from gtpin.data.instrument_tables import InstrumentTable, PlaneTable, RangeTable, SocketTable, TiltTable
from gtpin.model.model import FittedInstrument
from gtpin.report.camera import HEIGHT, WIDTH
from gtpin.report.sketch import drawing

MODELS = {name: gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot(name))) for name in ("gantry_tau", "ur5")}


def picture(name: str, *tables: InstrumentTable) -> str:
    model = replace(MODELS[name], instruments=tuple(FittedInstrument(table) for table in tables))
    found = drawing(model)
    assert found is not None
    return str(found)


def place(name: str, off: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[float, float, float]:
    """The TCP at home, or beside it."""
    model = MODELS[name]
    T = model.kinematics.forward(model.robot.home_q[None]).T[0]
    x, y, z = (T + off).tolist()
    return x, y, z


def pixels(svg: str) -> np.ndarray:
    """(m, 2) corners of all polygons, ends of lines and middles of circles."""
    found = [tuple(map(float, p.split(","))) for group in re.findall(r'points="([^"]*)"', svg) for p in group.split()]
    for x, y in (("x1", "y1"), ("x2", "y2"), ("cx", "cy")):
        found += [(float(a), float(b)) for a, b in re.findall(rf'{x}="(-?[\d.]+)" {y}="(-?[\d.]+)"', svg)]
    return np.array(found)


@pytest.mark.parametrize("name", ["gantry_tau", "ur5"])
def test_stations_planes_and_sockets_are_drawn_inside_the_picture(name: str) -> None:
    wire = RangeTable(name="wire", kind="range", stations={"A": place(name, (0.8, 0.0, 0.0)), "B": place(name)})
    bed = PlaneTable(name="bed", kind="plane", planes={"low": {"point": place(name), "normal": (0.0, 0.0, 1.0)}})
    cup = SocketTable(
        name="cup",
        kind="socket",
        sockets={"S1": place(name, (0.1, 0.0, 0.0)), "S2": place(name, (0.0, 0.1, 0.0))},
        distances=(("S1", "S2", 0.1414, 1e-4),),
    )
    svg = picture(name, wire, bed, cup)
    for word in ("wire A", "wire B", "bed"):
        assert f">{word}</text>" in svg
    for word in ("cup S1", "cup S2"):
        assert f"<title>{word}</title>" in svg
    assert svg.count("stroke-dasharray") == 3
    at = pixels(svg)
    assert (at >= 0.0).all()
    assert (at <= [WIDTH, HEIGHT]).all()


@pytest.mark.parametrize("name", ["gantry_tau", "ur5"])
def test_a_station_far_away_does_not_make_the_machine_small(name: str) -> None:
    far = RangeTable(name="tracer", kind="range", stations={"A": place(name, (0.0, 40.0, 0.0))})
    assert picture(name, far) == picture(name)


def test_a_tilt_sensor_adds_no_marks() -> None:
    assert picture("gantry_tau", TiltTable(name="level", kind="tilt")) == picture("gantry_tau")


def test_names_of_instruments_can_be_no_markup() -> None:
    stations = {"<b>": place("gantry_tau"), "B": place("gantry_tau")}
    svg = picture("gantry_tau", RangeTable(name="wire", kind="range", stations=stations))
    assert "<b>" not in svg
    assert "wire &lt;b&gt;" in svg
