"""Which causes could be a part of what is unknown."""

import pytest

import gtpin
from gtpin.diagnosis.hypothesis import Hypothesis, SmoothTerm, alike
from gtpin.effects.catalogue import effects_by_id

BY_PLACE = SmoothTerm("frame", ("position",), "shift")


@pytest.mark.parametrize(
    ("effect", "site", "expected"),
    [
        ("link_compliance", "arm", True),  # a floor that tilts with the tool's place
        ("joint_compliance", "joint2", True),
        ("axis_motion", "joint4", True),
        ("backlash", "joint2", False),
        ("thermal_links", "arm", False),
        ("zero_shift", "joint2", False),
    ],
)
def test_what_follows_the_place_of_an_arms_tool_can_be_any_part_that_follows_commands_or_loads(effect, site, expected):
    robot = gtpin.load_robot("xarm7")
    assert alike(robot, Hypothesis(effects_by_id()[effect], site), BY_PLACE) == expected
