"""MJCF: brought to rest in MuJoCo, the machine is where the model says."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn_machines import Drawn
from with_effects import active

import gtpin
from gtpin.errors import GtpinWarning
from gtpin.export import export

pytest.importorskip("mujoco")
sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "simulator"))
import mujoco
from mujoco_machine import MujocoMachine


def apart(poses: gtpin.Poses, expected: gtpin.Poses) -> tuple[float, float]:
    """Largest distance, m, and angle, rad."""
    off = poses.minus(expected)
    return tuple(float(np.linalg.norm(part, axis=1).max()) for part in (off[:, :3], off[:, 3:]))


@pytest.mark.slow
def test_at_rest_the_platform_is_where_the_model_is(drawn: Drawn, exported: Callable[[str], Path]) -> None:
    rest = MujocoMachine(exported(".xml"), drawn.model.robot.tcp_frame)
    assert max(apart(rest.poses(drawn.q, {}), drawn.poses)) < 1e-5


def test_a_file_starts_at_home_with_its_loops_closed(drawn: Drawn, exported: Callable[[str], Path]) -> None:
    rest = MujocoMachine(exported(".xml"), drawn.model.robot.tcp_frame)
    mujoco.mj_forward(rest.model, rest.data)
    assert rest.model.neq == 6
    np.testing.assert_allclose(rest.model.key_qpos[0], rest.model.qpos0, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(rest.model.key_ctrl[0], drawn.model.robot.home_q)
    home = drawn.model.predict(drawn.model.robot.home_q[None])
    np.testing.assert_allclose(rest.data.xpos[rest.tcp], home.T[0], rtol=0, atol=1e-12)
    # The second anchors, as MuJoCo places them, are where the URDF has them.
    for k, loop in enumerate(drawn.model.robot.description.loops):
        assert rest.model.equality(k).name == loop.name


def test_names_are_the_sites(drawn: Drawn, exported: Callable[[str], Path]) -> None:
    rest, robot = MujocoMachine(exported(".xml"), drawn.model.robot.tcp_frame), drawn.model.robot
    bodies = {rest.model.body(i).name for i in range(rest.model.nbody)}
    assert {*robot.sites, *(rod.link for rod in robot.rods), "platform"} <= bodies
    assert [rest.model.actuator(i).name for i in range(rest.model.nu)] == list(robot.sites)


def at_rest(model: gtpin.Model, folder: Path, q: np.ndarray, force: dict[str, np.ndarray] | None = None) -> gtpin.Poses:
    export(model, folder / "robot.xml", force=True)
    return MujocoMachine(folder / "robot.xml", model.robot.tcp_frame).poses(q, force or {})


def with_scales(robot: gtpin.Robot, off: float) -> gtpin.Geometry:
    geometry = gtpin.Geometry.nominal(robot, scale="actuator")
    return geometry.with_values(geometry.values + [off * (p.kind == "scale") for p in geometry.parameters])


@pytest.fixture
def gantry(drawn_of: Callable[[str], Drawn]) -> Drawn:
    return drawn_of("gantry_tau")


CART = {"along": 3e-7, "across_a": 1e-7, "across_b": 2e-7, "roll": 2e-6, "tip_a": 3e-6, "tip_b": 4e-6}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("within", "effect", "given"),
    [
        (0.02, "link_compliance", {"arm": {"compliance": 2e-7}, "link3b": {"compliance": 3e-7}}),
        (0.04, "cart_compliance", {"cart3": CART}),
    ],
)
def test_soft_parts_give_way_as_the_model_says(
    gantry: Drawn, within: float, effect: str, given: dict[str, dict[str, float]], tmp_path: Path
) -> None:
    """Five times as soft as usual. On the cart hangs besides half of its rods' own weight, 60 of some 900 N."""
    soft = tuple(active(gantry.model, gantry.q, effect, site, **values) for site, values in given.items())
    model, q = replace(gantry.model, effects=soft), gantry.q[:12]
    predicted = model.predict(q)
    shift = np.linalg.norm(predicted.T - gantry.model.predict(q).T, axis=1)
    assert shift.min() > 2e-5
    assert apart(at_rest(model, tmp_path, q), predicted)[0] < within * shift.max()


@pytest.mark.slow
def test_a_soft_arm_gives_way_under_a_push_on_the_tool(gantry: Drawn, tmp_path: Path) -> None:
    soft = active(gantry.model, gantry.q, "link_compliance", "arm", compliance=2e-7)
    model, q = replace(gantry.model, effects=(soft,)), gantry.q[:6]
    push = {"fx": np.full(6, 150.0), "fy": np.full(6, -200.0), "fz": np.full(6, 100.0)}
    found = at_rest(model, tmp_path, q, push).T - at_rest(model, tmp_path, q).T
    predicted = model.predict(q, push).T - model.predict(q).T
    assert np.linalg.norm(predicted, axis=1).min() > 1e-5
    assert np.abs(found - predicted).max() < 0.02 * np.abs(predicted).max()


def test_drive_scales_are_held(gantry: Drawn, tmp_path: Path) -> None:
    robot, q = gantry.model.robot, gantry.q[:10]
    geometry = with_scales(robot, 1e-3)
    scale = active(gtpin.Model(geometry), gantry.q, "encoder_scale", "cart2", first=5e-4)
    model = gtpin.Model(geometry, effects=(scale,))
    with warnings.catch_warnings():
        warnings.simplefilter("error", GtpinWarning)
        there = at_rest(model, tmp_path, q)
    assert apart(there, model.predict(q))[0] < 1e-5
    assert apart(there, gtpin.Model(gtpin.Geometry.nominal(robot)).predict(q))[0] > 1e-4


def test_ranges_are_those_of_the_commands_where_drives_are_scaled(
    drawn_of: Callable[[str], Drawn], tmp_path: Path
) -> None:
    """A leg that goes six per cent too far goes beyond the range of its joint in the URDF."""
    robot = drawn_of("stewart").model.robot
    model, q = gtpin.Model(with_scales(robot, 0.06)), np.array([robot.upper, robot.home_q])
    assert max(apart(at_rest(model, tmp_path, q), model.predict(q))) < 1e-5


def test_what_it_can_not_hold_is_named(gantry: Drawn, tmp_path: Path) -> None:
    wave = active(gantry.model, gantry.q, "rack_periodic", "cart1", 0.02, first=5e-5)
    with pytest.warns(GtpinWarning, match="does not hold rack_periodic@cart1"):
        export(replace(gantry.model, effects=(wave,)), tmp_path / "robot.xml")
    soft = active(gantry.model, gantry.q, "link_compliance", "arm", compliance=2e-7)
    with pytest.warns(GtpinWarning, match="does not hold link_compliance@arm"):
        export(replace(gantry.model, effects=(soft,)), tmp_path / "robot.urdf")
