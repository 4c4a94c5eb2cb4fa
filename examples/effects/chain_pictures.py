"""Draws the pictures of docs/effects for effects at joints of robots without rods: three arms' own case of each effect.

python examples/effects/chain_pictures.py docs/effects [EFFECT ...]
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import gtpin
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.chain_motions import joint_frame
from gtpin.effects.displacement import Displacement
from gtpin.effects.operating_points import OperatingPoints

Floats = np.ndarray
KINEMATICS = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot(Path(__file__).parent / "arm.urdf"))).kinematics
SITE = "shoulder"
NAMES = ("joint_compliance", "bearing_compliance", "axis_motion")
GRID = np.linspace(-1.0, 1.0, 240)
HOME = np.array([0.0, 0.3, 1.2, 0.2, 0.4, 0.0])


def operating_points(q: Floats, fixed: OperatingPoints | None = None, **columns: Floats) -> OperatingPoints:
    """Commands (N, 6) without a load on the tool, but for the columns given."""
    zero = np.zeros(len(q))
    told = dict.fromkeys(("payload", "fx", "fy", "fz"), zero) | {f"approach{i}": zero + 1.0 for i in range(1, 7)}
    return OperatingPoints(KINEMATICS, q, KINEMATICS.forward(q), told | columns, fixed.references if fixed else None)


def plane(count: int = 9) -> Floats:
    """Commands (N, 6) that put the TCP all over a vertical plane."""
    up, out = np.meshgrid(np.linspace(-0.2, 1.1, count), np.linspace(0.6, 1.9, count))
    q = np.tile(HOME, (up.size, 1))
    q[:, 1], q[:, 2] = up.ravel(), out.ravel()
    return q


FIT = operating_points(plane(), payload=np.tile([0.0, 5.0, 2.0], 27))


def shown(name: str) -> tuple[str, Floats, OperatingPoints, str]:
    """Label and values (N,) of what an effect goes with, the situations, and label of what it does."""
    q = np.tile(HOME, (len(GRID), 1))
    if name == "axis_motion":
        q[:, 1] = np.pi * GRID
        return "q2 [rad]", q[:, 1], operating_points(q, FIT), "shift across the axis, along a [µm]"
    if name == "bearing_compliance":
        at = operating_points(q, FIT, fy=100.0 * GRID)
        frame = joint_frame(at, SITE)
        moment = at.joint_loads[:, frame.index, 3:] @ frame.across[0]
        return "moment on the joint about a [N m]", moment, at, "tilt about a [µrad]"
    at = operating_points(q, FIT, fz=100.0 * GRID)
    frame = joint_frame(at, SITE)
    return (
        "moment on the joint about its axis [N m]",
        at.joint_loads[:, frame.index, 3:] @ frame.axis,
        at,
        "turn [µrad]",
    )


def seen(basis: Displacement, at: OperatingPoints, c: Floats) -> Floats:
    """(N,) what an effect does."""
    if basis.command is not None:
        return basis.command[1] @ c
    ((_, twist),) = basis.placements
    a = joint_frame(at, SITE).across[0]
    moved = twist @ c
    return (moved[:, :3] if np.abs(moved[:, :3]).max() > 0.0 else moved[:, 3:]) @ a


def draw(name: str, folder: Path) -> Path:
    effect = effects_by_id()[name]
    label, x, at, what = shown(name)
    basis = effect.basis(at, SITE)
    draws = basis.sigma * np.random.default_rng(4).standard_normal((3, len(basis)))
    if name != "axis_motion":
        draws[:, list(effect.core)] = np.outer([1.0, 0.7, 1.4], basis.sigma[list(effect.core)])
    figure, (own, platform) = plt.subplots(1, 2, figsize=(8.0, 3.0), width_ratios=(1.2, 1.0), layout="constrained")
    for k, c in enumerate(draws):
        own.plot(x, 1e6 * seen(basis, at, c), color=f"C{k}", lw=1.5, alpha=1.0 - 0.25 * k)
    own.set(xlabel=label, ylabel=what)
    own.grid(alpha=0.3)
    active = ActiveEffect(effect, SITE, None, draws[0], np.zeros((len(basis),) * 2), FIT.references)
    moved = with_effects(KINEMATICS, FIT.q, FIT.covariates, [active]).minus(FIT.poses)[:, [0, 2]]
    T, largest = FIT.poses.T[:, [0, 2]], float(np.linalg.norm(moved, axis=1).max())
    platform.quiver(*T.T, *(moved.T * 0.12 / largest), angles="xy", scale_units="xy", scale=1.0, width=0.005)
    title = f"TCP moves by up to {largest * 1e6:.0f} µm"
    platform.set(xlabel="x [m]", ylabel="z [m]", title=title, aspect="equal")
    platform.title.set_fontsize("medium")
    platform.margins(0.15)
    figure.suptitle(f"{name} at the {SITE} of an arm", fontsize="medium")
    path = folder / f"{name}.svg"
    figure.savefig(path, metadata={"Date": None, "Creator": None})
    plt.close(figure)
    return path


def main(folder: Path, names: list[str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "gtpin", "font.family": "sans-serif"})
    for name in names or NAMES:
        path = draw(name, folder)
        print(f"{path.name:24s} {path.stat().st_size / 1024.0:.0f} kB")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs/effects"), sys.argv[2:])
