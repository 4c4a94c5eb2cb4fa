"""What effects and their parameters mean stands on the page, in the words of their own classes."""

import pytest

from gtpin.effects.catalogue import effects_by_id
from gtpin.report.meaning import meaning


@pytest.mark.parametrize("effect", sorted(effects_by_id()))
def test_every_effect_of_the_catalogue_says_its_equation_and_its_parameters(effect):
    told = meaning(effect)
    assert "=" in told[0]
    parameters = next(part for part in told if part.startswith("Parameters:"))
    assert "<code>" in parameters
    assert not any("`" in part or "Typical size" in part for part in told)


def test_an_effect_that_nobody_knows_says_nothing():
    assert meaning("no_such_effect") == ()
