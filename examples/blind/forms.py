"""How the diagnosis names effects of the catalogue whose form differs from their equation: a table of docs/blind.md.

The machines are Gantry-Taus of the plant with weak other effects. The strong effect comes from this file alone: a step with a
wide flank, a backlash that is taken up over some millimetres of travel, a harmonic with a drifting amplitude or period, a
spring with a dead zone or with a contact's stiffening. ``python examples/pages/refresh.py --measure forms`` measures the table
again.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.special import erf

import gtpin
from gtpin.bench.blind.judged import Judged, Named, Statement
from gtpin.bench.blind.truth import TrueEffect
from gtpin.bench.simulator.build import as_dataset, assemble
from gtpin.bench.simulator.case import drawn_recipe
from gtpin.bench.simulator.machine import Deviation
from gtpin.bench.simulator.noncentrality import Past, amplitude_for
from gtpin.bench.simulator.recipe import SimulatedConditions
from gtpin.bench.simulator.situation import RodSituation
from gtpin.bench.simulator.visits import ids
from gtpin.data import Dataset

Floats = npt.NDArray[np.float64]
Cause = Callable[[RodSituation], Deviation]

SEED = 7_300
"""Nothing else draws its machines from it."""
ENERGIES = (300.0, 2000.0)
LARGEST = 50.0
"""Largest amplitude, in multiples of the sizes below."""
FORMS: Mapping[str, tuple[str, str]] = {
    "flank 2 mm": ("rack_step", "a step, 10 to 90 % of it over 2 mm"),
    "flank 8 mm": ("rack_step", "over 8 mm"),
    "flank 20 mm": ("rack_step", "over 20 mm"),
    "travel 2 mm": ("backlash", "a backlash, 63 % of it taken up over 2 mm"),
    "travel 6 mm": ("backlash", "over 6 mm"),
    "travel 20 mm": ("backlash", "over 20 mm"),
    "amplitude 50 %": ("rack_periodic", "a harmonic whose amplitude changes by 50 %"),
    "amplitude 100 %": ("rack_periodic", "by 100 %"),
    "period 0.5 %": ("rack_periodic", "whose period changes by 0.5 %"),
    "dead link": ("link_compliance", "a link that stretches only above half of its median force"),
    "hertz link": ("link_compliance", "a link that stretches with force^(2/3)"),
    "dead cart": ("cart_compliance", "a cart that shifts only above half of its median force"),
    "hertz cart": ("cart_compliance", "a cart that shifts with force^(2/3)"),
}
"""Each form: its effect, and what it is called in the table."""
CORE = {
    "rack_step": "step",
    "backlash": "half_width",
    "rack_periodic": "amplitude",
    "link_compliance": "compliance",
    "cart_compliance": "along",
}
"""The parameter of each effect whose value the form knows, but for springs, which have no single compliance."""


def jobs(machines: int) -> list[dict[str, object]]:
    """Every form at both energies, on some machines each."""
    return [{"form": f, "energy": e, "machine": m} for f in FORMS for e in ENERGIES for m in range(machines)]


def measured(form: str, energy: float, machine: int) -> list[dict[str, object]]:
    """What is said of one machine."""
    dataset, site, size, place, reached = made(form, energy, machine)
    effect = FORMS[form][0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)  # of poses that large effects make look like gross errors
        try:
            said = Statement.of(gtpin.diagnose(dataset).to_json())
        except gtpin.GtpinError:  # a diagnosis that fails names nothing
            said = Statement(verdict="none")
    truth = TrueEffect(effect=effect, site=site, energy=reached)
    judged = Judged(name="", kind="one", truth=(truth,), said=said)
    mine = next((cause for cause in said.causes if cause.name == truth.name), None)
    found = {
        "true": truth.name,
        "reached": round(reached, 1),
        "verdict": said.verdict,
        "named": " ".join(said.names),
        "right": int(judged.strict),
        "class": int(judged.in_class),
        "unknown": int(said.verdict == "unknown"),
        "false": int(bool(judged.false_confident)),
    }
    return [found | _parameters(mine, CORE[effect], size, place)]


def _parameters(cause: Named | None, core: str, size: float | None, place: float | None) -> dict[str, object]:
    """Said over true size, whether its 95 % interval covers the true one, and the distance of the places, mm; empty where the
    effect was not named or has none."""
    if cause is None or size is None:
        return {"size": "", "covers": "", "off_mm": ""}
    off = "" if place is None else round(1e3 * abs(cause.parameters["place"][0] - place), 3)
    value, sigma = cause.parameters[core]
    return {"size": round(value / size, 3), "covers": int(abs(value - size) <= 1.96 * sigma), "off_mm": off}


def made(form: str, energy: float, machine: int) -> tuple[Dataset, str, float | None, float | None, float]:
    """A dataset; the effect's site, its true core size and place where it has them, and the energy that it reached."""
    effect = FORMS[form][0]
    seed = SEED + 100 * list(FORMS).index(form) + machine
    rng = np.random.default_rng([seed, 11])
    needs = {"link_compliance": ("payload",), "cart_compliance": ("payload",)}.get(effect, ())
    conditions = SimulatedConditions.draw(rng, needs)
    recipe = drawn_recipe(seed, n_effects=0, conditions=conditions, held_out=1)
    built = assemble(recipe)
    plant, rows = built.response, built.rows
    robot = plant.machine.robot
    sites = robot.rod_sites if effect == "link_compliance" else robot.sites
    number = int(rng.integers(len(sites)))
    cause, size, place = DRAWN[effect](form, number, plant.ideal, machine, rng)
    past = Past.of_poses(plant.machine, plant.visits.q[rows], plant.ideal.poses[rows], recipe.noise.sigma)
    amplitude = amplitude_for(plant, cause, rows, past, energy, LARGEST)
    reached = past.noncentrality(plant.displacement([(cause, amplitude)])[rows])
    mine = plant.visits.take(rows)
    true = built.in_frame(plant.seen([(cause, amplitude), *built.active], built.jitter)[rows])
    measurements = recipe.noise.measured(true, built.rng)
    dataset = as_dataset(recipe, ids(mine.pose), mine.q, mine.columns(conditions), measurements)
    return dataset, sites[number], None if size is None else size * amplitude, place, reached


