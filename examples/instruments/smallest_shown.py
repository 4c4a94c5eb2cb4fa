"""How small an effect each instrument can show: the error at the TCP at which its readings hold an energy of 63.

A tracker and a tilt sensor read at 200 stops, and again at a tenth of them; four draw wires at each of these; of balls in
sockets and of touches of planes there are 200.

The energy is what the effect changes in the whitened readings past geometry and the instrument's unknowns; from 63 on, an
effect shows in nearly all sealed cases (docs/blind.md). ``python examples/pages/refresh.py --measure instruments`` measures
the table of docs/instruments.md again.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from gtpin.bench.simulator import build_measured
from gtpin.bench.simulator.case import drawn_recipe

ENERGY = 63.0
POSES = 200
INSTRUMENTS = ("tracker", "range", "socket", "plane", "tilt")
"""A laser tracker, draw wires of four stations, a ball in four sockets, touches of three planes, a tilt sensor."""
EFFECTS = {
    "gantry_tau": (
        ("backlash", "cart2"),
        ("linearity", "cart1"),
        ("rack_periodic", "cart2"),
        ("straightness", "cart3"),
        ("cart_rotation", "cart3"),
        ("thermal_track", "cart1"),
    ),
    "linear_delta": (
        ("backlash", "cart2"),
        ("linearity", "cart1"),
        ("rack_periodic", "cart2"),
        ("straightness", "cart3"),
        ("cart_rotation", "cart1"),
        ("thermal_track", "cart1"),
    ),
}
MOST = 5e-3
"""Error, m, from which a table says that the instrument does not show the effect."""


def jobs(machines: int) -> list[dict[str, object]]:
    """Each effect with each instrument, on a few machines."""
    return [
        {"robot": robot, "effect": effect, "site": site, "instrument": instrument, "seed": seed}
        for robot, effects in EFFECTS.items()
        for effect, site in effects
        for instrument in INSTRUMENTS
        for seed in range(machines)
    ]


def measured(robot: str, effect: str, site: str, instrument: str, seed: int) -> list[dict[str, object]]:
    """Root mean square position error, um, by an effect of the energy that shows."""
    recipe = drawn_recipe(
        seed, effects=[(effect, site)], noncentrality=ENERGY, poses=POSES, robot=robot, background=False
    )
    truth = build_measured(recipe, [instrument]).effects[0]
    size = float(np.sqrt((truth.displacement[:, :3] ** 2).sum(axis=1).mean()))
    # The energy goes with the square of the size.
    needed = size * np.sqrt(ENERGY / max(truth.noncentrality, 1e-12))
    return [{"micrometres": round(1e6 * needed, 1) if needed < MOST else -1.0}]


def table(records: pd.DataFrame) -> str:
    """The median over machines, by robot and effect."""
    head = ["laser tracker", "draw wires", "ball in sockets", "touches of planes", "tilt sensor"]
    lines = [f"| robot | effect | {' | '.join(head)} |", "|---" * (len(head) + 2) + "|"]
    for robot, effects in EFFECTS.items():
        for effect, site in effects:
            cells = []
            for instrument in INSTRUMENTS:
                mine = records[
                    (records["robot"] == robot)
                    & (records["effect"] == effect)
                    & (records["site"] == site)
                    & (records["instrument"] == instrument)
                ]
                cells.append(_words(median(mine["micrometres"].astype(float).to_numpy())))
            lines.append(f"| `{robot}` | `{effect}` | {' | '.join(cells)} |")
    return "\n".join(lines)


def median(values: np.ndarray) -> float:
    """Median, um, of machines; those on which the effect does not show (-1) need more than any."""
    return float(np.median(np.where(values < 0.0, np.inf, values)))


def _words(micrometres: float) -> str:
    """A length with two digits; "not seen" where none is enough."""
    if not np.isfinite(micrometres):
        return "not seen"
    if micrometres >= 1e3:
        return f"{1e-3 * micrometres:.2g} mm"
    return f"{float(f'{micrometres:.2g}'):g} µm"


if __name__ == "__main__":
    print(table(pd.DataFrame([{**job, **row} for job in jobs(1) for row in measured(**job)])))
