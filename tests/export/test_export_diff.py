"""The diff of a URDF: what it changes, put into the user's file by hand, is the exported robot; nothing else is in it."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from drawn_machines import Drawn, told

import gtpin
from gtpin.errors import GtpinError
from gtpin.export import export


def patched(xml: str, diff: str) -> ElementTree.Element:
    """The user's URDF with the attributes of each line that is added; each line that is removed must stand there."""
    root = ElementTree.fromstring(xml)
    _, _, *hunks = re.split(r"^@@ |^\+\+\+", diff, flags=re.MULTILINE)
    for hunk in hunks:
        place, (minus, plus) = hunk.partition(" @@")[0].split(), hunk.splitlines()[1:3]
        kind, name, *end = place
        owner = root.find(kind) if kind == "gtpin" else next(e for e in root.findall(kind) if e.get("name") == name)
        assert owner is not None
        element = owner.find(name if kind == "gtpin" else end[0] if end else "origin")
        if element is None:
            element = ElementTree.SubElement(owner, "origin", xyz="0 0 0", rpy="0 0 0")
        assert (minus[0], plus[0]) == ("-", "+")
        was, now = (ElementTree.fromstring(line[1:]) for line in (minus, plus))
        assert {key: element.get(key, "0 0 0") for key in was.attrib} == was.attrib
        assert now.tag == was.tag
        element.attrib.update(now.attrib)
    return root


@pytest.mark.parametrize("name", ["ur5", "gantry_tau", "linear_delta"])
def test_it_makes_the_users_file_the_exported_robot(
    name: str, drawn_of: Callable[[str], Drawn], tmp_path: Path
) -> None:
    drawn = drawn_of(name)
    told(drawn.model, tmp_path / "robot.diff")
    told(drawn.model, tmp_path / "robot.urdf")
    root = patched(drawn.model.robot.description.xml, (tmp_path / "robot.diff").read_text(encoding="utf-8"))
    (tmp_path / "patched.urdf").write_text(ElementTree.tostring(root, encoding="unicode"), encoding="utf-8")
    for file in ("patched.urdf", "robot.urdf"):
        found = gtpin.read_model(tmp_path / file, tcp=drawn.model.robot.tcp_frame).predict(drawn.q)
        assert np.abs(found.minus(drawn.poses)).max() < 1e-9, file


def test_it_has_what_changed_alone_and_the_tool_of_a_free_target_stays(
    drawn_of: Callable[[str], Drawn], tmp_path: Path
) -> None:
    model = gtpin.read_model("ur5")
    values, names = model.geometry.values.copy(), model.geometry.names
    values[names.index("placement[elbow_joint].rz")] = 1e-3
    values[names.index("platform.x")] = 0.07
    parameters = tuple(replace(p, nominal=0.07) if p.name == "platform.x" else p for p in model.geometry.parameters)
    free = gtpin.Model(replace(model.geometry, parameters=parameters, values=values))
    assert free.geometry.target is not None
    said = told(free, tmp_path / "robot.diff")
    assert any("has the tool, tool0, where the robot's own file has it" in text for text in said)
    lines = (tmp_path / "robot.diff").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if line.startswith("@@")] == ["@@ joint elbow_joint @@"]
    old, new = (ElementTree.fromstring(line[1:]) for line in lines[-2:])
    turned = [pin.rpy.rpyToMatrix(*map(float, one.get("rpy", "").split())) for one in (old, new)]
    np.testing.assert_allclose(pin.log3(turned[0].T @ turned[1]), [0.0, 0.0, 1e-3], rtol=0, atol=1e-12)
    assert old.get("xyz").split() == pytest.approx(new.get("xyz").split()) or old.get("xyz") == new.get("xyz")


def test_a_robot_without_origins_has_no_diff(tmp_path: Path) -> None:
    export(gtpin.read_model("linear_delta"), tmp_path / "robot.xml")
    with pytest.raises(GtpinError, match="MJCF, which has no origins"):
        export(gtpin.read_model(tmp_path / "robot.xml"), tmp_path / "robot.diff")
