"""Which effects can stand in for which on the Gantry-Tau, once the geometry has taken what it can.

Draws every effect at its typical size, scales it to the same whitened energy past geometry, and asks how much log evidence
every other effect gains on it, as a share of its own. ``python examples/pages/refresh.py --measure imitators`` measures the
table of docs/effects.md again.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.linalg import cho_factor, cho_solve

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.recipe import SimulatedConditions
from gtpin.diagnosis.evidence import best_scales
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.operating_points import OperatingPoints

SIGMA = np.array([1.5e-5] * 3 + [5e-5] * 3)
"""The tracker's, m and rad."""
ENERGY = 1000.0
SETTINGS = {"rack_periodic": (0.04, 0.1), "rack_step": (-0.2, 0.05, 0.25)}
DRAWS = 3
LEAST = 0.5
"""Smallest share of the true effect's gain that the table shows."""
ROBOT = "gantry_tau"


def past_geometry(at: OperatingPoints, geometry: gtpin.Geometry):
    """X' (I + B B')^-1 Z with B the whitened derivative by the geometry in tolerances."""
    B = (at.kinematics.geometry_jacobian(at.q, at.poses) * geometry.tolerance / SIGMA[:, None]).reshape(len(at) * 6, -1)
    factor = cho_factor(np.eye(B.shape[1]) + B.T @ B)
    return lambda X, Z: X.T @ Z - (X.T @ B) @ cho_solve(factor, B.T @ Z)


def columns(at: OperatingPoints, name: str, site: str, shape_parameter: float | None) -> np.ndarray:
    """Whitened displacements for coefficients of typical size."""
    basis = effects_by_id()[name].basis(at, site, shape_parameter)
    return (basis.displacement(at) * basis.sigma / SIGMA[:, None]).reshape(len(at) * 6, -1)


def gain(gram: np.ndarray, moment: np.ndarray, core: tuple[int, ...]) -> float:
    """Log evidence of a group over none, with the scale of its coefficients that suits best."""
    return float(best_scales(gram[None], moment.T, core)[0][0])


def jobs(machines: int) -> list[dict[str, object]]:
    """One job: all effects on one machine."""
    return [{"robot": ROBOT}]


def measured(robot: str) -> list[dict[str, object]]:
    """The share of each effect's evidence that each effect at each site gains on it."""
    conditions = SimulatedConditions(sessions=3, push=100.0, warming=1.5, rest=0.5)
    data = make_case(1, effects=[], poses=160, conditions=conditions, robot=robot).dataset
    geometry = gtpin.Geometry.nominal(gtpin.load_robot(robot))
    kinematics = gtpin.Model(geometry).kinematics
    at = OperatingPoints(kinematics, data.q, kinematics.forward(data.q), data.covariates)
    product = past_geometry(at, geometry)
    places = {
        (name, site): [columns(at, name, site, s) for s in SETTINGS.get(name, (None,))]
        for name, effect in effects_by_id().items()
        for site in effect.sites(at.robot)
        if not effect.untestable(at, site)
    }
    grams = {place: [product(X, X) for X in parts] for place, parts in places.items()}
    rng, rows = np.random.default_rng(0), []
    for (name, site), parts in places.items():
        for draw in range(DRAWS):
            X = parts[draw % len(parts)]
            d = X @ rng.standard_normal(X.shape[1])
            energy = float(product(d[:, None], d[:, None])[0, 0])
            if energy < 1.0:
                continue  # geometry takes it
            d *= np.sqrt(ENERGY / energy)
            own = gain(product(X, X), product(X, d[:, None]), effects_by_id()[name].core)
            for other, others in places.items():
                if other == (name, site):
                    continue
                core = effects_by_id()[other[0]].core
                found = max(gain(G, product(Y, d[:, None]), core) for G, Y in zip(grams[other], others, strict=True))
                rows.append((name, site, *other, max(found, 0.0) / own))
    found = pd.DataFrame(rows, columns=["effect", "site", "imitator", "at", "share"])
    found = found.groupby(["effect", "site", "imitator", "at"], as_index=False)["share"].median()
    return [{**row, "share": round(float(row["share"]), 3)} for row in found.to_dict("records")]


def table(records: pd.DataFrame) -> str:
    """Of each effect the imitators that have half of its gain, three at most; itself elsewhere where that has half of it."""
    # The best place of each imitator, and the median over the effect's own sites.
    best = records.groupby(["effect", "site", "imitator"])["share"].max().groupby(["effect", "imitator"]).median()
    lines, others = ["| effect | imitators |", "|---|---|"], []
    for name in effects_by_id():
        if name in best.index.get_level_values(0):
            top = best[name][best[name] >= LEAST].nlargest(3)
            found = [
                f"`{imitator}`{' at another site' * (imitator == name)} {100 * share:.0f} %"
                for imitator, share in top.items()
            ]
            lines += [f"| `{name}` | {', '.join(found)} |"] if found else []
            others += [] if found else [f"`{name}`"]
    return "\n".join([*lines, "", f"No other hypothesis has half of the gain of {', '.join(others)}."])


if __name__ == "__main__":
    print(table(pd.DataFrame(measured(ROBOT))))
