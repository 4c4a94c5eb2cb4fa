"""What the report says that a link of a loop moves is what the effect does to the TCP."""

from pathlib import Path

import numpy as np
import pytest

import gtpin
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.situation import Situation
from gtpin.kinematics.chain_kinematics import ChainKinematics
from gtpin.report.effect_motions import placements

FIVE_BAR = Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf"


@pytest.mark.parametrize("site", ["arm", "left", "right"])
def test_the_motions_of_a_link_s_tip_sum_to_the_effect(site: str) -> None:
    kinematics = ChainKinematics(gtpin.Geometry.nominal(gtpin.load_robot(str(FIVE_BAR))))
    q = np.random.default_rng(0).uniform(-0.4, 0.4, (5, 2))
    told = {"payload": np.linspace(0.0, 1.0, 5), "fy": np.linspace(-4.0, 5.0, 5)}
    at = Situation(kinematics, q, kinematics.forward(q), told)
    basis = effects_by_id()["link_compliance"].basis(at, site)
    summed = sum(motion.tcp[:, :, None] * motion.columns[:, None, :] for motion in placements(at, site, basis))
    np.testing.assert_allclose(summed, basis.displacement(at), atol=1e-12 * np.abs(basis.displacement(at)).max())
