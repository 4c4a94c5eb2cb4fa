"""Parameters that are held, freed or bounded by name, and zeros of joints as parameters."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from monte_carlo import Study, study
from virtual_arm import Arm
from virtual_gantry import GANTRY, ROBOT, Machine, case, commands, draw, measured

import gtpin
from gtpin.errors import GtpinError, GtpinWarning

NAME = "length[2a]"
LENGTH = next(rod.L for rod in ROBOT.rods if rod.name == "2a")
SIGMAS = (2e-5, 5e-5)


def spoiled(rng: np.random.Generator, off: float) -> tuple[Machine, gtpin.Dataset]:
    """A Gantry-Tau with one rod whose length is off by so much, and its measured poses."""
    drawn = draw(rng).deviations | {NAME: off}
    machine = Machine(GANTRY.off(drawn), drawn)
    return machine, measured(machine, commands(rng, 60), rng)


def test_a_held_parameter_has_its_value_in_the_result_on_disk_and_in_exports(tmp_path: Path) -> None:
    machine, dataset = case(np.random.default_rng(3), 60)
    known = LENGTH + machine.deviations[NAME]
    found = gtpin.calibrate(dataset, fix={NAME: known})
    assert found[NAME].value == known
    assert found[NAME].sigma == 0.0
    assert [one.before for one in found.by_instrument] == [one.before for one in gtpin.calibrate(dataset).by_instrument]
    text = found.summary()
    assert NAME in text
    assert "(held)" in text
    assert NAME not in found.names
    assert json.loads(json.dumps(found.to_json()))["held"] == {NAME: known}
    ends = found.model.kinematics.rod_ends(dataset.q, found.model.kinematics.forward(dataset.q))
    np.testing.assert_allclose(np.linalg.norm(ends[0] - ends[1], axis=2)[:, 1], known, rtol=0, atol=1e-12)
    gtpin.write_model(found.model, tmp_path / "model")
    again = gtpin.read_model(tmp_path / "model")
    assert again.geometry[NAME] == known
    assert (again.predict(dataset.q).T == found.model.predict(dataset.q).T).all()
    exported = gtpin.read_model(tmp_path / "model" / "robot.urdf")
    assert np.abs(exported.predict(dataset.q).T - found.model.predict(dataset.q).T).max() < 1e-9


def test_zeros_of_a_robot_with_rods_are_in_the_model_on_disk_and_in_the_exported_robot(tmp_path: Path) -> None:
    """A drive that stands 30 mm off, fifteen tolerances of the joints that it carries: without its zero they take it up."""
    rng = np.random.default_rng(8)
    machine, q, off = draw(rng), commands(rng, 60), np.array([0.0, 0.03, 0.0])
    data = replace(measured(machine, q + off, rng), q=q)
    found = gtpin.calibrate(data, zeros=True)
    assert abs(found["zero[cart2]"].value - 0.03) < 4.0 * found["zero[cart2]"].sigma < 0.01
    assert np.abs(found.model.predict(q).T - machine.gantry.poses(q + off)[0]).max() < 1e-4
    # The shift that the joints on the cart have in common is told in any case, with the zero.
    assert abs(found.zeros[1].value - 0.03) < 4.0 * found.zeros[1].sigma
    gtpin.write_model(found.model, tmp_path / "model")
    for again in ("model", "model/robot.urdf"):
        assert np.abs(gtpin.read_model(tmp_path / again).predict(q).T - found.model.predict(q).T).max() < 1e-9


@pytest.mark.slow
def test_the_others_cover_where_one_is_held_at_its_true_value() -> None:
    machines, found = [], []
    for seed in range(20):
        machine, dataset = case(np.random.default_rng([seed, 1]), 60)
        found.append(gtpin.calibrate(dataset, fix={NAME: LENGTH + machine.deviations[NAME]}))
        machines.append(machine)
    many = Study(found, machines)
    many.assert_covers()
    many.assert_unbiased()


@pytest.mark.slow
def test_a_freed_parameter_is_found_however_far_it_is_from_its_tolerance() -> None:
    """4 cm where the tolerance is 1 mm; the tolerances of the others say what they said."""
    machines, found = [], []
    for seed in range(20):
        machine, dataset = spoiled(np.random.default_rng([seed, 2]), 0.04)
        found.append(gtpin.calibrate(dataset, free=[NAME]))
        machines.append(machine)
    many = Study(found, machines)
    many.assert_covers()
    many.assert_unbiased()
    many.assert_clean(0.02)


def test_a_bounded_parameter_that_the_data_put_outside_is_held_at_its_end() -> None:
    dataset = spoiled(np.random.default_rng(5), 2e-3)[1]
    plain = gtpin.calibrate(dataset)
    high = plain[NAME].value - plain[NAME].sigma
    with pytest.warns(GtpinWarning, match=r"length\[2a\] is held at .*, the end of its bounds: .*, 1 sigmas outside"):
        found = gtpin.calibrate(dataset, bounds={NAME: (LENGTH, high)})
    assert found[NAME].value == high
    assert any("is held at" in text for text in found.warnings)
    held = gtpin.calibrate(dataset, fix={NAME: high})
    np.testing.assert_allclose(found.values, held.values, rtol=0, atol=1e-12)


def test_bounds_that_hold_anyway_change_nothing() -> None:
    dataset = case(np.random.default_rng(6), 60)[1]
    found, plain = gtpin.calibrate(dataset, bounds={NAME: (0.0, 5.0)}), gtpin.calibrate(dataset)
    assert (found.values == plain.values).all()
    assert not found.warnings


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fix": {"lenght[2a]": 2.0}}, r"no parameter is called 'lenght\[2a\]'; did you mean length\[2a\]"),
        ({"free": ["cart_joint[2a]"]}, r"did you mean cart_joint\[2a\]\.[xyz], "),
        ({"bounds": {"scale[cart1]": (0.0, 1.0)}}, r"no parameter is called 'scale\[cart1\]'; .*scale=.actuator."),
        ({"fix": {NAME: LENGTH}, "free": [NAME]}, r"length\[2a\] is to be held and freed"),
        ({"bounds": {NAME: (2.0, 1.0)}}, r"bounds of length\[2a\] are \(2\.0, 1\.0\)"),
        ({"fix": {NAME: float("nan")}}, r"length\[2a\] is held at nan"),
        ({"fix": {NAME: 2045.9}}, r"length\[2a\] is held at 2045.9 m, .* times less; .* mm"),
        ({"fix": {NAME: "long"}}, "give real numbers"),
        ({"fix": [NAME]}, r"fix=\['length\[2a\]'\]; give a dictionary"),
        ({"fix": {NAME: 0.1}}, "can reach none of the poses"),
        ({"without": ["length", "platform_joint", "cart_joint", "track_direction"]}, "no parameter is left"),
        ({"zeros": True, "directions": "rod"}, "zeros of joints beside parameters of single rods"),
    ],
)
def test_what_no_parameter_can_be_is_refused_with_the_names_that_are_alike(options: dict, message: str) -> None:
    with pytest.raises(GtpinError, match=message):
        gtpin.calibrate(case(np.random.default_rng(0), 20)[1], **options)


@pytest.mark.slow
def test_zeros_of_an_arm_cover() -> None:
    def drawn(rng: np.random.Generator) -> tuple[Arm, gtpin.Dataset]:
        zeros = rng.normal(0.0, 0.03, 6)
        machine = Arm.drawn(rng, 5e-4, off=lambda q: zeros)
        robot, true = gtpin.load_robot("ur5"), {}
        for i, site in enumerate(robot.sites):
            axis = {"Y": (0, 1, 0), "Z": (0, 0, 1), "X": (1, 0, 0)}[robot.model.joints[i + 1].shortname()[-1]]
            turned = [machine.deviations[f"placement[{site}].{name}"] for name in ("rx", "ry", "rz")]
            true[f"zero[{site}]"] = zeros[i] + float(np.dot(axis, turned))
        return replace(machine, deviations=true), machine.measured(
            rng.uniform(-2.0, 2.0, (50, 6)), rng, SIGMAS, free=False
        )

    found = study(drawn, 20, zeros=True)
    assert sum(name.startswith("zero[") for name in found.calibrations[0].names) == 6
    assert len(found.calibrations[0].names) == 42  # each in the place of the rotation about its axis
    assert len(found.known) == 6
    found.assert_covers()
    found.assert_unbiased()
