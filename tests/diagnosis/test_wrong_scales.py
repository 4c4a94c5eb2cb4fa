"""A wrong scale of a drive is named with its size from positions alone, wherever the instrument stands."""

from dataclasses import replace

import numpy as np
import pytest
from closures import nominal
from diagnosed import quietly
from quick_first import quick_first
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.report.verdict import verdict

SCALE, POSES = 5e-4, 120


@pytest.mark.parametrize(("machine", "sites"), quick_first([("linear_delta", 1), ("gantry_tau", 1), ("gantry_tau", 3)]))
def test_a_wrong_scale_is_in_the_headline_with_its_size(machine: str, sites: int) -> None:
    """Pitch of a screw 0.05 % too large; of all drives, it is the instrument's scale as well."""
    rng, plain = np.random.default_rng(0), nominal(machine)
    wrong = {f"scale[{site}]": SCALE for site in plain.sites[:sites]}
    real = plain.off({name: rng.normal(0.0, sigma) for name, sigma in plain.parameters().items()} | wrong)
    data = real.measured(plain.commands(POSES) if plain.spread else plain.in_range(rng, POSES), rng)
    elsewhere = data.position @ Rotation.from_rotvec([0.1, -0.2, 0.7]).as_matrix().T + np.array([1.0, -2.0, 0.4])
    instrument = data.instrument.model_copy(update={"orientation_sigma": None, "frame": "free"})
    found = quietly(gtpin.diagnose, replace(data, position=elsewhere, orientation=None, instrument=instrument))
    cause = found.causes[0]
    members = {(member.effect, member.site) for member in cause.members}
    assert {("encoder_scale", site) for site in plain.sites[:sites]} <= members
    scale = cause.parameters["scale"]
    assert abs(scale.value - SCALE) < 3.0 * scale.sigma < 0.4 * SCALE
    assert f"scale {1e6 * scale.value:.0f} µm/m" in verdict(found).headline.replace("\u00a0", " ")
