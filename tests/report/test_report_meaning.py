"""What effects and their parameters mean stands on the page, in the words of their own classes."""

import pytest

import gtpin
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.drive_errors import Linearity
from gtpin.report.diagnosis_page import meaning


@pytest.mark.parametrize("effect", sorted(effects_by_id()))
def test_every_effect_of_the_catalogue_says_its_equation_and_its_parameters(effect):
    for robot in (gtpin.load_robot("gantry_tau"), gtpin.load_robot("ur5")):
        told = meaning(effects_by_id()[effect], robot)
        assert "=" in told[0]
        parameters = next(part for part in told if "Parameters:" in part)
        assert "<code>" in parameters
        assert not any("`" in part or "Typical size" in part for part in told)
        assert not (robot.rods and any("robot without rods" in part[:50] for part in told))


class Silent(Linearity):
    id = "silent"


def test_an_effect_without_a_description_of_its_own_says_nothing_of_another():
    assert meaning(Silent(), gtpin.load_robot("ur5")) == ()
