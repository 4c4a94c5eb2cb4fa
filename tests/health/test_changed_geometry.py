"""A rod that was bent since the model is named as a change of its length, by a truth of the tests' own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from quick_first import quick_first
from scipy.spatial.transform import Rotation
from virtual_gantry import Machine, commands, draw, measured

import gtpin
from gtpin.effects.catalogue import effects_by_id
from gtpin.typing import Floats

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")


def calibrated(seed: int) -> tuple[np.random.Generator, Machine, gtpin.Model]:
    """A machine, and the model of it before anything changed."""
    rng = np.random.default_rng(seed)
    machine = draw(rng)
    return rng, machine, gtpin.calibrate(measured(machine, commands(rng, 120), rng)).model


def changed(machine: Machine, name: str, by: float) -> Machine:
    return replace(machine, gantry=machine.gantry.off({name: by}))


@pytest.mark.parametrize(("seed", "rod", "by"), quick_first([(1, "3a", -3e-4), (2, "2b", 2e-4), (3, "1", -3e-4)]))
def test_a_bent_rod_is_named_by_its_length_which_the_updated_geometry_has(
    seed: int, rod: str, by: float, tmp_path: Path
):
    rng, machine, earlier = calibrated(seed)
    q = commands(rng, 14)
    now = changed(machine, f"length[{rod}]", by)
    found = gtpin.diagnose(measured(now, q, rng), against=earlier)
    assert found.verdict in ("explained", "ambiguous")
    (cause,) = found.causes
    places = [(m.effect, m.site) for m in cause.members]
    assert ("length_change", f"link{rod}") in places
    # A cart that carries one rod moves it as its length does; and a link may have grown by heat that nobody recorded.
    own = next(m for m in cause.members if m.effect == "length_change")
    assert rod == "1" or own.probability > 0.8 * cause.members[0].probability
    assert rod == "1" or abs(own.parameters["length"].value - by) < 4.0 * own.parameters["length"].sigma
    # No member has a value that physics excludes; where a change of temperature is assumed, it may be a fall.
    effects = effects_by_id()
    for member in cause.members:
        for name, own in getattr(effects.get(member.effect), "plausible", {}).items():
            if (e := member.parameters.get(name)) is not None:
                value = abs(e.value) if member.effect.startswith("thermal") else e.value
                assert own.low <= value + 3.0 * e.sigma
                assert value - 3.0 * e.sigma <= own.high
    found.save(tmp_path / "check")
    model = gtpin.read_model(tmp_path / "check")
    test = commands(rng, 200)
    truth = now.gantry.poses(test)[0]
    errors = [np.sqrt(((one.predict(test).T - truth) ** 2).sum(axis=1).mean()) for one in (earlier, model)]
    if cause.effect == "length_change":
        assert model.effects == ()
        assert errors[1] < 0.4 * errors[0]


@pytest.mark.parametrize("seed", quick_first([4, 5]))
def test_an_unchanged_machine_has_no_changed_length(seed: int):
    rng, machine, earlier = calibrated(seed)
    found = gtpin.diagnose(measured(machine, commands(rng, 14), rng), against=earlier)
    assert found.verdict == "none"
    assert {c.site for c in found.candidates if c.effect == "length_change"} == {
        f"link{r}" for r in ("1", "2a", "2b", "3a", "3b", "3c")
    }


@pytest.mark.parametrize(
    ("seed", "cart", "axis", "by"), quick_first([(6, 2, "a", 5e-4), (7, 3, "b", -5e-4), (8, 2, "b", 4e-4)])
)
def test_a_track_that_was_turned_is_in_the_class_with_its_angle(seed: int, cart: int, axis: str, by: float):
    """The rods' joints move by the angle times the command; a track that is not straight can look like it."""
    rng, machine, earlier = calibrated(seed)
    now = changed(machine, f"track_direction[cart{cart}].{axis}", by)
    found = gtpin.diagnose(measured(now, commands(rng, 24), rng), against=earlier)
    (cause,) = found.causes
    own = next(m for m in cause.members if (m.effect, m.site) == ("track_change", f"cart{cart}"))
    assert max(m.probability for m in cause.members if m is not own) < 0.95
    for name in ("turn_a", "turn_b"):
        true = by if name.endswith(axis) else 0.0
        assert abs(own.parameters[name].value - true) < 4.0 * own.parameters[name].sigma


@pytest.mark.parametrize("seed", quick_first([9, 10]))
def test_the_updated_geometry_has_a_track_that_was_turned(seed: int):
    """Drive errors, which can look like it at these commands, are left out."""
    rng, machine, earlier = calibrated(seed)
    now = changed(machine, "track_direction[cart2].a", 6e-4)
    alike = ["straightness", "linearity", "encoder_scale", "thermal_track", "cross_coupling"]
    found = gtpin.diagnose(measured(now, commands(rng, 24), rng), against=earlier, exclude=alike)
    assert [(cause.effect, cause.site) for cause in found.causes] == [("track_change", "cart2")]
    assert found.model.effects == ()
    test = commands(rng, 200)
    truth = now.gantry.poses(test)[0]
    errors = [np.sqrt(((one.predict(test).T - truth) ** 2).sum(axis=1).mean()) for one in (earlier, found.model)]
    assert errors[1] < 0.4 * errors[0]


@dataclass(frozen=True)
class BentTrack(Machine):
    """A machine one of whose tracks has a wave of 0.2 mm and one period along 1.2 m, in both directions across it."""

    cart: int = 2

    def seen(self, q: Floats) -> tuple[Floats, Rotation]:
        """Row by row: the cart's joints are off by the wave at its command."""
        joints = [
            f"cart_joint[{rod}].{axis}" for rod in {2: ("2a", "2b"), 3: ("3a", "3b", "3c")}[self.cart] for axis in "yz"
        ]
        wave = 2e-4 * np.cos(2.0 * np.pi * q[:, self.cart - 1] / 1.2)
        rows = [self.gantry.off(dict.fromkeys(joints, off)).poses(row[None]) for row, off in zip(q, wave, strict=True)]
        T, R = (np.concatenate(part) for part in zip(*rows, strict=True))
        return T, Rotation.from_matrix(R)


@pytest.mark.parametrize(("seed", "cart"), quick_first([(11, 2), (12, 3)]))
def test_a_track_that_was_bent_is_told_as_not_straight(seed: int, cart: int):
    rng, machine, earlier = calibrated(seed)
    now = BentTrack(machine.gantry, machine.deviations, cart=cart)
    found = gtpin.diagnose(measured(now, commands(rng, 40), rng), against=earlier)
    (cause,) = found.causes
    assert (cause.effect, cause.site) == ("straightness", f"cart{cart}")
    assert all(member.effect != "track_change" for member in cause.members)
