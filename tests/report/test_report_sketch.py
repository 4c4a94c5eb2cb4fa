"""The machine drawn: every robot, every name, red where the gap is."""

from __future__ import annotations

import re

import numpy as np
import pytest
from defusedxml.ElementTree import fromstring

from gtpin import Geometry, Model, load_robot, robot_names
from gtpin.report.skeleton import skeleton
from gtpin.report.sketch import HEIGHT, WIDTH, Camera, color, sketch

ROBOTS = [name for name in robot_names() if load_robot(name).rods]


def model(name: str) -> Model:
    return Model(Geometry.nominal(load_robot(name)))


@pytest.mark.parametrize("name", ROBOTS)
def test_every_robot_with_rods_is_drawn_whole_with_all_its_names(name):
    robot, machine = load_robot(name), skeleton(model(name))
    assert machine is not None
    drawing = fromstring(str(sketch(machine, robot.rod_sites, {}, {})))
    told = " ".join(drawing.itertext())
    for site in (*robot.rod_sites, *machine.carts):
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
    np.testing.assert_allclose(np.linalg.norm(machine.joints - machine.seats, axis=1), wanted, rtol=1e-9)


def test_a_part_with_more_of_the_gap_is_redder():
    red = [float(re.search(r"(\d+)%", color(share)).group(1)) for share in (0.0, 0.1, 0.3, 0.5)]
    assert red == sorted(set(red))
    assert (red[0], red[-1]) == (0.0, 100.0)


def test_the_cart_of_a_cause_is_ringed_and_its_share_is_told():
    machine = skeleton(model("gantry_tau"))
    plain = str(sketch(machine, load_robot("gantry_tau").rod_sites, {"cart2": 0.6}, {}))
    ringed = str(sketch(machine, load_robot("gantry_tau").rod_sites, {"cart2": 0.6}, {}, ["cart2"]))
    assert ringed.count("<circle") == plain.count("<circle") + 1
    assert "cart2 60" in ringed


def test_names_in_a_sketch_are_text():
    machine = skeleton(model("gantry_tau"))
    drawing = str(sketch(machine, ["<script>", "b", "c", "d", "e", "f"], {}, {}))
    assert "<script>" not in drawing
    fromstring(drawing)


def test_a_robot_without_rods_has_no_skeleton(tmp_path):
    urdf = tmp_path / "arm.urdf"
    limit = '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'
    links = "".join(f'<link name="{name}"/>' for name in ("base", "fore", "hand"))
    joints = "".join(
        f'<joint name="{a}" type="revolute"><parent link="{a}"/><child link="{b}"/>{limit}</joint>'
        for a, b in (("base", "fore"), ("fore", "hand"))
    )
    urdf.write_text(f'<robot name="arm">{links}{joints}</robot>')
    assert skeleton(Model(Geometry.nominal(load_robot(urdf)))) is None
