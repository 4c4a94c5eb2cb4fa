"""How many touches of a flat bed determine which settings of a delta printer, and how well: the table of docs/importers.md.

    python examples/machines/touches_needed.py

The printer is the shipped linear_delta. A touch has a sigma of 10 um; the bed is the firmware's z = 0.
"""

import numpy as np
from exported_corrections import BOX, NOMINAL, TOUCH, TOWERS

from gtpin.compensation.machine import CompensatedMachine
from gtpin.extras.controllers.controller import controller_of
from gtpin.extras.controllers.towers import TowerFit, drives_of

REACH = 0.3  # of the probed points from the middle, m
MESHES = (5, 7, 9)  # points along each side of a mesh, of which those on a round bed are probed
GROUPS = {"delta radius": [0], "arms": [1, 2, 3], "end stops": [7, 8, 9], "angles": [4, 5, 6], "scales": [10, 11, 12]}


def delta_calibrate() -> np.ndarray:
    """(7, 2) x and y of the touches of a stock DELTA_CALIBRATE, m."""
    turn = np.radians(np.arange(30, 390, 60))
    return np.vstack([[0.0, 0.0], REACH * np.column_stack([np.cos(turn), np.sin(turn)])])


def mesh(per_side: int) -> np.ndarray:
    """(n, 2) x and y of the touches of a mesh on a round bed, m."""
    side = np.linspace(-REACH, REACH, per_side)
    xy = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    return xy[np.hypot(*xy.T) <= REACH + 1e-9]


PROBED = {"DELTA_CALIBRATE": delta_calibrate(), **{f"{n} x {n}": mesh(n) for n in MESHES}}


def sigmas(xy: np.ndarray) -> tuple[dict[str, float], dict[str, float], float]:
    """Largest sigma of each group of settings before and after the touches, m, rad or m/m, and what they took of the noise."""
    kinematics, tolerance = NOMINAL.kinematics, NOMINAL.geometry.tolerance
    q = controller_of(NOMINAL, BOX.origin)(np.column_stack([xy, np.zeros(len(xy))]))
    B = kinematics.geometry_jacobian(q, kinematics.forward(q))[:, 2] * tolerance / TOUCH
    covariance = np.linalg.inv(np.eye(B.shape[1]) + B.T @ B)
    fit = TowerFit.of(CompensatedMachine(NOMINAL), drives_of(TOWERS, NOMINAL, BOX), BOX)
    D = (
        kinematics.geometry_jacobian(fit.needed, kinematics.forward(fit.needed))[:, :3].reshape(-1, len(tolerance))
        * tolerance
    )
    settings = fit.response(np.ones(13, dtype=bool))[1] @ D
    p = len(tolerance)
    before, after = (np.sqrt(np.diag(settings @ C @ settings.T)) for C in (np.eye(p), covariance))
    effective_parameters = float(np.trace(B @ covariance @ B.T))
    return *(
        {name: float(size[rows].max()) for name, rows in GROUPS.items()} for size in (before, after)
    ), effective_parameters


def rows() -> list[str]:
    """The table's lines, in Markdown: sigma in mm, degrees and per mille, and - where half of the tolerance is left or more."""
    factor = {"angles": np.degrees(1.0), "scales": 1e3}
    found = ["| touches | left over | " + " | ".join(GROUPS) + " |", "|---" * (2 + len(GROUPS)) + "|"]
    before = sigmas(delta_calibrate())[0]
    shown = [f"{factor.get(name, 1e3) * size:.2g}" for name, size in before.items()]
    found.append(f"| none (tolerance) | | {' | '.join(shown)} |")
    for name, xy in PROBED.items():
        _, after, taken = sigmas(xy)
        cells = [f"{factor.get(n, 1e3) * s:.2g}" if s < np.sqrt(0.5) * before[n] else "-" for n, s in after.items()]
        found.append(f"| {len(xy)} ({name}) | {len(xy) - taken:.1f} | {' | '.join(cells)} |")
    return found


if __name__ == "__main__":
    print("\n".join(rows()))
