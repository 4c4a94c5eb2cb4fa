"""Plant known causes in measured data: ``python plant.py REAL OUT --seed N [--cases 48] [--half sealed]``.

Writes OUT/bare (each series, its diagnosis and models) and the cases in OUT/training or OUT/sealed: NAME, a dataset;
NAME.truth.json, as `gtpin blind --from` reads it; NAME.npz, the whitened displacement.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from background import Array, Background, Projection, series
from outside import NAMES, Form

import gtpin
from gtpin.effects import Effect, OperatingPoints
from gtpin.effects.active import ActiveEffect

HALVES = ("training", "sealed")
ENERGIES = (100.0, 300.0, 1000.0, 3000.0)
UNLISTED = 4
"""Every fourth case is a form outside the catalogue."""
LEAST_SEEN = 0.02
"""Least share of an effect's squares that geometry leaves; below it, geometry absorbs the effect."""
LARGEST = 0.02
"""Largest planted displacement, m (root mean square): beyond it no machine would be used."""
ADDED = ("approach", "session", "time")
"""Beginnings of the names of columns that may be added, beside the payload."""
TRIES = 60


@dataclass(frozen=True)
class Case:
    """A planted cause: the effect that acts, its energy with and without the named causes, and the case's dataset."""

    background: Background
    active: ActiveEffect
    energy: float
    bare_energy: float
    asked: float
    dataset: gtpin.Dataset
    whitened: Array
    added: tuple[str, ...]

    def truth(self) -> dict[str, Any]:
        effect, known = self.active.effect, {e.id for e in gtpin.catalogue()}
        values = effect.parameters_of(
            self.background.model.robot, self.active.site, self.active.coefficients, self.active.values
        )
        one = {"effect": effect.id, "site": self.active.site, "energy": self.energy}
        one["amplitude"] = float(self.active.coefficients[0]) if len(self.active.coefficients) else 0.0
        return {
            "effects": [one],
            "background": self.background.name,
            "listed": effect.id in known,
            "nature": effect.nature,
            "asked": self.asked,
            "energy_without_named": self.bare_energy,
            "parameters": {name: list(value) for name, value in values.items()},
            "added": list(self.added),
        }


def candidates(background: Background) -> list[tuple[Effect, str, str]]:
    """Effects, sites and the column to add (or none) that the data can show, and that the bare diagnosis does not name."""
    named = {(m["effect"], m["site"]) for c in background.said["causes"] for m in c["class"]}
    found, effects = [], {effect.id: effect for effect in gtpin.catalogue()}
    for one in background.said["candidates"]:
        effect, site = one["effect"], one["site"]
        kind, column = background.said["reasons"].get(f"{effect}@{site}", ("", ""))
        if kind in ("no_load", "no_masses", "one_sign"):
            column = "payload"
        elif kind and not (kind in ("missing", "constant") and column.startswith(ADDED)):
            continue
        if (effect, site) not in named and effect in effects:
            found.append((effects[effect], site, column))
    return found


def columns(background: Background, column: str, rng: np.random.Generator) -> dict[str, Any]:
    """The covariates, with the added one (of all joints, where it is the approach), drawn independently of the data."""
    data = background.dataset
    count, n = data.q.shape
    if column.startswith("approach"):
        return {**data.covariates, **{f"approach{k + 1}": rng.choice([-1.0, 1.0], count) for k in range(n)}}
    drawn: dict[str, Any] = {
        "session": np.array([f"s{k}" for k in rng.integers(1, 4, count)], dtype=object),
        "time": 60.0 * rng.permutation(count),
        "payload": rng.choice([0.0, 1.0, 3.0], count),
    }
    return {**data.covariates, **({column: drawn[column]} if column else {})}


def coefficients(effect: Effect, robot: gtpin.Robot, site: str, sigma: Array, rng: np.random.Generator) -> Array:
    """Normal in units of the typical sizes; a modulation has a third of it; of a description one mechanism's form, if any."""
    forms = effect.forms(robot, site) if effect.nature == "description" else ()
    core = forms[int(rng.integers(len(forms)))] if forms else effect.core or range(len(sigma))
    share = np.full(len(sigma), 0.0 if forms else 0.3)
    share[list(core)] = 1.0
    return np.asarray(sigma * share * rng.normal(size=len(sigma)))


