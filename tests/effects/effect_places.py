"""Effects at their sites on a Gantry-Tau and an arm drawn from their tolerances, under conditions in which all of them show."""

import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import seats

import gtpin
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.displacement import Displacement
from gtpin.effects.operating_points import Column, OperatingPoints, References
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.poses import Poses
from gtpin.robot.description import RobotDescription

Floats = np.ndarray
EFFECTS = effects_by_id()
SETTINGS = {"rack_periodic": 0.0314, "rack_step": 0.051}
"""Nonlinear parameters, m."""
TURNING = {**SETTINGS, "rack_periodic": 0.52}
"""Of joints of arms, rad."""
MIDDLE, HALF = np.array([0.1, 0.4, 1.2, 0.3, 0.5, 0.2]), np.array([1.5, 0.7, 0.7, 1.0, 1.0, 2.0])
"""Ranges of commands of arms, rad."""


def drawn(robot: str | gtpin.Robot = "gantry_tau", seed: int = 0) -> Kinematics:
    nominal = gtpin.Geometry.nominal(gtpin.load_robot(robot) if isinstance(robot, str) else robot)
    off = nominal.tolerance * np.random.default_rng(seed).standard_normal(len(nominal.values))
    return gtpin.Model(nominal.with_values(nominal.values + off)).kinematics


KINEMATICS = drawn()
GEOMETRY = KINEMATICS.geometry
ROBOT = GEOMETRY.robot
ARM_FILE = Path(__file__).parents[2] / "examples" / "effects" / "arm.urdf"
ARM = gtpin.load_robot(ARM_FILE)
PLACES = [(name, site) for name, effect in EFFECTS.items() for site in effect.sites(ROBOT)]
SEEN = [place for place in PLACES if place != ("cart_rotation", "cart1")]
"""All but a cart that turns about its only joint."""


def covariates(count: int, actuators: int = 3, seed: int = 0) -> dict[str, Column]:
    rng = np.random.default_rng(seed)
    columns: dict[str, Column] = {
        "time": np.sort(rng.uniform(0.0, 9000.0, count)),
        "session": np.array([f"day{i * 3 // count}" for i in range(count)], dtype=object),
        "temp_frame": 20.0 + rng.uniform(-2.0, 5.0, count),
        "temp_link": 20.0 + rng.uniform(-2.0, 7.0, count),
        "payload": rng.choice([0.0, 10.0, 20.0], count),
    }
    for i in range(actuators):
        columns[f"approach{i + 1}"] = rng.choice([-1.0, 1.0], count)
        columns[f"speed{i + 1}"] = rng.uniform(-0.3, 0.3, count)
    return columns | {f"f{axis}": 80.0 * rng.standard_normal(count) for axis in "xyz"}


def operating_points(
    count: int = 30,
    seed: int = 0,
    kinematics: Kinematics = KINEMATICS,
    fixed: References | None = None,
    without: tuple[str, ...] = (),
    **changed: Column,
) -> OperatingPoints:
    """Commands all over the range that the robot reaches, with everything that an effect may ask for."""
    robot = kinematics.geometry.robot
    rng, n = np.random.default_rng(seed + 1), robot.n_actuators
    if robot.rods:
        # Together over most of the range, and apart by less, as the carts of a Gantry-Tau must stay.
        apart = 0.5 * rng.uniform(-1.0, 1.0, (count, 1)) + 0.3 * rng.uniform(-1.0, 1.0, (count, n))
        q = robot.home_q + (robot.upper - robot.lower) / 2.0 * apart
    else:
        q = MIDDLE[:n] + HALF[:n] * rng.uniform(-1.0, 1.0, (count, n))
    told = {name: v for name, v in {**covariates(count, n, seed), **changed}.items() if name not in without}
    return OperatingPoints(kinematics, q, kinematics.forward(q), told, fixed)


def nominal_at(robot: gtpin.Robot, q: Floats, told: dict[str, Column] | None = None) -> OperatingPoints:
    kinematics = gtpin.Model(gtpin.Geometry.nominal(robot)).kinematics
    return OperatingPoints(kinematics, q, kinematics.forward(q), told or {})


def arm_with(old: str, new: str) -> gtpin.Robot:
    """The arm with a part of its URDF replaced, by a regular expression."""
    return gtpin.Robot(RobotDescription.parse(re.sub(old, new, ARM_FILE.read_text(encoding="utf-8"))))


arm_points = partial(operating_points, kinematics=drawn(ARM))
FIT, ARM_FIT = operating_points(120, seed=7), arm_points(120, seed=7)
"""What the effects were fitted to, as it were."""


def setting(name: str, references: References) -> float | None:
    """The nonlinear parameter; references of arms have ranges of commands, those of robots with rods have none."""
    return (TURNING if len(references.commands[0]) else SETTINGS).get(name)


def basis(name: str, site: str, at: OperatingPoints) -> Displacement:
    return EFFECTS[name].basis(at, site, setting(name, at.references))


def active(name: str, site: str, coefficients: Floats, references: References = FIT.references) -> ActiveEffect:
    m = len(coefficients)
    return ActiveEffect(EFFECTS[name], site, setting(name, references), coefficients, np.zeros((m, m)), references)


def applied(at: OperatingPoints, *effects: ActiveEffect) -> Poses:
    return with_effects(at.kinematics, at.q, at.covariates, effects)


def moved(at: OperatingPoints, *effects: ActiveEffect) -> Floats:
    """(N, 6) what effects do to the exact poses, m and rad, base frame."""
    return applied(at, *effects).minus(at.poses)


@dataclass(frozen=True)
class Displaced:
    """What an effect's coefficients do to its parts, pose by pose; ``seat_rate``: to first order."""

    command: Floats
    seat: Floats
    seat_rate: Floats
    length: Floats
    twist: Floats


def displaced(at: OperatingPoints, name: str, site: str, coefficients: Floats) -> Displaced:
    found, n, k = basis(name, site, at), len(at), len(at.robot.rods)
    command = np.zeros((n, at.robot.n_actuators))
    if found.command is not None:
        command[:, found.command[0]] = found.command[1] @ coefficients
    return Displaced(
        command,
        seats.displaced(at, found, coefficients),
        seats.rates(at, found) @ coefficients,
        np.zeros((n, k)) if found.length is None else found.length @ coefficients,
        np.zeros((n, 6)) if found.twist is None else found.twist @ coefficients,
    )


def given(name: str, site: str, values: dict[int, float], at: OperatingPoints = FIT) -> Floats:
    """Coefficients of these values at their indices, else zero."""
    coefficients = np.zeros(len(basis(name, site, at)))
    coefficients[[*values]] = [*values.values()]
    return coefficients


def some(name: str, site: str, at: OperatingPoints, seed: int = 3) -> Floats:
    """Coefficients of the typical size."""
    sigma = basis(name, site, at).sigma
    return sigma * np.random.default_rng(seed).standard_normal(len(sigma))