Drawn = tuple[Cause, float | None, float | None]
"""A cause, its size and its place."""


def _step(form: str, cart: int, ideal: RodSituation, machine: int, rng: np.random.Generator) -> Drawn:
    """30 um, with a flank that is an error function, half a cosine or a ramp, in turn."""
    width = 1e-3 * float(form.split()[1])
    low, high = np.quantile(ideal.q[:, cart], [0.2, 0.8])
    place, height = float(rng.uniform(low, high)), 3e-5 * float(rng.choice([-1.0, 1.0]))

    def flank(x: Floats) -> Floats:
        """From 0 to 1; x in widths from 10 to 90 %."""
        if machine % 3 == 0:
            return np.asarray(0.5 + 0.5 * erf(1.8124 * x))  # erf(0.9062) = 0.8
        if machine % 3 == 1:
            return np.asarray(0.5 + 0.5 * np.sin(np.clip(1.8546 * x, -np.pi / 2.0, np.pi / 2.0)))  # sin(0.9273) = 0.8
        return np.clip(0.5 + 0.8 * x, 0.0, 1.0)

    return (lambda now: now.driven(cart, height * flank((now.q[:, cart] - place) / width))), height, place


def _backlash(form: str, cart: int, ideal: RodSituation, machine: int, rng: np.random.Generator) -> Drawn:
    """10 um of lost motion to either side, of which the travel d since the reversal takes up 1 - exp(-d / w)."""
    w, half = 1e-3 * float(form.split()[1]), -1e-5

    def cause(now: RodSituation) -> Deviation:
        move = now.q[:, cart] - now.visits.before[:, cart]
        return now.driven(cart, half * now.visits.approach[:, cart] * -np.expm1(-np.abs(move) / w))

    return cause, half, None


