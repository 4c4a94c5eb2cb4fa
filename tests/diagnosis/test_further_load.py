"""Loads that nobody recorded, and drives and rods that give way to theirs, of a Gantry-Tau of the tests' own closures."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from closures import ORIENTATION_SIGMA, POSITION_SIGMA, Floats, nominal
from diagnosed import quietly
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.diagnosis.result import Diagnosis

pytestmark = pytest.mark.slow

GRAVITY, PLATE, ROD, CENTRE, POSES = -9.81, 22.0, 4.1, np.array([-0.09, 0.0, 0.02]), 120
"""m/s^2; masses of plate and of a rod, kg, and the plate's centre, m, as in the URDF; number of poses. Nothing of gtpin
computes the loads here."""
GIVES = np.array([6e-7, 4e-7, 5e-7])
"""Compliances of the three drives along their tracks, m/N."""


def pulls(machine: object, q: Floats, mass: Floats) -> Floats:
    """(N, 3) forces of the rods on the carts along their tracks, N, with a mass (N,) at the TCP."""
    T, R = machine.follow(q, 0.02)
    along = tensions(machine, q, mass, T, R) * np.einsum("nkx,kx->nk", directions(machine, q, T, R), machine.axis)
    return np.stack([along[:, machine.driver == i].sum(axis=1) for i in range(3)], axis=1)


def directions(machine: object, q: Floats, T: Floats, R: Floats) -> Floats:
    """(N, 6, 3) unit vectors along the rods, from the carts to the plate."""
    away = T[:, None] + machine.P @ np.swapaxes(R, 1, 2) - machine.C(q)
    return away / np.linalg.norm(away, axis=2, keepdims=True)


def tensions(machine: object, q: Floats, mass: Floats, T: Floats, R: Floats) -> Floats:
    """(N, 6) forces that pull the rods, N, with a mass (N,) at the TCP. Half of each rod's weight hangs on the plate."""
    P, u = machine.P @ np.swapaxes(R, 1, 2), directions(machine, q, T, R)
    weight = np.zeros((len(q), 6))
    weight[:, 2] = GRAVITY * (mass + PLATE + 3.0 * ROD)
    centre = (PLATE * CENTRE + ROD / 2.0 * machine.P.sum(axis=0)) @ np.swapaxes(R, 1, 2)
    weight[:, 3:] = np.cross(centre, [0.0, 0.0, GRAVITY])
    return np.linalg.solve(np.concatenate([u, np.cross(P, u)], axis=2).swapaxes(1, 2), weight[..., None])[..., 0]


@cache
def diagnosed(
    seed: int, hidden: float = 0.0, shift: float = 0.0, wheel: float = 0.0, orientations: bool = True
) -> Diagnosis:
    """``hidden``: load that hangs on in the last two of four sessions, kg. ``shift``: of the zero of cart 1 in them, m.

    ``wheel``: error of cart 2 by a wheel that turns every 0.5 m and is pressed into its teeth by the load, m. The drives give
    way without it.
    """
    rng, plain = np.random.default_rng(seed), nominal("gantry_tau")
    machine = plain.off({f"length[{rod[4:]}]": rng.normal(0.0, 2e-4) for rod in plain.rods})
    q, payload = machine.in_range(rng, POSES), rng.choice([0.0, 5.0, 10.0], POSES)
    time, session = np.sort(rng.uniform(0.0, 9000.0, POSES)), 4 * np.arange(POSES) // POSES
    load = pulls(machine, q, payload + hidden * (session > 1))
    off = np.zeros((POSES, 3)) if wheel else GIVES * load
    off[:, 0] += shift * (session > 1)
    pressed = (load[:, 1] - load[:, 1].mean()) / load[:, 1].std()
    turns = 2.0 * np.pi * q[:, 1] / 0.5 + rng.uniform(0.0, 6.0)
    off[:, 1] += wheel * (np.cos(turns) + 0.4 * np.cos(2.0 * turns)) * (1.0 + 0.3 * pressed)
    T, R = machine.follow(q)
    T, R = machine.close(q + off, T, R)
    noise = Rotation.from_rotvec(rng.normal(0.0, ORIENTATION_SIGMA, (POSES, 3)))
    return quietly(
        gtpin.diagnose,
        gtpin.Dataset(
            "gantry_tau",
            np.array([f"p{n}" for n in range(POSES)]),
            q,
            T + rng.normal(0.0, POSITION_SIGMA, (POSES, 3)),
            (noise * Rotation.from_matrix(R)).as_quat()[:, [3, 0, 1, 2]] if orientations else None,
            {"time": time, "session": session.astype(str).astype(object), "payload": payload},
            {"position_sigma": POSITION_SIGMA} | ({"orientation_sigma": ORIENTATION_SIGMA} if orientations else {}),
        ),
    )


def certain(found: Diagnosis) -> set[tuple[str, str]]:
    return {(cause.effect, cause.site) for cause in found.causes if cause.probability >= 0.9}


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_load_that_nobody_recorded_is_no_certain_shift_of_anything(seed):
    """It shifts all drives at once, each by its compliance."""
    found = diagnosed(seed, hidden=8.0)
    assert {effect for effect, _ in certain(found)} <= {"cart_compliance", "link_compliance"}
    held = {member.effect for cause in found.causes for member in cause.members}
    assert found.verdict == "unknown" or held & {"cart_compliance", "link_compliance"}


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_zero_that_moved_beside_drives_that_give_way_is_certain(seed):
    assert ("zero_shift", "cart1") in certain(diagnosed(seed, shift=2e-4))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_wheel_that_is_pressed_into_its_teeth_is_no_track_that_is_not_straight(seed):
    found = diagnosed(seed, wheel=2e-4, orientations=False)
    assert found.verdict != "none"
    assert {site for _, site in certain(found)} <= {"cart2"}
    assert {effect for effect, _ in certain(found)} <= {"linearity", "rack_periodic"}


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_rod_that_is_soft_under_half_of_its_load_has_no_certain_ball_that_is_out_of_round(seed):
    """A function of the rod's directions follows any function of the load, which the directions determine."""
    rng, plain, count = np.random.default_rng(seed), nominal("gantry_tau"), 230
    machine = plain.off({f"length[{rod[4:]}]": rng.normal(0.0, 2e-4) for rod in plain.rods})
    q = machine.in_range(rng, count)
    T, R = machine.follow(q, 0.02)
    pull = tensions(machine, q, np.zeros(count), T, R)[:, 4]
    longer = np.eye(6)[4] * 1e-5 * np.maximum(pull - np.median(pull), 0.0)[:, None]
    T, R = replace(machine, L0=machine.L0 + longer).close(q, T, R)
    turn = Rotation.from_rotvec(rng.normal(0.0, ORIENTATION_SIGMA, (count, 3))) * Rotation.from_matrix(R)
    found = quietly(
        gtpin.diagnose,
        gtpin.Dataset(
            "gantry_tau",
            np.array([f"p{n}" for n in range(count)]),
            q,
            T + rng.normal(0.0, POSITION_SIGMA, T.shape),
            turn.as_quat(scalar_first=True),
            {},
            {"position_sigma": POSITION_SIGMA, "orientation_sigma": ORIENTATION_SIGMA},
        ),
    )
    assert found.verdict != "none"
    assert {effect for effect, _ in certain(found)} <= {"link_compliance"}