class Planter:
    """Draws cases on one background."""

    def __init__(self, background: Background) -> None:
        self.background = background
        self.sigma, bare = background.sigma(background.model), background.sigma(background.plain)
        self.project = Projection(background.absorbed(self.sigma))
        self.rougher = np.tile(self.sigma / bare, len(background.dataset))
        self.known = candidates(background)
        self.left: dict[str, list[Any]] = {}

    def draw(self, asked: float, listed: bool, rng: np.random.Generator) -> Case:
        """A case with the energy that is asked for: effects in turn, each at a random site."""
        for _ in range(TRIES):
            effect, site, column = self._listed(rng) if listed else self._form(rng)
            case = self._planted(effect, site, column, asked, rng)
            if case is not None:
                return case
        raise RuntimeError(f"{self.background.name}: no effect can be planted")

    def _next(self, key: str, of: list[str], rng: np.random.Generator) -> str:
        left = self.left.setdefault(key, [])
        if not left:
            left += [of[k] for k in rng.permutation(len(of))]
        return str(left.pop())

    def _listed(self, rng: np.random.Generator) -> tuple[Effect, str, str]:
        name = self._next("effect", sorted({effect.id for effect, *_ in self.known}), rng)
        of = [one for one in self.known if one[0].id == name]
        return of[int(rng.integers(len(of)))]

    def _form(self, rng: np.random.Generator) -> tuple[Effect, str, str]:
        name, sites = self._next("form", list(NAMES), rng), self.background.model.robot.sites
        return Form(name, int(rng.integers(2**31))), sites[int(rng.integers(len(sites)))], ""

    def _planted(self, effect: Effect, site: str, column: str, asked: float, rng: np.random.Generator) -> Case | None:
        """None where geometry absorbs the effect, or it would be implausible or larger than any machine's."""
        b, model = self.background, self.background.model
        covariates = columns(b, column, rng)
        at = OperatingPoints(model.kinematics, b.dataset.q, model.kinematics.forward(b.dataset.q), covariates)
        if effect.untestable(at, site) is not None:
            return None
        values = list(effect.nonlinear_values(at, site)) if effect.has_nonlinear else []
        value = float(rng.choice(values)) if values else None
        if value is not None and not effect.resolved(at, site, np.array([value]), [])[0]:
            return None
        sigma = effect.basis(at, site, value).sigma
        c = coefficients(effect, model.robot, site, sigma, rng)
        active = ActiveEffect(effect, site, value, c, np.zeros((len(c), len(c))), at.references)
        for _ in range(5):
            acting = replace(model, effects=(*model.effects, active))
            dataset, r = b.planted(acting, covariates, self.sigma)
            left = float(r @ self.project(r))
            if not np.isfinite(r).all() or left <= LEAST_SEEN * float(r @ r):
                return None
            factor = float(np.sqrt(asked / left))
            active = replace(active, coefficients=active.coefficients * min(factor, 1e4))
        moved = (r.reshape(len(b.dataset), -1) * self.sigma)[:, :3]
        said = effect.parameters_of(model.robot, site, active.coefficients, active.values)
        allowed = [lim.low <= said[k][0] <= lim.high for k, lim in effect.plausible.items() if k in said]
        if abs(left / asked - 1.0) > 0.02 or np.sqrt((moved**2).sum(1).mean()) > LARGEST or not all(allowed):
            return None
        rough = r * self.rougher
        bare = float(rough @ self.project(rough))
        added = tuple(name for name in covariates if covariates[name] is not b.dataset.covariates.get(name))
        return Case(b, active, left, bare, asked, dataset, r, added)


def backgrounds(real: Path, out: Path) -> Iterator[Background]:
    for name, dataset in series(real, out / "measured"):
        place = out / "bare" / name
        if not place.with_suffix(".dataset").exists():
            dataset.write(place.with_suffix(".dataset"))
        yield Background.of(name, gtpin.Dataset.read(place.with_suffix(".dataset")), place)


def write(case: Case, name: str, folder: Path) -> str:
    """Write a case, and give the first 12 digits of the SHA-256 of its truth."""
    folder.mkdir(parents=True, exist_ok=True)
    case.dataset.write(folder / name)
    np.savez_compressed(folder / f"{name}.npz", whitened=case.whitened)
    truth = json.dumps(case.truth(), indent=1) + "\n"
    (folder / f"{name}.truth.json").write_text(truth)
    return hashlib.sha256(truth.encode()).hexdigest()[:12]


def main() -> None:
    parser = argparse.ArgumentParser(description="Plant known causes in measured data.")
    parser.add_argument("real", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--cases", type=int, default=48)
    parser.add_argument("--half", choices=HALVES, default="training")
    given = parser.parse_args()
    warnings.simplefilter("ignore", gtpin.GtpinWarning)
    planters = [Planter(one) for one in backgrounds(given.real, given.out)]
    for k in range(given.cases):
        rng = np.random.default_rng([given.seed, HALVES.index(given.half), k])
        planter, turn = planters[k % len(planters)], k // len(planters)
        energy = ENERGIES[(turn + turn // UNLISTED + k) % len(ENERGIES)]  # so that listed and unlisted have all of them
        case = planter.draw(energy, turn % UNLISTED != UNLISTED - 1, rng)
        name = f"{planter.background.name}{k:03d}"
        print(name, write(case, name, given.out / given.half), flush=True)


if __name__ == "__main__":
    main()
