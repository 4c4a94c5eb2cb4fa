"""The machine drawn: every robot, every name, red where the gap is, and the instruments."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from defusedxml.ElementTree import fromstring

import gtpin.report.sketch as sketch_module
from gtpin import Geometry, Model, load_robot, robot_names
from gtpin.data.instrument_tables import InstrumentTable, PlaneTable, RangeTable, SocketTable, TiltTable
from gtpin.model.model import FittedInstrument
from gtpin.report.skeleton import HEIGHT, WIDTH, Camera, skeleton
from gtpin.report.sketch import Labels, color, drawing, sketch

ROBOTS = [name for name in robot_names() if load_robot(name).rods]


@cache
def model(name: str) -> Model:
    return Model(Geometry.nominal(load_robot(name)))


@pytest.mark.parametrize("name", ROBOTS)
def test_every_robot_with_rods_is_drawn_whole_with_all_its_names(name):
    robot, machine = load_robot(name), skeleton(model(name))
    assert machine is not None
    drawing = fromstring(str(sketch(machine, {})))
    told = " ".join(drawing.itertext())
    for site in (*robot.rod_sites, *(spot.site for spot in machine.spots)):
        assert site in told
    pixels = Camera.of(machine)(machine.points)
    assert (pixels > 0.0).all()
    assert (pixels < [WIDTH, HEIGHT]).all()


@pytest.mark.parametrize("name", ROBOTS)
def test_rods_of_a_skeleton_have_the_lengths_of_the_robots_rods(name):
    found, machine = model(name), skeleton(model(name))
    assert machine is not None
    q = (found.robot.lower + found.robot.upper) / 2.0
    if not np.isfinite(q).all() or not found.kinematics.forward(q[None]).reached.all():
        q = found.robot.home_q
    wanted = [rod.L + (q[rod.extension] if rod.extension is not None else 0.0) for rod in found.robot.rods]
    np.testing.assert_allclose(
        [np.linalg.norm(np.subtract(*line.ends)) for line in machine.of("rod")], wanted, rtol=1e-9
    )


def test_a_part_with_more_of_the_gap_is_redder():
    red = [float(re.search(r"(\d+)%", color(part)).group(1)) for part in (0.0, 0.1, 0.6, 1.0)]
    assert red == sorted(set(red))
    assert (red[0], red[-1]) == (0.0, 100.0)


def test_the_cart_of_a_cause_is_ringed():
    machine = skeleton(model("gantry_tau"))
    plain = str(sketch(machine, {"cart2": 0.6}))
    ringed = str(sketch(machine, {"cart2": 0.6}, ["cart2"]))
    assert ringed.count("<circle") == plain.count("<circle") + 1


def shaded(share: dict[str, float], causes: tuple[str, ...] = ()) -> str:
    return str(sketch(skeleton(model("gantry_tau")), share, causes))


def shade(drawn: str, shape: str) -> list[int]:
    """How red each shape of a kind is, percent."""
    return [int(red) for red in re.findall(rf"<{shape} [^>]*?var\(--high\) (\d+)%", drawn)]


def test_rods_and_carts_are_coloured_on_one_scale():
    drawn = shaded({"cart1": 0.24, "cart2": 0.0, "cart3": 0.0, "link1": 0.12})
    assert max(shade(drawn, "rect")) == 100
    rod = re.search(r"<line [^>]*var\(--high\) (\d+)%[^>]*><title>link1", drawn)
    assert int(rod.group(1)) == 50


def test_no_number_stands_in_the_picture_because_its_shares_are_not_those_of_the_gap():
    told = " ".join(fromstring(shaded({"cart1": 0.24, "cart2": 0.03})).itertext())
    assert "%" not in told
    assert "gap" not in told


@pytest.mark.parametrize(("site", "name"), [("frame", "instrument"), ("arm", "all links")])
def test_sites_that_are_no_one_part_have_a_sign_of_their_own_which_is_ringed_where_a_cause_sits(site, name):
    plain, ringed = shaded({"cart1": 0.2, site: 0.3}), shaded({"cart1": 0.2, site: 0.3}, causes=(site,))
    told = " ".join(fromstring(plain).itertext()).replace("\u00a0", " ")
    assert name in told
    assert "frame" not in told
    assert ringed.count("<circle") == plain.count("<circle") + 1
    assert name not in shaded({"cart1": 0.2})


FIVE_BAR = Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf"


@pytest.mark.parametrize("name", [*ROBOTS, str(FIVE_BAR)])
def test_no_label_hides_another_one_or_leaves_the_picture(name, monkeypatch):
    made, machine = list[Labels](), skeleton(model(name))
    monkeypatch.setattr(sketch_module, "Labels", lambda *given: made.append(Labels(*given)) or made[-1])
    shares = {spot.site: 0.1 for spot in machine.spots} | {"arm": 0.2, "frame": 0.3, "platform": 0.1}
    sketch(machine, shares, [machine.spots[0].site] if machine.spots else [])
    (labels,) = made
    boxes = np.array(labels.taken)
    assert (boxes[:, :2] >= 0.0).all()
    assert (boxes[:, 2:] <= [WIDTH, HEIGHT]).all()
    for a, b in combinations(boxes, 2):
        assert not (a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3])


def test_a_loop_s_picture_has_both_its_sides():
    machine = skeleton(model(str(FIVE_BAR)))
    pairs = combinations([line.ends for line in machine.lines], 2)
    meet = [np.allclose(a[1], b[1], atol=1e-9) and not np.allclose(a[0], b[0], atol=1e-3) for a, b in pairs]
    assert sum(meet) == 1  # the far links of the two sides


def test_names_in_a_sketch_are_text():
    machine = skeleton(model("gantry_tau"))
    hostile = replace(machine, lines=tuple(replace(line, site="<script>") for line in machine.lines))
    drawn = str(sketch(hostile, {}))
    assert "<script>" not in drawn
    fromstring(drawn)


def picture(name: str, *tables: InstrumentTable) -> str:
    found = drawing(replace(model(name), instruments=tuple(FittedInstrument(table) for table in tables)))
    assert found is not None
    return str(found)


def place(name: str, off: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[float, float, float]:
    """The TCP at home, or beside it."""
    nominal = model(name)
    T = nominal.kinematics.forward(nominal.robot.home_q[None]).T[0]
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
        socket_sigma=1e-3,
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
