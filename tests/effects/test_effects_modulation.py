"""The sizes of modulations: each is used, and none changes an effect's core."""

import sys
from dataclasses import fields, replace

import numpy as np
import pytest
from effect_places import EFFECTS, SETTINGS, Floats, drawn, situation

from gtpin.data import Driver
from gtpin.effects.driver import DriverColumn, DriverEffect
from gtpin.effects.modulation import MODULATION
from gtpin.kinematics.chain_kinematics import ChainKinematics
from gtpin.kinematics.rod_kinematics import RodKinematics

MACHINES = [situation(10, kinematics=RodKinematics(drawn(name))) for name in ("gantry_tau", "stewart")]
MACHINES.append(situation(10, kinematics=ChainKinematics(drawn("ur5"))))
DRIVEN = DriverEffect(DriverColumn("payload", 10.0, 20.0), [Driver("payload", "platform", "z", 1e-4)])
ALL = {**EFFECTS, DRIVEN.id: DRIVEN}


def sizes() -> dict[tuple[str, str, str], Floats]:
    """Typical sizes of the coefficients, by robot, effect and site."""
    return {
        (at.robot.name, name, site): effect.basis(at, site, SETTINGS.get(name)).sigma
        for at in MACHINES
        for name, effect in ALL.items()
        for site in effect.sites(at.robot)
    }


@pytest.mark.parametrize("name", [field.name for field in fields(MODULATION)])
def test_every_number_changes_the_modulation_of_an_effect_and_no_core(name, monkeypatch):
    before = sizes()
    doubled = replace(MODULATION, **{name: 2.0 * getattr(MODULATION, name)})
    for module in [
        m for key, m in sys.modules.items() if key.startswith("gtpin.effects.") and hasattr(m, "MODULATION")
    ]:
        monkeypatch.setattr(module, "MODULATION", doubled)
    changed = {place: np.flatnonzero(after != before[place]) for place, after in sizes().items()}
    assert any(len(columns) for columns in changed.values())
    for (_, effect, _), columns in changed.items():
        assert not set(columns) & set(ALL[effect].core)
