"""Small machines of their own closed forms: a five-bar whose links are warm, and a delta printer whose belts stretch."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from closures import nominal
from diagnosed import quietly
from scipy.spatial.transform import Rotation
from urdfs import crossing, joint, loop, own, urdf

import gtpin
from gtpin.diagnosis.result import Diagnosis

BASES, NEAR, FAR, ZERO, TOOL = 0.06, 0.15, 0.2, (2.1817, 0.9599), 0.03
"""Of the five-bar: half of the distance of its drives, lengths, m; angles of its near links at zero, rad; tool, m."""


def five_bar() -> str:
    turns = [float(np.arctan2(*(meeting(np.zeros((1, 2)))[0] - e[0])[::-1])) for e in elbows(np.zeros((1, 2)), 1.0)]
    parts = []
    for side, x, zero, turn in zip(("left", "right"), (-BASES, BASES), ZERO, turns, strict=True):
        parts += [
            joint(f"drive_{side}", "base", side, f"{x} 0 0", rpy=f"0 0 {zero}"),
            joint(f"elbow_{side}", side, f"{side}_far", f"{NEAR} 0 0", rpy=f"0 0 {turn - zero}", limit=3.0),
        ]
    parts.append(joint("flange", "left_far", "tool", f"{FAR + TOOL} 0 0", kind="fixed"))
    pin = loop("left_far", f"{FAR} 0 0", "right_far", f"{FAR} 0 0")
    return urdf("five_bar", *parts, pin, own(["drive_left", "drive_right"], "tool"))


def elbows(q: np.ndarray, grown: np.ndarray | float) -> list[np.ndarray]:
    """(N, 2) places of both elbows."""
    found = []
    for i, x in enumerate((-BASES, BASES)):
        angle = q[:, i] + ZERO[i]
        way = np.column_stack([np.cos(angle), np.sin(angle)])
        found.append(np.array([x, 0.0]) + NEAR * np.reshape(grown, (-1, 1)) * way)
    return found


def meeting(q: np.ndarray, grown: np.ndarray | float = 1.0, far: float = FAR) -> np.ndarray:
    """(N, 2) where the far links meet, with all links longer by a factor."""
    left, right = elbows(q, grown)
    radius = far * np.reshape(grown * np.ones(len(q)), (-1, 1))
    return crossing(left, radius, right, radius)


def warm_five_bar(seed: int, expansion: float) -> Diagnosis:
    rng, count = np.random.default_rng(seed), 120
    q, warm = rng.uniform(-0.35, 0.35, (count, 2)), rng.uniform(15.0, 45.0, count)
    grown = 1.0 + expansion * (warm - 20.0)
    pin = meeting(q, grown, FAR + rng.normal(0.0, 2e-4))
    along = pin - elbows(q, grown)[0]
    tool = pin + along / np.linalg.norm(along, axis=1, keepdims=True) * TOOL * grown[:, None]
    T = np.column_stack([tool, np.zeros(count)])
    place = np.array([0.8, -1.1, 0.2]) + rng.normal(0.0, 2e-5, (count, 3))
    seen = Rotation.from_rotvec([0.02, -0.03, 0.7]).apply(T) + place
    return diagnosed(five_bar(), q, seen, {"temp_link": warm}, 2e-5)


def diagnosed(text: str, q: np.ndarray, seen: np.ndarray, told: dict[str, np.ndarray], sigma: float) -> Diagnosis:
    with TemporaryDirectory() as folder:
        (file := Path(folder) / "machine.urdf").write_text(text, encoding="utf-8")
        names, set_up = np.array([f"p{n}" for n in range(len(q))]), {"position_sigma": sigma, "frame": "free"}
        return quietly(gtpin.diagnose, gtpin.Dataset(str(file), names, q, seen, None, told, set_up))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_a_five_bar_whose_links_are_all_warm_is_explained_by_all_its_links(seed: int) -> None:
    found = warm_five_bar(seed, 2.4e-5)
    assert found.verdict == "explained"
    (cause,) = found.causes
    assert (cause.effect, cause.site) == ("thermal_links", "arm")
    expansion = cause.parameters["expansion"]
    assert abs(expansion.value - 2.4e-5) < 3.0 * expansion.sigma


def test_the_urdf_of_the_five_bar_is_the_five_bar_of_the_closed_form() -> None:
    with TemporaryDirectory() as folder:
        (file := Path(folder) / "machine.urdf").write_text(five_bar(), encoding="utf-8")
        robot = gtpin.load_robot(file)
    q = np.random.default_rng(0).uniform(-0.35, 0.35, (10, 2))
    pin = meeting(q)
    along = (pin - elbows(q, 1.0)[0]) / FAR
    T = gtpin.Model(gtpin.Geometry.nominal(robot)).kinematics.forward(q).T
    np.testing.assert_allclose(T[:, :2], pin + TOOL * along, atol=1e-9)


GRAVITY, MASS = -9.81, 9.8
"""Of the delta: m/s^2 along z, and the mass of plate and half of the rods, kg; nothing of gtpin computes its loads here."""


def on_belts(seed: int, compliance: float, payloads: tuple[float, ...] = (0.0, 1.0, 2.0, 3.0)) -> Diagnosis:
    """A linear delta whose carts give way along their tracks by as much per newton, m/N."""
    machine, rng, count = nominal("linear_delta"), np.random.default_rng(seed), 120
    names = machine.parameters()
    machine = machine.off({name: 0.3 * size * rng.standard_normal() for name, size in names.items()})
    q, payload = machine.in_range(rng, count), rng.choice(payloads, count)
    T, R = machine.follow(q, 0.02)
    away = T[:, None] + machine.P @ np.swapaxes(R, 1, 2) - machine.C(q)
    u = away / np.linalg.norm(away, axis=2, keepdims=True)
    weight = np.zeros((count, 6))
    weight[:, 2] = GRAVITY * (MASS + payload)
    lever = np.cross(machine.P @ np.swapaxes(R, 1, 2), u)
    tension = np.linalg.solve(np.concatenate([u, lever], axis=2).swapaxes(1, 2), weight[..., None])[..., 0]
    pull = tension * np.einsum("nkx,kx->nk", u, machine.axis)
    given = np.stack([pull[:, machine.driver == i].sum(axis=1) for i in range(3)], axis=1)
    T, R = machine.close(q + compliance * given, T, R)
    seen = T + rng.normal(0.0, 1.5e-5, (count, 3))
    return diagnosed(machine.urdf, q, seen, {"payload": payload}, 1.5e-5)


CARTS = {("cart_compliance", site) for site in ("cart1", "cart2", "cart3")}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("compliance", [5e-6, 1.5e-5])
def test_where_belts_stretch_at_all_carts_they_are_in_the_class_and_links_are_not_certain(
    seed: int, compliance: float
) -> None:
    """Links that all stretch move a delta in nearly the same way."""
    found = on_belts(seed, compliance)
    assert found.verdict != "none"
    held = {(member.effect, member.site) for cause in found.causes for member in cause.members}
    assert held >= CARTS or found.verdict == "unknown"
    assert not [cause for cause in found.causes if cause.probability >= 0.95 and cause.effect != "cart_compliance"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_delta_with_stiff_belts_is_silent(seed: int) -> None:
    assert on_belts(seed, 0.0).verdict == "none"
