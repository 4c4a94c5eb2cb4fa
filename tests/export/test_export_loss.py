"""What a file does not hold of a model is told in micrometres, and a drive's scale stands in a transmission."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from with_effects import active

import gtpin
from gtpin.export import export
from gtpin.export.loss import assumed_tool, with_losses

UR5 = gtpin.read_model("ur5")
RNG = np.random.default_rng(0)
Q = RNG.uniform(-2.0, 2.0, (1500, 6))
APPROACH = {f"approach{i + 1}": RNG.choice([-1.0, 1.0], len(Q)) for i in range(6)}


def with_effect(name: str, site: str, first: float) -> gtpin.Model:
    """An arm with an effect whose first coefficient is given; all others are none."""
    shape_parameter = 0.2 if name == "rack_periodic" else None
    return replace(UR5, effects=(active(UR5, Q, name, site, shape_parameter, APPROACH, first),))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "site", "first"),
    [
        ("encoder_scale", "shoulder_lift_joint", 1e-4),
        ("rack_periodic", "elbow_joint", 1e-4),
        ("joint_compliance", "shoulder_lift_joint", 2e-6),
        ("backlash", "wrist_1_joint", 1e-4),
        ("link_compliance", "arm", 1e-7),
    ],
)
def test_a_loss_is_how_far_predictions_without_the_effect_are_off(name: str, site: str, first: float) -> None:
    model = with_effect(name, site, first)
    off = model.predict(Q, APPROACH).T - UR5.predict(Q).T
    exact = 1e6 * float(np.sqrt((off**2).sum(axis=1).mean()))
    (text,) = with_losses(model, (f"{name}@{site}",))
    told = re.fullmatch(rf"{name}@{site} \((\S+) um\)", text)
    assert told is not None
    # Of 512 commands, beside 1,500 others of the same ranges.
    assert float(told[1]) == pytest.approx(exact, rel=0.1)


def test_what_depends_on_a_temperature_is_told_for_a_kelvin() -> None:
    warm = {"temp_link": np.linspace(20.0, 30.0, len(Q))}
    links = active(UR5, Q, "thermal_links", "arm", covariates=warm, drawn=lambda sigma: np.full(len(sigma), 1e-5))
    (text,) = with_losses(replace(UR5, effects=(links,)), ("thermal_links@arm",))
    assert text.endswith(" um for each K off the file's 20 degC)")


def test_a_loss_is_without_what_a_free_instrument_does_not_show() -> None:
    model = with_effect("joint_compliance", "shoulder_lift_joint", 2e-6)
    free = replace(model, frame=gtpin.Frame(np.array([2.0, 0.0, 1.0])))
    a, b = model.predict(Q, APPROACH).T, UR5.predict(Q).T
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    turn = Rotation.align_vectors(b, a)[0]
    exact = 1e6 * float(np.sqrt(((turn.apply(a) - b) ** 2).sum(axis=1).mean()))
    whole, told = (
        float(re.findall(r"\((\S+) um\)", with_losses(one, ("joint_compliance@shoulder_lift_joint",))[0])[0])
        for one in (model, free)
    )
    assert told == pytest.approx(exact, rel=0.1)
    assert told < 0.8 * whole


def test_a_drives_scale_stands_in_a_transmission_and_is_told(tmp_path: Path) -> None:
    with pytest.warns(gtpin.GtpinWarning, match=r"holds encoder_scale@elbow_joint \(\S+ um\) as <transmission> only"):
        export(with_effect("encoder_scale", "elbow_joint", 1e-4), tmp_path / "arm.urdf")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        export(UR5, tmp_path / "plain.urdf")
    before, after = (reductions(tmp_path / name) for name in ("plain.urdf", "arm.urdf"))
    assert len(after) == len(before)  # ur5's URDF has a transmission for each joint already
    for joint, reduction in after.items():
        # A joint moves by its actuator's travel over the reduction.
        assert before[joint] / reduction == pytest.approx(1.0 + 1e-4 * (joint == "elbow_joint"), abs=1e-12)
    assert "<!-- this file holds encoder_scale@elbow_joint" in (tmp_path / "arm.urdf").read_text(encoding="utf-8")
    q = Q[:3]
    again = gtpin.read_model(tmp_path / "arm.urdf")
    np.testing.assert_allclose(again.predict(q).T, UR5.predict(q).T, rtol=0, atol=1e-12)


def reductions(file: Path) -> dict[str, float]:
    root = ElementTree.parse(file).getroot()
    found = {}
    for transmission in root.findall("transmission"):
        joint, reduction = transmission.find("joint"), next(transmission.iter("mechanicalReduction"))
        assert joint is not None
        found[joint.get("name", "")] = float(reduction.text or "nan")
    return found


def test_the_place_of_an_assumed_tool_has_the_tolerances_that_the_fit_widened() -> None:
    nominal = gtpin.read_model("ur5").geometry
    seen = tuple(replace(p, nominal=0.07) if p.name == "platform.z" else p for p in nominal.parameters)
    geometry = replace(nominal, parameters=seen, values=np.array([p.nominal for p in seen]))
    for factor, words in ((1.0, "to 0.5 mm and 0.5 mrad"), (3.0, "to 1.5 mm and 1.5 mrad")):
        (said,) = assumed_tool(gtpin.Model(geometry.with_tolerances(np.full(len(seen), factor))))
        assert words in said
