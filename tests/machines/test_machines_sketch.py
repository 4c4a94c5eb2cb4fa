"""The shipped URDFs are what their sketches say, and a sketch that can't be is refused in one line."""

import importlib
import sys
from pathlib import Path

import pytest

import gtpin
from gtpin.errors import RobotError
from gtpin.robot.description import RobotDescription
from gtpin.robot.sketch import Carrier, Rod, Sketch

ROOT = Path(__file__).parents[2]


def test_urdfs_are_what_the_examples_write(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "examples/machines")
    names = ("tau", "gantry_tau_6dof", "stewart", "linear_delta", "stewart_jugglebot")
    for name in names:
        sketch = importlib.import_module(name).sketch()
        del sys.modules[name]
        assert sketch.urdf() == (ROOT / f"urdf/{name}.urdf").read_text(encoding="utf-8"), name
    assert {*names, "gantry_tau"} == set(gtpin.robot_names())


def test_dimensions_have_a_source_and_jugglebot_s_a_licence() -> None:
    for file in (ROOT / "urdf").glob("*.urdf"):
        head = file.read_text().split("<robot")[0]
        assert "ours" in head or "assumed" in head, file.name
    head = (ROOT / "urdf/stewart_jugglebot.urdf").read_text().split("<robot")[0]
    assert "github.com/Project-DeepBlue-Juggling/Jugglebot" in head
    assert "MIT" in head
    assert "Jugleer" in head


def test_a_sketch_that_can_not_be_is_one_line() -> None:
    rod = Rod("link1", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), carrier="cart9")
    with pytest.raises(RobotError, match="cart9"):
        Sketch("one", [rod], [Carrier("cart1", (0, 0, 1), (1, 0, 0), (-1, 1))], home=[0.0], T=(1, 0, 0)).urdf()
    with pytest.raises(RobotError, match="home has 0 commands for 1 actuators"):
        Sketch("two", [], [Carrier("cart1", (0, 0, 1), (1, 0, 0), (-1, 1))]).urdf()


def test_an_actuator_s_scale_is_unknown_or_not_mentioned() -> None:
    urdf = gtpin.load_robot("stewart_jugglebot").description.xml
    assert all(a.scale_unknown for a in gtpin.load_robot("stewart_jugglebot").actuators)
    assert not any(a.scale_unknown for a in gtpin.load_robot("stewart").actuators)
    with pytest.raises(RobotError, match="scale"):
        RobotDescription.parse(urdf.replace('scale="unknown"', 'scale="perhaps"'))
