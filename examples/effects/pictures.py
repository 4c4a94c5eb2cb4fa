"""Draws the pictures of docs/effects: three machines' own case of each effect, and what the first does to the platform.

python examples/effects/pictures.py docs/effects [EFFECT ...]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import gtpin
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.chain_motions import of_carried
from gtpin.effects.displacement import Displacement
from gtpin.effects.operating_points import Column, OperatingPoints
from gtpin.robot.parameters import rotation_axes

Floats = np.ndarray
ROBOT = gtpin.load_robot("gantry_tau")
KINEMATICS = gtpin.Model(gtpin.Geometry.nominal(ROBOT)).kinematics
SETTINGS = {"rack_periodic": 0.0628, "rack_step": 0.1}
LOADED = ("cart_compliance", "link_compliance", "joint_clearance")
POSITIVE = (*LOADED, "thermal_links", "thermal_track", "servo_lag", "measurement_delay")
"""What is so only with one sign."""
CART, ROD = 1, 1  # cart2 and link2a
GRID = np.linspace(-1.0, 1.0, 240)
SESSIONS = np.array(["a", "b", "c"], dtype=object)


def operating_points(q: Floats, **columns: Column) -> OperatingPoints:
    """Commands (N, 3) in plain circumstances, but for the columns given."""
    n = len(q)
    zero = np.zeros(n)
    told: dict[str, Column] = {"time": zero, "temp_frame": zero + 20.0, "temp_link": zero + 20.0, "payload": zero}
    told |= {f"{word}{i}": zero + (word == "approach") for word in ("approach", "speed") for i in (1, 2, 3)}
    told |= {f"f{axis}": zero for axis in "xyz"} | {"session": np.resize(SESSIONS, n)}
    return OperatingPoints(
        KINEMATICS, q, KINEMATICS.forward(q), {**told, **columns}, FIT.references if FITTED else None
    )


def workspace(count: int = 7) -> Floats:
    """Commands (N, 3) that put the platform all over a plane along the tracks: together, and carts 1 and 3 against 2."""
    along, apart = np.meshgrid(np.linspace(-0.4, 0.4, count), np.linspace(-0.25, 0.25, count))
    return np.stack([along + apart / 2.0, along - apart, along + apart / 2.0], axis=2).reshape(-1, 3)


FITTED = False
RNG = np.random.default_rng(2)
FIT = operating_points(
    workspace(),
    time=np.linspace(0.0, 7200.0, 49),
    temp_link=np.linspace(20.0, 25.0, 49),
    temp_frame=np.linspace(20.0, 24.0, 49),
    fx=RNG.normal(0.0, 80.0, 49),
    fz=RNG.normal(0.0, 80.0, 49),
    speed2=RNG.uniform(-0.3, 0.3, 49),
)
"""What gives covariates their zero and spread; it is also where the platform's motion is drawn."""
FITTED = True


def shown(name: str) -> tuple[str, Floats, OperatingPoints, str, float]:
    """Label and values (N,) of what an effect goes with, the situations, label of what it does, and the unit of that."""
    still = np.zeros((len(GRID), 3))
    together = np.tile(0.67 * GRID[:, None], (1, 3))
    along = ("q2 [m]", together[:, 1], operating_points(together), "along the track [µm]", 1e-6)
    if name == "backlash":
        return (
            along[0],
            along[1],
            operating_points(together, approach2=np.where(np.arange(240) % 2, 1.0, -1.0)),
            *along[3:],
        )
    if name == "servo_lag":
        speed = 0.3 * GRID
        return "speed2 [m/s]", speed, operating_points(still, speed2=speed), "along the track [µm]", 1e-6
    if name == "measurement_delay":
        speed = 0.3 * GRID
        at = operating_points(still, speed1=speed, speed2=speed, speed3=speed)
        return "speed of all carts [m/s]", speed, at, "x [µm]", 1e-6
    if name == "cross_coupling":
        ahead = still.copy()
        ahead[:, 0] = 0.67 * GRID
        return "q1 [m]", ahead[:, 0], operating_points(ahead), "along the track [µm]", 1e-6
    if name in ("zero_shift", "frame_shift", "target_shift"):
        member = np.repeat(SESSIONS, 80)
        what = "along the track [µm]" if name == "zero_shift" else "x [µm]"
        return "session", np.arange(240.0) / 80.0 - 0.5, operating_points(still, session=member), what, 1e-6
    if name == "thermal_track":
        warm = 22.0 + 2.0 * GRID
        return (
            "temp_frame [°C]",
            warm,
            operating_points(still + 0.5, temp_frame=warm),
            "along the track, q2 = 0.5 m [µm]",
            1e-6,
        )
    if name == "straightness":
        return along[0], along[1], along[2], "upwards [µm]", 1e-6
    if name == "cart_rotation":
        return along[0], along[1], along[2], "joint 2a, rolling [µm]", 1e-6
    if name in LOADED:
        at = operating_points(still)
        pulled = np.einsum("ni,ni->n", at.response[:, :3, ROD], at.along[:, ROD])  # force for each newton along it
        push = (120.0 * GRID - at.force[:, ROD]) / pulled
        at = operating_points(still, **{f"f{axis}": push * at.along[:, ROD, c] for c, axis in enumerate("xyz")})
        what = "along the track [µm]" if name == "cart_compliance" else "longer [µm]"
        return "force in link 2a [N]", at.force[:, ROD], at, what, 1e-6
    if name == "joint_runout":
        ahead = still.copy()
        ahead[:, 1] = 0.25 * GRID
        at = operating_points(ahead)
        return "angle of link 2a [rad]", FIT.references.direction[1][ROD] * at.tilt[:, ROD, 0], at, "longer [µm]", 1e-6
    if name == "thermal_links":
        warm = 22.5 + 2.5 * GRID
        return "temp_link [°C]", warm, operating_points(still, temp_link=warm), "link 2a longer [µm]", 1e-6
    if name in ("tracker_drift", "target_drift"):
        time = 3600.0 * (1.0 + GRID)
        return "time [h]", time / 3600.0, operating_points(still, time=time), "x [µm]", 1e-6
    if name == "tracker_scale":
        at = operating_points(together)
        return "x of the TCP [m]", at.poses.T[:, 0], at, "x [µm]", 1e-6
    if name == "target_offset":
        at = operating_points(together)
        return "x of the TCP [m]", at.poses.T[:, 0], at, "x [mm]", 1e-3
    return along


