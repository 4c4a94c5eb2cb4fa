"""The robot is drawn with the meshes that are there, whatever else is missing."""

from __future__ import annotations

import pytest

from gtpin.errors import GtpinWarning
from gtpin.robot.description import RobotDescription
from gtpin.robot.library import load_robot
from gtpin.robot.robot import Robot
from gtpin.view.shapes import shapes

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("name", "tcp"), [("ur5", None), ("panda", "panda_hand")])
@pytest.mark.filterwarnings("error", "ignore:.*does not move with panda_finger")
def test_meshes_of_a_package_are_found_beside_the_urdf(name: str, tcp: str | None) -> None:
    assert shapes(load_robot(name, tcp), {}).ngeoms >= 7


def test_shapes_without_their_mesh_are_left_out_in_one_warning() -> None:
    description = load_robot("ur5").description
    text = description.xml.replace("ur5/visual/wrist", "ur5/nowhere/wrist")
    with pytest.warns(GtpinWarning, match=r"nowhere/wrist1.dae and 2 more") as caught:
        found = shapes(Robot(RobotDescription.parse(text, description.source)), {})
    assert len(caught) == 1
    assert found.ngeoms == shapes(load_robot("ur5"), {}).ngeoms - 3