def _periodic(form: str, cart: int, ideal: RodSituation, machine: int, rng: np.random.Generator) -> Drawn:
    """15 um with the period of a tooth or a pinion's turn, in turn. The amplitude changes from end to end, or is largest in the
    middle, in turn."""
    what, change = form.split()[0], float(form.split()[1]) / 100.0
    low, high = float(ideal.q[:, cart].min()), float(ideal.q[:, cart].max())
    middle, half = (low + high) / 2.0, (high - low) / 2.0
    period = float(rng.uniform(0.012, 0.022) if machine % 2 else rng.uniform(0.08, 0.16))
    phase, side = float(rng.uniform(0.0, 2.0 * np.pi)), float(rng.choice([-1.0, 1.0]))

    def cause(now: RodSituation) -> Deviation:
        x = (now.q[:, cart] - middle) / half
        if what == "period":  # d(phase)/dq = 2 pi / p (1 + change x / 2): by ``change`` from end to end
            turns = half / period * (x + side * change * x**2 / 4.0)
            return now.driven(cart, 1.5e-5 * np.cos(2.0 * np.pi * turns + phase))
        drift = side * x / 2.0 if machine % 4 < 2 else 0.0 - x**2
        return now.driven(cart, 1.5e-5 * (1.0 + change * drift) * np.cos(2.0 * np.pi * half / period * x + phase))

    return cause, 1.5e-5, None


def _sprung(form: str, force: Floats, usual: Floats | float) -> Floats:
    """The force on a linear spring that deflects as much, N."""
    if form.startswith("dead"):
        return np.asarray(np.sign(force) * np.maximum(np.abs(force) - usual / 2.0, 0.0))
    return np.asarray(usual * np.sign(force) * (np.abs(force) / usual) ** (2.0 / 3.0))


def _link(form: str, rod: int, ideal: RodSituation, machine: int, rng: np.random.Generator) -> Drawn:
    """4e-8 m/N."""
    usual = float(np.median(np.abs(ideal.forces[:, rod])))

    return (lambda now: now.off(length=(rod, 4e-8 * _sprung(form, now.forces[:, rod], usual)))), None, None


def _cart(form: str, cart: int, ideal: RodSituation, machine: int, rng: np.random.Generator) -> Drawn:
    """5e-8 m/N along the track, and 3e-8 m/N to either side of it."""
    give = np.array([5e-8, 3e-8, 3e-8])

    def axes(now: RodSituation) -> Floats:
        return np.vstack([now.machine.tracks[cart], now.machine.across[cart]])

    usual = np.median(np.abs(ideal.pull(cart) @ axes(ideal).T), axis=0)

    def cause(now: RodSituation) -> Deviation:
        return now.off(shift=(cart, (give * _sprung(form, now.pull(cart) @ axes(now).T, usual)) @ axes(now)))

    return cause, None, None


DRAWN: Mapping[str, Callable[[str, int, Any, int, np.random.Generator], Drawn]] = {
    "rack_step": _step,
    "backlash": _backlash,
    "rack_periodic": _periodic,
    "link_compliance": _link,
    "cart_compliance": _cart,
}


COUNTED = ("right", "class", "unknown", "false")
"""Columns of the records that count."""


def table(records: pd.DataFrame) -> str:
    """Counts by form, over both energies; what is so on nearly all machines is said under the table."""
    numbers = records.assign(**{name: pd.to_numeric(records[name]) for name in COUNTED})
    lines = [
        "| form | machines | right, nothing else named | size named over true | 95 % interval covers |",
        "|---" * 5 + "|",
    ]
    for form, (effect, words) in FORMS.items():
        rows = numbers[numbers["form"] == form]
        sizes = pd.to_numeric(rows["size"], errors="coerce").dropna()
        covers = int(pd.to_numeric(rows["covers"], errors="coerce").sum())
        size = f"{sizes.min():.2f} to {sizes.max():.2f} | {covers}" if len(sizes) else "|"
        lines.append(f"| `{effect}`: {words} | {len(rows)} | {int(rows['right'].sum())} | {size} |")
    total = {name: int(numbers[name].sum()) for name in COUNTED}
    said = f"In a class on {total['class']} of {len(records)} machines, `unknown` on {total['unknown']}, a false cause sure on "
    return "\n".join([*lines, "", f"{said}{total['false']}."])