def seen(at: OperatingPoints, site: str, basis: Displacement, c: Floats) -> Floats:
    """(N,) what an effect does, by the first of the kinds of displacement that it has."""
    axis = ROBOT.actuators[CART].axis
    if basis.command is not None:
        return basis.command[1] @ c
    if basis.placements:
        shift, turn = np.split(of_carried(at, site, basis) @ c, 2, axis=1)
        lever = at.carrier_joints[:, ROD] - at.carrier_joints[:, ROBOT.rods_on(CART)].mean(axis=1)
        moved = shift + np.cross(turn, lever)
        return moved @ (rotation_axes(axis)[0] if np.abs(moved @ axis).max() < 1e-12 else axis)
    if basis.length is not None:
        return (basis.length @ c)[:, ROD]
    assert basis.twist is not None
    return (basis.twist @ c)[:, 0]


def draw(name: str, folder: Path) -> Path:
    effect = effects_by_id()[name]
    sites = effect.sites(ROBOT)
    site = next((s for s in ("cart2", "link2a") if s in sites), sites[0])
    shape_parameter = SETTINGS.get(name)
    label, x, at, what, unit = shown(name)
    figure, (own, platform) = plt.subplots(1, 2, figsize=(8.0, 3.0), width_ratios=(1.2, 1.0), layout="constrained")
    rng, basis = np.random.default_rng(4), effect.basis(at, site, shape_parameter)
    draws = basis.sigma * rng.standard_normal((3, len(basis)))
    if name in POSITIVE:
        draws[:, 0] = basis.sigma[0] * np.array([1.0, 0.7, 1.4])
    order = np.argsort(x)
    for k, c in enumerate(draws):
        y = seen(at, site, basis, c) / unit
        for rows in (order[::2], order[1::2]) if name == "backlash" else (order,):  # both sides of approach
            own.plot(x[rows], y[rows], color=f"C{k}", lw=1.5, alpha=1.0 - 0.25 * k)
    own.set(xlabel=label, ylabel=what)
    own.grid(alpha=0.3)
    if label == "session":
        own.set_xticks([0.0, 1.0, 2.0], list(SESSIONS))
    there = FIT
    n = len(effect.basis(there, site, shape_parameter))
    active = ActiveEffect(effect, site, shape_parameter, draws[0], np.zeros((n, n)), FIT.references)
    moved = with_effects(KINEMATICS, there.q, there.covariates, [active]).minus(there.poses)[:, :3]
    T, largest = there.poses.T, max(float(np.linalg.norm(moved[:, [0, 1]], axis=1).max()), 1e-9)
    platform.quiver(
        T[:, 0], T[:, 1], *(moved[:, [0, 1]].T * 0.12 / largest), angles="xy", scale_units="xy", scale=1.0, width=0.005
    )
    platform.set(
        xlabel="x [m]", ylabel="y [m]", title=f"platform moves by up to {largest * 1e6:.0f} µm", aspect="equal"
    )
    platform.title.set_fontsize("medium")
    platform.margins(0.15)
    figure.suptitle(f"{name} at {site}", fontsize="medium")
    path = folder / f"{name}.svg"
    figure.savefig(path, metadata={"Date": None, "Creator": None})
    plt.close(figure)
    return path


def main(folder: Path, names: list[str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "gtpin", "font.family": "sans-serif"})
    for name in names or [name for name, effect in effects_by_id().items() if effect.sites(ROBOT)]:
        path = draw(name, folder)
        print(f"{path.name:24s} {path.stat().st_size / 1024.0:.0f} kB")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("docs/effects"))
    parser.add_argument("effects", nargs="*", help="ids of effects; all by default")
    asked = parser.parse_args()
    main(asked.folder, asked.effects)
