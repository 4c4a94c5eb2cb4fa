"""MJCF: brought to rest in MuJoCo, the machine is where the model says."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn_machines import Drawn
from scipy.spatial.transform import Rotation
from with_effects import active

import gtpin
from gtpin.errors import GtpinWarning
from gtpin.export import export

mujoco = pytest.importorskip("mujoco")
from at_rest import Rest  # noqa: E402


def apart(T: np.ndarray, R: np.ndarray, poses: gtpin.Poses) -> tuple[float, float]:
    turn = Rotation.from_matrix(R @ np.swapaxes(poses.R, 1, 2)).magnitude()
    return float(np.linalg.norm(T - poses.T, axis=1).max()), float(turn.max())


@pytest.mark.slow
def test_at_rest_the_platform_is_where_the_model_is(drawn: Drawn, exported: Callable[[str], Path]) -> None:
    rest = Rest(exported(".xml"), drawn.model.robot.tcp_frame)
    position, turn = apart(*rest.poses(drawn.q), drawn.poses)
    assert position < 1e-5
    assert turn < 1e-5


def test_a_file_starts_at_home_with_its_loops_closed(drawn: Drawn, exported: Callable[[str], Path]) -> None:
    rest = Rest(exported(".xml"), drawn.model.robot.tcp_frame)
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
    rest, robot = Rest(exported(".xml"), drawn.model.robot.tcp_frame), drawn.model.robot
    bodies = {rest.model.body(i).name for i in range(rest.model.nbody)}
    assert {*robot.sites, *(rod.link for rod in robot.rods), "platform"} <= bodies
    assert [rest.model.actuator(i).name for i in range(rest.model.nu)] == list(robot.sites)


@pytest.fixture
def gantry(drawn_of: Callable[[str], Drawn]) -> Drawn:
    return drawn_of("gantry_tau")


@pytest.mark.slow
def test_soft_links_stretch_as_the_model_says(gantry: Drawn, tmp_path: Path) -> None:
    """Compliances of the whole arm and of one link, five times the usual so that they show."""
    soft = active(gantry.model, gantry.q, "link_compliance", "arm", compliance=2e-7)
    softer = active(gantry.model, gantry.q, "link_compliance", "link3b", compliance=3e-7)
    model = replace(gantry.model, effects=(soft, softer))
    export(model, tmp_path / "soft.xml")
    T, R = Rest(tmp_path / "soft.xml", "tcp").poses(gantry.q[:12])
    predicted, rigid = model.predict(gantry.q[:12]), gantry.model.predict(gantry.q[:12])
    shift = np.linalg.norm(predicted.T - rigid.T, axis=1)
    assert shift.min() > 2e-5
    assert apart(T, R, predicted)[0] < 0.02 * shift.max()


@pytest.mark.slow
def test_a_soft_cart_gives_way_and_tips_as_the_model_says(gantry: Drawn, tmp_path: Path) -> None:
    """But for what MuJoCo hangs on the cart besides: half of its rods' own weight, 60 of some 900 N."""
    given = {"along": 3e-7, "across_a": 1e-7, "across_b": 2e-7, "roll": 2e-6, "tip_a": 3e-6, "tip_b": 4e-6}
    model = replace(gantry.model, effects=(active(gantry.model, gantry.q, "cart_compliance", "cart3", **given),))
    export(model, tmp_path / "soft.xml")
    T, R = Rest(tmp_path / "soft.xml", "tcp").poses(gantry.q[:12])
    predicted, rigid = model.predict(gantry.q[:12]), gantry.model.predict(gantry.q[:12])
    shift = np.linalg.norm(predicted.T - rigid.T, axis=1)
    assert shift.min() > 2e-5
    assert apart(T, R, predicted)[0] < 0.04 * shift.max()


@pytest.mark.slow
def test_a_soft_arm_gives_way_under_a_push_on_the_tool(gantry: Drawn, tmp_path: Path) -> None:
    push = (150.0, -200.0, 100.0)
    soft = active(gantry.model, gantry.q, "link_compliance", "arm", compliance=2e-7)
    model = replace(gantry.model, effects=(soft,))
    export(model, tmp_path / "soft.xml")
    q = gantry.q[:6]
    pushed, unpushed = (Rest(tmp_path / "soft.xml", "tcp", load).poses(q)[0] for load in (push, (0.0, 0.0, 0.0)))
    told = {f"f{axis}": np.full(len(q), value) for axis, value in zip("xyz", push, strict=True)}
    predicted = model.predict(q, told).T - model.predict(q).T
    assert np.linalg.norm(predicted, axis=1).min() > 1e-5
    assert np.abs(pushed - unpushed - predicted).max() < 0.02 * np.abs(predicted).max()


def test_drive_scales_are_held(gantry: Drawn, tmp_path: Path) -> None:
    robot = gantry.model.robot
    geometry = gtpin.Geometry.nominal(robot, scale="actuator")
    off = np.array([1e-3 if p.kind == "scale" else 0.0 for p in geometry.parameters])
    geometry = geometry.with_values(geometry.values + off)
    scale = active(gtpin.Model(geometry), gantry.q, "encoder_scale", "cart2", first=5e-4)
    model = gtpin.Model(geometry, effects=(scale,))
    with warnings.catch_warnings():
        warnings.simplefilter("error", GtpinWarning)
        export(model, tmp_path / "scaled.xml")
    T, R = Rest(tmp_path / "scaled.xml", "tcp").poses(gantry.q[:10])
    assert apart(T, R, model.predict(gantry.q[:10]))[0] < 1e-5
    assert apart(T, R, gtpin.Model(gtpin.Geometry.nominal(robot)).predict(gantry.q[:10]))[0] > 1e-4


def test_ranges_are_those_of_the_commands_where_drives_are_scaled(
    drawn_of: Callable[[str], Drawn], tmp_path: Path
) -> None:
    """A leg that goes six per cent too far goes beyond the range of its joint in the URDF."""
    robot = drawn_of("stewart").model.robot
    geometry = gtpin.Geometry.nominal(robot, scale="actuator")
    off = np.array([0.06 if p.kind == "scale" else 0.0 for p in geometry.parameters])
    model = gtpin.Model(geometry.with_values(geometry.values + off))
    export(model, tmp_path / "scaled.xml")
    q = np.array([robot.upper, robot.home_q])
    T, R = Rest(tmp_path / "scaled.xml", robot.tcp_frame).poses(q)
    position, turn = apart(T, R, model.predict(q))
    assert position < 1e-5
    assert turn < 1e-5


def test_what_it_can_not_hold_is_named(gantry: Drawn, tmp_path: Path) -> None:
    wave = active(gantry.model, gantry.q, "rack_periodic", "cart1", 0.02, first=5e-5)
    with pytest.warns(GtpinWarning, match="does not hold rack_periodic@cart1"):
        export(replace(gantry.model, effects=(wave,)), tmp_path / "robot.xml")
    soft = active(gantry.model, gantry.q, "link_compliance", "arm", compliance=2e-7)
    with pytest.warns(GtpinWarning, match="does not hold link_compliance@arm"):
        export(replace(gantry.model, effects=(soft,)), tmp_path / "robot.urdf")
